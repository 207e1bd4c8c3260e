"""Cubics through an envelope that is known at some places of each interval between keyframes."""

from __future__ import annotations

import numpy as np

from rtradar.kernels.elementary import hermite_weights
from rtradar.kernels.jit import compiled, inlined


@inlined()
def stretch(known, place):
    """The known places (place,) on either side of one between the first and the last."""
    left = min(int(place), len(known) - 2)
    right = left + 1
    while not known[left]:
        left -= 1
    while not known[right]:
        right += 1
    return left, right


@compiled()
def fill_envelope(chirps, fraction, tx, weights, course, strength, amplitude):
    """Fill the amplitude (node, chirp, rx, part) at chirps, given by the fraction of the interval.

    ``tx (chirp,)`` and ``weights (tx, rx, pair)`` say what receivers take of each pair of nodes;
    ``course`` is the ratio and its slope (place, node, pair, part), and where it is known (place,
    part); ``strength (chirp, rx, part)`` multiplies it.
    """
    ratio, slope, known = course
    nodes, pairs, parts = ratio.shape[1:]
    receivers = weights.shape[1]
    for i in range(len(chirps)):
        # Weights of the cubic of each part.
        chirp, place = chirps[i], fraction[i] * (len(ratio) - 1)
        ends, cubic = np.empty((2, parts), dtype=np.int64), np.empty((4, parts))
        for part in range(parts):
            left, right = stretch(known[:, part], place)
            ends[0, part], ends[1, part] = left, right
            cubic[0, part], cubic[1, part], cubic[2, part], cubic[3, part] = hermite_weights(
                (place - left) / (right - left), right - left
            )
        own = weights[tx[chirp]]
        value = np.empty(parts, dtype=np.complex128)
        amplitude[:, chirp] = 0
        for pair in range(pairs):
            # Where nodes are at antennas a transmitter needs but a few of the pairs.
            used = False
            for receiver in range(receivers):
                used |= own[receiver, pair] != 0
            if not used:
                continue
            # Each pair's value, added to the receivers.
            for node in range(nodes):
                for part in range(parts):
                    left, right = ends[0, part], ends[1, part]
                    value[part] = (
                        cubic[0, part] * ratio[left, node, pair, part]
                        + cubic[1, part] * ratio[right, node, pair, part]
                        + cubic[2, part] * slope[left, node, pair, part]
                        + cubic[3, part] * slope[right, node, pair, part]
                    )
                for receiver in range(receivers):
                    weight, out = own[receiver, pair], amplitude[node, chirp, receiver]
                    for part in range(parts):
                        out[part] += weight * value[part] * strength[chirp, receiver, part]
