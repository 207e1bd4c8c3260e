"""Full-wave scattering by coaxial spheroids: auxiliary sources by azimuthal modes.

Rings of Huygens' sources stand on confocal spheroids inside each body. Their strengths make the
tangential electric field on the surface vanish in the sense of least squares, at more rings than
there are unknowns. Every azimuthal mode is a problem of its own, and small. The field is an exact
solution of Maxwell's equations outside; only the boundary condition is approximate, and its
`residual` says how well it holds. For the exterior problem has one solution at every frequency, a
resonance of the interior does no harm. Of a penetrable body, sources outside of it make the field
inside, and the tangential electric and magnetic fields are matched.

References
----------
D. I. Kaklamani, H. T. Anastassiu, "Aspects of the method of auxiliary sources (MAS) in
computational electromagnetics", IEEE Antennas Propag. Mag. 44 (2002) 48-64.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import qr, solve_triangular

from rtradar.errors import InputError
from rtradar.full_wave.antennas import Dipole, Polarization, antenna_moments, wavenumber
from rtradar.full_wave.revolution_curves import Rings, Spheroid
from rtradar.full_wave.revolution_modes import Medium

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

LARGEST_BYTES = 3 * 2**30
"""Memory of the factors beyond which bodies are refused."""

_NEGLIGIBLE = 1e-13
"""Pivot, relative to the largest one, below which a source adds nothing but rounding."""


@dataclass(frozen=True)
class Sampling:
    """How densely sources and the rings of a surface stand.

    Parameters
    ----------
    per_wavelength : float
        Rings of sources over a wavelength of the generating curve, where they are farthest apart.
    least : int
        Least number of rings of a body.
    depth : float
        Number of rings times their depth in the elliptic coordinate. Deeper sources make smoother
        fields, and a problem that rounding spoils sooner.
    oversampling : float
        Rings at which the boundary condition is asked for, over rings of sources.
    """

    per_wavelength: float = 5.0
    least: int = 24
    depth: float = 12.0
    oversampling: float = 1.5


class _Factor(NamedTuple):
    """Pivoted orthogonal factors of one mode."""

    q: Field  # (row, rank)
    r: Field  # (rank, rank)
    columns: NDArray[np.int64]  # (rank,)
    unknowns: int

    @classmethod
    def of(cls, matrix: Field) -> _Factor:
        """Factorise a matrix (row, unknown), and leave out what rounding has spoiled."""
        q, r, pivots = qr(matrix, mode="economic", pivoting=True, check_finite=False)
        size = np.abs(np.diagonal(r))
        rank = int(np.count_nonzero(size > _NEGLIGIBLE * size[0]))
        return cls(q[:, :rank], r[:rank, :rank], pivots[:rank], matrix.shape[1])

    def solve(self, right: Field) -> tuple[Field, Array]:
        """Least-squares solutions (unknown, case), and squares of what they leave (case,)."""
        seen = self.q.conj().T @ right
        out = np.zeros((self.unknowns, right.shape[1]), dtype=np.complex128)
        out[self.columns] = solve_triangular(self.r, seen, check_finite=False)
        return out, np.sum(np.abs(right - self.q @ seen) ** 2, axis=0)


@dataclass(frozen=True, eq=False)
class BodiesOfRevolution:
    """Coaxial spheroids at one frequency: factorised once, for any antennas.

    Parameters
    ----------
    spheroids : tuple of Spheroid
        Bodies about the z axis of `frame`, which do not touch each other.
    frequency_hz : float
        Frequency of the wave [Hz].
    centre : (3,) float64
        Place of z = 0 of the axis, in the coordinates of the antennas [m].
    frame : (3, 3) float64
        Proper rotation, whose third column is the direction of the axis.
    permittivity : complex, optional
        Relative permittivity of the bodies, for exp(+j omega t); None: perfect conductors.
    sampling : Sampling
        Density of sources.

    Raises
    ------
    InputError
        Where bodies touch each other, or are too large for `LARGEST_BYTES`.
    """

    spheroids: tuple[Spheroid, ...]
    frequency_hz: float
    centre: Array = field(default_factory=lambda: np.zeros(3))
    frame: Array = field(default_factory=lambda: np.eye(3))
    permittivity: complex | None = None
    sampling: Sampling = field(default_factory=Sampling)

    def __post_init__(self) -> None:
        spans = sorted(body.span for body in self.spheroids)
        for (_, below), (above, _) in pairwise(spans):
            if above <= below:
                raise InputError(
                    f"full-wave: two coaxial bodies overlap by {below - above:.3g} m along their "
                    "axis; they must be apart"
                )
        if self.memory_bytes > LARGEST_BYTES:
            raise InputError(
                f"full-wave: bodies of {2 * max(b.half_length for b in self.spheroids):.3g} m at "
                f"{self.frequency_hz / 1e9:g} GHz take {self.unknowns} unknowns in each of "
                f"{self.modes} modes, {self.memory_bytes / 2**30:.1f} GiB; allowed are "
                f"{LARGEST_BYTES / 2**30:.0f} GiB: take a smaller body or a lower frequency"
            )

    # -- sizes -------------------------------------------------------------------------------------

    @cached_property
    def _k(self) -> float:
        return wavenumber(self.frequency_hz)

    @cached_property
    def modes(self) -> int:
        """Number of azimuthal modes from 0 on; those below 0 follow by symmetry."""
        size = self._k * max(body.radius for body in self.spheroids)
        return int(np.ceil(size + 4.05 * size ** (1 / 3) + 6))

    def _counts(self, wavenumber: float) -> list[int]:
        """Rings of sources of each body, for waves of that wavenumber."""
        longest = [max(body.radius, body.half_length) for body in self.spheroids]
        wanted = [self.sampling.per_wavelength * wavenumber * size / 2 for size in longest]
        return [max(self.sampling.least, int(np.ceil(count))) for count in wanted]

    @cached_property
    def unknowns(self) -> int:
        """Number of unknowns of a mode."""
        return 2 * sum(len(sources) for sources in self._sources)

    @cached_property
    def memory_bytes(self) -> int:
        """Memory of the factors of all modes [bytes]."""
        rows = len(self._surface) * (2 if self.permittivity is None else 4)
        return 16 * rows * self.unknowns * self.modes

    @cached_property
    def _outer_counts(self) -> list[int]:
        return self._counts(self._k)

    @cached_property
    def _outer(self) -> Rings:
        """Sources inside of the bodies, whose fields are outside."""
        return Rings.joined(
            [
                body.rings(count, -min(self.sampling.depth / count, 0.75 * body.innermost))
                for body, count in zip(self.spheroids, self._outer_counts, strict=True)
            ]
        )

    @property
    def _sources(self) -> list[Rings]:
        return [self._outer]

    @cached_property
    def _surface(self) -> Rings:
        return Rings.joined(
            [
                body.rings(int(np.ceil(count * self.sampling.oversampling)))
                for body, count in zip(self.spheroids, self._outer_counts, strict=True)
            ]
        )

    @cached_property
    def _azimuths(self) -> int:
        """Points around rings of sources, dense enough for those nearest to the surface."""
        return 2 * max(int(1.5 * max(self._outer_counts)), self.modes + 10)

    # -- the problem of each mode ------------------------------------------------------------------

    @cached_property
    def _outside(self) -> Medium:
        return Medium(self._k, 1, self.modes, self._azimuths)

    @cached_property
    def _factors(self) -> list[_Factor]:
        field = self._outside.electric(self._surface, self._outer)
        field *= np.sqrt(self._surface.area)[:, None, None]
        field *= np.sqrt(self._outer.area)
        rows, columns = 2 * len(self._surface), 2 * len(self._outer)
        return [_Factor.of(mode.reshape(rows, columns)) for mode in field]

    def _fields_on(self, rings: Rings, antenna: Dipole) -> tuple[Field, Field]:
        """Tangential E and H (mode, component, ring) of an antenna; modes 0, 1, ... -1."""
        count = self._azimuths
        position, *tangents = rings.points(count)
        found = antenna.fields(self.centre + position @ self.frame.T, self._k)
        out = []
        for vectors in found:
            local = vectors @ self.frame
            along = np.stack([np.sum(local * one, axis=-1) for one in tangents])
            out.append(np.moveaxis(np.fft.fft(along, axis=-1) / count, -1, 0))
        return out[0], out[1]

    def _strengths(self, antennas: list[Dipole]) -> tuple[Field, Array]:
        """Strengths (mode, component, source, antenna) and residuals (antenna,) of sources."""
        rings = self._surface
        given = np.stack([self._fields_on(rings, antenna)[0] for antenna in antennas], axis=-1)
        given *= np.sqrt(rings.area)[:, None]
        out = np.empty((self._azimuths, 2, len(self._outer), len(antennas)), dtype=np.complex128)
        out[:] = 0.0
        left = np.zeros(len(antennas))
        for number, factor in enumerate(self._factors):
            for mode in {number, -number}:
                # Of the mode below zero the currents around the axis have the other sign.
                sign = np.array([1, -1 if mode < 0 else 1])[:, None, None]
                right = -(sign * given[mode]).reshape(-1, len(antennas))
                solved, squares = factor.solve(right)
                out[mode] = sign * solved.reshape(out.shape[1:])
                left += squares
        size = np.sum(np.abs(given) ** 2, axis=(0, 1, 2))
        out *= np.sqrt(self._outer.area)[:, None]
        return out, np.sqrt(left / size)

    def _received(self, antenna: Dipole) -> Field:
        """Field at an antenna per strength (mode, component, source) of the sources.

        It follows from the antenna's own field at the sources, by reciprocity.
        """
        electric, magnetic = self._fields_on(self._outer, antenna)
        # The magnetic current of a source along the curve is around the axis, and of one around the
        # axis against the curve.
        both = np.stack([electric[:, 0] - magnetic[:, 1], electric[:, 1] + magnetic[:, 0]], axis=1)
        # The integral with exp(+j m phi) is the coefficient of the mode -m.
        return np.roll(both[::-1], 1, axis=0) * self._k / (4j * np.pi)

    # -- answers -----------------------------------------------------------------------------------

    def scattering_length(
        self, tx: ArrayLike, rx: ArrayLike, polarization: Polarization = "v"
    ) -> Field:
        """Co-polar scattering length between antennas, pair by pair.

        Parameters
        ----------
        tx, rx : (n, 3) array_like
            Antennas outside of the bodies [m].
        polarization : {"v", "h"}
            Polarisation of both, see `rtradar.full_wave.antennas.antenna_moments`.

        Returns
        -------
        (n,) complex128
            Scattering length [m] as that of `rtradar.scattering_length`.
        """
        return self.solve(tx, rx, polarization)[0]

    def solve(
        self, tx: ArrayLike, rx: ArrayLike, polarization: Polarization = "v"
    ) -> tuple[Field, Array]:
        """Compute scattering lengths, and how well the boundary condition holds.

        Parameters
        ----------
        tx, rx : (n, 3) array_like
            Antennas outside of the bodies [m].
        polarization : {"v", "h"}
            Polarisation of both.

        Returns
        -------
        length : (n,) complex128
            Scattering length [m].
        residual : (n,) float64
            Root mean square over the surface of the tangential electric field that is left, over
            that of the incident field.
        """
        senders, sent = _distinct(np.atleast_2d(np.asarray(tx, np.float64)), polarization)
        receivers, received = _distinct(np.atleast_2d(np.asarray(rx, np.float64)), polarization)
        strengths, residual = self._strengths(senders)
        length = np.empty(len(sent), dtype=np.complex128)
        for index, receiver in enumerate(receivers):
            pairs = np.flatnonzero(received == index)
            at = self._received(receiver)
            fields = np.tensordot(at, strengths[..., sent[pairs]], axes=3)
            # The field of a flat conductor is against that which arrives, and counts as positive.
            length[pairs] = -np.sqrt(4 * np.pi) * fields
        return length, residual[sent]


def _distinct(
    antennas: Array, polarization: Polarization
) -> tuple[list[Dipole], NDArray[np.int64]]:
    """Each antenna once, and the number of it for each row (n,)."""
    places, index = np.unique(antennas, axis=0, return_inverse=True)
    moments = antenna_moments(places, polarization)
    return [Dipole(*one) for one in zip(places, moments, strict=True)], index.ravel()
