"""Physical optics of one target over facets, for antennas anywhere."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Ellipsoids
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.facets.body import FacetShadows
from rtradar.scatter.facets.mesh_target import mesh_scattering
from rtradar.scatter.facets.radiation import NEAR, Links, directions_apart, radiated, visible
from rtradar.scatter.facets.surfaces import (
    FACETS_PER_SQUARE_KA,
    LARGEST_KA,
    MAXIMUM_FACETS,
    edge_facets,
    subdivisions_for,
)
from rtradar.scatter.target import target_mesh
from rtradar.trace.backend import select

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
    count = partial(_enough_facets, solid, facets)
    field = _block_by_block(solid, (tx, rx, wavenumber), sent, variant, count, radiated).sum(axis=1)
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
    given = target, (tx, rx, wavenumber), Polarization(polarization), variant
    few = _block_by_block(*given, lambda *_: _FEW_FACETS, _hidden)
    cut = few.any(axis=0)
    if not cut.any():
        return np.ones_like(few)

    def count(largest: float, wide: bool) -> int:
        return _for_directions(4 * edge_facets(target.semi_axes[cut], largest), wide)

    return _block_by_block(*given, count, visible)


def _hidden(*given: Any) -> NDArray[np.bool_]:
    """Whether parts are cut or hidden (pose, part, 1, 1), for what `visible` takes."""
    seen, index = given[-2:]
    return np.asarray(seen.row[index].any(axis=1)[..., None, None])


def _block_by_block(
    target: Ellipsoids,
    pairs: tuple[Array, Array, Array],
    polarization: Polarization,
    variant: str,
    count: Callable[[float, bool], int],
    find: Callable[..., NDArray[Any]],
) -> NDArray[np.complex128]:
    """What `radiated` or `visible` finds of each part (n, part), for pairs near and far apart.

    ``pairs`` are Tx and Rx (n, 3) [m] and wavenumbers (n,) [rad/m]; ``count(wavenumber, wide)`` is
    the number of facets per part that either need.
    """
    tx, rx, wavenumber = pairs
    parts = np.arange(len(target.centres))
    found = np.empty((len(tx), len(parts)), dtype=np.complex128)
    to_tx, to_rx = (antennas[:, None] - target.centres for antennas in (tx, rx))
    apart = directions_apart(to_tx, to_rx).max(axis=1)
    for wide in (False, True):
        some = np.flatnonzero((apart > NEAR) == wide)
        if not len(some):
            continue
        enough = count(float(wavenumber[some].max()), wide)
        shadows = FacetShadows(select(variant), target.semi_axes, enough)
        facets = shadows.facets
        block = max(1, _VIEWS_AT_ONCE // (8 * len(parts) * len(facets.faces)))
        for first in range(0, len(some), block):
            own = some[first : first + block]
            ends = np.stack([tx[own], rx[own]], axis=1)
            antennas, index = np.unique(ends.reshape(-1, 3), axis=0, return_inverse=True)
            beyond = float(apart[own].max()) if wide else 0.0
            seen = shadows.seen(target.centres, target.frames, antennas, parts, apart=beyond)
            pose = tuple(
                np.repeat(array[None], len(own), axis=0)
                for array in (target.centres, target.frames)
            )
            path = np.linalg.norm(ends, axis=2).sum(axis=1)[:, None, None]
            path = np.broadcast_to(path, (len(own), 1, len(parts)))
            k = wavenumber[own, None]
            links = Links(ends, np.array([[0, 1]]), path, k, polarization, True, shadow=True)
            given = facets, parts, pose, links, seen, index.reshape(-1, 2)
            found[own] = find(*given)[..., 0, 0]
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
