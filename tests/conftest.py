"""Fixtures that tests share: repeatable hypothesis, each ray-tracing backend, the recordings."""

from __future__ import annotations

import gc
import importlib.util
import io
import math
import os
import sys
from collections.abc import Callable, Iterator
from functools import cache, wraps
from pathlib import Path
from types import ModuleType
from typing import Any

import hypothesis
import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

import rtradar as rt
from rtradar.system import figure_style, threads
from rtradar.trace.backend import Backend, available, select, use
from rtradar.validate import validation_folder

# The same examples every time, and no limit of time, because kernels are compiled when first used.
hypothesis.settings.register_profile("rtradar", deadline=None, derandomize=True, database=None)
# New examples in every run, former failures first, and more of them: `make test-fresh`.
hypothesis.settings.register_profile("fresh", deadline=None, derandomize=False, print_blob=True)
hypothesis.settings.load_profile(os.environ.get("RTRADAR_HYPOTHESIS", "rtradar"))
_MORE = float(os.environ.get("RTRADAR_EXAMPLES", "1"))


pytest_plugins = ["pytester", "rtradar.testing"]

SMALL = """
tx_y = 2
tx_z = 0
rx_y = 4
rx_z = 0
chirp_duration_s = 250e-6
samples_per_chirp = 128
frame_duration_s = 0.05
"""

SLOW_LEVELS = {"auto", "rays", "reference"}
"""Levels by which ``make test`` makes whole runs alone, and ``make test-all`` all else, too."""


def _place(item: pytest.Item) -> bool:
    return item.path.name != "test_whole_runs.py"


@pytest.hookimpl(tryfirst=True)  # before `-m` chooses by the marks
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Order the tests, mark the slow ones, and give property tests the examples asked for.

    Whole runs come first, for they compile what most others need.

    The fixtures' names say what a test is about: ``fidelity`` a level, ``backend`` a backend of
    Mitsuba. Of the backends `tests/trace` tries each. Every property test gets
    ``RTRADAR_EXAMPLES`` times as many examples as it asks for.
    """
    items.sort(key=_place)
    for item in items:
        given = item.callspec.params if hasattr(item, "callspec") else {}
        slow_backend = given.get("backend") == "scalar" and "trace" not in item.path.parts
        if given.get("fidelity") in SLOW_LEVELS or slow_backend:
            item.add_marker(pytest.mark.slow)
    if _MORE == 1:
        return
    tests = {id(item.obj): item.obj for item in items if isinstance(item, pytest.Function)}
    for test in tests.values():
        # There is no public way to the settings of a test.
        own = getattr(test, "_hypothesis_internal_use_settings", None)
        if own is not None:
            examples = math.ceil(_MORE * own.max_examples)
            more = hypothesis.settings(own, max_examples=examples)
            test._hypothesis_internal_use_settings = more


def pytest_collection_finish() -> None:
    """Keep what was imported out of every later search for garbage, which took 0.3 to 0.7 s."""
    gc.collect()
    gc.freeze()


class _Pictures:
    """Drawing of pictures, which takes nine tenths of the time of a small run.

    Only tests with the mark ``drawn`` have their pictures drawn. In all others a figure is made up
    to its last label, and a blank picture is saved in its place.
    """

    drawn = False
    save = Figure.savefig
    write_png = figure_style.write_png

    @staticmethod
    @cache
    def blank() -> bytes:
        """A PNG file of a few grey pixels."""
        file = io.BytesIO()
        matplotlib.image.imsave(file, np.full((3, 4, 3), 0.5), format="png")
        return file.getvalue()

    @staticmethod
    @wraps(Figure.savefig)  # pyplot, imported later, reads its name
    def save_or_blank(figure: Figure, file: Any, **options: Any) -> None:
        """Do what `Figure.savefig` does, or save a blank picture in place of a PNG or a PDF."""
        kind = options.get("format") or Path(file).suffix[1:]
        if _Pictures.drawn or kind not in ("png", "pdf"):
            _Pictures.save(figure, file, **options)
        elif kind == "pdf":
            Path(file).write_bytes(b"%PDF-blank")
        else:
            _Pictures.write_blank(file)

    @staticmethod
    def write_or_blank(figure: Figure, file: Any) -> None:
        """Do what `figure_style.write_png` does, or save a blank picture."""
        if _Pictures.drawn:
            _Pictures.write_png(figure, file)
        else:
            _Pictures.write_blank(file)

    @staticmethod
    def write_blank(file: Any) -> None:
        """Write a blank picture to a path, or to an open file."""
        if hasattr(file, "write"):
            file.write(_Pictures.blank())
        else:
            Path(file).write_bytes(_Pictures.blank())


Figure.savefig = _Pictures.save_or_blank
figure_style.write_png = _Pictures.write_or_blank


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Draw pictures in the fixtures and the test of an item with the mark ``drawn``."""
    _Pictures.drawn = item.get_closest_marker("drawn") is not None


@cache
def _available() -> tuple[str, ...]:
    return available()


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Run a test that takes ``backend`` once on each backend that works here."""
    if "backend" in metafunc.fixturenames:
        metafunc.parametrize("backend", _available(), indirect=True)


@pytest.fixture
def backend(request: pytest.FixtureRequest) -> Iterator[Backend]:
    """A backend in use, of which `use` gives Mitsuba; its memory is released afterwards."""
    chosen = select(request.param)
    use(chosen)
    yield chosen
    import drjit as dr  # not before the libLLVM is chosen

    gc.collect()
    gc.freeze()  # what is left stays, and is not searched again
    dr.sync_thread()
    dr.flush_malloc_cache()


@pytest.fixture
def four_threads(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Four threads in `rtradar.system.threads`, whatever the number of cores."""
    monkeypatch.setenv(threads.THREADS_VARIABLE, "4")
    threads._pool.cache_clear()
    yield
    threads._pool.cache_clear()


@pytest.fixture(scope="session")
def small_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The file of a radar of few samples, with a line of antennas along y."""
    path = tmp_path_factory.mktemp("radar") / "small.toml"
    path.write_text(SMALL)
    return path


@pytest.fixture(scope="session")
def small(small_file: Path) -> rt.Radar:
    """The radar of `small_file`."""
    return rt.Radar.load(small_file)


@pytest.fixture(scope="session")
def small_run(small: rt.Radar, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a small run, with its IF samples, for all who only read one."""
    out = tmp_path_factory.mktemp("run") / "out"
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.3)
    rt.run(motion, small, out=out, fidelity="analytic", save_if=True)
    return out


@pytest.fixture(scope="session")
def beside_a_wall(small: rt.Radar, rtradar_scene: rt.Scene) -> tuple[rt.Radar, rt.Scene]:
    """The small radar, and a scene with one metal wall on its left: few echoes on each path."""
    return small, rtradar_scene


@pytest.fixture(scope="session")
def script() -> Callable[[str], ModuleType]:
    """Load a script of the validation folder by its path there, such as ``cost/threads.py``."""

    def load(place: str) -> ModuleType:
        path = validation_folder() / place
        spec = importlib.util.spec_from_file_location(f"validation_{path.stem}", path)
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module  # dataclasses look their module up
        spec.loader.exec_module(module)
        return module

    return load


@pytest.fixture(scope="session")
def mocap() -> Path:
    """Folder of real recordings."""
    named = os.environ.get("RTRADAR_MOCAP")
    if not named:
        pytest.skip("RTRADAR_MOCAP is not set: it names the folder of real recordings")
    folder = Path(named)
    assert folder.is_dir(), f"RTRADAR_MOCAP names no folder: {folder}"
    return folder
