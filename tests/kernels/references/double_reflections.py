"""Reflections over two ellipsoids, by SciPy's minimiser and finite differences."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize

from references.cases import Pair, filled, kernel_case
from references.specular_point import geometry
from rtradar.kernels.scatter.double_reflections import solve_double
from rtradar.kernels.scatter.specular_point import Options


def _across(units):
    """Two directions (2, 2, 3) across each of two unit vectors."""
    return np.array([np.linalg.svd(unit[None])[2][1:] for unit in units])


def _steps_from(units, across, steps):
    """Unit vectors (2, 3), moved by steps (4,) across them."""
    moved = units + (np.reshape(steps, (2, 1, 2)) @ across)[:, 0]
    return moved / np.linalg.norm(moved, axis=1, keepdims=True)


def _three_ways(units, bodies, ends):
    """Vectors along the three legs over two ellipsoids (centre, frame, semi-axes)."""
    p, q = (c + f @ (a * u) for u, (c, f, a) in zip(units, bodies, strict=True))
    return p - ends[0], q - p, q - ends[1]


def _path_after(steps, units, across, bodies, ends):
    moved = _steps_from(units, across, steps)
    return sum(np.linalg.norm(way) for way in _three_ways(moved, bodies, ends))


def _second_derivatives(units, bodies, ends):
    e, across = 1e-3, _across(units)
    found = np.zeros((4, 4))
    for i, j in np.ndindex(4, 4):
        for s, t in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            steps = np.zeros(4)
            steps[i] += s * e
            steps[j] += t * e
            found[i, j] += s * t * _path_after(steps, units, across, bodies, ends) / (4 * e * e)
    return found


def _least_path(bodies, ends):
    """Unit vectors (2, 3) over which the path is least."""
    units = np.empty((2, 3))
    seen = (ends[0], bodies[1][0]), (bodies[0][0], ends[1])
    for unit, (centre, frame, axes), places in zip(units, bodies, seen, strict=True):
        ways = [place - centre for place in places]
        unit[:] = axes * (frame.T @ sum(way / np.linalg.norm(way) for way in ways))
    units /= np.linalg.norm(units, axis=1, keepdims=True)
    for _ in range(3):
        given = units, _across(units), bodies, ends
        best = minimize(_path_after, np.zeros(4), given, options={"gtol": 1e-9})
        units = _steps_from(*given[:2], best.x)
    return units


def _reflected_twice(units, bodies, ends, horizontal, up):
    """Length and amplitude of the path over two points."""
    ways = _three_ways(units, bodies, ends)
    ranges = [np.linalg.norm(way) for way in ways]
    s1, s2, s3 = (way / size for way, size in zip(ways, ranges, strict=True))
    area, normals = 1.0, []
    for unit, (_, frame, axes) in zip(units, bodies, strict=True):
        area *= np.prod(axes) * np.linalg.norm(unit / axes)
        normals.append(frame @ (unit / axes) / np.linalg.norm(unit / axes))
    cosines = -s1 @ normals[0], -s3 @ normals[1]
    if min(*cosines, s2 @ normals[0], -s2 @ normals[1]) <= 0:
        return sum(ranges), 0.0
    fields = [np.cross(s, up) if horizontal else up - s * (s @ up) for s in (s1, s3)]
    sent, received = (field / np.linalg.norm(field) for field in fields)
    for normal in normals:
        sent = 2 * (normal @ sent) * normal - sent
    spread = np.sqrt(np.linalg.det(_second_derivatives(units, bodies, ends)))
    value = -2 * np.sqrt(np.pi) * np.prod(cosines) * area / spread * (sent @ received)
    return sum(ranges), value / np.prod(ranges)


def solve_double_reference(at, pairs, horizontal, up=(0.0, 0.0, 1.0)):
    """Length and amplitude as by `solve_double` with spreading, each path from cold."""
    shape = (*at.rx.shape[:2], len(pairs))
    length, amplitude = np.empty(shape), np.empty(shape)
    for place in np.ndindex(*shape):
        chirp, receiver, pair = place
        ends = at.tx[chirp], at.rx[chirp, receiver]
        posed = at.centres[chirp], at.frames[chirp], at.semi_axes
        bodies = [tuple(array[part] for array in posed) for part in pairs[pair]]
        units = _least_path(bodies, ends)
        length[place], amplitude[place] = _reflected_twice(
            units, bodies, ends, horizontal, np.array(up)
        )
    return length, amplitude


@kernel_case(solve_double, 2e-3)
def _solve_double() -> Pair:
    # In a row across the line of sight, so that all pairs reflect.
    at = geometry(1, 2, 3)._replace(
        centres=np.array([[[4.0, 0.7 * n, 1.0 - 0.1 * n] for n in range(3)]])
    )
    pairs, shape = np.array([[0, 1], [2, 1], [0, 2]]), (1, 2, 3)
    start, options = np.full((1, 3, 2, 3), np.nan), Options(False, spreading=True)
    up = np.array([[0.6, 0.0, 0.8]])
    given = at, up, pairs, start, options
    out = np.empty(shape), np.empty(shape), np.empty((*shape, 2, 3))
    *found, _ = filled(solve_double, 0, 1, *given, out=out)
    return tuple(found), solve_double_reference(at, pairs, horizontal=False, up=up[0])
