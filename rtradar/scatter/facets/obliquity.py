"""How facets radiate from Tx to Rx: by the reciprocal form, by the currents of Tx, or between them.

The reciprocal form of physical optics is of what both antennas see, as in a radar. Where Tx and Rx
are far apart as the target sees them, the currents on all that Tx lights count. From `NEAR` to
`WIDE` the one fades into the other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import smoothstep
from rtradar.kernels.scatter.facets import Waves
from rtradar.scatter.common.polarization import Polarization, copolar, driven_currents, unit

Array = NDArray[np.float64]

NEAR, WIDE = 0.15, 0.25
"""Distances of the unit vectors to Tx and to Rx between which the forms fade into each other."""

FORWARD = 2 * np.sin(np.radians([165.0, 175.0]) / 2)
"""Distances between which the reciprocal form, which has no forward scatter, returns where a body
is not to cast its shadow on the way from Tx to Rx: clutter has that already."""


def directions_apart(to_tx: Array, to_rx: Array) -> Array:
    """Distance (...) between the unit vectors along ``to_tx`` and ``to_rx (..., 3)``, 0 to 2."""
    return np.asarray(np.linalg.norm(unit(to_tx) - unit(to_rx), axis=-1))


def with_obliquity(
    waves: Waves,
    to_tx: Array,
    to_rx: Array,
    frames: Array,
    polarization: Polarization,
    *,
    shadow: bool,
) -> tuple[Waves, Array]:
    """Return waves with the obliquities of their pairs, and the factor (pose, part, pair) left.

    ``to_tx`` and ``to_rx (pose, part, pair, 3)`` are the ways from the parts to the antennas [m],
    ``frames (pose, part, 3, 3)`` the axes of the parts. Where all antennas are near each other the
    factor is the co-polar fraction, and no currents are computed. Without ``shadow`` there is no
    scatter straight ahead. Unit vectors of polarisation are
    those at the middle of a part: of a sphere of radius a between antennas at R that leaves forward
    scatter 4 a / (3 R) too weak.
    """
    apart = directions_apart(to_tx, to_rx)
    factor = copolar(to_tx, to_rx, polarization)
    if not (apart > NEAR).any():
        return waves, factor
    fade = smoothstep(np.clip((apart - NEAR) / (WIDE - NEAR), 0.0, 1.0))[..., None]
    if not shadow:
        ahead = np.clip((apart - FORWARD[0]) / (FORWARD[1] - FORWARD[0]), 0.0, 1.0)
        fade = fade * (1 - smoothstep(ahead))[..., None]
    along, across = driven_currents(to_tx, to_rx, polarization)
    across = np.einsum("...ji,...nj->...ni", frames, across)
    parts = [fade * along[..., None], fade * across, (1 - fade) * factor[..., None]]
    currents = np.concatenate(parts, axis=-1).reshape(-1, apart.shape[-1], 5)
    return waves._replace(currents=currents), np.ones_like(factor)
