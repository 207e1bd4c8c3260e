"""Folders from others: whatever they contain, commands change nothing but what they write."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from rtradar.cli import main

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="links and pipes of POSIX")

RUN_NAMES = ["plan.png", "clutter_removal.png", "range_azimuth_walls.png"]
RUN_NAMES += ["maps.h5", "report.html", "summary.json", "view.npz"]


@pytest.fixture
def home(small_run: Path, tmp_path: Path) -> Path:
    """A home with documents, and the folder of a run among its downloads."""
    documents = tmp_path / "Documents"
    (documents / "thesis").mkdir(parents=True)
    (documents / "thesis" / "chapter.tex").write_text("years of work")
    (documents / "letter.txt").write_text("mine")
    shutil.copytree(small_run, tmp_path / "Downloads" / "run")
    return tmp_path


def snapshot(folder: Path) -> dict[str, tuple[object, ...]]:
    """Everything below a folder: its kind, its content, and its file on the disk."""
    found: dict[str, tuple[object, ...]] = {}
    for parent, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(parent, name)
            status = path.lstat()
            content: object = path.read_bytes() if path.is_file() else None
            content = os.readlink(path) if path.is_symlink() else content
            found[str(path.relative_to(folder))] = (status.st_mode, status.st_ino, content)
    return found


Runner = Callable[..., int]


@pytest.fixture
def run_into(small_file: Path) -> Runner:
    """Runs a small simulation into a folder, with more words, and gives the exit status."""

    def run_into(out: Path, *more: str) -> int:
        words = ["synthetic:walk", "--duration", "0.2", "--fidelity", "analytic"]
        return main(["run", *words, *more, "--radar", str(small_file), "--out", str(out)])

    return run_into


def reading_commands(run: Path, elsewhere: Path) -> list[list[str]]:
    return [
        ["view", str(run), "--out", str(elsewhere / "page.html")],
        ["view", str(run), "--still", str(elsewhere / "still.png")],
        ["export", str(run), "--out", str(elsewhere / "samples.nc")],
        ["export", str(run / "cloud_xyz.npz"), "--out", str(elsewhere / "cloud.ply")],
    ]


def plant_linked_work(run: Path) -> None:
    (run / ".rtradar-0123456789abcdef").symlink_to("../../Documents")


def plant_list(run: Path) -> None:
    path = run / "summary.json"
    summary = json.loads(path.read_text())
    summary["files"] += ["../../Documents/letter.txt", "../../Documents/", "/etc/hosts"]
    path.write_text(json.dumps(summary))


def plant_notes(run: Path) -> None:
    (run / ".rtradar-notes").mkdir()
    (run / ".rtradar-notes" / "mine").write_text("mine")


PLANTED = [plant_linked_work, plant_list, plant_notes]


@pytest.mark.parametrize("plant", PLANTED)
def test_commands_that_read_change_nothing(
    home: Path, plant: object, tmp_path_factory: pytest.TempPathFactory
) -> None:
    plant(home / "Downloads" / "run")
    before = snapshot(home)
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    for words in reading_commands(home / "Downloads" / "run", elsewhere):
        assert main(words) == 0
        assert snapshot(home) == before


@pytest.mark.parametrize("plant", PLANTED)
def test_a_run_into_such_a_folder_touches_nothing_outside(
    home: Path, plant: object, run_into: Runner
) -> None:
    run = home / "Downloads" / "run"
    plant(run)
    before = snapshot(home / "Documents")
    planted = {name: what for name, what in snapshot(run).items() if name.startswith(".rtradar")}
    assert run_into(run) == 0
    assert snapshot(home / "Documents") == before
    assert {
        name: what for name, what in snapshot(run).items() if name.startswith(".rtradar")
    } == planted


@pytest.mark.parametrize("name", RUN_NAMES)
def test_files_of_the_user_under_names_of_a_run_are_refused(
    tmp_path: Path, name: str, capsys: pytest.CaptureFixture[str], run_into: Runner
) -> None:
    (tmp_path / name).write_text("mine")
    before = snapshot(tmp_path)
    assert run_into(tmp_path) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert name in said[0]
    assert "--overwrite" in said[0]
    assert snapshot(tmp_path) == before


def test_overwrite_replaces_what_the_run_makes_and_leaves_the_rest(
    tmp_path: Path, run_into: Runner
) -> None:
    for name in ("maps.h5", "plan.png"):
        (tmp_path / name).write_text("mine")
    assert run_into(tmp_path, "--overwrite") == 0
    assert (tmp_path / "maps.h5").read_bytes()[:4] == b"\x89HDF"
    assert (tmp_path / "plan.png").read_text() == "mine"  # only runs in rooms draw one
    assert run_into(tmp_path) == 2  # which is still not this run's
    (tmp_path / "plan.png").unlink()
    assert run_into(tmp_path) == 0


def test_compare_and_its_runs_replace_their_own_and_refuse_the_users(
    tmp_path: Path, small_file: Path, run_into: Runner
) -> None:
    words = ["compare", "synthetic:walk", "--duration", "0.1", "--radar", str(small_file)]
    words += ["--fidelities", "analytic,analytic-paper", "--out", str(tmp_path)]
    (tmp_path / "analytic").mkdir()
    (tmp_path / "analytic" / "notes.txt").write_text("mine")
    assert main(words) == 0
    assert main(words) == 0
    assert run_into(tmp_path / "analytic") == 0  # each of its folders is that of a run
    assert (tmp_path / "analytic" / "notes.txt").read_text() == "mine"
    (tmp_path / "specular").mkdir()
    (tmp_path / "specular" / "maps.h5").write_text("mine")
    before = snapshot(tmp_path)
    assert main(words) == 2
    assert snapshot(tmp_path) == before


def test_a_page_of_the_users_own_is_not_replaced(
    home: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = home / "Downloads" / "run"
    assert main(["view", str(run), "--no-browser"]) == 0
    assert main(["view", str(run), "--no-browser"]) == 0
    (run / "view.html").write_text("mine")
    before = snapshot(home)
    assert main(["view", str(run), "--no-browser"]) == 2
    assert "--out" in capsys.readouterr().err
    assert snapshot(home) == before


def test_an_index_of_the_users_own_is_not_replaced(tmp_path: Path) -> None:
    from rtradar.clouds.sample_files import read_index, write_index
    from rtradar.errors import InputError

    write_index(tmp_path, ["b", "a"])
    write_index(tmp_path, ["c"])
    assert read_index(tmp_path) == ("c",)
    for text in ('{"stamps": ["penny black"]}', "[]", "not JSON"):
        (tmp_path / "collection.json").write_text(text)
        with pytest.raises(InputError, match="no index of a collection"):
            write_index(tmp_path, ["d"])
        assert (tmp_path / "collection.json").read_text() == text


def test_sweeping_takes_only_what_an_interrupted_writer_leaves(tmp_path: Path) -> None:
    from rtradar.clouds.sample_files import sweep

    ours = [".0a1b2c.npz.0123456789ab.part", ".collection.json.0123456789ab.part"]
    users = [".x.npz.y.part", ".x.npz.0123456789ab.part.txt"]
    users += ["x.npz.0123456789ab.part", ".notes.0123456789ab.part"]
    for name in (*ours, *users):
        (tmp_path / name).write_text("mine")
    (tmp_path / ".d.npz.0123456789ab.part").mkdir()
    sweep(tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(
        [*users, ".d.npz.0123456789ab.part"]
    )


def test_trainings_of_somebody_else_are_not_taken_up(tmp_path: Path) -> None:
    from rtradar.classify.study import check_plan
    from rtradar.errors import InputError

    (tmp_path / "training-01").mkdir()
    (tmp_path / "training-01" / "checkpoint.pt").write_text("mine")
    with pytest.raises(InputError, match=r"'training-01', but no plan\.json"):
        check_plan(tmp_path, {})


PIPES = ["summary.json", "view.npz", "cloud_rdt.npz", "cloud_xyz.npz", "maps.h5"]
PIPES += ["if.zarr/zarr.json", "if.zarr/c/0/0/0"]


@pytest.mark.parametrize("name", PIPES)
def test_a_pipe_in_the_place_of_a_file_is_not_waited_for(
    home: Path,
    name: str,
    tmp_path_factory: pytest.TempPathFactory,
    capsys: pytest.CaptureFixture[str],
) -> None:
    run = home / "Downloads" / "run"
    (run / name).unlink()
    os.mkfifo(run / name)
    before = snapshot(home)
    elsewhere = tmp_path_factory.mktemp("elsewhere")
    which = {"cloud_xyz.npz": 3}.get(name, 2 if name.startswith("if.zarr") else 0)
    words = reading_commands(run, elsewhere)[which]
    signal.alarm(60)  # ends the whole worker, which is more than a test that waits for ever
    try:
        assert main(words) == 2
    finally:
        signal.alarm(0)
    assert capsys.readouterr().err.count("\n") == 1
    assert snapshot(home) == before
