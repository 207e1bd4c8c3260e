"""Full-wave scattering by coaxial spheroids: auxiliary sources by azimuthal modes.

Rings of Huygens' sources stand on confocal spheroids inside each body. Their strengths make the
tangential electric field on the surface vanish in the sense of least squares, at more rings than
there are unknowns. Every azimuthal mode is a small problem of its own. The field is an exact
solution of Maxwell's equations outside; only the boundary condition is approximate, and its
`residual` says how well it holds. Resonances of the interior do no harm, because the exterior
problem has one solution at every frequency. For a penetrable body, sources outside of it make the
field inside, and the tangential electric and magnetic fields are matched. The fields of the sources
are those of :eq:`huygens-source`.

References
----------
D. I. Kaklamani, H. T. Anastassiu, "Aspects of the method of auxiliary sources (MAS) in
computational electromagnetics", IEEE Antennas Propag. Mag. 44 (2002) 48-64.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import qr, solve_triangular

from rtradar.errors import InputError
from rtradar.full_wave.antennas import Dipole, Polarization, antenna_moments, wavenumber
from rtradar.full_wave.revolution_rings import Medium, Rings, Spheroid

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

LARGEST_BYTES = 2 * 2**30
"""Memory of the factors beyond which bodies are refused."""

_OF_THE_WAY = 0.75
"""How far sources stand between the surface and the line between the foci, at most."""


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
    least_depth : float
        Least number of rings times depth, over ``depth``, of bodies whose sources cannot stand
        deeper, such as needles: with fewer of them the surface would see the sources one by one.
    oversampling : float
        Rings at which the boundary condition is asked for, over rings of sources.
    inner_per_wavelength, inner_oversampling : float
        The same two for the sources of the field inside of a penetrable body and for its shorter
        wavelength. Its field on the surface is smoother than they are.
    """

    per_wavelength: float = 4.0
    least: int = 24
    depth: float = 12.0
    least_depth: float = 0.85
    oversampling: float = 1.5
    inner_per_wavelength: float = 3.0
    inner_oversampling: float = 1.2


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
        # Bodies that are next to each other along the axis must not touch.
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
                f"{', or bodies farther apart' if len(self.spheroids) > 1 else ''}"
            )

    # -- sizes -------------------------------------------------------------------------------------

    @property
    def _fields(self) -> int:
        """Number of fields that are matched: E of a conductor, else E and H."""
        return 1 if self.permittivity is None else 2

    @cached_property
    def _k(self) -> float:
        return wavenumber(self.frequency_hz)

    @cached_property
    def _inner_wavenumber(self) -> complex:
        # The root with a positive real part absorbs where the permittivity does.
        return self._k * complex(np.sqrt(complex(self.permittivity or 1.0)))

    @cached_property
    def modes(self) -> int:
        """Number of azimuthal modes from 0 on; those below 0 follow by symmetry."""
        # As many as Wiscombe's count for a sphere of that radius: higher modes fall off quickly.
        size = self._k * max(body.radius for body in self.spheroids)
        return int(np.ceil(size + 4.05 * size ** (1 / 3) + 6))

    def _deepest(self, body: Spheroid) -> float:
        """Largest depth of sources in a body, in the elliptic coordinate.

        Sources stand around the line between the foci, and around the image of the neighbour's
        tip in the tip of this body, because the scattered field has no sources outside of those.
        """
        gaps = [
            max(other.span[0] - body.span[1], body.span[0] - other.span[1])
            for other in self.spheroids
            if other is not body
        ]
        # At the tip the coordinate changes by the change of the depth over the radius.
        image = body.image_depth(min(gaps)) / body.radius if gaps else np.inf
        return min(_OF_THE_WAY * body.innermost, image)

    def _counts(self, wavenumber: float, per_wavelength: float) -> list[int]:
        """Rings of sources of each body, for waves of that wavenumber."""
        # The curve from pole to pole is as long as half a circle of the longest semi-axis, or
        # shorter.
        longest = [max(body.radius, body.half_length) for body in self.spheroids]
        wanted = [per_wavelength * wavenumber * size / 2 for size in longest]
        return [max(self.sampling.least, int(np.ceil(count))) for count in wanted]

    @cached_property
    def unknowns(self) -> int:
        """Number of unknowns of a mode."""
        return 2 * sum(len(sources) for sources in (*self._outer, *self._inner))

    @cached_property
    def memory_bytes(self) -> int:
        """Memory of the factors of all modes [bytes]."""
        rows = sum(len(rings) for rings in self._surfaces) * self._fields * 2
        return 16 * rows * self.unknowns * self.modes

    @cached_property
    def _outer(self) -> list[Rings]:
        """Sources inside of each body, whose fields are outside."""
        depth, found = self.sampling.depth, []
        # The more rings there are, the nearer to the surface they stand. A body that is too slender
        # for the depth of few rings takes more of them.
        counts = self._counts(self._k, self.sampling.per_wavelength)
        for body, count in zip(self.spheroids, counts, strict=True):
            deepest = self._deepest(body)
            enough = max(count, int(np.ceil(self.sampling.least_depth * depth / deepest)))
            found.append(body.rings(enough, -min(depth / enough, deepest)))
        return found

    @cached_property
    def _inner(self) -> list[Rings]:
        """Sources outside of each body, whose fields are inside; none where it conducts."""
        if self.permittivity is None:
            return []
        # Waves inside are shorter, and their sources stand outside.
        counts = self._counts(self._inner_wavenumber.real, self.sampling.inner_per_wavelength)
        return [
            body.rings(count, self.sampling.depth / count)
            for body, count in zip(self.spheroids, counts, strict=True)
        ]

    @cached_property
    def _surfaces(self) -> list[Rings]:
        """Rings of each body at which the boundary conditions are asked for."""
        # More rings than sources, so that the boundary condition is a problem of least squares.
        counts = [self.sampling.oversampling * len(rings) for rings in self._outer]
        if self._inner:
            within = [self.sampling.inner_oversampling * len(rings) for rings in self._inner]
            counts = [max(pair) for pair in zip(counts, within, strict=True)]
        return [
            body.rings(int(np.ceil(count)))
            for body, count in zip(self.spheroids, counts, strict=True)
        ]

    @cached_property
    def _azimuths(self) -> int:
        """Points around rings of sources, dense enough for those nearest to the surface."""
        return self._points_around(self._outer)

    def _points_around(self, sources: list[Rings]) -> int:
        return 2 * max(int(1.5 * max(len(rings) for rings in sources)), self.modes + 10)

    # -- the problem of each mode ------------------------------------------------------------------

    @cached_property
    def _factors(self) -> list[_LeastSquares]:
        return [_LeastSquares.of(matrix) for matrix in self._matrices()]

    def _matrices(self) -> Iterator[Field]:
        """Tangential fields (row, unknown) of all sources, the matrix of each mode.

        Rows are (field, component, ring), unknowns (component, source).
        """
        surface, sources = Rings.joined(self._surfaces), Rings.joined(self._outer)
        # Sources and rows are weighted by the roots of the areas that their rings stand for, so
        # that sums of squares are integrals over the surfaces.
        outside = Medium(self._k, 1, self.modes, self._azimuths)
        electric = outside.electric(surface, sources) * np.sqrt(sources.area)
        fields = [electric] if self._fields == 1 else [electric, outside.magnetic(electric)]
        blocks = [np.stack(fields, axis=1), *self._inner_fields()]
        weight = np.sqrt(surface.area)[:, None, None]
        # Each mode has a matrix of its own, with the fields of all sources side by side.
        for mode in range(self.modes):
            rows = 2 * self._fields * len(surface)
            columns = [(block[mode] * weight).reshape(rows, -1) for block in blocks]
            yield np.concatenate(columns, axis=1)

    def _inner_fields(self) -> Iterator[Field]:
        """Fields (mode, field, component, ring, component, source) inside of each body, negative.

        They are matched on that body's own rings. Each source is scaled to the same strength there,
        because the fields of sources farther away lose more in the body.
        """
        whole, begin = sum(len(rings) for rings in self._surfaces), 0
        if not self._inner:
            return
        k = self._inner_wavenumber
        inside = Medium(k, -1, self.modes, self._points_around(self._inner))
        for rings, sources in zip(self._surfaces, self._inner, strict=True):
            electric = inside.electric(rings, sources)
            size = np.sqrt(np.sum(np.abs(electric[0]) ** 2, axis=(0, 1, 2)))
            electric /= -size
            # H times the wave impedance of vacuum
            both = np.stack([electric, k / self._k * inside.magnetic(electric)], axis=1)
            # The field inside a body is matched on its own rings alone.
            block = np.zeros((*both.shape[:3], whole, *both.shape[4:]), dtype=np.complex128)
            block[:, :, :, begin : begin + len(rings)] = both
            yield block
            begin += len(rings)

    def _fields_on(self, rings: Rings, antenna: Dipole) -> tuple[Field, Field]:
        """Tangential E and H (mode, component, ring) of an antenna; modes are 0, 1, ... -1."""
        # The field at evenly spaced points around each ring, in the axes of the bodies, and its
        # Fourier coefficients.
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
        """Strengths (mode, component, source, antenna) and residuals (antenna,) of the sources.

        The sources are those inside of the bodies, whose fields reach the antennas.
        """
        surface, sources = Rings.joined(self._surfaces), Rings.joined(self._outer)
        # What arrives, with the same weights as the rows of the matrices.
        arriving = [
            np.stack(self._fields_on(surface, antenna)[: self._fields], axis=1)
            for antenna in antennas
        ]
        given = np.stack(arriving, axis=-1) * np.sqrt(surface.area)[:, None]
        shape = (self._azimuths, 2, len(sources), len(antennas))
        out, left = np.zeros(shape, dtype=np.complex128), np.zeros(len(antennas))
        for number, factor in enumerate(self._factors):
            for mode in {number, -number}:
                # Reflection at a plane through the axis turns a mode into that of the negative
                # number: it changes the sign of currents and E around the axis, and of H along the
                # curve.
                sign = np.array([1, -1 if mode < 0 else 1])
                rows = np.stack([sign, sign[::-1]])[: self._fields, :, None, None]
                solved, squares = factor.solve(-(rows * given[mode]).reshape(-1, len(antennas)))
                own = solved[: 2 * len(sources)].reshape(shape[1:])
                out[mode] = sign[:, None, None] * own
                left += squares
        size = np.sum(np.abs(given) ** 2, axis=(0, 1, 2, 3))
        out *= np.sqrt(sources.area)[:, None]
        return out, np.sqrt(left / size)

    def _received(self, antenna: Dipole) -> Field:
        """Field at an antenna per strength (mode, component, source) of the sources.

        It follows from the antenna's own field at the sources, by reciprocity.
        """
        electric, magnetic = self._fields_on(Rings.joined(self._outer), antenna)
        # A source along the curve has its magnetic current around the axis, a source around the
        # axis has it against the curve.
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
        self,
        tx: ArrayLike,
        rx: ArrayLike,
        polarization: Polarization = "v",
        received: Polarization | None = None,
    ) -> tuple[Field, Array]:
        """Compute scattering lengths, and how well the boundary condition holds.

        Parameters
        ----------
        tx, rx : (n, 3) array_like
            Antennas outside of the bodies [m].
        polarization : {"v", "h"}
            Polarisation of the tx, and of the rx too unless ``received`` is given.
        received : {"v", "h"}, optional
            Polarisation of the rx.

        Returns
        -------
        length : (n,) complex128
            Scattering length [m].
        residual : (n,) float64
            Root mean square over the surface of the tangential electric field that is left, over
            that of the incident field.
        """
        senders, sent = _distinct(np.atleast_2d(np.asarray(tx, np.float64)), polarization)
        receivers, chosen = _distinct(
            np.atleast_2d(np.asarray(rx, np.float64)), received or polarization
        )
        # Strengths of the sources are found once for each transmitter.
        strengths, residual = self._strengths(senders)
        length = np.empty(len(sent), dtype=np.complex128)
        for index, receiver in enumerate(receivers):
            # All pairs with this receiver: the product of what it receives with the strengths.
            pairs = np.flatnonzero(chosen == index)
            at = self._received(receiver)
            fields = np.tensordot(at, strengths[..., sent[pairs]], axes=3)
            # A flat conductor reverses the field, and its scattering length counts as positive.
            length[pairs] = -np.sqrt(4 * np.pi) * fields
        return length, residual[sent]


def _distinct(
    antennas: Array, polarization: Polarization
) -> tuple[list[Dipole], NDArray[np.int64]]:
    """Each antenna once, and the number of it for each row (n,)."""
    places, index = np.unique(antennas, axis=0, return_inverse=True)
    moments = antenna_moments(places, polarization)
    return [Dipole(*one) for one in zip(places, moments, strict=True)], index.ravel()


class _LeastSquares(NamedTuple):
    """Pivoted orthogonal factors of a matrix, some of whose columns may be spoiled by rounding.

    Attributes
    ----------
    q : (row, rank) complex128
        Orthonormal columns.
    r : (rank, rank) complex128
        Upper triangle.
    columns : (rank,) int64
        Unknowns that are used, in the order of the triangle.
    unknowns : int
        Number of all unknowns.
    """

    q: Field  # (row, rank)
    r: Field  # (rank, rank)
    columns: NDArray[np.int64]  # (rank,)
    unknowns: int

    @classmethod
    def of(cls, matrix: Field) -> _LeastSquares:
        """Factorise a matrix (row, unknown), and leave out what rounding has spoiled."""
        q, r, pivots = qr(matrix, mode="economic", pivoting=True, check_finite=False)
        # Pivots come in descending order: those that are negligible belong to sources that add
        # nothing.
        size = np.abs(np.diagonal(r))
        rank = int(np.count_nonzero(size > _NEGLIGIBLE * size[0]))
        return cls(q[:, :rank], r[:rank, :rank], pivots[:rank], matrix.shape[1])

    def solve(self, right: Field) -> tuple[Field, Array]:
        """Find solutions (unknown, case), and the squares of what they leave (case,)."""
        # The part of the right side that the columns can make; the rest is the residual.
        seen = self.q.conj().T @ right
        out = np.zeros((self.unknowns, right.shape[1]), dtype=np.complex128)
        out[self.columns] = solve_triangular(self.r, seen, check_finite=False)
        return out, np.sum(np.abs(right - self.q @ seen) ** 2, axis=0)
