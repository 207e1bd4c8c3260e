"""What each candidate model of a part would leave wrong, and which one `auto` selects.

The error budget is estimated beforehand at little cost. The body is looked at from the middle of
the array: the specular point's return G, the far-field cross-section's A, and the radii of
curvature in closed form, and by rays the fraction V of the Fresnel zones that others leave in view.
What is true is taken to be G V; then

    analytic         |A exp(jk dL) - G V|   dL between both paths
    specular         |G (v - V)|            v whether the specular point itself is in view
    fresnel          3 % of G               where an edge cuts the zones
    all of optics    G V / (2 k rho)        next term of its expansion, rho the mean radius
    physical-optics  1.5 % of G V           what its interpolation leaves

(``validation/other_methods/fresnel.py`` and ``whole_bodies.py`` measure the third and the last),
and that of `reference` is 0, for errors are held against it. All of it through the patterns of the
radar's antennas.
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
from rtradar.scatter.common.interpolation import array_nodes
from rtradar.scatter.common.polarization import bisector, unit
from rtradar.scatter.common.poses import ChirpPoses
from rtradar.scatter.free_space_legs import leg_gain
from rtradar.scatter.fresnel_zones.visible_fraction import SHADOW_RAYS, Zones, zone_fractions
from rtradar.scatter.models.analytic import far_field_echo
from rtradar.scatter.specular_point.solver import solve_specular_points
from rtradar.system.registries import MODELS
from rtradar.trace.body_tracer import BodyTracer

CANDIDATES = ("left-out", "analytic", "specular", "fresnel", "physical-optics", "reference")
"""Candidate models of a part, cheapest first; the first is no echo, for occluded parts."""

LEFT_OUT, ANALYTIC, SPECULAR, FRESNEL, PHYSICAL_OPTICS, REFERENCE = range(len(CANDIDATES))

_AT_AN_EDGE, _INTERPOLATED = 0.03, 0.015
_IN_VIEW = 0.99
"""Fraction of the power from which on a part counts as being in full view."""


class ErrorBudget(NamedTuple):
    """Part by part at some instants, all float64.

    ``true (time, part)`` power [m^2]; ``power (time, candidate, part)`` that each would give;
    ``wrong (time, candidate, part)`` squared complex error of each [m^2], without ``optics (time,
    candidate, part)``, which curvature adds to it; ``in_view`` and ``hidden (time, part)`` bool:
    wholly, or so that neither specular point nor zones are seen.
    """

    true: NDArray[np.float64]
    power: NDArray[np.float64]
    wrong: NDArray[np.float64]
    optics: NDArray[np.float64]
    in_view: NDArray[np.bool_]
    hidden: NDArray[np.bool_]


def error_budget(
    radar: Radar,
    poses: Poses,
    tracer: BodyTracer,
    *,
    spreading: bool = True,
    shadow_rays: int = SHADOW_RAYS,
) -> ErrorBudget:
    """Estimate the errors of all candidates at some poses of the tracer's body.

    With ``spreading`` powers hold 1 / (R1 R2)^2. ``shadow_rays`` are traced to each part.
    """
    times, parts = poses.centres.shape[:2]
    wavenumber = 2 * math.pi * radar.centre_frequency_hz / SPEED_OF_LIGHT_MPS
    # Returns at the ends of the lines, for dL differs over the array.
    nodes = array_nodes(radar, 2, 2)
    pairs = len(nodes.pairs)
    tx, rx = (np.tile(nodes.antennas[nodes.pairs[:, side]], (times, 1)) for side in (0, 1))
    centres, frames = (np.repeat(array, pairs, axis=0) for array in poses[:2])
    at = Geometry(tx, rx[:, None], centres, frames, poses.semi_axes)
    far_length, far = far_field_echo(at, spreading=spreading)
    length, near, _ = solve_specular_points(
        at, polarization=radar.polarization, spreading=spreading
    )
    # A tolerance is held against what the antennas transmit and receive.
    gain = leg_gain(radar, ChirpPoses(np.zeros(len(tx), dtype=np.int64), *at))
    rotated = gain * far * np.exp(1j * wavenumber * (far_length - length))
    rotated, near = (values.reshape(times, pairs, parts) for values in (rotated, gain * near))

    fraction, seen, radius = _views(radar, poses, tracer, wavenumber, shadow_rays)
    free = (near**2).mean(axis=1)
    true = free * np.abs(fraction) ** 2
    power = np.zeros((times, len(CANDIDATES), parts))
    wrong, optics = np.zeros_like(power), np.zeros_like(power)
    optics[:, ANALYTIC:PHYSICAL_OPTICS] = (true / (2 * wavenumber * radius) ** 2)[:, None]
    wrong[:, LEFT_OUT] = true
    power[:, ANALYTIC] = (np.abs(rotated) ** 2).mean(axis=1)
    wrong[:, ANALYTIC] = (np.abs(rotated - near * fraction[:, None]) ** 2).mean(axis=1)
    power[:, SPECULAR] = free * seen
    wrong[:, SPECULAR] = free * np.abs(seen - fraction) ** 2
    power[:, FRESNEL:] = true[:, None]
    cut = np.abs(fraction - seen) > 1e-3
    wrong[:, FRESNEL] = free * (_AT_AN_EDGE * cut) ** 2
    wrong[:, PHYSICAL_OPTICS] = true * _INTERPOLATED**2
    in_view = np.abs(fraction - 1) < 1 - _IN_VIEW
    hidden = ~seen & (np.abs(fraction) ** 2 < 1 - _IN_VIEW)
    return ErrorBudget(true, power, wrong, optics, in_view & seen, hidden)


def _views(
    radar: Radar, poses: Poses, tracer: BodyTracer, wavenumber: float, shadow_rays: int
) -> tuple[NDArray[np.complex128], NDArray[np.bool_], NDArray[np.float64]]:
    """Look at the parts (time, part) from the middle of the array, or of both images of it.

    Returned are V, whether the specular point is seen, and the mean radius of curvature there [m].
    """
    times, parts = poses.centres.shape[:2]
    # Over a wall out and another back, Tx and Rx look from two places.
    eyes = [radar.tx.mean(axis=0), radar.rx.mean(axis=0)]
    if np.linalg.norm(eyes[1] - eyes[0]) < _ONE_PLACE_M:
        eyes = [np.concatenate([radar.tx, radar.rx]).mean(axis=0)]
    first, last = (np.tile(eye, (times, 1)) for eye in (eyes[0], eyes[-1]))
    points = solve_specular_points(Geometry(first, last[:, None], *poses), points=True)[2][:, 0]
    half_way = bisector(*(unit(eye - points) for eye in (eyes[0], eyes[-1])))
    normal = np.einsum("tpji,tpj->tpi", poses.frames, half_way)
    angles = np.arccos(np.clip(normal[..., 2], -1, 1)), np.arctan2(normal[..., 1], normal[..., 0])
    a, b, c = poses.semi_axes.T
    smaller, larger = ellipsoid_radii(a, b, c, *angles)
    # One zone a part, those of one pose after the other.
    pose, part = np.divmod(np.arange(times * parts), parts)
    targets, group = points.reshape(-1, 3), np.arange(len(part))
    sights = [np.tile(eye, (len(part), 1)) for eye in eyes]
    seen = np.logical_and.reduce(
        [tracer.clear(here, targets, group, part, pose, poses) for here in sights]
    )
    k = np.full(len(part), wavenumber)
    ends, antennas = (sights[0], sights[-1]), np.stack(sights, axis=1)
    zones = Zones(*ends, targets, part, pose, antennas, k)
    pair = np.array([[0, len(eyes) - 1]])
    fraction = zone_fractions(tracer, zones, poses, pair, k[:, None], shadow_rays)[:, 0, 0]
    shape = (times, parts)
    return fraction.reshape(shape), seen.reshape(shape), np.asarray(np.sqrt(smaller * larger))


_ONE_PLACE_M = 1e-6
"""Distance of two places up to which they are one: the middle of Tx and that of Rx [m]."""


# -- selection -------------------------------------------------------------------------------------

_COST = np.array([0.0, *(MODELS[name].relative_cost for name in CANDIDATES[1:])])
"""Rough cost of a part: which change to try first, where several would do."""


_SYSTEMATIC, _INTERFERING = 0.5, 0.6
"""Fractions of a tolerance on power by which the sum of all powers may be off, and the field.

A frame holds some ten independent looks at how echoes interfere, and a field that is off by a
fraction e leaves its power off by up to 1.3 e in the worst frame of a hundred
(``validation/cost/auto.py``). What curvature adds turns faster and averages out.
"""


def select_candidates(
    budget: ErrorBudget, power_fraction: float, complex_fraction: float | None
) -> NDArray[np.int64]:
    """Select a candidate, a number into `CANDIDATES`, for each part at each instant (time, part).

    All parts begin with the cheapest; as long as the whole misses the tolerance, the one change
    that mends the most for its cost is made. What a part needs at an instant it is given at the
    ones before and after, too. Tolerances are the largest error of the power of all parts together,
    over that power; and their largest rms complex error over the root of it, None if it does not
    matter.
    """
    chosen = np.where(budget.hidden, LEFT_OUT, ANALYTIC)
    whole = budget.true.sum(axis=1)
    excess = budget.power - budget.true[:, None]

    def refine() -> None:
        # What mends one tolerance may break another: until nothing changes, and choices only rise.
        before = np.full_like(chosen, -1)
        while not np.array_equal(chosen, before):
            before[:] = chosen
            if complex_fraction is not None:
                _raise(chosen, budget.wrong + budget.optics, complex_fraction**2 * whole)
            _raise(chosen, budget.wrong, (_INTERFERING * power_fraction) ** 2 * whole)
            _raise(chosen, excess, _SYSTEMATIC * power_fraction * whole)
            # Facets, once meshed and traced for one part, serve all.
            by_facets = np.flatnonzero((chosen >= PHYSICAL_OPTICS).any(axis=1))
            chosen[by_facets] = np.where(
                chosen[by_facets] == FRESNEL, PHYSICAL_OPTICS, chosen[by_facets]
            )

    refine()
    padded = np.pad(chosen, ((1, 1), (0, 0)), mode="edge")
    chosen = np.maximum(np.maximum(padded[:-2], padded[2:]), chosen)
    refine()
    return chosen


def _raise(
    chosen: NDArray[np.int64], error: NDArray[np.float64], allowed: NDArray[np.float64]
) -> None:
    """Raise choices until errors (time, candidate, part) add up to at most ``allowed (time,)``."""
    parts = error.shape[2]
    while True:
        current = np.take_along_axis(error, chosen[:, None], axis=1)
        total = current.sum(axis=(1, 2))
        missed = np.flatnonzero(np.abs(total) > allowed)
        if not len(missed):
            return
        after = total[missed, None, None] - current[missed] + error[missed]
        gain = np.abs(total[missed])[:, None, None] - np.abs(after)
        dearer = _COST[:, None] - _COST[chosen[missed]][:, None]
        # More than is allowed need not be mended.
        gain = np.minimum(gain, (np.abs(total[missed]) - allowed[missed])[:, None, None])
        worth = np.where(
            (dearer > 0) & (gain > 0), gain / np.maximum(dearer, 1e-9), -np.inf
        ).reshape(len(missed), -1)
        best = worth.argmax(axis=1)
        possible = worth[np.arange(len(missed)), best] > -np.inf
        if not possible.any():
            return
        candidate, part = np.divmod(best[possible], parts)
        chosen[missed[possible], part] = candidate
