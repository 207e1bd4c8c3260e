"""The warning where optics ends."""

from __future__ import annotations

import numpy as np
import pytest

import rtradar as rt
from rtradar.errors import ValidityWarning
from rtradar.scatter.validity import warn_of_small_radii

WAVENUMBER = np.array([100.0])


def two(radius: float) -> rt.Ellipsoids:
    return rt.Ellipsoids([[0, 0, 0], [0, 1, 0]], [np.eye(3)] * 2, [[1.0, 1.0, 1.0], [radius] * 3])


def test_a_small_sphere_that_counts_is_told() -> None:
    antenna = np.array([[4.0, 0.0, 0.0]])
    with pytest.warns(ValidityWarning, match=r"50% .* below 5, down to 4\.9"):
        warn_of_small_radii(two(0.049), antenna, antenna, WAVENUMBER, np.array([[1.0, -1.0]]))


def test_what_is_large_or_does_not_count_is_not() -> None:
    antenna = np.array([[4.0, 0.0, 0.0]])
    warn_of_small_radii(two(0.051), antenna, antenna, WAVENUMBER, np.array([[1.0, 1.0]]))
    warn_of_small_radii(
        two(0.049), antenna, antenna, WAVENUMBER, np.array([[1.0, 0.2]])
    )  # 4 % of the power
    warn_of_small_radii(two(0.049), antenna, antenna, WAVENUMBER, np.array([[0.0, 0.0]]))


def test_opposite_antennas_have_no_normal() -> None:
    needle = rt.Ellipsoids([[0, 0, 0]], [np.eye(3)], [[0.01, 0.01, 1.0]])
    sight = np.array([[4.0, 0.0, 0.0]])
    warn_of_small_radii(needle, sight, -sight, WAVENUMBER, np.zeros((1, 1)))


def test_the_tip_of_a_needle_counts_by_its_own_radius() -> None:
    needle = rt.Ellipsoids(
        [[0, 0, 0]], [np.eye(3)], [[0.1, 0.1, 1.0]]
    )  # radii 0.01 at the tip, 0.1 and 10 on the side
    tip, side = np.array([[0.0, 0.0, 4.0]]), np.array([[4.0, 0.0, 0.0]])
    with pytest.warns(ValidityWarning, match="down to 1,"):
        warn_of_small_radii(needle, tip, tip, WAVENUMBER, np.ones((1, 1)))
    warn_of_small_radii(needle, side, side, WAVENUMBER, np.ones((1, 1)))
