"""Which parts of a moving body stand before which others, for any antenna: rays to the Fresnel zones of each, traced."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.radar import Radar
from rtradar.scatter.common.array_interpolation import array_nodes
from rtradar.scatter.fresnel_zones.grid import zone_rays
from rtradar.scatter.specular_point.solver import mirror
from rtradar.trace.body_tracer import BodyTracer

TX_NODES, RX_NODES = 6, 3
"""Antennas along a line of Tx and of Rx at which shares are known."""


def hiding_parts(
    tracer: BodyTracer,
    antennas: NDArray[np.float64],
    rays: NDArray[np.float64],
    part: NDArray[np.int64],
    parts: int,
) -> NDArray[np.bool_]:
    """Which parts of the posed body are met before points of other parts.

    Parameters
    ----------
    tracer : BodyTracer
        Posed.
    antennas : (zone, antenna, 3) float64
        From where rays go [m].
    rays : (zone, ray, 3) float64
        Where they go to [m].
    part : (zone,) int64
        On which part that is.
    parts : int
        How many the body has.

    Returns
    -------
    (zone, part) bool
    """
    shape = (rays.shape[0], antennas.shape[1], rays.shape[1], 3)
    origins = np.broadcast_to(antennas[:, :, None], shape).reshape(-1, 3)
    targets = np.broadcast_to(rays[:, None], shape).reshape(-1, 3)
    hits = tracer.first_hits(origins, targets)
    zone = np.repeat(np.arange(shape[0]), shape[1] * shape[2])
    # The part's own mesh may miss the ray at its rim, or lie a hair behind the point: only others can hide it.
    hidden = (
        (hits.part >= 0)
        & (hits.part != part[zone])
        & (hits.distance < np.linalg.norm(targets - origins, axis=1) * (1 - 1e-7))
    )
    found = np.zeros((shape[0], parts), dtype=bool)
    found[zone[hidden], hits.part[hidden]] = True
    return found


class TracedHiders:
    """Which parts rays from any antenna meet before those of others.

    Parameters
    ----------
    radar : Radar
    body : Body
    tracer : BodyTracer
        Tracer of the same body.
    shadow_rays : int
        Points on each part that are traced.
    """

    def __init__(self, radar: Radar, body: Body, tracer: BodyTracer, shadow_rays: int) -> None:
        self._radar, self._body, self._tracer, self._shadow_rays = radar, body, tracer, shadow_rays
        self._antennas = array_nodes(radar, TX_NODES, RX_NODES).antennas

    def __call__(self, time: float) -> NDArray[np.bool_]:
        """At one time [s]: (part, part), hidden first."""
        centres, frames, semi_axes = self._body.at(np.array([time]))
        self._tracer.pose(centres[0], frames[0])
        parts = np.arange(len(semi_axes))
        tx, rx, points, k = middle_zones(self._radar, centres, frames, semi_axes)
        rays = zone_rays(
            tx, rx, centres[0], frames[0], semi_axes, points[:, 0], k, self._shadow_rays
        )
        antennas = np.broadcast_to(self._antennas, (len(parts), *self._antennas.shape))
        return hiding_parts(self._tracer, antennas, rays, parts, len(parts))


def middle_zones(
    radar: Radar,
    centres: NDArray[np.float64],
    frames: NDArray[np.float64],
    semi_axes: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Of every part: the middle of the array twice (part, 3), specular points (part, time, 3), wavenumber (part,)."""
    times, parts = centres.shape[:2]
    tx, rx = radar.tx.mean(axis=0), radar.rx.mean(axis=0)
    _, _, points = mirror(
        np.tile(tx, (times, 1)), np.tile(rx, (times, 1, 1)), centres, frames, semi_axes, points=True
    )
    k = np.full(parts, 2 * np.pi * radar.centre_frequency_hz / SPEED_OF_LIGHT_MPS)
    return np.tile(tx, (parts, 1)), np.tile(rx, (parts, 1)), np.moveaxis(points[:, 0], 0, 1), k
