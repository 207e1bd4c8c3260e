"""The doctor finds what is there, and advises where something is missing."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from rtradar import doctor
from rtradar.errors import InputError
from rtradar.trace import backend as backends
from rtradar.trace.probe import Library, ProbeResult

LIBRARIES = [
    Library("/lib/libLLVM-15.so.1", "environment"),
    Library("/venv/libLLVM.so.23.1", "wheel"),
]


def _machine(
    monkeypatch: pytest.MonkeyPatch, libraries: list[Library], *, scalar: str = "good"
) -> None:
    def probe_backend(variant: str, library: Library | None, *, fresh: bool = False) -> ProbeResult:
        if variant.startswith("llvm"):
            assert library is not None
            return (
                ProbeResult("good", "23.1.4")
                if "23" in library.path
                else ProbeResult("aborts the process", "15.0.6")
            )
        return ProbeResult(scalar if variant.startswith("scalar") else "no CUDA driver or no GPU")

    for module in (doctor, backends):
        monkeypatch.setattr(module, "candidates", lambda: libraries)
        monkeypatch.setattr(module, "probe_backend", probe_backend)
    monkeypatch.setattr(backends, "loaded_llvm_version", lambda: None)


def test_all_well(monkeypatch: pytest.MonkeyPatch) -> None:
    _machine(monkeypatch, LIBRARIES)
    found = doctor.examine()
    assert found["chosen"] == "llvm_ad_rgb"
    assert [(row["version"], row["finding"], row["chosen"]) for row in found["llvm"]] == [
        ("15.0.6", "aborts the process", False),
        ("23.1.4", "good", True),
    ]
    assert found["backends"] == {
        "llvm": "good",
        "scalar": "good",
        "cuda": "no CUDA driver or no GPU",
    }
    text = doctor.report_text(found)
    assert "ready, on llvm_ad_rgb" in text
    assert "aborts the process" in text


@pytest.mark.parametrize("libraries", [[], LIBRARIES[:1]])
def test_scalar_serves_and_the_cure_is_named(
    monkeypatch: pytest.MonkeyPatch, libraries: list[Library]
) -> None:
    _machine(monkeypatch, libraries)
    found = doctor.examine()
    assert found["chosen"] == "scalar_rgb"
    assert any("install one: " in line for line in found["advice"])
    assert "To do" in doctor.report_text(found)


def test_nothing_works(monkeypatch: pytest.MonkeyPatch) -> None:
    _machine(monkeypatch, [], scalar="fails: broken")
    found = doctor.examine()
    assert found["chosen"] is None
    assert "no backend works" in doctor.report_text(found)
    assert doctor.report() == 1


@pytest.mark.parametrize(
    ("finding", "advice"),
    [("kept, in /cache", ""), ("not kept: no room", "name a folder in NUMBA_CACHE_DIR")],
)
def test_whether_compiled_code_is_kept(
    monkeypatch: pytest.MonkeyPatch, finding: str, advice: str
) -> None:
    _machine(monkeypatch, LIBRARIES)
    monkeypatch.setattr(doctor, "try_cache", lambda: (finding, advice))
    found = doctor.examine()
    advised = [advice] if advice else []
    assert (found["compiled_code"], found["advice"]) == (finding, advised)
    text = doctor.report_text(found)
    assert f"Compiled  {finding}" in text
    assert advice in text


def test_a_missing_package_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    _machine(monkeypatch, LIBRARIES)
    monkeypatch.setattr(doctor, "PACKAGES", ("numpy", "no-such-package"))
    found = doctor.examine()
    assert found["packages"]["no-such-package"] is None
    assert found["packages"]["numpy"]
    assert any("pip install no-such-package" in line for line in found["advice"])


def test_the_report_goes_to_the_terminal_and_to_json(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    _machine(monkeypatch, LIBRARIES)
    assert doctor.report(tmp_path / "doctor.json") == 0
    assert "Cores" in capsys.readouterr().out
    assert json.loads((tmp_path / "doctor.json").read_text()) == doctor.examine() | _memory(
        tmp_path / "doctor.json"
    )
    with pytest.raises(InputError, match="cannot write"):
        doctor.report(tmp_path / "no" / "doctor.json")


def _memory(file: Path) -> dict[str, float]:
    """The one value that may change between two reports."""
    return {"memory_available_mb": json.loads(file.read_text())["memory_available_mb"]}


def test_this_machine() -> None:
    """Whatever the machine has, a working backend is found, and the figures make sense."""
    found = doctor.examine()
    assert found["chosen"]
    assert found["cores"] >= 1
    if found["memory_total_mb"] is not None and found["memory_available_mb"] is not None:
        assert 0 < found["memory_available_mb"] <= found["memory_total_mb"]
