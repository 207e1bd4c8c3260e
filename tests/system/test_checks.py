"""What counts as a number."""

from fractions import Fraction

import numpy as np
import pytest

from rtradar.system.checks import is_real, is_whole


@pytest.mark.parametrize("number", [3, 0, -(10**30), np.int8(3), np.uint64(3)])
def test_whole_numbers_of_python_and_numpy_are_real_too(number: object) -> None:
    assert is_whole(number)
    assert is_real(number)


@pytest.mark.parametrize(
    "number", [3.0, float("nan"), np.float32(3), np.float64(3), np.longdouble(3)]
)
def test_floats_are_real_and_not_whole(number: object) -> None:
    assert is_real(number)
    assert not is_whole(number)


@pytest.mark.parametrize(
    "thing", [True, np.True_, None, "3", 3j, np.complex64(3), np.array(3), [3], Fraction(1, 2)]
)
def test_nothing_else_is_a_number(thing: object) -> None:
    assert not is_real(thing)
    assert not is_whole(thing)
