"""Two conducting spheres by multipoles: the reference for full-wave methods where bodies interact.

The field of each sphere is a series of vector spherical waves about its own centre, and on the
surface of each the tangential electric field is projected onto vector spherical harmonics by
Gauss-Legendre quadrature (A. R. Jones, *Light scattering by two spheres*; the waves are those of
C. F. Bohren, D. R. Huffman, *Absorption and Scattering of Light by Small Particles*, section 4.1,
for exp(+j omega t)). The centres are on the z axis, so that every azimuthal mode stands alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import assoc_legendre_p_all, spherical_jn, spherical_yn

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Case(NamedTuple):
    """Unit vectors (3,) to a far Tx and a far Rx, each with that of its polarisation."""

    tx: Array
    sent: Array
    rx: Array
    received: Array


@dataclass(frozen=True)
class SpherePair:
    """Two conducting spheres of one radius [m] at some heights on the z axis [m]."""

    radius: float
    heights: tuple[float, float]
    wavenumber: float  # [rad/m]

    @cached_property
    def orders(self) -> int:
        """Largest order of the series: that of one sphere, and more for what is near."""
        size = self.wavenumber * self.radius
        gap = abs(self.heights[1] - self.heights[0]) - 2 * self.radius
        # Fields of a neighbour at that gap decay by radius / (radius + gap) an order.
        near = 16 / np.log1p(gap / self.radius)
        return int(np.ceil(size + 4.05 * size ** (1 / 3) + min(12 + near / 4, 60)))

    @cached_property
    def nodes(self) -> tuple[Array, Array]:
        """Cosines of the polar angle on a sphere, and the weights of their integral."""
        return np.polynomial.legendre.leggauss(2 * self.orders + 8)

    def waves(self, mode: int, x: Array, cosine: Array) -> tuple[Complex, Complex, Complex]:
        """Radial, polar and azimuthal field (point, wave) of outgoing waves at azimuth zero.

        ``x`` is the wavenumber times the distance. Each wave is divided by the size that it has on
        the surface of its own sphere.
        """
        order = np.arange(max(mode, 1), self.orders + 1)
        values, slopes = assoc_legendre_p_all(
            self.orders, mode, np.clip(cosine, -1, 1), norm=True, diff_n=1
        )[:, order, mode]
        sine = np.sqrt(np.maximum(1 - cosine**2, 1e-300))
        polar, azimuthal = (-sine * slopes).T, 1j * mode * (values / sine).T
        bessel, slope, own, own_slope = *_outgoing(order, x), *_outgoing(order, self._x)
        radial_n = order * (order + 1) * bessel / x[:, None] * values.T / own_slope
        theta = np.concatenate([azimuthal * bessel / own, polar * slope / own_slope], axis=1)
        phi = np.concatenate([-polar * bessel / own, azimuthal * slope / own_slope], axis=1)
        return np.concatenate([0 * radial_n, radial_n], axis=1), theta, phi

    @property
    def _x(self) -> Array:
        return np.array([self.wavenumber * self.radius])

    def projection(self, mode: int) -> Complex:
        """Matrix (wave, 2 nodes) of the tangential field on a sphere, projected on harmonics."""
        cosine, weight = self.nodes
        _, theta, phi = self.waves(mode, np.full(len(cosine), self._x[0]), cosine)
        return (np.concatenate([theta, phi]).conj() * np.tile(weight, 2)[:, None]).T

    def from_other(self, mode: int, offset: float) -> Complex:
        """Tangential field (2 nodes, wave) on a sphere of waves about a centre ``offset`` above."""
        cosine, _ = self.nodes
        sine = np.sqrt(1 - cosine**2)
        across, along = self.radius * sine, self.radius * cosine - offset
        distance = np.hypot(across, along)
        radial, theta, phi = self.waves(mode, self.wavenumber * distance, along / distance)
        # Unit vectors about the other centre, in those about this one.
        ahead = (across * cosine - along * sine) / distance
        beside = (along * cosine + across * sine) / distance
        return np.concatenate([ahead[:, None] * radial + beside[:, None] * theta, phi])

    def solve(self, mode: int, arriving: Complex) -> Complex:
        """Coefficients (sphere, wave, case) for tangential fields (sphere, 2 nodes, case)."""
        project = self.projection(mode)
        apart = self.heights[1] - self.heights[0]
        own = project @ self.from_other(mode, 0.0)
        there, back = (project @ self.from_other(mode, offset) for offset in (apart, -apart))
        matrix = np.block([[own, there], [back, own]])
        right = -np.concatenate([project @ field for field in arriving])
        return np.linalg.solve(matrix, right).reshape(2, len(own), -1)

    def tangential(self, field: Callable[[Array], Complex], azimuths: int) -> Complex:
        """Tangential part (mode, sphere, 2 nodes) of a field (..., 3) of points (..., 3)."""
        cosine, _ = self.nodes
        sine, angle = np.sqrt(1 - cosine**2)[:, None], 2 * np.pi * np.arange(azimuths) / azimuths
        out = []
        for height in self.heights:
            along = np.broadcast_to(height + self.radius * cosine[:, None], (len(sine), azimuths))
            across = self.radius * sine
            at = np.stack([across * np.cos(angle), across * np.sin(angle), along], axis=-1)
            x, y, z = np.moveaxis(field(at), -1, 0)
            theta = cosine[:, None] * (x * np.cos(angle) + y * np.sin(angle)) - sine * z
            phi = y * np.cos(angle) - x * np.sin(angle)
            out.append(np.fft.fft(np.concatenate([theta, phi]), axis=1).T / azimuths)
        return np.stack(out, axis=1)

    def plane_wave(self, case: Case) -> Callable[[Array], Complex]:
        """Field of a plane wave from a far Tx, with the phase 0 at the origin."""
        return lambda at: np.exp(1j * self.wavenumber * (at @ case.tx))[..., None] * case.sent

    def scattering_lengths(self, cases: list[Case]) -> Complex:
        """Scattering lengths (case,) [m] of far Tx and Rx."""
        azimuths = 2 * self.orders + 16
        arriving = np.stack(
            [self.tangential(self.plane_wave(one), azimuths) for one in cases], axis=-1
        )
        total = np.zeros(len(cases), dtype=np.complex128)
        for mode in range(self.orders + 1):
            # A mode below zero is that above, reflected in the plane of x and z.
            flips = [1] if mode == 0 else [1, -1]
            signs = [np.repeat([1, flip], len(self.nodes[0]))[:, None] for flip in flips]
            right = [sign * arriving[flip * mode] for sign, flip in zip(signs, flips, strict=True)]
            solved = self.solve(mode, np.concatenate(right, axis=-1))
            for number, flip in enumerate(flips):
                for index, one in enumerate(cases):
                    waves = solved[:, :, number * len(cases) + index]
                    total[index] += self._far(mode, flip, waves, one)
        return -np.sqrt(4 * np.pi) * total / self.wavenumber

    def near_scattering_length(self, case: Case) -> complex:
        """Scattering length [m] of dipoles at places (3,) of a case, not in directions."""
        azimuths = 2 * self.orders + 16
        ranges = [float(np.linalg.norm(antenna)) for antenna in (case.tx, case.rx)]

        def dipole(at: Array) -> Complex:
            # Jackson, Classical Electrodynamics, eq. 9.18, over k^2.
            away = at - case.tx
            distance = np.linalg.norm(away, axis=-1, keepdims=True)
            unit, x = away / distance, self.wavenumber * distance
            along = (unit @ case.sent)[..., None] * unit
            near = (3 * along - case.sent) * (1 / x**2 + 1j / x)
            return (case.sent - along + near) * np.exp(-1j * x) / distance

        arriving = self.tangential(dipole, azimuths)
        around = float(np.arctan2(case.rx[1], case.rx[0]))
        total = 0j
        for mode in range(-self.orders, self.orders + 1):
            flip = 1 if mode >= 0 else -1
            sign = np.repeat([1, flip], len(self.nodes[0]))
            solved = self.solve(abs(mode), (sign * arriving[mode])[..., None])[..., 0]
            for height, waves in zip(self.heights, solved, strict=True):
                away = case.rx - np.array([0.0, 0.0, height])
                distance = float(np.linalg.norm(away))
                cosine = np.array([away[2] / distance])
                fields = self.waves(abs(mode), np.array([self.wavenumber * distance]), cosine)
                radial, theta, phi = (complex(field[0] @ waves) for field in fields)
                level = np.array([np.cos(around), np.sin(around), 0.0])
                sine = float(np.hypot(*away[:2])) / distance
                vector = (
                    radial * away / distance
                    + theta * (cosine * level - np.array([0.0, 0.0, sine]))
                    + flip * phi * np.array([-level[1], level[0], 0.0])
                )
                total += np.exp(1j * mode * around) * (vector @ case.received)
        path = np.exp(1j * self.wavenumber * sum(ranges)) * np.prod(ranges)
        return complex(-np.sqrt(4 * np.pi) * path * total)

    def _far(self, mode: int, flip: int, waves: Complex, case: Case) -> complex:
        """Received field of the waves (sphere, wave) of a mode, or of that below zero (flip -1)."""
        rx, angle = case.rx, float(np.arctan2(case.rx[1], case.rx[0]))
        turn = np.array([np.cos(angle), np.sin(angle)])
        theta_hat = np.array([rx[2] * turn[0], rx[2] * turn[1], -np.hypot(rx[0], rx[1])])
        phi_hat = np.array([-turn[1], turn[0], 0.0])
        theta, phi = self.far_waves(mode, rx[2:])
        height = np.array(self.heights)
        phase = np.exp(1j * (self.wavenumber * height * rx[2] + flip * mode * angle))
        fields = np.outer(waves @ theta, theta_hat) + flip * np.outer(waves @ phi, phi_hat)
        return complex(phase @ fields @ case.received)

    def far_waves(self, mode: int, cosine: Array) -> tuple[Complex, Complex]:
        """Polar and azimuthal field (wave,) of waves far away, over exp(-j x) / x."""
        order = np.arange(max(mode, 1), self.orders + 1)
        values, slopes = assoc_legendre_p_all(self.orders, mode, cosine, norm=True, diff_n=1)[
            :, order, mode, 0
        ]
        sine = np.sqrt(1 - cosine[0] ** 2)
        polar, azimuthal = -sine * slopes, 1j * mode * values / sine
        own, own_slope = (one[0] for one in _outgoing(order, self._x))
        far = 1j ** (order + 1) / own, 1j**order / own_slope
        theta = np.concatenate([azimuthal * far[0], polar * far[1]])
        return theta, np.concatenate([-polar * far[0], azimuthal * far[1]])


def _outgoing(order: NDArray[np.int64], x: Array) -> tuple[Complex, Complex]:
    """Spherical Hankel functions of the second kind h(x), and (x h)' / x, each (point, order)."""
    x = x[:, None]
    value = spherical_jn(order, x) - 1j * spherical_yn(order, x)
    slope = spherical_jn(order, x, derivative=True) - 1j * spherical_yn(order, x, derivative=True)
    return value, value / x + slope
