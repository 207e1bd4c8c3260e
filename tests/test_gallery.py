"""The gallery: every script runs alone, in short, and draws something."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

pytestmark = pytest.mark.drawn

GALLERY = Path(__file__).parents[1] / "docs" / "gallery"
SCRIPTS = sorted(path.stem for path in GALLERY.glob("[0-9]_*.py"))


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("gallery")


def ran(name: str, out: Path, cwd: Path, **more: str) -> tuple[str, Path]:
    """Output of a script, and its picture; only ``more`` names a folder of recordings."""
    own = {key: value for key, value in os.environ.items() if key != "RTRADAR_MOCAP"}
    own |= {"MPLBACKEND": "agg", "RTRADAR_GALLERY_OUT": str(out), "RTRADAR_GALLERY_S": "0.5"}
    options: Any = {"cwd": cwd, "env": own | more, "capture_output": True, "text": True}
    done = subprocess.run([sys.executable, GALLERY / f"{name}.py"], timeout=600, **options)
    assert done.returncode == 0, done.stderr
    return done.stdout, out / f"{name}.png"


def is_blank(picture: Path) -> bool:
    """Paper, axes and letters are grey, and data are coloured: 0.2 % of the picture or more."""
    channels = np.asarray(Image.open(picture).convert("RGB"), dtype=np.int64)
    return bool((np.ptp(channels, axis=-1) > 40).mean() < 1 / 500)


def test_there_is_one_for_each_step() -> None:
    assert [name[0] for name in SCRIPTS] == list("12344456789")


@pytest.mark.parametrize("name", SCRIPTS)
def test_it_runs_where_its_page_is_made(name: str) -> None:
    # sphinx-gallery runs a script's text, and defines no such name.
    assert "__file__" not in (GALLERY / f"{name}.py").read_text()


@pytest.mark.slow
@pytest.mark.parametrize("name", SCRIPTS)
def test_it_runs_and_draws(name: str, out: Path, tmp_path: Path) -> None:
    said, picture = ran(name, out, tmp_path)
    assert not is_blank(picture)
    assert list(tmp_path.iterdir()) == []  # all that it writes is where it was told to
    if name == "2_own_recording":
        assert "RTRADAR_MOCAP names no folder" in said


@pytest.mark.slow
def test_it_takes_a_recording_that_is_there(mocap: Path, out: Path, tmp_path: Path) -> None:
    said, picture = ran("2_own_recording", out, tmp_path, RTRADAR_MOCAP=str(mocap))
    assert "RTRADAR_MOCAP names no folder" not in said
    assert not is_blank(picture)


def test_a_blank_picture_is_told(tmp_path: Path) -> None:
    from matplotlib.figure import Figure

    figure = Figure()
    axes = figure.subplots()
    axes.set(title="nothing", xlabel="Time [s]", ylabel="Range [m]")
    figure.savefig(tmp_path / "blank.png")
    assert is_blank(tmp_path / "blank.png")
    axes.scatter(np.linspace(0, 1, 20), np.linspace(0, 1, 20))
    figure.savefig(tmp_path / "drawn.png")
    assert not is_blank(tmp_path / "drawn.png")
