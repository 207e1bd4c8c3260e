"""Every file that the command line reads may be anything: one line says what is wrong.

This holds for files that are named and for those in folders that are named. Each input meets each
kind of file that is none, or not the one that is meant. Nothing may wait, take all memory or show a
traceback.
"""

from __future__ import annotations

import dataclasses
import json
import os
import shutil
import signal
import socket
import stat
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import h5py
import numpy as np
import pytest
import trimesh
import zarr

import rtradar as rt
from rtradar.cli import main
from rtradar.exchange import read_if
from rtradar.system import files
from rtradar.system.files import open_regular, read_bytes
from rtradar.system.hdf5 import stored

pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs POSIX")

HANGS_S = 30.0
"""The slowest takes a second, most of it for imports."""

Make = Callable[[Path], None]
Words = list[str | Path]


class Waits(BaseException):
    """An error that no reader takes for one of its own, as TimeoutError is an OSError."""


@contextmanager
def guarded() -> Iterator[None]:
    """End what waits for ever."""

    def end(number: int, frame: FrameType | None) -> None:
        raise Waits(f"for more than {HANGS_S} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, HANGS_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def a_socket(path: Path) -> None:
    here = Path.cwd()
    os.chdir(path.parent)  # a socket's whole path has 107 bytes at most
    try:
        with socket.socket(socket.AF_UNIX) as one:
            one.bind(path.name)
    finally:
        os.chdir(here)


def unreadable(path: Path) -> None:
    path.write_bytes(b"x")  # which is what an administrator reads
    path.chmod(0)


def itself(path: Path) -> None:
    path.symlink_to(path.name)


ODD: dict[str, Make] = {
    "nothing": lambda path: None,
    "directory": Path.mkdir,
    "pipe": os.mkfifo,
    "socket": a_socket,
    "endless device": lambda path: path.symlink_to("/dev/zero"),
    "empty device": lambda path: path.symlink_to(os.devnull),
    "link to a pipe": lambda path: (os.mkfifo(path.with_name("pipe")), path.symlink_to("pipe"))[1],
    "dangling link": lambda path: path.symlink_to("nowhere"),
    "link to itself": itself,
    "unreadable": unreadable,
    "no bytes": lambda path: path.write_bytes(b"") and None,
    "Latin-1": lambda path: path.write_bytes(b"\xe9t\xe9\n") and None,
    "byte order mark": lambda path: path.write_bytes(b"\xef\xbb\xbf\n") and None,
    "UTF-16": lambda path: path.write_bytes("a = 1\n".encode("utf-16")) and None,
    "zeros": lambda path: path.write_bytes(bytes(5000)) and None,
}

MARK = "byte order mark"

NAMES: dict[str, Callable[[str], str]] = {
    "empty": lambda ending: "",
    "ending alone": lambda ending: ending,
    "of 300 letters": lambda ending: "x" * 300 + ending,
    "of 5000 letters": lambda ending: "x/" * 2500 + "x" + ending,
    "no UTF-8": lambda ending: os.fsdecode(b"caf\xe9" + ending.encode()),
    "with a null": lambda ending: f"a\0b{ending}",
    "of two lines": lambda ending: f"a\nb{ending}",
    "half a character": lambda ending: f"\ud83d{ending}",
}
"""Nothing has such a name here."""


def one_line(words: Words, capfd: pytest.CaptureFixture[str]) -> str:
    """Message of the command for bad input."""
    with guarded():
        status = main([os.fspath(word) for word in words])
    err = capfd.readouterr().err
    assert (status, len(err.splitlines()), err.startswith("rtradar")) == (2, 1, True), err
    return err


# -- files that the command line names -------------------------------------------------------------

GIVEN: dict[str, tuple[str, Callable[[str], Words]]] = {
    "a BVH": (".bvh", lambda path: ["run", path, "--out", "out"]),
    "a C3D": (".c3d", lambda path: ["run", path, "--out", "out"]),
    "an ASF": (".asf", lambda path: ["run", "x.amc", "--skeleton", path, "--out", "out"]),
    "an AMC": (".amc", lambda path: ["run", path, "--skeleton", "good.asf", "--out", "out"]),
    "a motion to compare": (".bvh", lambda path: ["compare", path, "--out", "out"]),
    "a radar": (".toml", lambda path: ["run", "synthetic:walk", "--radar", path, "--out", "out"]),
    "a scene": (".toml", lambda path: ["run", "synthetic:walk", "--scene", path, "--out", "out"]),
    "a radar to measure": (".toml", lambda path: ["bench", "--quick", "--radar", path]),
    "a data set": (".toml", lambda path: ["dataset", "build", path, "--out", "out"]),
    "a NumPy archive": (".npz", lambda path: ["export", path, "--out", "out.ply"]),
    "a PLY": (".ply", lambda path: ["export", path, "--out", "out.npz"]),
    "a PCD": (".pcd", lambda path: ["export", path, "--out", "out.npz"]),
    "a README": (".md", lambda path: ["validate", "--readme", path]),
    "a run to see": ("", lambda path: ["view", path, "--out", "out.html"]),
    "a run to export": ("", lambda path: ["export", path, "--out", "out.nc"]),
    "clouds": ("", lambda path: ["train", path, "--out", "out"]),
    "trainings": ("", lambda path: ["evaluate", path, "--out", "out"]),
}

ASF = """:units
length 0.45
angle deg
:root
order TX TY TZ RX RY RZ
axis XYZ
position 0 0 0
orientation 0 0 0
:bonedata
begin
name lhipjoint
direction 1 0 0
length 2
axis 0 0 0 XYZ
end
:hierarchy
begin
root lhipjoint
end
"""


@pytest.fixture(scope="module")
def imported() -> None:
    """Import what is slow to import before time is measured."""
    for name in ("torch", "matplotlib.pyplot", "rtradar.pipeline.output.view", "rtradar.campaign"):
        pytest.importorskip(name)


@pytest.fixture
def there(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, imported: None) -> Iterator[Path]:
    """An empty working folder, which stays as it is."""
    (tmp_path / "good.asf").write_text(ASF)
    monkeypatch.chdir(tmp_path)
    yield tmp_path
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("kind", ODD)
@pytest.mark.parametrize("given", GIVEN)
def test_a_given_path_that_is_something_else(
    there: Path, capfd: pytest.CaptureFixture[str], given: str, kind: str
) -> None:
    described = given in ("a radar", "a radar to measure", "a scene")
    if described and kind in ("no bytes", MARK):
        pytest.skip("that leaves everything as it is by default")
    ending, words = GIVEN[given]
    path = there / f"odd{ending}"
    ODD[kind](path)
    assert "odd" in one_line(words(str(path)), capfd)
    if kind != "nothing":
        path.lstat()  # it is still there


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("given", GIVEN)
def test_a_given_path_that_no_file_has(
    there: Path, capfd: pytest.CaptureFixture[str], given: str, name: str
) -> None:
    ending, words = GIVEN[given]
    one_line(words(NAMES[name](ending)), capfd)


# -- files in folders that the command line names --------------------------------------------------


@pytest.fixture(scope="module")
def folders(small_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Everything that commands read: a run, a scene, a data set, clouds and trainings."""
    pytest.importorskip("torch")
    from rtradar.classify.outcomes import HISTORY, Outcome, save_outcome
    from rtradar.classify.recipes import RECIPES
    from rtradar.classify.study import write_plan
    from rtradar.clouds import Sample
    from rtradar.clouds.sample_files import write_index, write_sample

    root = tmp_path_factory.mktemp("folders")
    shutil.copytree(small_run, root / "run")
    (root / "scene").mkdir()
    for ending in ("obj", "stl", "ply", "glb"):
        trimesh.creation.box((1, 1, 1)).export(root / "scene" / f"box.{ending}")
        (root / "scene" / f"{ending}.toml").write_text(
            f'[[furniture]]\nname = "box"\nmesh = "box.{ending}"\nmaterial = "wood"\n'
            "position_m = [0, 3, 0.5]\nmetres_per_unit = 1\n"
        )
    (root / "set").mkdir()
    (root / "set" / "set.toml").write_text(
        '[each]\nradar = ["radar.toml"]\nscene = ["scene.toml"]\n[windows]\nduration_s = 0.1\n'
        '[[recordings]]\nfile = "x.bvh"\nlabel = "walk"\nsubject = "s"\nlicence = "none"\n'
    )
    (root / "set" / "radar.toml").write_text("tx_z = 0\nrx_z = 0\n")
    (root / "set" / "scene.toml").write_text("")
    (root / "set" / "x.bvh").write_text("HIERARCHY\n")
    (root / "clouds").mkdir()
    write_index(root / "clouds", ["one"])
    one = Sample(np.ones((9, 3)), "walk", {"recording": "r"})
    write_sample(root / "clouds", "one", one, np.zeros((0, 3)))
    plan = {"data": [], "clouds": 2, "fingerprint": "", "made": "", "classes": ["kick", "walk"]}
    plan |= {"split": "folds", "recipe": RECIPES["lean"].as_dict(), "folds": 2, "seed": 0}
    write_plan(root / "trained", plan | {"trainings": ["1"]})
    (root / "trained" / "training-01").mkdir()
    column, words = np.array([0, 1]), np.array(["", ""])
    history = [dict.fromkeys(HISTORY, 0.5)]
    outcome = Outcome("1", "", column, column, column, words, words, history)
    save_outcome(root / "trained" / "training-01" / "outcome.json", outcome)
    return root


RUN_FILES = "summary.json", "view.npz", "cloud_rdt.npz", "cloud_xyz.npz", "maps.h5"
READ_BY: dict[str, tuple[str, ...]] = {
    "view run --out out.html": tuple(f"run/{name}" for name in RUN_FILES),
    "export run --out out.nc": tuple(f"run/if.zarr{of}" for of in ("", "/zarr.json", "/c/0/0/0")),
    **{
        f"run synthetic:walk --scene scene/{ending}.toml --out out": (f"scene/box.{ending}",)
        for ending in ("obj", "stl", "ply", "glb")
    },
    "dataset build set/set.toml --out out": ("set/radar.toml", "set/scene.toml", "set/x.bvh"),
    "train clouds --out out": ("clouds/collection.json", "clouds/one.npz"),
    "evaluate trained --out out": ("trained/plan.json", "trained/training-01/outcome.json"),
}
INSIDE: dict[str, Words] = {
    name: [*command.split()] for command, names in READ_BY.items() for name in names
}

FINE = {
    ("set/scene.toml", "no bytes"),
    ("set/scene.toml", "byte order mark"),
    ("set/radar.toml", "no bytes"),
    ("set/radar.toml", "byte order mark"),
    # A missing part of the samples is zero, as in zarr.
    ("run/if.zarr/c/0/0/0", "nothing"),
    ("run/if.zarr/c/0/0/0", "directory"),
}
"""Not wrong at all."""


@pytest.mark.parametrize("kind", ODD)
@pytest.mark.parametrize("inside", INSIDE)
def test_a_file_of_a_folder_that_is_something_else(
    there: Path, folders: Path, capfd: pytest.CaptureFixture[str], inside: str, kind: str
) -> None:
    if (inside, kind) in FINE:
        pytest.skip("that is allowed")
    top = inside.split("/")[0]
    shutil.copytree(folders / top, there / top)
    path = there / inside
    shutil.rmtree(path) if path.is_dir() else path.unlink()
    ODD[kind](path)
    one_line(INSIDE[inside], capfd)


@pytest.mark.parametrize("kind", ODD)
def test_a_checkpoint_that_is_something_else(tmp_path: Path, kind: str) -> None:
    pytest.importorskip("torch")
    from rtradar.classify.training import load_checkpoint

    ODD[kind](tmp_path / "odd.pt")
    with guarded(), pytest.raises(rt.InputError, match=r"odd\.pt") as caught:
        load_checkpoint(tmp_path / "odd.pt")
    assert len(str(caught.value).splitlines()) == 1


# -- what they all use -----------------------------------------------------------------------------


def test_what_is_opened_counts_not_what_had_the_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_bytes(b"x")
    os.mkfifo(tmp_path / "pipe")
    regular = os.stat(tmp_path / "file")
    opened = len(os.listdir("/proc/self/fd")) if Path("/proc/self/fd").is_dir() else None
    with monkeypatch.context() as patch, guarded():
        patch.setattr(files.os, "stat", lambda path: regular)  # as it was a moment ago
        with pytest.raises(OSError, match="a pipe"):
            open_regular(tmp_path / "pipe")
    if opened is not None:
        assert len(os.listdir("/proc/self/fd")) == opened


def test_a_device_is_not_opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def opened(*words: object) -> int:
        raise AssertionError("opening a device may move it")

    with monkeypatch.context() as patch:
        patch.setattr(files.os, "open", opened)
        with pytest.raises(OSError, match="a device"):
            open_regular(os.devnull)


def test_a_file_larger_than_allowed_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "large"
    path.write_bytes(b"12345")
    assert read_bytes(path, 5) == b"12345"
    with pytest.raises(ValueError, match="more than"):
        read_bytes(path, 4)
    os.truncate(path, 2**40)  # no such memory
    with pytest.raises(ValueError, match="more than"):
        read_bytes(path, 5)
    assert stat.S_ISREG(path.stat().st_mode)


def test_a_link_inside_of_hdf5_is_not_followed(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    with h5py.File(tmp_path / "maps.h5", "w") as file:
        file["power"] = h5py.ExternalLink(str(tmp_path / "pipe"), "power")
        file["there"] = np.zeros(3)
        file["same"] = h5py.SoftLink("/there")
    with guarded(), open_regular(tmp_path / "maps.h5") as raw, h5py.File(raw) as file:
        for name in ("power", "same"):
            with pytest.raises(ValueError, match="is not in this file"):
                stored(file, name)
        for name in ("nothing", "there/nothing"):
            with pytest.raises(KeyError):
                stored(file, name)
        assert stored(file, "there").shape == (3,)


def test_a_samples_folder_of_links_is_not_followed(tmp_path: Path) -> None:
    small = {"samples_per_chirp": 4, "chirp_duration_s": 1e-3, "frame_duration_s": 4e-3}
    radar = rt.Radar(tx_y=1, tx_z=0, rx_y=2, rx_z=0, **small)
    told = {"parameters": {"radar": dataclasses.asdict(radar)}}
    (tmp_path / "summary.json").write_text(json.dumps(told))
    samples = np.ones((2, 2, 4), "<c8")
    zarr.create_array(tmp_path / "if.zarr", data=samples, chunks=(1, 2, 4))
    os.mkfifo(tmp_path / "if.zarr" / "c" / "pipe")
    with guarded(), pytest.raises(rt.InputError, match="pipe"):
        read_if(tmp_path)
