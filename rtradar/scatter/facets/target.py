"""Physical optics of one target over facets, for `scattering_length`: of ellipsoids, and of any triangle mesh."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.scatter.common.polarization import copolar
from rtradar.scatter.facets.integral import facet_integral
from rtradar.scatter.facets.mesh import mesh_scattering
from rtradar.scatter.facets.shadows import FacetShadows
from rtradar.scatter.facets.surfaces import (
    MAXIMUM_FACETS,
    Facets,
    ellipsoid_facets,
    subdivisions_for,
)
from rtradar.scatter.target_mesh import target_mesh
from rtradar.trace.backends.backend import select, use
from rtradar.trace.facet_visibility import FacetTracer

if TYPE_CHECKING:
    import trimesh

LARGEST_KA = 400.0
"""Up to here facets for 0.1 dB are chosen unasked; above, whoever asks has to ask for them."""

_FACETS_A_SQUARE_KA = 6.0
"""Facets of a sphere, over (ka)^2, that keep it within 0.07 dB of the closed form: its terminator is what takes them."""

_VIEWS_AT_ONCE = 2**27
"""Bytes of visibility held at a time."""


def facet_scattering(
    target: Ellipsoids | trimesh.Trimesh,
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    frequency: NDArray[np.float64],
    polarization: Literal["v", "h"] = "v",
    variant: str = "auto",
    facets: int | None = None,
) -> NDArray[np.complex128]:
    """Co-polar scattering length by physical optics over facets that neither antenna sees hidden.

    Parameters
    ----------
    target : Ellipsoids or trimesh.Trimesh
        An open mesh is a thin sheet, lit from both sides.
    tx, rx : (n, 3) float64
        [m].
    frequency : (n,) float64
        [Hz].
    polarization : {"v", "h"}
        Co-polar, v along world z.
    variant : {"auto", "cpu", "llvm", "scalar", "cuda"}
        Mitsuba's backend.
    facets : int, optional
        Least number per ellipsoid; None: enough for 0.1 dB, up to ka = 400. A mesh brings its own.

    Returns
    -------
    (n,) complex128
        [m], times |tx| |rx|, phase relative to the path over the origin; 0 where nothing is lit.

    Raises
    ------
    InputError
        Where ka is above 400 and facets are too few, ``facets`` does not fit the target, or a mesh cannot be used.
    BackendError
        Where no backend of that kind works here.

    Notes
    -----
    Equations :eq:`po` and :eq:`facet` of the theory page.
    """
    wavenumber = 2 * np.pi * np.asarray(frequency, dtype=np.float64) / SPEED_OF_LIGHT_MPS
    solid = target if isinstance(target, Ellipsoids) else target_mesh(target, tx, rx)
    if not isinstance(solid, Ellipsoids) and facets is not None:
        raise InputError(
            "facets: a mesh brings its own triangles; leave facets out, or subdivide the mesh"
        )
    if len(tx) == 0:
        return np.zeros(0, dtype=np.complex128)
    if not isinstance(solid, Ellipsoids):
        return mesh_scattering(solid, tx, rx, wavenumber, polarization, variant)
    backend = select(variant)
    surface = ellipsoid_facets(
        solid.semi_axes, subdivisions_for(_enough_facets(solid, float(wavenumber.max()), facets))
    )
    shadows = FacetShadows(FacetTracer(use(backend), solid.semi_axes), surface, solid.semi_axes)
    field = np.empty(len(tx), dtype=np.complex128)
    parts = len(solid.centres)
    block = max(1, _VIEWS_AT_ONCE // (8 * parts * len(surface.faces)))
    for first in range(0, len(tx), block):
        some = slice(first, first + block)
        field[some] = _ellipsoids(
            solid, surface, shadows, tx[some], rx[some], wavenumber[some], polarization
        )
    return field


def _enough_facets(target: Ellipsoids, wavenumber: float, facets: int | None) -> int:
    """Facets per part: those asked for, or as many as the thickest part takes."""
    ka = wavenumber * float(np.median(target.semi_axes, axis=1).max())
    needed = max(5120, math.ceil(_FACETS_A_SQUARE_KA * ka**2))
    if facets is not None:
        subdivisions_for(facets)
    if ka > LARGEST_KA and (facets is None or facets < needed):
        cure = (
            f"set facets={needed}"
            if needed <= MAXIMUM_FACETS
            else f"more than {MAXIMUM_FACETS} are not made: take 'specular'"
        )
        raise InputError(
            f"physical optics of a part with ka = {ka:.0f}, above {LARGEST_KA:.0f}, needs {needed} facets an ellipsoid; {cure}"
        )
    return min(needed, MAXIMUM_FACETS) if facets is None else facets


def _ellipsoids(
    target: Ellipsoids,
    surface: Facets,
    shadows: FacetShadows,
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    wavenumber: NDArray[np.float64],
    polarization: Literal["v", "h"],
) -> NDArray[np.complex128]:
    n, parts = len(tx), np.arange(len(target.centres))
    antennas, view = np.unique(np.concatenate([tx, rx]), axis=0, return_inverse=True)
    seen = shadows.shares(target.centres, target.frames, antennas, parts)
    to_antennas = np.stack([tx, rx], axis=1)[:, None] - target.centres[:, None]
    local = np.einsum("pji,npaj->npai", target.frames, to_antennas)
    row = np.moveaxis(seen.row[view.reshape(2, n)], (0, 1, 2), (2, 0, 1))
    path = np.linalg.norm(tx, axis=1) + np.linalg.norm(rx, axis=1)
    field = facet_integral(
        surface,
        np.tile(parts, n),
        local.reshape(-1, 2, 3),
        row.reshape(-1, 2),
        seen.share,
        np.array([[0, 1]]),
        np.repeat(path, len(parts))[:, None],
        np.repeat(wavenumber, len(parts))[:, None],
    )
    share = copolar(to_antennas[:, :, 0], to_antennas[:, :, 1], polarization)
    spread = np.linalg.norm(tx, axis=1) * np.linalg.norm(rx, axis=1)
    return np.asarray((field.reshape(n, len(parts)) * share).sum(axis=1) * spread)
