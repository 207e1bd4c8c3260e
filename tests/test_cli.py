"""The command line: what it writes, and its error messages."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray

from rtradar.cli import main
from rtradar.cli.values import setting
from rtradar.errors import InputError
from rtradar.pipeline.timing import NOT_TO_CLOUD

SHORT = ["--duration", "0.2", "--snr-db", "20"]
ANALYTIC = ["--fidelity", "analytic"]

SKELETON = """:version 1.10
:name tiny
:units
  mass 1.0
  length 0.45
  angle deg
:root
  order TX TY TZ RX RY RZ
  axis XYZ
  position 0 0 0
  orientation 0 0 0
:bonedata
  begin
    id 1
    name leg
    direction 0 -1 0
    length 10
    axis 0 0 0 XYZ
    dof rx ry rz
    limits (-180 180)
           (-180 180)
           (-180 180)
  end
:hierarchy
  begin
    root leg
  end
"""
FRAMES = (
    ":FULLY-SPECIFIED\n:DEGREES\n1\nroot 0 0 0 0 0 0\nleg 0 0 0\n2\nroot 0 0 0 0 0 0\nleg 0 0 1\n"
)


def run(*words: object) -> int:
    return main(["run", *(str(word) for word in words)])


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("walk") / "new" / "out"
    words = [*SHORT, "--fidelity", "specular", "--save-if", "--pictures"]
    assert run("synthetic:walk", *words, "--out", out) == 0
    return out


def test_a_run_writes_all_its_files_and_nothing_else(walked: Path) -> None:
    names = {file.name for file in walked.iterdir()}
    maps = {"range_time.png", "spectrogram.png", "range_doppler.png", "range_angle.png"}
    pictures = maps | {"cloud_rdt.png", "cloud_xyz.png"}
    clouds = {"cloud_rdt.npz", "cloud_rdt.ply", "cloud_xyz.npz", "view.npz"}
    own = {"maps.h5", "run.toml", "summary.json", "report.html", "if.zarr"}
    assert names == own | pictures | clouds


def test_the_summary_says_what_was_done(walked: Path) -> None:
    summary = json.loads((walked / "summary.json").read_text())
    assert summary["fidelity"] == "specular"
    assert summary["seed"] == 0
    assert summary["windows"] == 5  # starts at 0, 25, ... 100 ms
    assert summary["capture_s"] == pytest.approx(0.19950)  # 266 whole cycles of 0.75 ms
    assert summary["rdt_points"] == 3000
    assert summary["detections"] > 0
    assert summary["parameters"]["radar"]["start_frequency_hz"] == 12e9
    stages = summary["stages"]
    later = sum(stages.get(name, 0.0) for name in NOT_TO_CLOUD)
    assert summary["cloud_s"] == pytest.approx(summary["wall_s"] - later, abs=1e-3)
    assert 0 < summary["cloud_s"] < summary["wall_s"]
    factor = summary["wall_s"] / summary["capture_s"]
    assert summary["real_time_factor"] == pytest.approx(factor, rel=1e-3)
    assert {"scatter", "signal", "noise", "range", "doppler", "cfar", "cloud"} <= set(stages)
    assert summary["variant"] in ("llvm", "scalar", "cuda")
    assert summary["occlusion"] == "mitsuba"
    assert summary["rays_traced"] > 0
    for key in ("warmup_s", "peak_memory_mb", "limits", "versions"):
        assert key in summary


def test_maps_open_in_xarray_with_their_axes(walked: Path) -> None:
    with xarray.open_dataset(walked / "maps.h5", engine="h5netcdf") as maps:
        assert maps.range_doppler.dims == ("time", "range", "velocity")
        assert maps.range_doppler.shape == (5, 256, 133)
        assert maps.detections.shape == (5, 256, 133)
        assert maps.range_time.dims == ("slow_time", "range")
        assert maps.time.values[0] == pytest.approx(133 * 0.75e-3 / 2)
        assert maps.velocity.attrs["units"] == "m/s"
        assert float(maps.range[1]) == pytest.approx(0.0374741, abs=1e-6)  # c / 2B
        # 128 cycles of 266 every 6: starts at 0, 6, ... 138.
        assert maps.spectrogram.dims == ("spectrogram_time", "spectrogram_velocity")
        assert maps.spectrogram.shape == (24, 128)
        assert maps.range_azimuth.dims == ("time", "range", "azimuth")
        assert maps.range_elevation.dims == ("time", "range", "elevation")
        # The body is to the right of the radar, 14 degrees where it stands at the origin.
        azimuth = int(np.argmax(maps.range_azimuth.sum(("time", "range")).data))
        assert -25 < np.degrees(float(maps.azimuth[azimuth])) < -5
        brightest = maps.range_doppler.isel(time=0).argmax(...)
        # The walk is about 4 m from the radar.
        assert 3.0 < float(maps.range[brightest["range"]]) < 7.0


def test_the_cloud_lies_where_the_person_is(walked: Path) -> None:
    points = np.load(walked / "cloud_rdt.npz")["points"]
    assert points.shape == (3000, 3)
    assert (points[:, 0] > 0).all()
    assert (points[:, 0] < 0.2).all()
    time, distance, velocity = np.median(points, axis=0)
    assert time == pytest.approx(0.1, abs=0.05)
    assert distance == pytest.approx(4.1, abs=0.5)  # the radar is 4.1 m from the origin
    assert -4 < velocity < -0.5  # toward the radar, the swinging leg fastest


def test_the_cloud_in_the_room_is_about_the_person(walked: Path) -> None:
    cloud = np.load(walked / "cloud_xyz.npz")
    (length,) = {len(cloud[name]) for name in ("points", "velocity", "power", "time")}
    assert length > 500
    # The body walks from x = 0.1 m to -0.1 m, within 0.2 m of y = 0, and is 1.8 m high; the beam is
    # 0.13 m wide.
    x, y, z = np.median(cloud["points"], axis=0)
    assert abs(x) < 0.4
    assert abs(y) < 0.2
    assert 0.5 < z < 1.5
    assert (np.diff(cloud["time"]) >= 0).all()


def test_if_samples_are_kept_whole(walked: Path) -> None:
    import zarr

    samples = zarr.open_array(walked / "if.zarr", mode="r")
    assert samples.shape == (266 * 12, 8, 256)
    assert (np.abs(samples[-1]) > 0).all()  # noise is everywhere


def test_the_same_seed_gives_the_same_files_and_replaces_them(walked: Path, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("keep")
    for _ in range(2):
        words = [*SHORT, "--fidelity", "specular", "--out", tmp_path]
        assert run("synthetic:walk", *words) == 0
    assert (tmp_path / "mine.txt").read_text() == "keep"
    with h5py.File(walked / "maps.h5") as first, h5py.File(tmp_path / "maps.h5") as second:
        assert np.array_equal(first["range_doppler"][:], second["range_doppler"][:])
    assert np.array_equal(
        np.load(walked / "cloud_rdt.npz")["points"], np.load(tmp_path / "cloud_rdt.npz")["points"]
    )
    assert not list(tmp_path.glob(".rtradar-*"))


@pytest.mark.parametrize(
    ("text", "value"),
    [("3", 3), ("0.5", 0.5), ("true", True), ("false", False), ("inf", "inf"), ("a=b", "a=b")],
)
def test_a_model_option_is_a_number_a_truth_value_or_a_word(text: str, value: object) -> None:
    name, read = setting(f"tolerance={text}")
    assert (name, type(read), read) == ("tolerance", type(value), value)


def test_a_model_option_reaches_the_model_and_json_goes_where_it_is_asked_for(
    small_file: Path, tmp_path: Path
) -> None:
    words = ["--fidelity", "specular", "--model-option", "visibility=gradual"]
    words += ["--out", tmp_path / "out", "--radar", small_file]
    assert run("synthetic:punch", *SHORT, *words, "--json", tmp_path / "s.json") == 0
    summary = json.loads((tmp_path / "s.json").read_text())
    assert summary["parameters"]["model_options"] == {"visibility": "gradual"}
    assert json.loads((tmp_path / "out" / "summary.json").read_text()) == summary


def _amc(folder: Path, frames: str = FRAMES) -> list[str]:
    (folder / "tiny.asf").write_text(SKELETON)
    (folder / "tiny.amc").write_text(frames)
    return [str(folder / "tiny.amc"), "--skeleton", str(folder / "tiny.asf")]


def _radar(folder: Path, text: str) -> list[str]:
    (folder / "mine.toml").write_text(text)
    return ["synthetic:walk", "--radar", str(folder / "mine.toml")]


AT = "position_m = [{}, 0.0, 1.0]"
OPTION = ["synthetic:walk", "--model-option"]
BAD: dict[str, tuple[Callable[[Path], list[str]], str]] = {
    "no skeleton": (lambda folder: _amc(folder)[:1], "skeleton"),
    "motion not there": (lambda folder: [str(folder / "none.bvh")], "none.bvh"),
    "NaN": (lambda folder: _amc(folder, FRAMES.replace("leg 0 0 1", "leg 0 nan 1")), "nan"),
    "unknown kind": (lambda folder: [str(folder / "walk.fbx")], "fbx"),
    "unknown actor": (lambda folder: ["synthetic:fly"], "fly"),
    "unknown radar": (lambda folder: ["synthetic:walk", "--radar", "paper-13ghz"], "paper-12ghz"),
    "radar is no TOML": (lambda folder: _radar(folder, "bandwidth_hz : 4e9"), "mine.toml"),
    "unknown scene": (lambda folder: ["synthetic:walk", "--scene", "moon"], "free-space"),
    "unknown fidelity": (lambda folder: ["synthetic:walk", "--fidelity", "perfect"], "specular"),
    "huge number": (lambda folder: _radar(folder, "tx_y = 1" + 400 * "0"), "tx_y"),
    "pfa of zero": (lambda folder: ["synthetic:walk", "--pfa", "0"], "pfa"),
    "SNR is not a number": (lambda folder: ["synthetic:walk", "--snr-db", "nan"], "--snr-db"),
    "SNR beyond all bounds": (lambda folder: ["synthetic:walk", "--snr-db", "-5000"], "--snr-db"),
    "negative start": (lambda folder: ["synthetic:walk", "--start", "-1"], "--start"),
    "too short for a frame": (lambda folder: ["synthetic:walk", "--duration", "0.05"], "frame"),
    "radar inside the person": (lambda folder: _radar(folder, AT.format(0.0)), "0.3 m"),
    "person beyond the range": (lambda folder: _radar(folder, AT.format(-40.0)), "range"),
    "model option without a value": (lambda folder: [*OPTION, "shadow_rays"], "NAME=VALUE"),
    "unknown model option": (lambda folder: [*OPTION, "rays=3"], "no option 'rays'"),
    "no such option": (lambda folder: ["synthetic:walk", "--fidelty", "analytic"], "fidelty"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_gets_one_clear_line_and_leaves_nothing(
    case: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words, named = BAD[case]
    out = tmp_path / "deep" / "out"
    fidelity = [] if "--fidelity" in words(tmp_path) else ANALYTIC
    assert run(*words(tmp_path), *fidelity, "--out", out) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert named in said.err
    assert "Traceback" not in said.err
    assert not (tmp_path / "deep").exists()


def test_real_recording_past_its_end(
    mocap: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = mocap / "hdm05"
    words = [folder / "HDM_bd_kickLFront1Reps_001_120.amc", "--skeleton", folder / "HDM_bd.asf"]
    assert run(*words, "--duration", "99", "--out", tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "99" in said
    assert "1.33" in said  # what is there: 160 intervals at 120 Hz
    assert not (tmp_path / "out").exists()


def test_real_skeleton_with_a_bone_of_no_length(
    mocap: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    skeleton = (mocap / "hdm05/HDM_bd.asf").read_bytes().decode("latin-1")
    bone = re.search(r"name ltibia.*?length\s+([0-9.]+)", skeleton, re.DOTALL)
    assert bone is not None
    (tmp_path / "flat.asf").write_text(
        skeleton[: bone.start(1)] + "0.0" + skeleton[bone.end(1) :], encoding="latin-1"
    )
    motion = shutil.copy(mocap / "hdm05/HDM_bd_kickLFront1Reps_001_120.amc", tmp_path)
    assert run(motion, "--skeleton", tmp_path / "flat.asf", "--out", tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "ltibia" in said
    assert not (tmp_path / "out").exists()


def test_the_output_folder_must_be_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "file").write_text("mine")
    assert run("synthetic:walk", *SHORT, "--fidelity", "analytic", "--out", tmp_path / "file") == 2
    assert "--out" in capsys.readouterr().err
    assert (tmp_path / "file").read_text() == "mine"


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert re.fullmatch(r"rtradar \d+\.\d+\.\d+\n", capsys.readouterr().out)


HEAVY = {
    *("numba", "mitsuba", "drjit", "scipy", "matplotlib", "h5py", "skimage", "trimesh"),
    *("torch", "dask", "sklearn", "xarray", "pandas", "zarr"),
}


def imported(code: str) -> list[str]:
    """Heavy packages that a process has imported after this code."""
    code += f"\nimport sys; print(sorted({HEAVY | {'numpy'}} & set(sys.modules)))"
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    return list(ast.literal_eval(done.stdout.splitlines()[-1]))


@pytest.mark.slow
def test_analytic_traces_nothing_and_loads_no_tracer() -> None:
    code = (
        "import rtradar as rt\n"
        "rt.run('synthetic:walk', 'paper-12ghz', fidelity='analytic', duration_s=0.12)\n"
        "import sys; print({'mitsuba', 'drjit'} & set(sys.modules))"
    )
    words = [sys.executable, "-W", "ignore", "-c", code]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["set()"]


def test_import_is_quick_and_light() -> None:
    assert not set(imported("import rtradar")) - {"numpy"}


@pytest.mark.parametrize(
    ("words", "near"),
    [
        ("run synthetic:walk --snr 10", "no option --snr; did you mean --snr-db?"),
        ("run synthetic:walk --fidelty=rays", "no option --fidelty; did you mean --fidelity?"),
        ("predict x --zzz", "no option --zzz; see"),
        ("dataset build x.toml --worker 1", "no option --worker; did you mean --workers?"),
    ],
)
def test_an_option_that_is_none_is_told_with_the_nearest(
    words: str, near: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words.split()) == 2
    said = capsys.readouterr().err
    assert near in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("words", [[], ["--help"], ["--version"], ["run", "--fidelty", "x"]])
def test_help_and_unknown_options_need_no_numpy(words: list[str]) -> None:
    assert "numpy" in imported("import numpy")
    assert not imported(f"from rtradar.cli import main; main({words})")


def test_wrong_input_is_refused_before_anything_slow_is_imported(tmp_path: Path) -> None:
    (tmp_path / "bad.toml").write_text("bandwidth_hz : 4e9\n")
    bad, walk = str(tmp_path / "bad.toml"), ["run", "synthetic:walk", "--out", "o"]
    refused = [
        *([*walk, *words.split()] for words in ("--radar x", "--scene x", "--fidelity x")),
        *([*walk, *words.split()] for words in ("--pfa 3", "--seed x", "--detector x")),
        *([*walk, option, bad] for option in ("--radar", "--scene")),
        ["run", "synthetic:fly", "--out", "o"],
        ["run", "none.bvh", "--out", "o"],
        ["run", "none.amc", "--out", "o"],
        ["compare", "none.bvh", "--out", "o"],
        ["compare", "synthetic:walk", "--fidelities", "analytic,x", "--out", "o"],
        ["view", "none"],
        ["dataset", "build", "none.toml", "--out", "o"],
        ["dataset", "build", bad, "--out", "o"],
        ["train", "none", "--out", "o"],
        ["evaluate", "none"],
        ["export", "none", "--out", "o.mat"],
    ]
    code = f"from rtradar.cli import main\nassert [main(words) for words in {refused}] == " + str(
        [2] * len(refused)
    )
    assert not imported(code)


@pytest.mark.parametrize(
    "command",
    [["run", "synthetic:kick"], ["compare", "synthetic:kick"], ["export", "x"], ["view", "x"]],
)
def test_an_empty_name_is_not_the_current_folder(
    command: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main([*command, "--out", ""]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device that is always full")
@pytest.mark.parametrize("buffered", [True, False])
def test_what_cannot_be_printed_is_said_in_one_line(buffered: bool) -> None:
    words = [sys.executable, *["-u"] * (not buffered), "-m", "rtradar", "list", "scenes"]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            words, stdout=full, stderr=subprocess.PIPE, text=True, check=False, env=environment
        )
    assert done.returncode == 1
    assert done.stderr == "rtradar: cannot write to the standard output: No space left on device\n"


LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, 100_000))
from rtradar.cli import main
sys.exit(main(sys.argv[1:]))
"""


@pytest.mark.skipif(sys.platform == "win32", reason="limits of POSIX")
@pytest.mark.parametrize(
    "command",
    ["run", *(pytest.param(f"export {kind}", marks=pytest.mark.slow) for kind in (".nc", ".mat"))],
)
def test_files_that_may_not_grow_are_told_in_one_line(
    walked: Path, tmp_path: Path, command: str
) -> None:
    words = {
        "run": ["run", "synthetic:kick", *SHORT, *ANALYTIC, "--out", tmp_path / "out"],
        "export .nc": ["export", walked, "--out", tmp_path / "samples.nc"],
        "export .mat": ["export", walked, "--out", tmp_path / "samples.mat"],
    }[command]
    limited = [sys.executable, "-c", LIMITED, *map(str, words)]
    done = subprocess.run(limited, capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert "Traceback" not in done.stderr
    assert "File too large" in done.stderr.splitlines()[-1]
    assert not list(tmp_path.iterdir())


# -- several people ------------------------------------------------------------------------------


def people_of(monkeypatch: pytest.MonkeyPatch, *words: object) -> list[Any]:
    """People whom `rtradar run` would simulate."""
    found: list[Any] = []

    def run_nothing(motion: list[Any], **_: object) -> None:
        found.extend(motion)
        raise InputError("enough")

    monkeypatch.setattr("rtradar.pipeline.run", run_nothing)
    assert run(*words, "--duration", "0.2", "--out", "nowhere") == 2
    return found


@pytest.mark.parametrize(
    "words",
    [
        ("synthetic:walk", "synthetic:kick", "--at", "-1,0.5", "--at", "-.5,-1,90"),
        ("synthetic:walk", "--at", "-1,0.5", "synthetic:kick", "--at=-.5,-1,90"),
        ("--at", "-1,0.5", "--at", "-.5,-1,90", "synthetic:walk", "synthetic:kick"),
    ],
)
def test_each_motion_has_its_place_in_order(
    monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    walker, kicker = people_of(monkeypatch, *words)
    assert walker.motion.name == "synthetic:walk"
    assert (walker.position_m, walker.heading_deg) == ((-1.0, 0.5), 0.0)
    assert kicker.motion.name == "synthetic:kick"
    assert (kicker.position_m, kicker.heading_deg) == ((-0.5, -1.0), 90.0)


def test_exact_ghosts_may_be_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(people_of(monkeypatch, "synthetic:walk", "--path-tolerance-db", "-inf")) == 1


def test_actors_of_one_activity_are_two_people(monkeypatch: pytest.MonkeyPatch) -> None:
    words = "synthetic:walk", "synthetic:walk", "--at", "0,1", "--at", "0,-1"
    one, other = people_of(monkeypatch, *words)
    assert not np.array_equal(one.motion.rotations, other.motion.rotations)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["synthetic:walk", "synthetic:kick"], "2 MOTION and 0 --at"),
        (["synthetic:walk", "--at", "1,2", "--at", "1,3"], "1 MOTION and 2 --at"),
        (["synthetic:walk", "--at", "1"], "place X,Y"),
        (["synthetic:walk", "--at", "1,2,3,4"], "place X,Y"),
        ([], "nobody is in the scene"),
        (["a.amc", "b.amc", "--at", "0,1", "--at", "1,0", *["--skeleton", "a.asf"] * 3], "2 rec"),
    ],
)
def test_places_that_do_not_fit_are_refused(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, words: list[str], message: str
) -> None:
    assert run(*words, "--out", tmp_path / "out") == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.count("\n") == 1
