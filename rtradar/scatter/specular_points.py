"""Specular points of ellipsoids: where they are, which of them are visible, and their second term.

**Where they are.** A solver finds where Tx sees Rx mirrored in each ellipsoid, how far away and how
strongly.

**Which are visible** is traced at keyframes 10 ms apart, and ramped between them. A part that goes
behind another fades as the edge crosses the Fresnel zone round its specular point, which takes
longer than 10 ms for a limb at 1 m/s. A jump would smear a line over all velocities, which physical
optics does not: ``validation/other_methods/occlusion.py`` measures -35 dB beside the Doppler line
for a ramp of 1.25 ms, -59 dB for this one and -60 dB for physical optics (12 GHz, 1.5 m/s). The
instant is known to 5 ms; at 4 m/s the true fade is faster than the ramp.

**The second term** of geometric optics in powers of 1/k, for conducting ellipsoids, has two parts.
One comes from the shape: the area of an ellipsoid's section at the depth z below its specular point
grows as z (1 - z / 2p), where p is the distance of the tangent plane from the centre. The other
comes from the currents, which differ where the surface bends more along the electric field than
across it. Where Tx and Rx stand apart, with i half the angle between them as the part sees them,
the first part is (1 - tan^2 i) / cos i times as large for a field across their plane, and (1 +
tan^2 i) / cos i times for a field in it: exactly so for a sphere, by the series of Mie.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.kernels.elementary import smoothstep
from rtradar.kernels.scatter.specular_point import Geometry, Options, solve
from rtradar.radar import Radar
from rtradar.scatter.common.polarization import Polarization, antenna_field, unit
from rtradar.scatter.common.poses import (
    ChirpPoses,
    KeyframeCache,
    keyframe_before,
    keyframe_step,
    keyframe_time,
)
from rtradar.system.threads import in_threads
from rtradar.trace.tracers import BodyTracer

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Bools = NDArray[np.bool_]


def solve_specular_points(
    at: Geometry | ChirpPoses,
    *,
    start: NDArray[np.float64] | None = None,
    polarization: Polarization | None = None,
    spreading: bool = True,
    points: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Path length, amplitude and specular point of every ellipsoid, as if each stood alone.

    The search begins at ``start (chirp, part, 3)``, in the ellipsoid's axes [m], NaN where nothing
    is known. Returned are the lengths |T - p| + |R - p| (chirp, rx, part) [m]; the scattering
    lengths (chirp, rx, part), over R1 R2 with ``spreading`` [m], co-polar where both antennas have
    a ``polarization``, else without regard to it; and the specular points (chirp, rx, part, 3),
    world [m], which are many, so only if ``points`` are wanted.

    Equations :eq:`specular-point`, :eq:`mirror-matrix` and :eq:`mirror-return` of the theory page,
    times :eq:`polarization`.
    """
    at = Geometry.of(at)
    shape = (*at.rx.shape[:2], at.centres.shape[1])
    length, amplitude = np.empty(shape), np.empty(shape)
    point = np.empty((*shape, 3)) if points else np.empty((0, 0, 0, 0))
    begin = np.full(at.centres.shape, np.nan) if start is None else start
    begin = np.ascontiguousarray(begin, dtype=np.float64)
    # An up of no length stands for no polarisation.
    above, horizontal = np.zeros(at.tx.shape), False
    if polarization is not None:
        above[:], horizontal = polarization.up, polarization.kind == "h"
    given = at, above, begin, Options(horizontal, spreading)
    in_threads(solve, len(at.tx), *given, length, amplitude, point)
    return length, amplitude, point


# -- visibility ------------------------------------------------------------------------------------


_KEPT_KEYFRAMES = 2048
"""Keyframes kept, 20 s: the passes that measure power and make the signal trace once."""

_PASSING = 2
"""Keyframes among these that give way to later ones: a chirp needs one on either side of it."""


class Keyframe(NamedTuple):
    """One pose: ``visible (tx, rx, part)``, and the specular points of one pair.

    These are ``start (part, 3)``, in the axes of the parts [m].
    """

    visible: NDArray[np.bool_]
    start: NDArray[np.float64]


def sees(tracer: BodyTracer, places: Array, points: Array, parts: Indices) -> Bools:
    """Whether no other part of the posed body is between places and points on some parts.

    Places and points are (..., 3), world [m], and broadcast against each other; the result and
    ``parts`` are (...).
    """
    starts, ends = np.broadcast_arrays(places, points)
    own = np.broadcast_to(parts, ends.shape[:-1])
    return tracer.sees(starts.reshape(-1, 3), ends.reshape(-1, 3), own.ravel()).reshape(own.shape)


def unobstructed(tracer: BodyTracer, tx: Array, rx: Array, points: Array) -> Bools:
    """Whether no other part of the posed body occludes either leg, (chirp, rx, part) bool.

    The legs run from ``tx (chirp, 3)`` and ``rx (chirp, rx, 3)`` to one point on each part,
    ``points (chirp, rx, part, 3)``, world [m].
    """
    given = points, np.arange(points.shape[2])
    return sees(tracer, tx[:, None, None], *given) & sees(tracer, rx[:, :, None], *given)


class SpecularVisibility:
    """Visibility of the specular points of a moving body, that of the tracer, over a capture."""

    def __init__(self, radar: Radar, body: Body, tracer: BodyTracer) -> None:
        self._radar, self._body, self._tracer = radar, body, tracer
        self._step = keyframe_step(radar)
        self._kept: KeyframeCache[int, Keyframe] = KeyframeCache(
            _KEPT_KEYFRAMES - _PASSING, _PASSING
        )

    def keyframe(self, chirp: int) -> Keyframe:
        """Trace the pose of a chirp of `Radar.gapless`, for each Tx and its Rx.

        The tracer is asked whether another part occludes either leg, from Tx and from Rx to the
        specular point of each pair. At one of these points the search at the next chirps begins.
        """
        time_s = keyframe_time(self._radar, self._body, chirp)
        radar, (centres, frames, semi_axes) = self._radar.at(time_s), self._body.at([time_s])
        # One pose of the body before every Tx, each with the Rx that are kept with it.
        self._tracer.pose(centres[0], frames[0])
        of_tx = np.zeros(radar.n_tx, dtype=np.int64)
        tx, rx = radar.tx, radar.rx[radar.rx_of_tx]
        given = np.arange(radar.n_tx), tx, rx, centres[of_tx], frames[of_tx], semi_axes
        at = ChirpPoses(*given)
        # Visibility is asked for the exact specular point of each pair of antennas.
        points = solve_specular_points(at, points=True)[2]
        start = np.einsum("pji,pj->pi", frames[0], points[0, 0] - centres[0])
        return Keyframe(unobstructed(self._tracer, tx, rx, points), start)

    def at(self, chirps: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Visibility and starting points at chirps.

        Returned are weights (chirp, rx, part), which are 1 for visible, 0 for occluded, and between
        both on the ramp between two keyframes that differ; and the specular points (chirp, part, 3)
        of one pair at the keyframe before, in the parts' axes [m].
        """
        before, rest = keyframe_before(self._radar, chirps, self._step)
        # At a keyframe the one after it does not matter.
        numbers, place = np.unique([before, before + (rest > 0)], return_inverse=True)
        kept = [
            self._kept.get(number, partial(self.keyframe, number * self._step))
            for number in numbers.tolist()
        ]
        # The keyframes before and after each chirp, for its own transmitter.
        place = place.reshape(2, -1)
        visible = np.stack([one.visible for one in kept])
        first, last = visible[place, self._radar.tx_of_chirp(chirps)]
        ramp = smoothstep(rest / self._step)[:, None, None]
        start = np.stack([one.start for one in kept])[place[0]]
        return (1 - ramp) * first + ramp * last, start


# -- the second term -------------------------------------------------------------------------------


_FADES_DEG = (90.0, 120.0)
"""Angles between Tx and Rx from which and to which the term fades. From 60 degrees to the first,
spheres of ka 10 to 40 are nearer to the series of Mie with it, in rms over the angles, for both
fields (`validation/closed_forms/sphere.py`)."""


def with_second_term(
    at: Geometry | ChirpPoses, points: Array, polarization: Polarization, wavenumber: Array
) -> NDArray[np.complex128]:
    """Return both terms over the first, for specular points (chirp, rx, part, 3), world [m].

    The result (chirp, rx, part) is a factor of scattering lengths, for exp(+j omega t), by equation
    :eq:`second-term` of the theory page; ``wavenumber`` [rad/m] is one for all, or (chirp, 1, 1).
    The factor is 1 where Tx and Rx are over 120 degrees apart, as a part sees them.
    """
    # Everything in the axes of the ellipsoids, where curvature has a simple form.
    ways = [unit(a - points) for a in (at.tx[:, None, None], at.rx[:, :, None])]
    turned = np.swapaxes(at.frames, -1, -2)[:, None]

    def in_axes(vectors: Array) -> Array:
        return np.asarray((turned @ vectors[..., None])[..., 0])

    # The gradient of x^2 / a^2 + ... is along the normal, and as long as one over the distance of
    # the tangent plane from the centre.
    inverse_squares = 1 / at.semi_axes**2
    gradient = in_axes(points - at.centres[:, None]) * inverse_squares
    # One over the distance of the tangent plane; at the centre, where there is no echo, it is 0.
    size, normal = np.linalg.norm(gradient, axis=-1), unit(gradient)
    # The direction of the electric field on the surface, and the curvatures along it and across it.
    field = in_axes(antenna_field(ways[0], polarization))
    along = unit(field - np.sum(field * normal, axis=-1, keepdims=True) * normal)
    bends = [
        np.sum(direction**2 * inverse_squares, axis=-1) / np.maximum(size, 1e-12)
        for direction in (along, np.cross(normal, along))
    ]
    # The shape's part, for a field across or in the plane of Tx and Rx.
    cosine = np.sum(in_axes(ways[0] + ways[1]) * normal, axis=-1) / 2
    # Antennas in one direction have no plane, and no need of one.
    across = in_axes(unit(np.cross(ways[0], ways[1])))
    tangent = (1 - cosine**2) / np.maximum(cosine, 1e-12) ** 2
    turned_by = 1 + tangent * (1 - 2 * np.sum(field * across, axis=-1) ** 2)
    shape = size * turned_by / np.maximum(cosine, 1e-12)
    # The term fades where Tx and Rx are too far apart for it.
    apart = np.degrees(2 * np.arccos(np.clip(cosine, 0.0, 1.0)))
    first, last = _FADES_DEG
    left = 1 - smoothstep(np.clip((apart - first) / (last - first), 0.0, 1.0))
    return np.asarray(1 + 1j * left * (shape + bends[0] - bends[1]) / (2 * wavenumber))
