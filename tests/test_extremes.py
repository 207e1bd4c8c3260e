"""Extremes of ``validation/robustness/extremes.py``: right finite answers, refusals or warnings."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

FOLDER = Path(__file__).resolve().parents[1] / "validation" / "robustness"


def load(name: str) -> ModuleType:
    """A script of the validation folder, which finds its neighbours as if it ran there."""
    sys.path.insert(0, str(FOLDER))
    try:
        spec = importlib.util.spec_from_file_location(f"validation_{name}", FOLDER / f"{name}.py")
        assert spec is not None
        assert spec.loader is not None
        module = importlib.util.module_from_spec(spec)
        sys.modules[spec.name] = module  # dataclasses look their module up
        spec.loader.exec_module(module)
    finally:
        sys.path.remove(str(FOLDER))
    return module


extremes = load("extremes")


FAR = "radar and person 10 km from the origin of coordinates"
CASES = [
    pytest.param(case, id=case.name, marks=[pytest.mark.slow] * (case.slow or case.name == FAR))
    for case in extremes.CASES
]  # the slow ones have a million triangles, or every level twice


@pytest.mark.parametrize("case", CASES)
def test_extreme(case: Any) -> None:
    assert case.run()


def test_a_case_that_is_wrong_or_breaks_is_told() -> None:
    def wrong() -> str:
        assert 1 > 2, "one is not more than two"
        return ""

    def broken() -> str:
        raise ZeroDivisionError("by nought")

    said = "WRONG: one is not more than two\nassert 1 > 2"
    assert extremes.outcome(extremes.Case("a", "b", wrong)) == (False, said)
    said = "ZeroDivisionError: by nought"
    assert extremes.outcome(extremes.Case("a", "b", broken)) == (False, said)
