"""`rtradar view`: pages and stills of a run, and what is said where a folder holds none."""

from __future__ import annotations

import json
import pickle
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

import rtradar as rt
from rtradar.cli import main
from rtradar.pipeline.output.view import load_run_view, view
from rtradar.report.run_view import COLOURS
from rtradar.system import figure_style


@pytest.fixture(scope="module")
def made(
    beside_a_wall: tuple[rt.Radar, rt.Scene], tmp_path_factory: pytest.TempPathFactory
) -> Path:
    out = tmp_path_factory.mktemp("made")
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.4)
    options = {"fidelity": "analytic", "clutter_removal": "mean"}
    rt.run(motion, *beside_a_wall, out=out, **options)
    return out


def test_a_map_is_that_of_the_run_to_half_a_level(made: Path) -> None:
    linked = load_run_view(made)
    shown = (
        linked.range_doppler.low_db
        + linked.range_doppler.step_db * linked.range_doppler.level.astype(float)
    )
    with h5py.File(made / "maps.h5") as maps:
        assert linked.snapshots.times.tolist() == pytest.approx(
            maps["time"][linked.snapshots.window]
        )
        power, velocity = maps["range_doppler"][:][linked.snapshots.window], maps["velocity"][:]
        distance = maps["range"][:]
    # Mean of 8 channels, with R^4 for the loss over distance; the first bin's centre is at 0 m, its
    # end at half a bin.
    loss_db = 40 * np.log10(np.maximum(distance, distance[1] / 2))[:, None]
    level = np.maximum(10 * np.log10(power / 8) + loss_db, linked.range_doppler.low_db)
    assert np.abs(shown - level).max() <= linked.range_doppler.step_db / 2 * 1.001
    assert linked.range_doppler.across == pytest.approx((velocity[0], velocity[1] - velocity[0]))


def test_the_strongest_echo_stands_on_the_strongest_cell(made: Path) -> None:
    linked = load_run_view(made)
    snapshots, levels = linked.snapshots, linked.range_doppler
    near = 0
    for step in range(len(snapshots.times)):
        row, column = np.unravel_index(levels.level[step].argmax(), levels.level.shape[1:])
        distance, velocity = (
            levels.up[0] + row * levels.up[1],
            levels.across[0] + column * levels.across[1],
        )
        bins = np.hypot(
            (snapshots.range_m[step] - distance) / levels.up[1],
            (linked.shown_velocity()[step] - velocity) / levels.across[1],
        )
        near += bins[linked.seen[step]].min() <= 1.5
    # One of them is within its cell or next to it, but for the odd window in which parts interfere.
    assert near >= len(snapshots.times) - 1


def test_points_are_of_who_returned_them(made: Path, tmp_path: Path) -> None:
    linked = load_run_view(made)
    # One person alone: the surface about detected cells is half a cell away from one of theirs.
    with h5py.File(made / "maps.h5") as maps:
        sources = maps["source"][:]
        nobodys = (sources[maps["detections"][:] > 0] < 0).mean()
    assert (linked.rdt_source == 0).mean() > 0.9 - nobodys
    # A folder whose map of sources is damaged, or who points at somebody who is not there.
    shutil.copytree(made, tmp_path / "run")
    with h5py.File(tmp_path / "run" / "maps.h5", "r+") as maps:
        maps["source"][...] = np.where(sources >= 0, 7, -1)
    assert (load_run_view(tmp_path / "run").rdt_source == -1).all()
    with h5py.File(tmp_path / "run" / "maps.h5", "r+") as maps:
        del maps["source"]
        maps["source"] = np.full(sources.shape, np.nan)
    with pytest.raises(rt.InputError, match="damaged"):
        load_run_view(tmp_path / "run")


@pytest.mark.drawn
@pytest.mark.parametrize(
    "colour",
    [
        pytest.param(colour, marks=[] if colour == "velocity" else [pytest.mark.slow])
        for colour in COLOURS
    ],
)
def test_a_still_shows_the_moment_in_those_colours(made: Path, tmp_path: Path, colour: str) -> None:
    told = view(made, still=tmp_path / "a.png", time_s=0.1, colour=colour)
    view(made, still=tmp_path / "b.png", time_s=0.3, colour=colour)
    first, second = (matplotlib.image.imread(tmp_path / name) for name in ("a.png", "b.png"))
    assert told["still"]["time_s"] == pytest.approx(0.1, abs=0.0125)
    assert "page" not in told
    assert first.shape == second.shape
    assert (first != second).any(axis=2).sum() > 1000
    assert (np.ptp(first[..., :3], axis=2) > 0.25).sum() > 5000


def test_a_still_cuts_no_body_at_the_edge_of_its_axes(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[Figure] = []
    # As it was then, for afterwards it is emptied.
    monkeypatch.setattr(
        figure_style,
        "write_png",
        lambda figure, _: drawn.append(pickle.loads(pickle.dumps(figure))),
    )
    view(made, still=tmp_path / "a.png", time_s=0.1)
    views = [axes for axes in drawn[0].axes if axes.name == "3d"]
    parts = sum(isinstance(artist, Poly3DCollection) for artist in views[0].collections)
    assert parts >= 21
    assert not any(
        artist.get_clip_on() for axes in views for artist in (*axes.collections, *axes.lines)
    )


def test_the_command_writes_what_it_is_asked_for(
    made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(made, folder)
    opened: list[str] = []
    monkeypatch.setattr("webbrowser.open", lambda address: opened.append(address) or True)
    assert main(["view", str(folder), "--no-browser", "--json", str(tmp_path / "told.json")]) == 0
    told = json.loads((tmp_path / "told.json").read_text())
    assert told["page"] == {
        "path": str(folder / "view.html"),
        "bytes": (folder / "view.html").stat().st_size,
    }
    assert told["page"]["bytes"] < 8e6
    assert (
        main(
            [
                "view",
                str(folder),
                "--out",
                str(tmp_path / "own.html"),
                "--still",
                str(tmp_path / "own.png"),
            ]
        )
        == 0
    )
    assert (tmp_path / "own.html").read_bytes() == (folder / "view.html").read_bytes()
    (folder / "view.html").unlink()
    assert main(["view", str(folder), "--still", str(tmp_path / "own.png"), "--time", "0.2"]) == 0
    assert not opened
    assert not (folder / "view.html").exists()
    assert main(["view", str(folder)]) == 0
    assert opened == [(folder / "view.html").as_uri()]


@pytest.mark.parametrize(("window", "wider_db"), [("hann", 0.0), ("flattop", 4.002)])
def test_a_spectrogram_is_divided_by_the_bandwidth_of_the_runs_window(
    made: Path, tmp_path: Path, window: str, wider_db: float
) -> None:
    """3.7702 bins of ``flattop``, 1.5 of ``hann``, which a folder that names none has."""
    low_db = []
    for named in ({}, {"range_window": window}):
        folder = tmp_path / f"run{len(named)}"
        shutil.copytree(made, folder, ignore=shutil.ignore_patterns("*.png", "*.html"))
        summary = json.loads((folder / "summary.json").read_text())
        del summary["parameters"]["range_window"]
        # The level is absolute where there is no loss with distance.
        summary["parameters"] |= {"spreading": False, **named}
        (folder / "summary.json").write_text(json.dumps(summary))
        low_db.append(load_run_view(folder).spectrogram.low_db)
    assert low_db[0] - low_db[1] == pytest.approx(wider_db, abs=1e-3)


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("summary.json", None, "holds no run"),
        ("summary.json", "{", "is damaged"),
        ("summary.json", '{"parameters": {"radar": {"tx_y": -1}}}', "tx_y = -1"),
        ("summary.json", '{"parameters": {"radar": {}, "range_window": 3}}', "range window 3"),
        ("view.npz", None, "is not there"),
        ("maps.h5", None, "is not there"),
        ("maps.h5", "text", "is damaged"),
        ("cloud_rdt.npz", None, "is not there"),
        ("cloud_xyz.npz", "text", "is damaged"),
    ],
)
def test_a_folder_without_a_whole_run_is_refused_in_one_line(
    made: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    name: str,
    content: str | None,
    said: str,
) -> None:
    folder = tmp_path / "run"
    shutil.copytree(made, folder, ignore=shutil.ignore_patterns("*.png", "*.html"))
    (folder / name).unlink()
    if content is not None:
        (folder / name).write_text(content)
    assert main(["view", str(folder), "--out", str(tmp_path / "v.html")]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert not (tmp_path / "v.html").exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--still", "s.png", "--time", "7"], "time_s = 7.0; the capture has windows from"),
        (["--time", "0.1"], "give --still"),
        (["--out", "nowhere/v.html"], "give a folder that exists"),
        (["--still", "nowhere/s.png"], "give a folder that exists"),
    ],
)
def test_bad_options_are_refused(
    made: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    options: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["view", str(made), *options]) == 2
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_moments_of_another_run_are_refused(
    made: Path, beside_a_wall: tuple[rt.Radar, rt.Scene], tmp_path: Path
) -> None:
    radar, _ = beside_a_wall
    folder = tmp_path / "run"
    shutil.copytree(made, folder)
    rt.run(
        rt.synthetic_motion("walk", seed=0, duration_s=0.1),
        radar,
        out=tmp_path / "short",
        fidelity="analytic",
    )
    shutil.copy(tmp_path / "short" / "maps.h5", folder / "maps.h5")
    with pytest.raises(rt.InputError, match="not of one run"):
        view(folder, page=tmp_path / "v.html")


def test_a_capture_too_short_for_a_spectrogram_is_shown_without(
    small: rt.Radar, tmp_path: Path
) -> None:
    radar = replace(small, chirp_duration_s=1e-3)
    stand = rt.synthetic_motion("stand", seed=1, duration_s=1.0)
    rt.run(stand, radar, out=tmp_path, fidelity="analytic", duration_s=0.2)
    with h5py.File(tmp_path / "maps.h5") as maps:
        assert maps["spectrogram"].shape == (0, 128)  # 100 cycles of 128
    assert not (tmp_path / "spectrogram.png").exists()
    view(tmp_path, page=tmp_path / "v.html", still=tmp_path / "s.png")
    text = (tmp_path / "v.html").read_text(encoding="utf-8")
    assert "The capture is too short for one." in text
    assert 'id="scene-spectrogram"' not in text
