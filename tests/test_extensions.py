"""The package of ``docs/extending.md``, used from outside, and packages that are broken."""

from __future__ import annotations

import dataclasses
import importlib
import json
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

import rtradar as rt
from rtradar.cli import main
from rtradar.process import DETECTORS, build_detector
from rtradar.radar import PRESETS
from rtradar.scatter import MODELS, build_model
from rtradar.scene import Wall, material
from rtradar.system.registries import READERS, Registry

ROOT = Path(__file__).resolve().parents[1]
REGISTRIES: tuple[Registry, ...] = (MODELS, READERS, PRESETS, DETECTORS)
USED = ("--fidelity", "points", "--radar", "lane-60ghz", "--detector", "threshold")


Install = Callable[..., None]
Capture = pytest.CaptureFixture[str]


def files_of_the_how_to() -> dict[str, str]:
    """Each file by its name, as the page has it."""
    page = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
    return dict(
        re.findall(r"^`([\w.]+)`\n\n```\w+\n(.*?)^```$", page, flags=re.MULTILINE | re.DOTALL)
    )


def install(folder: Path, files: dict[str, str], changes: dict[str, str] | None = None) -> None:
    """What pip installs of a package: its modules, and beside them its name and entry points."""
    folder.mkdir()
    whole = tomllib.loads(files["pyproject.toml"])
    project, modules = whole["project"], whole["tool"]["setuptools"]["py-modules"]
    assert len(files) == 1 or {f"{name}.py" for name in modules} == files.keys() - {
        "pyproject.toml"
    }
    about = folder / f"{project['name']}-{project['version']}.dist-info"
    about.mkdir()
    (about / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    lines = []
    for group, entries in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in entries.items())]
    (about / "entry_points.txt").write_text("\n".join(lines) + "\n")
    for name, text in (files | (changes or {})).items():
        (folder / name).write_text(text, encoding="utf-8")


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., None]]:
    """Install the package for this process, as `install` does for another."""

    def put(folder: Path, changes: dict[str, str] | None = None) -> None:
        install(folder, files_of_the_how_to(), changes)
        monkeypatch.syspath_prepend(str(folder))

    forget()
    yield put
    forget()


def forget() -> None:
    for registry in REGISTRIES:
        registry.__dict__.pop("_installed", None)
    for module in [name for name in sys.modules if name.startswith("outside_")]:
        del sys.modules[module]


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.4)
    path = tmp_path_factory.mktemp("recording") / "walk.angles"
    fields = ("joints", "parents", "offsets", "root_positions", "rotations", "rate_hz")
    with path.open("wb") as file:
        np.savez(file, **{field: np.asarray(getattr(motion, field)) for field in fields})
    return path


@pytest.mark.slow
def test_a_package_from_outside_adds_one_of_each(tmp_path: Path, recording: Path) -> None:
    files = files_of_the_how_to()
    assert len(files) == 5
    assert all(len(text.splitlines()) < 40 for text in files.values())
    install(tmp_path / "site", files)
    words = ["run", recording, *USED, "--duration", 0.2, "--out", tmp_path / "out"]
    done = subprocess.run(
        [sys.executable, "-m", "rtradar", *map(str, words)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([str(tmp_path / "site"), str(ROOT)])},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    said = summary["parameters"]
    named = said["fidelity"], said["radar"]["name"], said["detector"]
    assert named == ("points", "lane-60ghz", "threshold")
    # 21 parts of 0.01 m^2, 3 to 5 m from the radar.
    assert 21 * 0.01 / 5**4 < summary["echo_power_m2"] < 21 * 0.01 / 3**4
    assert summary["detections"] > 20
    assert summary["variant"] is None


@pytest.mark.parametrize(
    ("option", "name", "known"),
    [
        ("--fidelity", "rough", "specular, physical-optics, rays, reference, auto, points"),
        ("--radar", "rough", "radhar, mars, lane-60ghz, or the path"),
        ("--detector", "rough", "os-cfar, ca-cfar, ti-oob, threshold"),
        (None, "walk.rough", ".amc, .bvh, .c3d, .npz, .csv, .trc, .motion, .angles"),
    ],
)
def test_an_unknown_name_is_answered_with_all_that_there_are(
    tmp_path: Path, here: Install, capsys: Capture, option: str | None, name: str, known: str
) -> None:
    here(tmp_path / "site")
    words = ["synthetic:walk", option, name] if option else [str(tmp_path / name)]
    assert main(["run", *words, "--duration", "0.2", "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert known in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("broken", "text", "said"),
    [
        ("model", "import nowhere", "fidelity 'points' of package 'outside' failed: ModuleNotFou"),
        ("model", "Points = 3", "is a int, not a function or class"),
        ("detector", "def threshold(power, *, pfa, looks): return power", "gave float32"),
        ("detector", "def threshold(power): return power > 1", "failed: TypeError"),
        ("reader", "def read(path): return path", "not a Motion"),
    ],
)
def test_a_broken_package_is_one_line(
    tmp_path: Path,
    here: Install,
    capsys: Capture,
    recording: Path,
    broken: str,
    text: str,
    said: str,
) -> None:
    here(tmp_path / "site", {f"outside_{broken}.py": text})
    assert said in fails(capsys, tmp_path / "out", str(recording), *USED)


def fails(capsys: Capture, out: Path, *words: str) -> str:
    """Message of a run that fails, of one line, and that leaves nothing."""
    assert main(["run", *words, "--duration", "0.2", "--out", str(out)]) == 1
    lines = filter(None, capsys.readouterr().err.splitlines())
    (said,) = (line for line in lines if not line.startswith("rtradar: warning"))
    assert not out.exists()
    return said


PLACES: dict[str, tuple[str, str, tuple[str, ...]]] = {
    # The name, the function, and the words that ask for it.
    "model": ("points", "Points(radar, body, *, spreading=True)", USED[:2]),
    "reader": ("angles", "read(path)", ()),
    "radar": ("lane-60ghz", "lane()", USED[2:4]),
    "detector": ("threshold", "threshold(power, *, pfa, looks)", USED[2:]),
}
ENDS = ["SystemExit('gone')", "BaseException('gone')", "Ended('gone')", "Stopped('gone')"]
ENDS += ["Silent()", "GeneratorExit('gone')"]
CLASSES = """
class Ended(BaseException): pass
class Stopped(KeyboardInterrupt): pass
class Silent(BaseException):
    def __str__(self): raise BaseException('not even that')
"""


@pytest.mark.parametrize("called", [False, True], ids=["imported", "called"])
@pytest.mark.parametrize("raised", ENDS)
@pytest.mark.parametrize("place", PLACES)
def test_a_package_may_raise_what_it_likes(
    tmp_path: Path,
    here: Install,
    capsys: Capture,
    recording: Path,
    place: str,
    raised: str,
    called: bool,
) -> None:
    named, head, asked = PLACES[place]
    text = f"def {head}:\n    raise {raised}\n" if called else f"raise {raised}\n"
    here(tmp_path / "site", {f"outside_{place}.py": CLASSES + text})
    motion = str(recording) if place == "reader" else "synthetic:walk"
    said = fails(capsys, tmp_path / "out", motion, "--fidelity", "analytic", *asked)
    assert f"'{named}' of package 'outside' failed: {raised.partition('(')[0]}" in said
    # The others of its kind still work.
    for registry in REGISTRIES:
        assert all(callable(registry[name]) for name in registry.built_in)


def test_ctrl_c_is_still_ctrl_c(tmp_path: Path, here: Install, capsys: Capture) -> None:
    here(tmp_path / "site", {"outside_radar.py": "raise KeyboardInterrupt"})
    words = ["run", "synthetic:walk", "--radar", "lane-60ghz", "--out", str(tmp_path / "out")]
    assert main(words) == 130
    assert "stopped by the user" in capsys.readouterr().err


@pytest.mark.parametrize(
    "text", [b"[rtradar.radars]\nno equals sign\n", b"[rtradar.radars]\n\xe9 = x:y\n"]
)
def test_entry_points_that_cannot_be_read_are_left_out(
    tmp_path: Path, here: Install, monkeypatch: pytest.MonkeyPatch, text: bytes
) -> None:
    here(tmp_path / "site", {})
    about = tmp_path / "broken" / "broken-1.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: broken\nVersion: 1\n")
    (about / "entry_points.txt").write_bytes(text)
    monkeypatch.syspath_prepend(str(tmp_path / "broken"))
    with pytest.warns(UserWarning, match="package broken: its entry points cannot be read"):
        assert rt.Radar.load("lane-60ghz").name == "lane-60ghz"


def test_an_account_that_no_file_can_hold(registered: None) -> None:
    class Accounted(Wrong):
        def account(self) -> dict[str, object]:
            return {"power": object()}

    rt.register_model("wrong", Accounted)
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=0.1))
    model = build_model("wrong", rt.Radar(tx_y=2, tx_z=0, rx_y=2, rx_z=0), body, spoil="nothing")
    with pytest.raises(rt.ExtensionError, match="'wrong' failed: TypeError"):
        model.account()


@pytest.fixture
def registered() -> Iterator[None]:
    """Remove again what a test registers."""
    before = [dict(registry._registered) for registry in REGISTRIES]
    yield
    for registry, known in zip(REGISTRIES, before, strict=True):
        registry._registered = known


@pytest.mark.usefixtures("registered")
def test_the_model_for_rooms_of_the_page_has_a_ghost_over_a_wall(
    tmp_path: Path, here: Install
) -> None:
    page = (ROOT / "docs" / "extending.md").read_text(encoding="utf-8")
    code = re.search(r"^### In rooms$.*?^```python\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert code is not None
    here(tmp_path / "site", {"outside_room.py": code[1]})
    rt.register_model("room-points", importlib.import_module("outside_room").RoomPoints)
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=0.2))
    wall = Wall(
        name="left",
        corner_m=(-10.0, 3.0, -5.0),
        edge_u_m=(20.0, 0.0, 0.0),
        edge_v_m=(0.0, 0.0, 10.0),
        material=material("perfect-conductor"),
        thickness_m=0.1,
    )
    alone, inside = (
        build_model("room-points", rt.Radar(), body, scene=scene).echoes(np.arange(2))
        for scene in (None, rt.Scene(walls=(wall,)))
    )
    parts = len(body.part_names)
    # Direct, and over the wall on the way out or on the way back.
    assert inside.length.shape[2] == 3 * parts
    np.testing.assert_array_equal(inside.length[..., :parts], alone.length)
    np.testing.assert_allclose(
        np.abs(inside.amplitude[0, ..., :parts]), np.abs(alone.amplitude[0]), rtol=1e-6
    )
    assert (inside.length[..., parts : 2 * parts] > alone.length).all()
    assert (np.abs(inside.amplitude[..., parts:]) > 0).all()
    # Without the formula each path has a model of its own, and the echoes are the same.
    rt.register_model("slow-points", importlib.import_module("outside_model").Points)
    slowly = build_model("slow-points", rt.Radar(), body, scene=rt.Scene(walls=(wall,)))
    echoes = slowly.echoes(np.arange(2))
    np.testing.assert_allclose(echoes.length, inside.length, rtol=1e-12)
    # But for the co-polar fraction, which a model before images is taken to hold itself.
    np.testing.assert_allclose(echoes.amplitude, inside.amplitude, rtol=0.02)


@pytest.mark.usefixtures("registered")
def test_a_running_program_adds_its_own() -> None:
    rt.register_radar("mine", lambda: rt.Radar(tx_z=0, rx_z=0))
    assert rt.Radar.load("mine") == rt.Radar(name="mine", tx_z=0, rx_z=0)
    rt.register_detector("all", lambda power, *, pfa, looks: power > 0)
    assert build_detector("all", pfa=0.1, looks=1)(np.ones((2, 3))).all()
    still = rt.synthetic_motion("walk", seed=0, duration_s=0.1)
    rt.register_reader("mine", lambda path: still)
    assert rt.load_motion("here.mine") is still
    with pytest.raises(rt.InputError, match="take no skeleton"):
        rt.load_motion("here.mine", skeleton="there.asf")
    with pytest.raises(rt.InputError, match="there already"):
        rt.register_radar("mine", rt.Radar)
    with pytest.raises(rt.InputError, match="cannot be called"):
        rt.register_radar("yours", 3)


class Wrong:
    """A model that changes the result of `analytic`."""

    def __init__(self, radar: rt.Radar, body: rt.Body, *, spreading: bool, spoil: str) -> None:
        self._model, self._spoil = build_model("analytic", radar, body, spreading=spreading), spoil

    def echoes(self, chirps: np.ndarray) -> object:
        good = self._model.echoes(chirps)
        names = "length", "amplitude", "frequency", "tx", "part", "bounces"
        fields = {name: getattr(good, name) for name in names}
        match self._spoil:
            case "type":
                return fields
            case "rx":
                fields |= {"length": good.length[:, :1], "amplitude": good.amplitude[:, :, :1]}
            case "tx":
                fields["tx"] = good.tx[::-1]
            case "part":
                fields["part"] = good.part + 1
            case "value":
                fields["amplitude"] = good.amplitude * np.nan
        return rt.Echoes(**fields)


@pytest.mark.usefixtures("registered")
@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        ("type", "gave a dict"),
        ("rx", "of shape"),
        ("tx", "other Tx"),
        ("part", "parts outside 0 to 20"),
        ("value", "not finite"),
    ],
)
def test_a_model_must_give_what_the_rest_relies_on(spoil: str, said: str) -> None:
    rt.register_model("wrong", Wrong)
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=0.1))
    radar = rt.Radar(tx_y=2, tx_z=0, rx_y=2, rx_z=0)
    good = build_model("wrong", radar, body, spoil="nothing").echoes(np.arange(4))
    assert good.length.shape == (4, 2, 21)
    with pytest.raises(rt.ExtensionError, match=said):
        build_model("wrong", radar, body, spoil=spoil).echoes(np.arange(4))
    with pytest.raises(rt.InputError, match=r"no option 'depth'; it has: spoil"):
        build_model("wrong", radar, body, depth=3)


def test_two_of_one_name_are_refused_by_that_name(
    tmp_path: Path, here: Install, monkeypatch: pytest.MonkeyPatch
) -> None:
    files = files_of_the_how_to()
    here(tmp_path / "site", {})
    taken = files["pyproject.toml"].replace("points =", "specular =")
    install(tmp_path / "other", {"pyproject.toml": taken.replace('"outside"', '"other"')})
    monkeypatch.syspath_prepend(str(tmp_path / "other"))
    with pytest.raises(rt.ExtensionError, match="'specular' is claimed by rtradar and by 'other'"):
        MODELS.find("specular")
    assert MODELS.find("analytic") is not None
    said = "'threshold' is claimed by 'other' and by 'outside'"
    with pytest.raises(rt.ExtensionError, match=said):
        DETECTORS.find("threshold")


class Imaginary:
    """`analytic` with its amplitudes times j, which says that it is fast and has no formula."""

    fast_over_walls = True
    variant = None

    def __init__(self, radar: rt.Radar, body: rt.Body, *, spreading: bool) -> None:
        self._model = MODELS["analytic"](radar, body, spreading=spreading)

    def echoes(self, chirps: np.ndarray) -> rt.Echoes:
        good = self._model.echoes(chirps)
        return dataclasses.replace(good, amplitude=1j * good.amplitude)


@pytest.mark.usefixtures("registered")
def test_a_model_without_a_formula_keeps_its_phase_behind_a_pattern() -> None:
    rt.register_model("imaginary", Imaginary)
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=0.1))
    beam = rt.Antenna(pattern="cosine", exponent=2.0)
    radar = rt.Radar(tx_y=2, tx_z=0, rx_y=2, rx_z=0, tx_antenna=beam)
    known, own = (
        build_model(level, radar, body).echoes(np.arange(4)) for level in ("analytic", "imaginary")
    )
    assert np.abs(known.amplitude).max() > 0
    np.testing.assert_allclose(own.amplitude, 1j * known.amplitude, rtol=1e-6)
