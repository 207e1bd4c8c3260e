"""Each compiled kernel against its plain reference, on the cases of `rtradar bench --only
kernels`."""

from __future__ import annotations

import importlib
import inspect
import pkgutil

import numpy as np
import pytest
from numba.extending import is_jitted

import rtradar.kernels
from rtradar.bench.kernels import CASES, difference


@pytest.mark.parametrize("name", CASES)
def test_a_kernel_is_its_reference(name: str) -> None:
    kernel, reference = CASES[name].make()
    assert difference(kernel(), reference()) <= CASES[name].tolerance


def test_every_exported_kernel_has_a_case_and_a_short_reference() -> None:
    exported = set()
    for module in pkgutil.walk_packages(rtradar.kernels.__path__, "rtradar.kernels."):
        for name, value in vars(importlib.import_module(module.name)).items():
            own = is_jitted(value) and value.py_func.__module__ == module.name
            if own and not name.startswith("_"):
                exported.add(f"{module.name}.{name}".removeprefix("rtradar.kernels."))
            if name.endswith("_reference") and value.__module__ == module.name:
                assert len(inspect.getsource(value).splitlines()) <= 20, name
    assert exported <= set(CASES)


@pytest.mark.parametrize("wrong", [0, 1])
def test_a_difference_that_is_no_number_is_not_lost(wrong: int) -> None:
    found, expected = (np.ones(3), np.ones(2)), (np.ones(3), np.ones(2))
    assert difference(found, expected) == 0
    found[wrong][1] = np.nan
    assert np.isnan(difference(found, expected))
