"""Kernels of rooms: fields, amplitudes and lengths of echoes over walls; edges beside legs."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import dot, minus, plus, scaled, smoothstep, turned, with_length
from rtradar.kernels.jit import compiled, inlined

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class PathFactors(NamedTuple):
    """What walls, the body's surface and occluders leave of echoes at one end of each interval.

    ``factor (interval, node, line, tx_end, rx_end, echo)`` complex64 and ``seen (interval, line,
    tx_end, rx_end, echo)`` bool, for the ends of lines of antennas.
    """

    factor: NDArray[np.complex64]
    seen: NDArray[np.bool_]


class Blend(NamedTuple):
    """Where chirps are between keyframes and between the ends of lines of antennas.

    Each chirp has an ``interval``, the ``fraction`` of the interval that has passed, and a
    ``line``; ``tx_weight (chirp, tx_end)`` and ``rx_weight (chirp, rx, rx_end)`` are the weights of
    the ends.
    """

    interval: Indices
    fraction: Array
    line: Indices
    tx_weight: Array
    rx_weight: Array


@compiled(fastmath={"contract"})
def path_amplitudes(start, stop, bare, before, after, at, out):
    """Fill ``out (node, chirp, rx, echo)`` complex64 with amplitudes of echoes over paths.

    Chirps ``start`` to ``stop`` are filled. Amplitudes are ``bare (chirp, rx, echo)`` times the
    conjugate of what is left of the echoes, given by the `PathFactors` ``before`` and ``after``
    each interval and the `Blend` ``at``. Factors change linearly from keyframe to keyframe,
    visibility by `smoothstep`.
    """
    nodes, _, receivers, echoes = out.shape
    ends = at.rx_weight.shape[2]
    for chirp in range(start, stop):
        which, line, fraction = at.interval[chirp], at.line[chirp], at.fraction[chirp]
        smooth = smoothstep(fraction)
        # Real and imaginary parts apart, so that the loops over echoes run in vector lanes.
        left = np.zeros((ends, echoes), dtype=np.float32)
        real, imaginary = np.zeros((2, nodes, ends, echoes), dtype=np.float32)
        fade = np.empty(echoes, dtype=np.float32)
        # Interpolate over time and along the line of Tx, for each end of the lines of Rx.
        for end in range(ends):
            for side in range(at.tx_weight.shape[1]):
                weight = at.tx_weight[chirp, side]
                if weight == 0:
                    continue
                old, new = np.float32(weight * (1 - smooth)), np.float32(weight * smooth)
                first_seen = before.seen[which, line, side, end]
                last_seen = after.seen[which, line, side, end]
                for echo in range(echoes):
                    left[end, echo] += old * first_seen[echo] + new * last_seen[echo]
                old, new = np.float32(weight * (1 - fraction)), np.float32(weight * fraction)
                for node in range(nodes):
                    first = before.factor[which, node, line, side, end]
                    last = after.factor[which, node, line, side, end]
                    for echo in range(echoes):
                        real[node, end, echo] += old * first[echo].real + new * last[echo].real
                        imaginary[node, end, echo] += old * first[echo].imag + new * last[echo].imag
        for receiver in range(receivers):
            # Interpolate visibility along the line of Rx, and multiply by the bare amplitude.
            weights, own = at.rx_weight[chirp, receiver], bare[chirp, receiver]
            fade[:] = 0
            for end in range(ends):
                weight = np.float32(weights[end])
                for echo in range(echoes):
                    fade[echo] += weight * left[end, echo]
            for echo in range(echoes):
                fade[echo] *= np.float32(own[echo])
            # The factors along the line of Rx, node by node; the minus sign conjugates them.
            for node in range(nodes):
                target = out[node, chirp, receiver]
                target[:] = 0
                for end in range(ends):
                    weight = np.float32(weights[end])
                    if weight != 0:
                        re, im = real[node, end], imaginary[node, end]
                        for echo in range(echoes):
                            kept = weight * fade[echo]
                            target[echo] += complex(kept * re[echo], -kept * im[echo])


@compiled()
def received_from_conductors(start, stop, sent, received, to_tx, to_rx, out):
    """Fill ``out (node, keyframe, line, tx_end, rx_end, echo)`` with what conductors send back.

    Keyframes ``start`` to ``stop`` are filled. The field ``sent (node, keyframe, line, tx_end,
    echo, 3)`` arrives, ``received (node, keyframe, line, rx_end, echo, 3)`` is what the receiver
    would send; ``to_tx (keyframe, line, tx_end, echo, 3)`` and ``to_rx (keyframe, line, rx_end,
    echo, 3)`` are unit vectors towards where they come from. A conductor across the bisector n of
    both returns 2 (n.E) n - E; where they are opposite, n is 0.
    """
    nodes, _, lines, tx_ends, rx_ends, echoes = out.shape
    for keyframe in range(start, stop):
        for line in range(lines):
            for one in range(tx_ends):
                for other in range(rx_ends):
                    for echo in range(echoes):
                        # The bisector halves the angle between both ways, as the normal of a mirror
                        # does.
                        a, b = to_tx[keyframe, line, one, echo], to_rx[keyframe, line, other, echo]
                        normal = plus(a, b)
                        square = dot(normal, normal)
                        scale = 2 / square if square > 1e-24 else 0.0
                        for node in range(nodes):
                            e = sent[node, keyframe, line, one, echo]
                            f = received[node, keyframe, line, other, echo]
                            value = scale * dot(e, normal) * dot(f, normal) - dot(e, f)
                            out[node, keyframe, line, one, other, echo] = value


class LegAntennas(NamedTuple):
    """Images of the antennas over each leg: ``tx (leg, tx, 3)``, ``rx (leg, tx, rx, 3)`` [m]."""

    tx: Array
    rx: Array


class PartPoints(NamedTuple):
    """Points in the axes of their parts: ``local (chirp, echo, 3)`` [m], ``part (echo,)``."""

    local: Array
    part: Indices


class SlabDelays(NamedTuple):
    """Which slabs delay the columns of an echo list.

    ``echo (column,)`` is the echo of each column. ``legs (column, 2, 3)`` are its leg, its first
    passage and the one after its last, on the way out and on the way back. ``passes (passage,)``
    are the passes through a slab, ``slabs (passage, 5)`` its normal, thickness [m] and squared
    index.
    """

    echo: Indices
    legs: Indices
    passes: Indices
    slabs: Array


@inlined()
def _delay(antenna, place, first, last, delays):
    """Length that the passages on a leg add to it."""
    # A leg goes straight on through each slab, so one direction gives all angles of incidence.
    way, _ = with_length(minus(place, antenna))
    total = 0.0
    for one in range(first, last):
        slab, passes = delays.slabs[one], delays.passes[one]
        cosine = min(abs(dot(way, slab)), 1.0)
        # The passes through the slab, less the air that a transmitted wave has passed anyway.
        total += slab[3] * passes * math.sqrt(slab[4] - 1 + cosine * cosine)
        if passes % 2:
            total -= slab[3] * cosine
    return total


@inlined()
def _leg(row):
    return row[0], row[1], row[2]


@compiled()
def delayed_lengths(start, stop, antennas, tx_index, points, bodies, delays, length, out):
    """Fill ``out (chirp, rx, column)`` with path lengths and the delays of slabs [m].

    Chirps ``start`` to ``stop`` are filled. ``antennas`` are `LegAntennas`, ``tx_index (chirp,)``
    the transmitters, ``points`` the `PartPoints` towards which echoes leave the ``bodies``, which
    are `Ellipsoids`, ``delays`` `SlabDelays`, and ``length (chirp, rx, echo)`` lengths without
    slabs.
    """
    _, receivers, columns = out.shape
    for chirp in range(start, stop):
        transmitter = tx_index[chirp]
        places = np.empty((len(points.part), 3))
        for echo in range(len(points.part)):
            # Find where the ray from the part's centre through the point leaves the ellipsoid.
            part = points.part[echo]
            axes, centre = bodies.semi_axes[part], bodies.centres[chirp, part]
            frame, local = bodies.frames[chirp, part], points.local[chirp, echo]
            x, y, z = local[0] / axes[0], local[1] / axes[1], local[2] / axes[2]
            size = math.sqrt(x * x + y * y + z * z)
            # An echo without a specular point takes any place.
            scale = 1 / size if size > 0 else 0.0
            place = plus(centre, scaled(turned(frame, local), scale))
            for row in range(3):
                places[echo, row] = place[row]
        for column in range(columns):
            # Add the delays on the way out, which all receivers share, and those on the way back.
            echo = delays.echo[column]
            place = places[echo]
            leg, first, last = _leg(delays.legs[column, 0])
            more = 0.0
            if last > first:
                more = _delay(antennas.tx[leg, transmitter], place, first, last, delays)
            leg, first, last = _leg(delays.legs[column, 1])
            for receiver in range(receivers):
                whole = length[chirp, receiver, echo] + more
                if last > first:
                    antenna = antennas.rx[leg, transmitter, receiver]
                    whole += _delay(antenna, place, first, last, delays)
                out[chirp, receiver, column] = whole


class EdgeBalls(NamedTuple):
    """Edges of a mesh: a ball around all, ``centre (3,)`` and ``radius``, and one around each [m].

    ``middles (edge, 3)`` and ``radii (edge,)`` belong to the balls around each edge, and ``normals
    (edge, 2, 3)`` to the two faces that meet there.
    """

    centre: Array
    radius: float
    middles: Array
    radii: Array
    normals: Array


@inlined()
def _beside(origin, way, square, centre, reach):
    """Whether a leg comes nearer to a place than the reach."""
    there = minus(centre, origin)
    aside = minus(there, scaled(way, min(max(dot(there, way) / square, 0.0), 1.0)))
    return dot(aside, aside) < reach * reach


@compiled()
def outline_near(origins, ways, later_m, edges):
    """Find edges of the outline that a mesh has along each leg, where the leg comes near to them.

    Legs have ``origins`` and ``ways`` to their ends (leg, 3) [m], ``edges`` are `EdgeBalls`. An
    edge is near if a detour over it may lengthen the leg by less than ``later_m``. Returned are the
    numbers of legs and of edges (2, pair).
    """
    found, count = np.empty((2, 1024), dtype=np.int64), 0
    for leg in range(len(origins)):
        origin, way = origins[leg], ways[leg]
        square = dot(way, way)
        if square == 0:
            continue
        # The half width of the ellipsoid on which a detour over an edge is ``later_m`` longer.
        wide = math.sqrt(later_m * (2 * math.sqrt(square) + later_m)) / 2
        # The ball round the whole mesh rules out most legs.
        if not _beside(origin, way, square, edges.centre, edges.radius + wide):
            continue
        for edge in range(len(edges.radii)):
            # An edge is on the outline if the leg meets one of its faces from the front and the
            # other from behind.
            one, other = edges.normals[edge, 0], edges.normals[edge, 1]
            if (dot(one, way) > 0) == (dot(other, way) > 0):
                continue
            if not _beside(origin, way, square, edges.middles[edge], edges.radii[edge] + wide):
                continue
            if count == found.shape[1]:
                more = np.empty((2, 2 * count), dtype=np.int64)
                for own in range(count):  # a slice would bring in the texts of Numba's errors
                    more[0, own], more[1, own] = found[0, own], found[1, own]
                found = more
            found[0, count], found[1, count] = leg, edge
            count += 1
    return found[:, :count]
