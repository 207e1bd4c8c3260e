"""Physical optics of one target over facets, for antennas anywhere."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.scatter.facets import Facets, Views, Waves
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.facets.body import FacetShadows, Seen, visible_fraction
from rtradar.scatter.facets.mesh_target import mesh_scattering
from rtradar.scatter.facets.obliquity import NEAR, directions_apart, with_obliquity
from rtradar.scatter.facets.surfaces import (
    FACETS_PER_SQUARE_KA,
    LARGEST_KA,
    MAXIMUM_FACETS,
    edge_facets,
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

_FEW_FACETS = 5120
"""Least number per ellipsoid."""

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
    sent = Polarization(polarization)
    if not isinstance(solid, Ellipsoids):
        return mesh_scattering(solid, tx, rx, wavenumber, sent, variant)
    pairs = _Pairs(tx, rx, wavenumber, sent, wide=False)
    count = partial(_enough_facets, solid, facets)
    field = _block_by_block(solid, pairs, variant, count, _fields).sum(axis=1)
    return np.asarray(field * np.linalg.norm(tx, axis=1) * np.linalg.norm(rx, axis=1))


def visible_fractions(
    target: Ellipsoids,
    tx: Array,
    rx: Array,
    frequency: Array,
    polarization: Literal["v", "h"],
    variant: str,
) -> NDArray[np.complex128]:
    """Visible fraction (n, part) of each part past the others, pair by pair.

    It is the sum over the facets of a part with shadows over that without, in the forms of
    `facet_scattering` but for forward scatter: 1 in full view, 0 where a part is hidden. Facets are
    four times as many as a moving body has, by the thickest of those parts that others cut, as a
    look at few facets tells.
    """
    wavenumber = 2 * np.pi * np.asarray(frequency, dtype=np.float64) / SPEED_OF_LIGHT_MPS
    pairs = _Pairs(tx, rx, wavenumber, Polarization(polarization), wide=False)
    few = _block_by_block(target, pairs, variant, lambda *_: _FEW_FACETS, _rows)
    cut = few.any(axis=0)
    if not cut.any():
        return np.ones_like(few)

    def count(largest: float, wide: bool) -> int:
        return _for_directions(4 * edge_facets(target.semi_axes[cut], largest), wide)

    return _block_by_block(target, pairs, variant, count, _fractions)


class _Pairs(NamedTuple):
    """Antennas (n, 3) pair by pair [m], wavenumbers (n,) [rad/m], and whether all are far apart."""

    tx: Array
    rx: Array
    wavenumber: Array
    polarization: Polarization
    wide: bool

    def some(self, chosen: slice | NDArray[np.int64]) -> _Pairs:
        return self._replace(
            tx=self.tx[chosen], rx=self.rx[chosen], wavenumber=self.wavenumber[chosen]
        )


_OfBlock = Callable[[Ellipsoids, Facets, FacetShadows, _Pairs], NDArray[np.complex128]]


def _block_by_block(
    target: Ellipsoids,
    pairs: _Pairs,
    variant: str,
    count: Callable[[float, bool], int],
    of_block: _OfBlock,
) -> NDArray[np.complex128]:
    """What a function finds of each part (n, part), for pairs near each other and far apart.

    ``count(wavenumber, wide)`` is the number of facets per part that either need.
    """
    found = np.empty((len(pairs.tx), len(target.centres)), dtype=np.complex128)
    apart = _directions_apart(target, pairs.tx, pairs.rx)
    for wide in (False, True):
        some = np.flatnonzero((apart > NEAR) == wide)
        if not len(some):
            continue
        enough = count(float(pairs.wavenumber[some].max()), wide)
        surface = ellipsoid_facets(target.semi_axes, subdivisions_for(enough))
        tracer = BodyTracer(use(select(variant)), target.semi_axes)
        shadows = FacetShadows(tracer, surface, target.semi_axes)
        block = max(1, _VIEWS_AT_ONCE // (8 * len(target.centres) * len(surface.faces)))
        for first in range(0, len(some), block):
            own = some[first : first + block]
            given = pairs.some(own)._replace(wide=wide)
            found[own] = of_block(target, surface, shadows, given)
    return found


def _for_directions(enough: int, wide: bool) -> int:
    """Facets of pairs far apart: the current does not fall to nothing at the edge of the light."""
    return min(4 * enough if wide else enough, MAXIMUM_FACETS)


def _enough_facets(target: Ellipsoids, facets: int | None, wavenumber: float, wide: bool) -> int:
    """Facets per part: those asked for, or as many as the thickest part takes."""
    ka = wavenumber * float(np.median(target.semi_axes, axis=1).max())
    needed = max(_FEW_FACETS, math.ceil(FACETS_PER_SQUARE_KA * ka**2))
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
    return _for_directions(needed, wide) if facets is None else facets


def _fields(
    target: Ellipsoids, surface: Facets, shadows: FacetShadows, pairs: _Pairs
) -> NDArray[np.complex128]:
    """Fields (n, part), spreading and all, relative to the path over the origin."""
    parts = np.arange(len(target.centres))
    return _integrals(target, surface, _seen(target, shadows, pairs), pairs, parts, shadow=True)


def _rows(
    target: Ellipsoids, surface: Facets, shadows: FacetShadows, pairs: _Pairs
) -> NDArray[np.complex128]:
    """Not 0 where a part is cut or hidden (n, part)."""
    row = _seen(target, shadows, pairs).row
    return row.reshape(2, len(pairs.tx), -1).sum(axis=0).astype(np.complex128)


def _fractions(
    target: Ellipsoids, surface: Facets, shadows: FacetShadows, pairs: _Pairs
) -> NDArray[np.complex128]:
    """Visible fractions (n, part)."""
    seen = _seen(target, shadows, pairs)
    left = np.ones((len(pairs.tx), len(target.centres)), dtype=np.complex128)
    # Parts in full view need no sum.
    cut = np.flatnonzero(seen.row.any(axis=0))
    if len(cut):
        seen = seen.of(cut)
        left[:, cut] = visible_fraction(
            *(
                _integrals(target, surface, own, pairs, cut, shadow=False)
                for own in (seen, seen.unhidden())
            )
        )
    return left


def _seen(target: Ellipsoids, shadows: FacetShadows, pairs: _Pairs) -> Seen:
    """What all Tx and then all Rx of some pairs see, a row for each of them and each part."""
    tx, rx = pairs.tx, pairs.rx
    antennas, view = np.unique(np.concatenate([tx, rx]), axis=0, return_inverse=True)
    apart = float(_directions_apart(target, tx, rx).max()) if pairs.wide else 0.0
    parts = np.arange(len(target.centres))
    seen = shadows.seen(target.centres, target.frames, antennas, parts, apart=apart)
    return seen._replace(row=seen.row[view.ravel()])


def _integrals(
    target: Ellipsoids,
    surface: Facets,
    seen: Seen,
    pairs: _Pairs,
    parts: NDArray[np.int64],
    *,
    shadow: bool,
) -> NDArray[np.complex128]:
    """Sums over the facets of some parts (n, part), see `_fields` and `with_obliquity`."""
    tx, rx, wavenumber, polarization, _ = pairs
    n, frames = len(tx), target.frames[parts]
    to_antennas = np.stack([tx, rx], axis=1)[:, None] - target.centres[parts][:, None]
    to_tx, to_rx = (to_antennas[:, :, end] for end in (0, 1))
    local = np.einsum("pji,npaj->npai", frames, to_antennas)
    row = np.moveaxis(seen.row.reshape(2, n, len(parts)), 0, 2)
    ranges = np.linalg.norm(tx, axis=1), np.linalg.norm(rx, axis=1)
    carrier, k = (np.repeat(a, len(parts))[:, None] for a in (ranges[0] + ranges[1], wavenumber))
    views = Views(np.tile(parts, n), local.reshape(-1, 2, 3), row.reshape(-1, 2), seen.fraction)
    waves = Waves(np.array([[0, 1]]), carrier, k, spreading=True)
    ways = to_tx[:, :, None], to_rx[:, :, None], frames
    waves, factor = with_obliquity(waves, *ways, polarization, shadow=shadow)
    field = facet_integral(surface, views, waves).reshape(n, len(parts))
    return np.asarray(field * factor[:, :, 0])


def _directions_apart(target: Ellipsoids, tx: Array, rx: Array) -> Array:
    """Distance (n,) of the unit vectors to Tx and to Rx, 0 to 2, the largest of any part."""
    to_tx, to_rx = (antennas[:, None] - target.centres for antennas in (tx, rx))
    return np.asarray(directions_apart(to_tx, to_rx).max(axis=1))
