"""Quadrature over one triangle, and over two that touch."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.surface_currents import Rules

Array = NDArray[np.float64]


def triangle_rule() -> tuple[Array, Array]:
    """Six points, exact to the fourth degree (D. A. Dunavant, Int. J. Numer. Methods Eng., 1985).

    Returned are barycentric coordinates (point, corner) and weights (point,), whose sum is 1.
    """
    orbits = (
        (0.445948490915965, 0.223381589678011),
        (0.091576213509771, 0.109951743655322),
    )
    places = [np.roll([1 - 2 * side, side, side], turn) for side, _ in orbits for turn in range(3)]
    weights = np.repeat([weight for _, weight in orbits], 3)
    return np.array(places), weights / weights.sum()


@cache
def rules(order: int) -> Rules:
    """Return the rules of matrix elements; pairs that touch take ``order`` points an axis.

    The coordinates are those of S. A. Sauter and C. Schwab, *Boundary Element Methods*, section
    5.2: of the four-dimensional domain each part is a cube whose Jacobian cancels the singularity.
    """
    places, weights = triangle_rule()
    x, w = np.polynomial.legendre.leggauss(order)
    x, w = (x + 1) / 2, w / 2
    cube = [axis.ravel() for axis in np.meshgrid(x, x, x, x, indexing="ij")]
    weight = np.prod(np.meshgrid(w, w, w, w, indexing="ij"), axis=0).ravel()
    touching = [
        np.concatenate(
            [_pairs(first, second, 4 * weight * jacobian) for first, second, jacobian in parts]
        )
        for parts in (_one_corner(*cube), _one_edge(*cube), _all_corners(*cube))
    ]
    one, other = (index.ravel() for index in np.indices((len(weights), len(weights))))
    product = np.column_stack([places[one], places[other], weights[one] * weights[other]])
    return Rules(places, weights, (product, *touching))


_Place = tuple[Array, Array]
_Part = tuple[_Place, _Place, Array]


def _pairs(first: _Place, second: _Place, weight: Array) -> Array:
    """Pairs of points (pair, 7): barycentric coordinates on both triangles, and the weight."""
    (a, b), (c, d) = first, second
    return np.stack([1 - a, a - b, b, 1 - c, c - d, d, weight], axis=1)


def _one_corner(s: Array, a: Array, b: Array, c: Array) -> list[_Part]:
    """Parts of the domain where the first corners are one."""
    near, far = (s, s * a), (s * b, s * b * c)
    jacobian = s**3 * b
    return [(near, far, jacobian), (far, near, jacobian)]


def _one_edge(s: Array, a: Array, b: Array, c: Array) -> list[_Part]:
    """Parts of the domain where the first two corners are common."""
    jacobian = s**3 * a**2
    return [
        ((s, s * a * c), (s * (1 - a * b), s * a * (1 - b)), jacobian),
        ((s, s * a), (s * (1 - a * b * c), s * a * b * (1 - c)), jacobian * b),
        ((s * (1 - a * b), s * a * (1 - b)), (s, s * a * b * c), jacobian * b),
        ((s * (1 - a * b * c), s * a * b * (1 - c)), (s, s * a), jacobian * b),
        ((s * (1 - a * b * c), s * a * (1 - b * c)), (s, s * a * b), jacobian * b),
    ]


def _all_corners(s: Array, a: Array, b: Array, c: Array) -> list[_Part]:
    """Parts of the domain where both triangles are one."""
    jacobian = s**3 * a**2 * b
    pairs = [
        ((s, s * (1 - a + a * b)), (s * (1 - a * b * c), s * (1 - a))),
        ((s, s * a * (1 - b + b * c)), (s * (1 - a * b), s * a * (1 - b))),
        ((s * (1 - a * b * c), s * a * (1 - b * c)), (s, s * a * (1 - b))),
    ]
    return [
        part for one, other in pairs for part in ((one, other, jacobian), (other, one, jacobian))
    ]
