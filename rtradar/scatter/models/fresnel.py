"""The echo model `fresnel`: `specular`, times the visible fractions of the Fresnel zones."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body, Ellipsoids
from rtradar.body.body import Poses
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import sweep_nodes
from rtradar.scatter.common.poses import chirp_poses, one_echo_a_part
from rtradar.scatter.double_reflections import (
    TwoBounceModel,
    check_bounces,
    double_scattering,
)
from rtradar.scatter.fresnel_zones.keyframes import ZoneFractions
from rtradar.scatter.fresnel_zones.visible_fraction import (
    SHADOW_RAYS,
    Zones,
    bounds_of,
    zone_fractions,
)
from rtradar.scatter.specular_point.solver import StartPoints, solve_specular_points
from rtradar.scatter.target import sum_of_echoes, target_geometry
from rtradar.trace.backends.backend import select, use
from rtradar.trace.body_tracer import BodyTracer

_WIDE = 0.1
"""Bandwidth over centre frequency above which fractions differ over the sweep."""


def zone_nodes(radar: Radar) -> NDArray[np.float64]:
    """Frequencies (node,) at which fractions are computed [Hz]: Chebyshev nodes over the sweep.

    What an edge diffracts takes another path than the specular point's return, and its phase
    changes against that over the sweep: one node is enough for a narrow sweep only.
    """
    return sweep_nodes(radar, 3 if radar.bandwidth_hz > _WIDE * radar.centre_frequency_hz else 1)


def fresnel_scattering(
    target: Ellipsoids,
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    frequency: NDArray[np.float64],
    polarization: Literal["v", "h"] = "v",
    variant: str = "auto",
    shadow_rays: int = SHADOW_RAYS,
    bounces: int = 1,
) -> NDArray[np.complex128]:
    """Co-polar scattering length (n,) of ellipsoids that occlude each other, pair by pair.

    Parameters, returns and errors are those of `scattering_length`; ``shadow_rays`` and ``bounces``
    are those of `Fresnel`. Equation :eq:`fresnel` of the theory page.
    """
    check_bounces("fresnel", bounces)
    pairs, parts = len(tx), len(target.semi_axes)
    at = target_geometry(target, tx, rx)
    length, amplitude, points = solve_specular_points(at, polarization=polarization, points=True)
    wavenumber = 2 * np.pi * frequency / SPEED_OF_LIGHT_MPS
    # One zone for each pair and part, pairs outermost.
    part = np.tile(np.arange(parts), pairs)
    zone_tx, zone_rx, k = (np.repeat(a, parts, axis=0) for a in (tx, rx, wavenumber))
    pose, antennas = np.zeros(len(part), dtype=np.int64), np.stack([zone_tx, zone_rx], axis=1)
    zones = Zones(zone_tx, zone_rx, points.reshape(-1, 3), part, pose, antennas, k)
    tracer = BodyTracer(use(select(variant)), target.semi_axes)
    poses = Poses(target.centres[None], target.frames[None], target.semi_axes)
    fractions = zone_fractions(tracer, zones, poses, np.array([[0, 1]]), k[:, None], shadow_rays)
    left = fractions.reshape(pairs, 1, parts)
    field = sum_of_echoes(length, amplitude * left, at, frequency)
    if bounces == 2:
        field += double_scattering(target, tx, rx, frequency, polarization, tracer)
    return field


class Fresnel(TwoBounceModel):
    """`fresnel`: echoes of `specular`, times the visible fraction of the Fresnel zones.

    Occlusion: gradual. Each node of the array is asked which corners of the zones' cells it sees,
    and where edges cross their sides, every 10 ms, and more often while an edge passes.

    Parameters
    ----------
    shadow_rays : int
        Points on each part to which rays are traced from each node of the array, 8 to 4096.
    bounces : int
        1, or 2 for reflections from part to part as well (`rtradar.scatter.double_reflections`);
        of these a path is visible or not, without its zone.

    Raises
    ------
    InputError
        Where an option is out of range.
    """

    relative_cost = 6.0
    scattering = staticmethod(fresnel_scattering)

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str = "auto",
        spreading: bool = True,
        shadow_rays: int = SHADOW_RAYS,
        bounces: int = 1,
    ) -> None:
        bounds_of(shadow_rays)  # refuses what is out of range
        check_bounces("fresnel", bounces)
        self._radar, self._body, self._spreading = radar, body, spreading
        backend = select(variant)
        self.variant: str | None = backend.kind
        self._frequency = zone_nodes(radar)
        self._starts = StartPoints(radar, body)
        tracer = BodyTracer(use(backend), body.semi_axes)
        self.fractions = ZoneFractions(
            radar, body, self._frequency, tracer, shadow_rays=shadow_rays
        )
        if bounces == 2:
            self._reflect_twice(radar, body, tracer, spreading=spreading)

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        at = chirp_poses(self._radar, self._body, chirps)
        start, fractions = self._starts.at(chirps), self.fractions.at(chirps)
        length, amplitude, _ = solve_specular_points(
            at, start=start, polarization=self._radar.polarization, spreading=self._spreading
        )
        # The amplitude of an echo is the conjugate of the scattering length.
        left = amplitude * fractions.conj()
        single = one_echo_a_part(at.tx_index, length, left, self._frequency)
        return self._with_doubles(single, chirps)
