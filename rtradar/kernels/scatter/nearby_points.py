"""Echoes over specular points that are nearly known, by one or two steps of Newton's method.

Each wall adds an echo from each part of the body. To search for the specular points of all these
echoes would cost more than all the rest of a run. But between keyframes a specular point wanders
little on its part. So the steps start where it is expected, and lead to the point for the middle of
the line of receivers. The path is stationary there: with the second-order term of each receiver,
-1/2 g H^-1 g with the slope g on the tangent plane, an error of third order is left, below 1 um.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import dot, minus, plus, turned, turned_back
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.specular_point import (
    ROOT_PI,
    Array,
    Options,
    Plane,
    leg,
    look,
    moved,
    newton,
    on_surface,
    search_all,
)

_NEARBY_STEPS = 6
_SMALL_STEP = 0.003
"""Last step over the least semi-axis: from there each receiver corrects its length itself."""

_LEFT_OUT_M = 1e-6
"""Largest error of a length after the correction by its second-order term [m]."""


class Ellipsoids(NamedTuple):
    """Ellipsoids chirp by chirp, as in `Geometry`."""

    centres: Array
    frames: Array
    semi_axes: Array


class Images(NamedTuple):
    """Antennas as the body sees them over each leg, and what each echo goes over.

    ``tx (leg, tx, 3)``, ``rx (leg, tx, 3, rx)`` of the receivers kept with a transmitter, and
    ``middle (leg, tx, 3)`` of these [m]; ``out, back, part (echo,)`` int64 are the legs to and from
    a part of the body.
    """

    tx: Array
    rx: Array
    middle: Array
    out: NDArray[np.int64]
    back: NDArray[np.int64]
    part: NDArray[np.int64]


@inlined()
def _plane_in_world(plane, frame):
    normal, e, f = plane.normal, plane.e, plane.f
    return Plane(turned(frame, normal), turned(frame, e), turned(frame, f), plane.curvature)


@inlined()
def _settle(tx, rx, axes, start):
    """Take Newton's steps from near the specular point, all in the part's axes.

    Returned are whether they settled on the side that Tx sees, the point, its tangent plane, and
    the leg to Tx.
    """
    inverse_squares = (1 / axes[0] ** 2, 1 / axes[1] ** 2, 1 / axes[2] ** 2)
    least = min(axes[0], min(axes[1], axes[2]))
    # The expected point need not lie on the surface.
    x, y, z = on_surface(start[0], start[1], start[2], inverse_squares)
    settled = False
    for _ in range(_NEARBY_STEPS):
        # Take Newton's steps while they lead to a minimum on the lit side and are not absurdly
        # long.
        plane, out, back, step = look(x, y, z, tx, rx, inverse_squares)
        size = math.sqrt(step.e * step.e + step.f * step.f)
        if not (out.facing + back.facing > 0 and step.determinant > 0 and size < 10 * least):
            break
        # What is left of the step is small enough for the second-order term of each receiver.
        settled = size < _SMALL_STEP * least
        if settled:
            break
        x, y, z = moved(x, y, z, plane, step, inverse_squares)
    return settled and out.facing > 0, (x, y, z), plane, out


@inlined(fastmath={"contract"})
def _correct(rx, point, plane, out, least, room):
    """Lengths and returns for receivers ``rx (3, rx)`` beside the one whose specular point this is.

    The path is stationary there: with its second-order term, -1/2 g H^-1 g with the slope g on the
    tangent plane, an error of third order is left. ``room (4, rx)`` is filled, with lengths and
    returns first. Returned is whether all receivers see the point and are near enough.
    """
    # Without branches, so that the receivers run in vector lanes.
    for i in range(rx.shape[1]):
        back = leg(rx[0, i] - point[0], rx[1, i] - point[1], rx[2, i] - point[2], plane)
        # The step of this receiver gives its own second-order term.
        step = newton(plane, out, back)
        room[0, i] = out.distance + back.distance - step.drop
        ranges = out.distance * back.distance
        room[1, i] = ROOT_PI * (out.facing + back.facing) / (math.sqrt(step.determinant) * ranges)
        # What is left out is about a third of twice this drop, times the step over the radius of
        # curvature.
        room[2, i] = 4 * step.drop * step.drop * (step.e * step.e + step.f * step.f)
        room[3, i] = min(back.facing, step.determinant)
    good = True
    for i in range(rx.shape[1]):
        good &= room[3, i] > 0 and room[2, i] < (3 * _LEFT_OUT_M * least) ** 2
    return good


@compiled()
def nearby_echoes(start, stop, images, tx_index, ellipsoids, near, length, amplitude):
    """Lengths and returns of echoes, by one or two steps from near their specular points.

    Chirps ``start`` to ``stop`` are computed. Filled are ``length`` and ``amplitude (chirp, rx,
    echo)``: path lengths, and the returns of a perfect conductor over R1 R2 without regard to
    polarisation [m]. ``tx_index (chirp,)`` is the transmitter of each chirp, ``near (chirp, echo,
    3)`` are expected specular points, in the axes of the parts [m], which need not lie on the
    surface. Echoes that have 0 there get the path over the part's centre and no return. Returned is
    the number of echoes, over all chirps, that had to be searched for as by `solve`, because the
    steps did not settle on the side that both antennas see, or lengths could be off by 1 um. That
    happens near forward scattering, where a small step of an antenna moves the specular point far.
    """
    # Unpacked here, as in `solve`.
    images_tx, images_rx, images_middle, out_leg, back_leg, part_of = images
    centres, frames, semi_axes = ellipsoids
    _, receivers, echoes = length.shape
    searched = 0
    for chirp in range(start, stop):
        room, one, guess = np.empty((6, receivers)), np.empty(5), np.empty(3)
        local = np.empty((3, receivers))
        transmitter = tx_index[chirp]
        for echo in range(echoes):
            part = part_of[echo]
            axes, frame = semi_axes[part], frames[chirp, part]
            centre = centres[chirp, part]
            # The images of the antennas over the legs of this echo, in the axes of the part.
            rx = images_rx[back_leg[echo], transmitter]
            tx = turned_back(frame, minus(images_tx[out_leg[echo], transmitter], centre))
            middle = turned_back(frame, minus(images_middle[back_leg[echo], transmitter], centre))
            for k in range(3):
                guess[k] = near[chirp, echo, k]
            # Nothing is expected: the path over the centre, without a return.
            if guess[0] == 0 and guess[1] == 0 and guess[2] == 0:
                over_centre = math.sqrt(dot(tx, tx)) + math.sqrt(dot(middle, middle))
                for i in range(receivers):
                    length[chirp, i, echo], amplitude[chirp, i, echo] = over_centre, 0.0
                continue
            # Find the point for the middle of the receivers, and correct it for each of them.
            good, point, plane, out = _settle(tx, middle, axes, guess)
            place = plus(turned(frame, point), centre)
            least = min(axes[0], min(axes[1], axes[2]))
            good &= _correct(rx, place, _plane_in_world(plane, frame), out, least, room)
            if not good:
                # Search for each receiver, from cold.
                searched += 1
                guess[:] = math.nan
                for i in range(receivers):
                    antenna = turned_back(frame, minus(rx[:, i], centre))
                    local[0, i], local[1, i], local[2, i] = antenna
                options, up = Options(False, True), (0.0, 0.0, 0.0)
                search_all(tx, local, axes, up, options, guess, one, room)
            for i in range(receivers):
                length[chirp, i, echo], amplitude[chirp, i, echo] = room[0, i], room[1, i]
    return searched
