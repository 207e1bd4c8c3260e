"""Physical optics of one target over facets, for antennas anywhere."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.scatter.facets import Facets, Views, Waves
from rtradar.scatter.facets.body import FacetShadows
from rtradar.scatter.facets.mesh_target import mesh_scattering
from rtradar.scatter.facets.obliquity import NEAR, directions_apart, with_obliquity
from rtradar.scatter.facets.surfaces import (
    FACETS_PER_SQUARE_KA,
    LARGEST_KA,
    MAXIMUM_FACETS,
    ellipsoid_facets,
    facet_integral,
    subdivisions_for,
)
from rtradar.scatter.target import target_mesh
from rtradar.trace.backends.backend import select, use
from rtradar.trace.body_tracer import BodyTracer

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]

_VIEWS_AT_ONCE = 2**27
"""Size of the visibility that is held at a time [bytes]."""


def facet_scattering(
    target: Ellipsoids | trimesh.Trimesh,
    tx: Array,
    rx: Array,
    frequency: Array,
    polarization: Literal["v", "h"] = "v",
    variant: str = "auto",
    facets: int | None = None,
) -> NDArray[np.complex128]:
    """Co-polar scattering length (n,) by physical optics.

    Where Tx and Rx are up to 0.15 rad apart as the target sees them it is the reciprocal form of
    :eq:`po`, of what both see, as in a radar. More than 0.25 rad apart it is that of
    :eq:`po-bistatic`: the currents on all that Tx lights radiate to Rx wherever other parts do not
    stand between, through their own part too. Of a closed mesh, what stands between is what is met
    after the way has left it. There Tx and Rx may not be exchanged. In between one fades into the
    other. For each facet it is :eq:`facet`.

    Parameters, returns and errors are those of `scattering_length`; ``facets`` is the least number
    per ellipsoid, None for 0.1 dB up to ka = 400.
    """
    wavenumber = 2 * np.pi * np.asarray(frequency, dtype=np.float64) / SPEED_OF_LIGHT_MPS
    solid = target if isinstance(target, Ellipsoids) else target_mesh(target, tx, rx)
    if not isinstance(solid, Ellipsoids) and facets is not None:
        raise InputError(
            "facets: a mesh brings its own triangles; leave facets out, or subdivide the mesh"
        )
    if not isinstance(solid, Ellipsoids):
        return mesh_scattering(solid, tx, rx, wavenumber, polarization, variant)
    field = np.empty(len(tx), dtype=np.complex128)
    apart = _directions_apart(solid, tx, rx)
    for wide in (False, True):
        some = np.flatnonzero((apart > NEAR) == wide)
        if len(some):
            pairs = _Pairs(tx[some], rx[some], wavenumber[some], polarization, wide)
            field[some] = _ellipsoids(solid, pairs, variant, facets)
    return field


class _Pairs(NamedTuple):
    """Antennas (n, 3) pair by pair [m], wavenumbers (n,) [rad/m], and whether all are far apart."""

    tx: Array
    rx: Array
    wavenumber: Array
    polarization: Literal["v", "h"]
    wide: bool

    def some(self, chosen: slice) -> _Pairs:
        return self._replace(
            tx=self.tx[chosen], rx=self.rx[chosen], wavenumber=self.wavenumber[chosen]
        )


def _ellipsoids(
    target: Ellipsoids, pairs: _Pairs, variant: str, facets: int | None
) -> NDArray[np.complex128]:
    backend = select(variant)
    enough = _enough_facets(target, float(pairs.wavenumber.max()), facets)
    if facets is None and pairs.wide:
        # The current does not fall to nothing at the edge of the lit side.
        enough = min(4 * enough, MAXIMUM_FACETS)
    surface = ellipsoid_facets(target.semi_axes, subdivisions_for(enough))
    shadows = FacetShadows(BodyTracer(use(backend), target.semi_axes), surface, target.semi_axes)
    block = max(1, _VIEWS_AT_ONCE // (8 * len(target.centres) * len(surface.faces)))
    return np.concatenate(
        [
            _block(target, surface, shadows, pairs.some(slice(first, first + block)))
            for first in range(0, len(pairs.tx), block)
        ]
    )


def _enough_facets(target: Ellipsoids, wavenumber: float, facets: int | None) -> int:
    """Facets per part: those asked for, or as many as the thickest part takes."""
    ka = wavenumber * float(np.median(target.semi_axes, axis=1).max())
    needed = max(5120, math.ceil(FACETS_PER_SQUARE_KA * ka**2))
    if facets is not None:
        subdivisions_for(facets)
    if ka > LARGEST_KA and (facets is None or facets < needed):
        cure = (
            f"set facets={needed}"
            if needed <= MAXIMUM_FACETS
            else f"more than {MAXIMUM_FACETS} are not made: take 'specular'"
        )
        raise InputError(
            f"physical optics of a part with ka = {ka:.0f}, above {LARGEST_KA:.0f}, needs {needed} "
            f"facets an ellipsoid; {cure}"
        )
    return min(needed, MAXIMUM_FACETS) if facets is None else facets


def _block(
    target: Ellipsoids, surface: Facets, shadows: FacetShadows, pairs: _Pairs
) -> NDArray[np.complex128]:
    tx, rx, wavenumber, polarization, wide = pairs
    n, parts = len(tx), np.arange(len(target.centres))
    antennas, view = np.unique(np.concatenate([tx, rx]), axis=0, return_inverse=True)
    to_antennas = np.stack([tx, rx], axis=1)[:, None] - target.centres[:, None]
    to_tx, to_rx = (to_antennas[:, :, end] for end in (0, 1))
    apart = float(_directions_apart(target, tx, rx).max()) if wide else 0.0
    seen = shadows.seen(target.centres, target.frames, antennas, parts, apart=apart)
    local = np.einsum("pji,npaj->npai", target.frames, to_antennas)
    row = np.moveaxis(seen.row[view.reshape(2, n)], (0, 1, 2), (2, 0, 1))
    ranges = np.linalg.norm(tx, axis=1), np.linalg.norm(rx, axis=1)
    carrier, k = (np.repeat(a, len(parts))[:, None] for a in (ranges[0] + ranges[1], wavenumber))
    views = Views(np.tile(parts, n), local.reshape(-1, 2, 3), row.reshape(-1, 2), seen.fraction)
    waves = Waves(np.array([[0, 1]]), carrier, k, spreading=True)
    ways = to_tx[:, :, None], to_rx[:, :, None], target.frames
    waves, factor = with_obliquity(waves, *ways, polarization, shadow=True)
    field = facet_integral(surface, views, waves).reshape(n, len(parts)) * factor[:, :, 0]
    return np.asarray(field.sum(axis=1) * ranges[0] * ranges[1])


def _directions_apart(target: Ellipsoids, tx: Array, rx: Array) -> Array:
    """Distance (n,) of the unit vectors to Tx and to Rx, 0 to 2, the largest of any part."""
    to_tx, to_rx = (antennas[:, None] - target.centres for antennas in (tx, rx))
    return np.asarray(directions_apart(to_tx, to_rx).max(axis=1))
