"""Scalar physical optics of one conducting ellipsoid by a convergent quadrature, as a reference.

    F = jk/sqrt(pi) * Int (n.s_T + n.s_R)/2 exp(-jk (R_T + R_R - L_T - L_R)) L_T L_R/(R_T R_R) dS

over what both antennas light, with exact spherical path lengths. On p = A u, with u on the unit
sphere, n dS = det(A) A^-1 u dOmega, and the part that an antenna at T lights is exactly a cap,
u.T' > 1 with T' = A^-1 T. In polar coordinates about the middle of both caps the border is
therefore known in closed form, and so are its two corners, where it changes from one cap to the
other: Gauss-Legendre rules between them converge exponentially. No specular points, meshes or rays
are used.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
SPEED_OF_LIGHT = 299_792_458.0


@dataclass(frozen=True)
class Quadrature:
    """Points of one ellipsoid that two antennas light, and their contributions.

    ``points (n, 3)`` are in the ellipsoid's axes [m], ``weight (n,)`` includes obliquity and
    spreading [m^2], and ``path (n,)`` is the path Tx-point-Rx less that over the centre [m].
    """

    points: Array
    weight: Array
    path: Array

    def scattering_length(self, frequency: float, fraction: Array | float = 1.0) -> complex:
        """F [m]; ``fraction (n,)`` is the lit fraction of each point."""
        k = wave_number(frequency)
        return complex(
            1j * k / np.sqrt(np.pi) * np.sum(self.weight * fraction * np.exp(-1j * k * self.path))
        )


def wave_number(frequency: float) -> float:
    return 2 * np.pi * frequency / SPEED_OF_LIGHT


def lit_points(
    tx: Array, rx: Array, semi_axes: Array, frequency: float, *, density: float = 1.0
) -> Quadrature:
    """Points and weights for antennas ``tx, rx (3,)`` in the axes of the ellipsoid.

    ``frequency`` is the highest that the points must serve, and ``density`` multiplies their number
    along both coordinates.
    """
    cap_t, cap_r = tx / semi_axes, rx / semi_axes
    pole, east, north = _axes_about(cap_t / np.linalg.norm(cap_t) + cap_r / np.linalg.norm(cap_r))

    def border(azimuth: Array, cap: Array) -> Array:
        along, across = cap @ pole, np.cos(azimuth) * (cap @ east) + np.sin(azimuth) * (cap @ north)
        return np.arctan2(across, along) + np.arccos(1 / np.hypot(along, across))

    # The range of the phase over the lit region determines the number of points.
    probe = np.linspace(0, 2 * np.pi, 97)[:-1]
    rim = np.minimum(border(probe, cap_t), border(probe, cap_r))
    mesh = rim[:, None] * np.linspace(0, 1, 49)
    extent = np.ptp(_path(_points(mesh, probe[:, None], pole, east, north) * semi_axes, tx, rx))
    phase = wave_number(frequency) * float(extent)
    polar_nodes, azimuth_nodes = (
        round(density * (30 + 0.4 * phase)),
        round(density * (45 + 0.4 * phase)),
    )

    corners = _corners(cap_t, cap_r)
    if corners is None:
        azimuth = np.arange(2 * azimuth_nodes) * np.pi / azimuth_nodes
        azimuth_weight = np.full(2 * azimuth_nodes, np.pi / azimuth_nodes)
    else:
        cuts = np.sort(np.arctan2(corners @ north, corners @ east))
        edges = np.array([cuts[0], cuts[1], cuts[0] + 2 * np.pi])
        x, w = np.polynomial.legendre.leggauss(azimuth_nodes)
        azimuth = np.concatenate([a + (b - a) * (x + 1) / 2 for a, b in pairwise(edges)])
        azimuth_weight = np.concatenate([w * (b - a) / 2 for a, b in pairwise(edges)])
    rim = np.minimum(border(azimuth, cap_t), border(azimuth, cap_r))
    x, w = np.polynomial.legendre.leggauss(polar_nodes)
    polar = rim[:, None] * (x + 1) / 2
    weight = azimuth_weight[:, None] * rim[:, None] * w / 2 * np.sin(polar)
    unit = _points(polar, azimuth[:, None], pole, east, north)
    weight = weight * _density(unit, tx, rx, semi_axes)
    points = unit * semi_axes
    return Quadrature(points.reshape(-1, 3), weight.ravel(), _path(points, tx, rx).ravel())


def specular_contribution(
    tx: Array, rx: Array, semi_axes: Array, frequency: float, *, density: float = 1.0
) -> complex:
    """Contribution of the specular point with all its higher orders: PO without its terminator [m].

    The integral along each meridian from the specular point to the border is that along the path
    of steepest descent from the specular point less that from the border. The first is computed
    here, on a straight line into complex polar angles. The second is omitted: it is the wave of the
    terminator, an artefact of physical optics.
    """
    k = wave_number(frequency)
    pole, east, north = _axes_about(_shortest(tx, rx, semi_axes))
    meridians = round(64 * density)
    azimuth = np.arange(meridians) * 2 * np.pi / meridians
    step = 1e-3
    near = _path(
        _points(np.array([[-step, 0.0, step]]), azimuth[:, None], pole, east, north) * semi_axes,
        tx,
        rx,
    )
    bend = (near[:, 0] - 2 * near[:, 1] + near[:, 2]) / step**2
    x, w = np.polynomial.legendre.leggauss(round(32 * density))
    # exp(-bend s^2 k / 2) is 1e-12 at the end of the line.
    reach = np.sqrt(55 / (k * bend))[:, None] * np.exp(-0.25j * np.pi)
    polar = reach * (x + 1) / 2
    unit = _points(polar, azimuth[:, None], pole, east, north)
    integrand = (
        np.sin(polar)
        * _density(unit, tx, rx, semi_axes)
        * np.exp(-1j * k * _path(unit * semi_axes, tx, rx))
    )
    return complex(
        1j * k / np.sqrt(np.pi) * np.sum(reach * w / 2 * integrand) * 2 * np.pi / meridians
    )


def _shortest(tx: Array, rx: Array, semi_axes: Array) -> Array:
    """Direction (3,) on the unit sphere of the point of the shortest path, by Newton's method."""
    pole = tx * semi_axes / np.linalg.norm(tx) + rx * semi_axes / np.linalg.norm(rx)
    for _ in range(50):
        centre, east, north = _axes_about(pole)

        def move(
            step: Array, centre: Array = centre, east: Array = east, north: Array = north
        ) -> Array:
            place = centre + step[..., :1] * east + step[..., 1:] * north
            return place / np.linalg.norm(place, axis=-1, keepdims=True)

        h = 1e-4
        grid = np.array([[i, j] for i in (-h, 0, h) for j in (-h, 0, h)])
        f = _path(move(grid) * semi_axes, tx, rx).reshape(3, 3)
        slope = np.array([f[2, 1] - f[0, 1], f[1, 2] - f[1, 0]]) / (2 * h)
        cross = (f[2, 2] - f[2, 0] - f[0, 2] + f[0, 0]) / (4 * h * h)
        hessian = (
            np.array([[f[2, 1] - 2 * f[1, 1] + f[0, 1], 0], [0, f[1, 2] - 2 * f[1, 1] + f[1, 0]]])
            / h**2
        )
        hessian += np.array([[0, cross], [cross, 0]])
        step = -np.linalg.solve(hessian, slope)
        pole = move(step * (0.3 / max(float(np.linalg.norm(step)), 0.3)))
        if np.linalg.norm(step) < 1e-9:
            break
    return pole


def _axes_about(direction: Array) -> tuple[Array, Array, Array]:
    pole = direction / np.linalg.norm(direction)
    east = np.cross(pole, np.eye(3)[np.argmin(np.abs(pole))])
    east /= np.linalg.norm(east)
    return pole, east, np.cross(pole, east)


def _density(unit: Any, tx: Array, rx: Array, semi_axes: Array) -> Any:
    """Obliquity and spreading times the area of a solid angle; ``unit`` may be complex."""
    to_t, to_r = tx - unit * semi_axes, rx - unit * semi_axes
    range_t, range_r = (np.sqrt(np.sum(way * way, axis=-1)) for way in (to_t, to_r))
    normal = np.prod(semi_axes) * unit / semi_axes
    facing = (
        np.sum(normal * to_t, axis=-1) / range_t + np.sum(normal * to_r, axis=-1) / range_r
    ) / 2
    return facing * np.linalg.norm(tx) * np.linalg.norm(rx) / (range_t * range_r)


def _points(polar: Any, azimuth: Array, pole: Array, east: Array, north: Array) -> Any:
    around = np.cos(azimuth)[..., None] * east + np.sin(azimuth)[..., None] * north
    return np.cos(polar)[..., None] * pole + np.sin(polar)[..., None] * around


def _path(points: Any, tx: Array, rx: Array) -> Any:
    # |T - p| - |T| without cancellation: a fraction of a wavelength counts, a kilometre away.
    path = 0.0
    for antenna in (tx, rx):
        way = points - antenna
        lengths = np.sqrt(np.sum(way * way, axis=-1)) + np.linalg.norm(antenna)
        path = path + np.sum(points * (points - 2 * antenna), axis=-1) / lengths
    return path


def _corners(cap_t: Array, cap_r: Array) -> Array | None:
    """Where the borders of both caps meet, u.T' = u.R' = 1, (2, 3); None if they do not cross."""
    apart = cap_t - cap_r
    if np.linalg.norm(apart) < 1e-9 * np.linalg.norm(cap_t):
        return None
    apart = apart / np.linalg.norm(apart)
    middle = cap_t - (cap_t @ apart) * apart
    size = np.linalg.norm(middle)
    if size <= 1:
        return None
    along, side = middle / size, np.cross(apart, middle / size)
    return np.array([along / size + sign * np.sqrt(1 - 1 / size**2) * side for sign in (1, -1)])
