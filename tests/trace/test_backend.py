"""Which backend is chosen, and that no libLLVM gets near a kernel before it was tried elsewhere."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from rtradar.errors import BackendError, InputError
from rtradar.trace import backend as backends
from rtradar.trace import probe
from rtradar.trace.backend import Backend, BackendWarning, select, use
from rtradar.trace.probe import ENVIRONMENT_VARIABLE, Library, ProbeResult

BAD = Library("/lib/libLLVM-15.so.1", "environment")
WHEEL = Library("/venv/lib/libLLVM.so.23.1", "wheel")
OLD = Library("/lib/libLLVM-14.so.1", "system")
FINDINGS = {
    BAD.path: ProbeResult("aborts the process", "15.0.6"),
    WHEEL.path: ProbeResult("good", "23.1.4"),
    OLD.path: ProbeResult("refused by Dr.Jit: too old", "14"),
}

Machine = Callable[..., None]


@pytest.fixture
def machine(monkeypatch: pytest.MonkeyPatch) -> Machine:
    """Let the machine have these libraries, and a GPU or none, without probing or Dr.Jit."""

    def set_up(*libraries: Library, gpu: bool = False, loaded: str | None = None) -> None:
        def probe_backend(
            variant: str, library: Library | None, *, fresh: bool = False
        ) -> ProbeResult:
            if variant == "cuda_ad_rgb":
                return ProbeResult("good" if gpu else "no CUDA driver or no GPU")
            assert library is not None
            return FINDINGS[library.path]

        monkeypatch.setattr(backends, "candidates", lambda: list(libraries))
        monkeypatch.setattr(backends, "probe_backend", probe_backend)
        monkeypatch.setattr(backends, "loaded_llvm_version", lambda: loaded)

    return set_up


@pytest.mark.parametrize("variant", ["auto", "cpu", "llvm"])
def test_bad_libraries_are_passed_over_to_the_next_good_one(machine: Machine, variant: str) -> None:
    for gpu in (False, True):  # a GPU is taken only by name
        machine(BAD, OLD, WHEEL, gpu=gpu)
        assert select(variant) == Backend("llvm", "llvm_ad_rgb", WHEEL.path, "23.1.4")


@pytest.mark.parametrize("libraries", [(), (OLD,)])
def test_without_a_good_library_auto_takes_scalar_and_says_how_to_mend_it(
    machine: Machine, libraries: tuple[Library]
) -> None:
    machine(*libraries)
    with pytest.warns(BackendWarning, match=r"install one: .*scalar_rgb") as caught:
        backend = select("auto")
    assert (backend.kind, backend.variant, backend.llvm_path) == ("scalar", "scalar_rgb", None)
    assert backend.warning == str(caught[0].message)


def test_without_a_good_library_llvm_by_name_is_refused_with_the_cure(machine: Machine) -> None:
    machine(OLD)
    with pytest.raises(BackendError, match=r"libLLVM-14.*too old.*install one: ") as caught:
        select("llvm")
    assert "\n" not in str(caught.value)


def test_a_good_library_does_not_help_when_drjit_has_taken_another_one(machine: Machine) -> None:
    machine(WHEEL, loaded="15.0.6")
    with pytest.raises(BackendError, match=r"imported with libLLVM 15\.0\.6 before"):
        select("llvm")
    machine(WHEEL, loaded="23.1.4")
    assert select("llvm").llvm_version == "23.1.4"


def test_cuda_only_where_its_probe_succeeds(machine: Machine) -> None:
    machine(WHEEL)
    with pytest.raises(BackendError, match="no CUDA driver"):
        select("cuda")
    machine(WHEEL, gpu=True)
    assert select("cuda") == Backend("cuda", "cuda_ad_rgb", WHEEL.path, "23.1.4")


def test_available_lists_what_works(machine: Machine) -> None:
    machine(OLD)
    assert backends.available() == ("scalar",)
    machine(WHEEL, gpu=True)
    assert backends.available() == ("llvm", "scalar", "cuda")


def test_unknown_variant() -> None:
    with pytest.raises(
        InputError, match="'metal' is unknown; allowed: auto, cpu, llvm, scalar, cuda"
    ):
        select("metal")


def test_use_sets_the_variant_however_often(backend: Backend) -> None:
    for _ in range(2):
        mi = use(backend)
        assert mi.variant() == backend.variant
        sphere = mi.load_dict({"type": "scene", "sphere": {"type": "sphere"}})
        hit = sphere.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(0, 0, 4), mi.Vector3f(0, 0, -1)))
        assert hit.t == 3.0  # exact in float32


def test_use_refuses_llvm_when_another_library_was_loaded_since(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(backends, "loaded_llvm_version", lambda: "15.0.6")
    with pytest.raises(BackendError, match="before"):
        use(Backend("llvm", "llvm_ad_rgb", WHEEL.path, "23.1.4"))


# -- where libraries are looked for ----------------------------------------------------------------


def test_environment_then_wheel_then_system_newest_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    names = "-9.so.1", "-19.so.1", ".so.18.1", ".so.23.1", "SPIRVLib.so.14", "-15.so.1"
    files = {f"libLLVM{name}": tmp_path / f"libLLVM{name}" for name in names}
    for file in files.values():
        file.touch()
    (tmp_path / "libLLVM-19.0.so").symlink_to(files["libLLVM-19.so.1"])
    monkeypatch.setattr(probe, "_SYSTEM_PATTERNS", {sys.platform: (f"{tmp_path}/libLLVM*",)})
    monkeypatch.setattr(probe, "_of_wheel", lambda: [files["libLLVM.so.23.1"]])
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "none"))
    monkeypatch.setattr(sys, "base_prefix", str(tmp_path / "none"))
    monkeypatch.setenv(ENVIRONMENT_VARIABLE, str(files["libLLVM-15.so.1"]))
    found = [(Path(library.path).name, library.origin) for library in probe.candidates()]
    assert found == [
        ("libLLVM-15.so.1", "environment"),
        ("libLLVM.so.23.1", "wheel"),
        ("libLLVM-19.so.1", "system"),
        ("libLLVM.so.18.1", "system"),
        ("libLLVM-9.so.1", "system"),
    ]


# -- probing ---------------------------------------------------------------------------------------


@pytest.fixture
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RTRADAR_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def _counted(monkeypatch: pytest.MonkeyPatch, finding: str, ended: int = 0) -> list[str]:
    probes: list[str] = []

    def answer(variant: str, library: Library | None) -> tuple[ProbeResult, int | None]:
        probes.append(variant)
        return ProbeResult(finding), ended

    monkeypatch.setattr(probe, "_probe", answer)
    return probes


def test_a_result_is_kept_until_the_library_or_the_question_changes(
    empty_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    probes = _counted(monkeypatch, "aborts the process")
    file, script = tmp_path / "libLLVM-15.so.1", tmp_path / "probe.py"
    file.touch()

    def asked(*, fresh: bool = False) -> int:
        found = probe.probe_backend("llvm_ad_rgb", Library(str(file), "system"), fresh=fresh)
        assert found == ProbeResult("aborts the process")
        return len(probes)

    assert (asked(), asked(), asked(fresh=True), asked()) == (1, 1, 2, 2)
    os.utime(file, (1, 1))
    assert (asked(), asked()) == (3, 3)
    script.write_text("another question")
    monkeypatch.setattr(probe, "_PROBE", script)
    assert (asked(), asked()) == (4, 4)
    assert len(list(empty_cache.iterdir())) == 3


# Who told it to end says nothing of the library, and GPUs come and go.
@pytest.mark.parametrize(
    ("variant", "ended", "probed"),
    [
        ("scalar_rgb", -signal.SIGABRT, 1),
        ("scalar_rgb", -signal.SIGKILL, 2),
        ("scalar_rgb", -signal.SIGTERM, 2),
        ("cuda_ad_rgb", 0, 2),
    ],
)
def test_not_every_result_is_kept(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch, variant: str, ended: int, probed: int
) -> None:
    probes = _counted(monkeypatch, "aborts the process", ended)
    for _ in range(2):
        probe.probe_backend(variant, None)
    assert len(probes) == probed


@pytest.mark.parametrize("content", ["{", "[1]", "{}"])
def test_a_spoilt_cache_is_written_anew(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch, content: str
) -> None:
    probes = _counted(monkeypatch, "good")
    assert probe.probe_backend("scalar_rgb", None).good
    (kept,) = empty_cache.iterdir()
    kept.write_text(content, encoding="utf-8")
    for _ in range(2):
        assert probe.probe_backend("scalar_rgb", None).good
    assert len(probes) == 2


def test_a_cache_that_cannot_be_written_does_no_harm(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    _counted(monkeypatch, "good")
    (tmp_path / "file").touch()
    monkeypatch.setenv("RTRADAR_CACHE", str(tmp_path / "file" / "cache"))
    assert probe.probe_backend("scalar_rgb", None).good


def test_a_probe_that_takes_too_long_is_no_good_and_is_not_kept(
    empty_cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(probe, "TIMEOUT_S", 0.01)
    assert probe.probe_backend("scalar_rgb", None).finding.startswith("hangs")
    assert not empty_cache.exists()


def test_a_real_probe_of_a_file_that_is_no_library(empty_cache: Path, tmp_path: Path) -> None:
    file = tmp_path / "libLLVM-23.so.1"
    file.write_text("not a library")
    assert probe.probe_backend("llvm_ad_rgb", Library(str(file), "environment")) == ProbeResult(
        "cannot be loaded", "23"
    )
    assert probe.probe_backend("scalar_rgb", Library(str(file), "environment")).good


@pytest.mark.slow
def test_a_real_probe_of_every_library_here(empty_cache: Path) -> None:
    """LLVM 14 to 16 are never good; from 19 on all are. Nothing of it reaches this process."""
    libraries = [library for library in probe.candidates() if library.version]
    if not libraries:
        pytest.skip("this machine has no libLLVM of a known version")
    for library in libraries:
        found = probe.probe_backend("llvm_ad_rgb", library)
        major = int((found.version or library.version or "0").split(".")[0])
        assert found.good or major < 19, (library, found)
        assert not (found.good and major < 17), (library, found)
