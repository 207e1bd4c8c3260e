"""What each way of modelling a part would leave wrong, told beforehand at little cost.

The body is looked at from the middle of the array: the specular point's return G, the far-field
cross-section's A, and the radii of curvature in closed form, and by rays the fraction V of the
Fresnel zones that others leave in view. What is true is taken to be G V; then

    analytic         |A exp(jk dL) - G V|     dL between both paths
    specular         |G (v - V)|              v whether the specular point itself is in view
    fresnel          3 % of G where an edge cuts the zones (``validation/other_methods/fresnel.py``)
    all of optics    G V / (2 k rho)          the next term of its expansion, rho the mean radius of curvature
    physical-optics  1.5 % of G V: about what its interpolation leaves (``validation/other_methods/ladder.py``)

and that of `reference` is 0, for it is what errors are held against. All of it through the patterns of the radar's antennas.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.rcs import ellipsoid_radii
from rtradar.scatter.antenna_gain import leg_gain
from rtradar.scatter.common.interpolation import array_nodes
from rtradar.scatter.common.poses import ChirpPoses
from rtradar.scatter.fresnel_zones.visible_fraction import Zones, zone_fractions
from rtradar.scatter.models.analytic import far_field_echo
from rtradar.scatter.specular_point.solver import solve_specular_points
from rtradar.trace.body_tracer import BodyTracer

WAYS = ("left-out", "analytic", "specular", "fresnel", "physical-optics", "reference")
"""Ways of modelling a part, cheapest first; the first is no echo, for parts that are hidden."""

LEFT_OUT, ANALYTIC, SPECULAR, FRESNEL, PHYSICAL_OPTICS, REFERENCE = range(len(WAYS))

_AT_AN_EDGE, _INTERPOLATED = 0.03, 0.015
_IN_VIEW = 0.99
"""Share of the power from which on a part counts as being in full view."""


class Forecast(NamedTuple):
    """Part by part at some instants, all float64.

    ``true (time, part)`` power [m^2]; ``power (time, way, part)`` that each way would give; ``wrong (time, way, part)``
    squared complex error of each way [m^2], without ``optics (time, way, part)``, what curvature adds to it; ``in_view``
    and ``hidden (time, part)`` bool: wholly, or so that neither specular point nor zones are seen.
    """

    true: NDArray[np.float64]
    power: NDArray[np.float64]
    wrong: NDArray[np.float64]
    optics: NDArray[np.float64]
    in_view: NDArray[np.bool_]
    hidden: NDArray[np.bool_]


def forecast(radar: Radar, poses: Poses, tracer: BodyTracer, *, spreading: bool = True) -> Forecast:
    """Forecast for these poses.

    Parameters
    ----------
    radar : Radar
    poses : Poses
        Poses of the body at the instants to evaluate.
    tracer : BodyTracer
        Tracer of the same body.
    spreading : bool
        Whether powers hold 1 / (R1 R2)^2.

    Returns
    -------
    Forecast
    """
    times, parts = poses.centres.shape[:2]
    wavenumber = 2 * math.pi * radar.centre_frequency_hz / SPEED_OF_LIGHT_MPS
    # Returns at the ends of the lines, for dL differs over the array.
    nodes = array_nodes(radar, 2, 2)
    pairs = len(nodes.pairs)
    tx, rx = (np.tile(nodes.antennas[nodes.pairs[:, side]], (times, 1)) for side in (0, 1))
    at = (
        tx,
        rx[:, None],
        np.repeat(poses.centres, pairs, axis=0),
        np.repeat(poses.frames, pairs, axis=0),
        poses.semi_axes,
    )
    far_length, far = far_field_echo(Geometry(*at), spreading=spreading)
    length, near, _ = solve_specular_points(
        Geometry(*at), polarization=radar.polarization, spreading=spreading
    )
    # What a tolerance is held against is what the antennas let through.
    gain = leg_gain(radar, ChirpPoses(np.zeros(len(tx), dtype=np.int64), *at))
    turned = (gain * far * np.exp(1j * wavenumber * (far_length - length))).reshape(
        times, pairs, parts
    )
    near = (gain * near).reshape(times, pairs, parts)

    share, seen, radius = _views(radar, poses, tracer, wavenumber)
    free = (near**2).mean(axis=1)
    true = free * np.abs(share) ** 2
    power = np.zeros((times, len(WAYS), parts))
    wrong, optics = np.zeros_like(power), np.zeros_like(power)
    optics[:, ANALYTIC:PHYSICAL_OPTICS] = (true / (2 * wavenumber * radius) ** 2)[:, None]
    wrong[:, LEFT_OUT] = true
    power[:, ANALYTIC] = (np.abs(turned) ** 2).mean(axis=1)
    wrong[:, ANALYTIC] = (np.abs(turned - near * share[:, None]) ** 2).mean(axis=1)
    power[:, SPECULAR] = free * seen
    wrong[:, SPECULAR] = free * np.abs(seen - share) ** 2
    power[:, FRESNEL:] = true[:, None]
    cut = np.abs(share - seen) > 1e-3
    wrong[:, FRESNEL] = free * (_AT_AN_EDGE * cut) ** 2
    wrong[:, PHYSICAL_OPTICS] = true * _INTERPOLATED**2
    in_view = np.abs(share - 1) < 1 - _IN_VIEW
    hidden = ~seen & (np.abs(share) ** 2 < 1 - _IN_VIEW)
    return Forecast(true, power, wrong, optics, in_view & seen, hidden)


def _views(
    radar: Radar, poses: Poses, tracer: BodyTracer, wavenumber: float
) -> tuple[NDArray[np.complex128], NDArray[np.bool_], NDArray[np.float64]]:
    """Look at the parts (time, part) from the middle of the array.

    Returned are V, whether the specular point is seen, and the mean radius of curvature there [m].
    """
    times, parts = poses.centres.shape[:2]
    eye = np.concatenate([radar.tx, radar.rx]).mean(axis=0)
    eyes = np.tile(eye, (times, 1))
    points = solve_specular_points(Geometry(eyes, eyes[:, None], *poses), points=True)[2][:, 0]
    sight = np.einsum("tpji,tpj->tpi", poses.frames, eye - points)
    normal = sight / np.linalg.norm(sight, axis=-1, keepdims=True)
    angles = np.arccos(np.clip(normal[..., 2], -1, 1)), np.arctan2(normal[..., 1], normal[..., 0])
    a, b, c = poses.semi_axes.T
    smaller, larger = ellipsoid_radii(a, b, c, *angles)
    # One zone a part, those of one pose after the other.
    pose, part = np.divmod(np.arange(times * parts), parts)
    here, targets = np.tile(eye, (len(part), 1)), points.reshape(-1, 3)
    seen = tracer.clear(here, targets, np.arange(len(part)), part, pose, poses)
    k = np.full(len(part), wavenumber)
    zones = Zones(here, here, targets, part, pose, here[:, None], k)
    pair = np.zeros((1, 2), dtype=np.int64)
    share = zone_fractions(tracer, zones, poses, pair, k[:, None])[:, 0, 0]
    shape = (times, parts)
    return share.reshape(shape), seen.reshape(shape), np.asarray(np.sqrt(smaller * larger))
