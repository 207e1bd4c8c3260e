"""Each compiled kernel against its reference in plain NumPy, on the cases of `references`."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from typing import Any

import numpy as np
import pytest
from numba.extending import is_jitted

import references
import rtradar.kernels
from references.cases import CASES, OfEach, assert_close

VARIANTS = [
    pytest.param(name, options, id=" ".join([name, *(f"{k}={v}" for k, v in options.items())]))
    for name, case in CASES.items()
    for options in case.variants()
]


@pytest.mark.parametrize(("name", "options"), VARIANTS)
def test_a_kernel_is_its_reference(name: str, options: dict[str, Any]) -> None:
    case = CASES[name]
    assert_close(*case.results(**options), case.tolerance)


def test_every_exported_kernel_has_a_case() -> None:
    exported = set()
    for module in pkgutil.walk_packages(rtradar.kernels.__path__, "rtradar.kernels."):
        for name, value in vars(importlib.import_module(module.name)).items():
            own = is_jitted(value) and value.py_func.__module__ == module.name
            if own and not name.startswith("_"):
                exported.add(f"{module.name}.{name}".removeprefix("rtradar.kernels."))
    assert exported <= set(CASES)


def test_every_reference_is_short() -> None:
    for module in pkgutil.iter_modules(references.__path__, "references."):
        for name, value in vars(importlib.import_module(module.name)).items():
            if name.endswith("_reference") and value.__module__ == module.name:
                assert len(inspect.getsource(value).splitlines()) <= 20, name


@pytest.mark.parametrize("wrong", [0, 1])
@pytest.mark.parametrize("number", [1.5, np.nan])
def test_a_difference_in_any_array_is_noticed(wrong: int, number: float) -> None:
    found, expected = (np.ones(3), np.ones(2)), (np.ones(3), np.ones(2))
    assert_close(found, expected, 0)
    found[wrong][1] = number
    with pytest.raises(AssertionError):
        assert_close(found, expected, 0.25)


def test_a_tolerance_is_relative_to_the_largest_number_or_to_each() -> None:
    found, expected = np.array([100.0, 1.1]), np.array([100.0, 1.0])
    assert_close(found, expected, 0.01)
    assert_close(found, expected, OfEach(0.11))
    with pytest.raises(AssertionError):
        assert_close(found, expected, OfEach(0.01))
