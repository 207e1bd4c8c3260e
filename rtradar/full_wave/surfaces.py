"""Any closed conducting mesh, by the combined field integral equation over its surface.

The unknowns are the currents over the edges of the triangles (S. M. Rao, D. R. Wilton, A. W.
Glisson, IEEE Trans. Antennas Propag. 30, 1982). The tangential electric field on the surface is
zero, and the tangential magnetic field is the current. The sum of both conditions, unlike each
alone, has no resonances of the inside (J. R. Mautz, R. F. Harrington, A.E.U. 32, 1978).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lu_factor, lu_solve

from rtradar.errors import InputError
from rtradar.full_wave.antennas import Dipole, Polarization, antenna_moments, wavenumber
from rtradar.full_wave.surfaces_mesh import ClosedMesh
from rtradar.kernels.surface_integrals import Equation, Rules, fill_matrices

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

MOST_UNKNOWNS = 17_000
"""Largest number of edges of a mesh without mirror planes: a matrix of 2.3 GB.

Each mirror plane divides the matrix into two with half the unknowns each, so that a mesh may have
sqrt(2) times as many edges."""

LONGEST_EDGE = 1 / 8
"""Root mean square of the lengths of edges, in wavelengths, above which triangles are divided."""

_ELECTRIC = 0.8
"""Weight of the electric field's equation. It is the more accurate one; a fifth of the other is
enough at resonances of the inside."""

_DOUBLE_UP_TO = 6000
"""Number of edges up to which matrices are complex128; larger ones are complex64."""

_ORDER = 4
"""Points an axis where triangles touch, which leaves 1e-4 of the static integrals."""

_TOGETHER = 64
"""Number of antennas whose fields are kept at once."""


@dataclass(frozen=True, eq=False)
class ConductingSurface:
    """Scattering by perfect conductors with closed surfaces, at one frequency.

    The matrix is factorised once, when it is first needed, for all antennas.

    Parameters
    ----------
    mesh : ClosedMesh
        Surface of the conductors. Its triangles are divided until their edges are short enough
        (`LONGEST_EDGE`); they stay flat.
    frequency_hz : float
        Frequency of the wave [Hz].

    Raises
    ------
    InputError
        Where there are too many unknowns.

    Notes
    -----
    Equations :eq:`combined-field`, whose alpha is 0.8, and :eq:`received-current` of the theory
    page. The error falls with the square of the lengths of the edges. For a curved surface it comes
    mostly from the flat triangles if their corners lie on the surface: with the corners moved
    outward, so that the triangles are on average on the surface, it is several times smaller.
    """

    mesh: ClosedMesh
    frequency_hz: float

    def __post_init__(self) -> None:
        # The size of the problem is known before any triangle is divided.
        mesh = self.mesh
        wavelength = 2 * np.pi / wavenumber(self.frequency_hz)
        edge = float(np.sqrt(np.mean(mesh.lengths**2))) / wavelength
        # Each division halves the edges, and makes four times as many.
        divisions = max(0, math.ceil(math.log2(edge / LONGEST_EDGE)))
        _refuse_large(mesh, 4**divisions, self.frequency_hz)
        for _ in range(divisions):
            mesh = mesh.divided()
        object.__setattr__(self, "mesh", mesh)

    @property
    def memory_bytes(self) -> int:
        """Memory of the matrices [bytes]."""
        size = 16 if self.mesh.unknowns <= _DOUBLE_UP_TO else 8
        return size * _entries(self.mesh)

    @cached_property
    def _equation(self) -> Equation:
        return Equation(wavenumber(self.frequency_hz), _ELECTRIC)

    @cached_property
    def _factors(self) -> list[Any]:
        """Factors of the transposed matrix of each parity."""
        # Currents of each parity at the mirror planes have a matrix of their own.
        orbits = self.mesh.orbits
        shape = len(orbits.parity), *2 * (1 + int(orbits.unknown.max()),)
        kind = np.complex128 if self.mesh.unknowns <= _DOUBLE_UP_TO else np.complex64
        matrices = np.zeros(shape, dtype=kind)
        fill_matrices(self.mesh.triangles, orbits, rules(_ORDER), self._equation, matrices)
        factors = []
        for matrix, sums in zip(matrices, self.mesh.sums_of_edges, strict=True):
            # Some currents cannot have this parity, because they are their own mirror images.
            none = np.flatnonzero(abs(sums).sum(axis=1) == 0)
            matrix[none, none] = 1.0
            # The transposed matrix is stored by columns, as LAPACK takes it, so nothing is copied.
            factors.append(lu_factor(matrix.T, overwrite_a=True, check_finite=False))
        return factors

    def scattering_length(self, tx: Array, rx: Array, polarization: Polarization) -> Field:
        """Compute the co-polar scattering length between each Tx and Rx.

        Parameters
        ----------
        tx, rx : (n, 3) float64
            Positions of the antennas, pair by pair [m]; they stand outside the conductors.
        polarization : {"v", "h"}
            v is world z projected across the line of sight, h is across both.

        Returns
        -------
        (n,) complex128
            Scattering length [m], see `rtradar.scattering_length`. Antennas are dipoles across
            the line of sight from the origin, with their near fields.
        """
        out = np.empty(len(tx), dtype=np.complex128)
        for first in range(0, len(tx), _TOGETHER):
            some = slice(first, first + _TOGETHER)
            out[some] = self._some(tx[some], rx[some], polarization)
        # The radiated field is -jk/(4 pi) times the product of the current and the field of the
        # receiving dipole; the scattering length has sqrt(4 pi) and the sign of `copolar`.
        return 1j * wavenumber(self.frequency_hz) / math.sqrt(4 * math.pi) * out

    def _some(self, tx: Array, rx: Array, polarization: Polarization) -> Field:
        # Each antenna once, whether it transmits or receives.
        antennas, index = np.unique(np.concatenate([tx, rx]), axis=0, return_inverse=True)
        received, sent = self._products(antennas, polarization)
        # The currents that the transmitters drive, as the sum over parities, each of which is a
        # smaller system.
        sources = np.unique(index[: len(tx)])
        currents = np.zeros_like(sent)
        for factors, sums in zip(self._factors, self.mesh.sums_of_edges, strict=True):
            # The matrix counts each set of mirror images once.
            right = (sums @ sent[sources].T) / len(self._factors)
            solved = lu_solve(factors, right, trans=1, check_finite=False)
            currents[sources] += (sums.T @ solved).T
        # What Rx receives is the product of these currents and the field that Rx would send.
        ends = index[: len(tx)], index[len(tx) :]
        return np.asarray(np.sum(currents[ends[0]] * received[ends[1]], axis=1))

    def _products(self, antennas: Array, polarization: Polarization) -> Field:
        """Products (2, antenna, edge) of each current with the fields of antennas.

        First comes the product with the electric field, then the right side of the equation.
        """
        triangles, rule = self.mesh.triangles, rules(_ORDER)
        # Each of the three currents of a triangle at the points of the rule, with the weights of
        # the integral.
        points = np.einsum("pc,tcx->tpx", rule.places, triangles.corners)
        currents = points[:, None] - triangles.corners[:, :, None]
        currents *= triangles.scales[..., None, None] * triangles.areas[:, None, None, None]
        currents *= rule.weights[:, None]
        out = np.zeros((2, len(antennas), self.mesh.unknowns), dtype=np.complex128)
        moments = antenna_moments(antennas, polarization)
        for number, dipole in enumerate(map(Dipole, antennas, moments)):
            field, magnetic = dipole.fields(points, self._equation.wavenumber)
            # The same combination of both conditions as in the matrix.
            jump = np.cross(triangles.normals[:, None], magnetic)
            for side, own in enumerate((field, _ELECTRIC * field + (1 - _ELECTRIC) * jump)):
                products = np.einsum("tipx,tpx->ti", currents, own)
                # An edge has its current on both of its triangles.
                np.add.at(out[side, number], self.mesh.edge_of, products)
        return out


def _entries(mesh: ClosedMesh) -> int:
    """Number of matrix elements."""
    orbits = mesh.orbits
    return len(orbits.parity) * (1 + int(orbits.unknown.max())) ** 2


def _refuse_large(mesh: ClosedMesh, parts: int, frequency_hz: float) -> None:
    planes, edges = len(mesh.mirror_axes), parts * mesh.unknowns
    most = round(MOST_UNKNOWNS * math.sqrt(2) ** planes)
    if edges > most:
        raise InputError(
            f"full-wave: at {frequency_hz / 1e9:g} GHz the mesh has {edges} edges, each "
            f"with an unknown current; with {planes} mirror planes {most} are allowed: take a "
            "lower frequency, a coarser mesh or a smaller body"
        )


# -- quadrature over one triangle, and over two that touch -----------------------------------------


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
    5.2: each part of the four-dimensional domain is a cube whose Jacobian cancels the singularity.
    """
    # Points along the four axes of a cube.
    places, weights = triangle_rule()
    x, w = np.polynomial.legendre.leggauss(order)
    x, w = (x + 1) / 2, w / 2
    cube = [axis.ravel() for axis in np.meshgrid(x, x, x, x, indexing="ij")]
    weight = np.prod(np.meshgrid(w, w, w, w, indexing="ij"), axis=0).ravel()
    # Weights are those of triangles whose areas count as 1; in these coordinates each has a half.
    touching = [
        np.concatenate(
            [_pairs(first, second, 4 * weight * jacobian) for first, second, jacobian in parts]
        )
        for parts in (_one_corner(*cube), _one_edge(*cube), _all_corners(*cube))
    ]
    # Triangles that do not touch have every point of one with every point of the other.
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
