"""What walls, body and shadows leave of many echoes, from what they leave at the ends of intervals and of lines of antennas."""

from __future__ import annotations

import numpy as np
from numba import prange

from rtradar.kernels.blends import smoothstep
from rtradar.kernels.jit import compiled


@compiled(parallel=True, fastmath={"contract"})
def weigh(
    amplitude,
    before,
    after,
    seen_before,
    seen_after,
    share,
    interval,
    line,
    tx_weight,
    rx_weight,
    out,
):
    """Fill ``out (node, chirp, rx, echo)`` complex64: amplitude times what walls, body and shadows leave of it, conjugated.

    ``before, after (interval, node, line, 2, rx_end, echo)`` complex64, at the ends of lines of antennas, go over into each
    other linearly, ``seen_before, seen_after (interval, line, 2, rx_end, echo)`` smoothly; ``share (chirp,)`` of the
    ``interval (chirp,)`` is over. ``tx_weight (chirp, 2)`` and ``rx_weight (chirp, rx, rx_end)`` are the shares that the ends of
    ``line (chirp,)`` have in each antenna.
    """
    nodes, chirps, receivers, echoes = out.shape
    ends = rx_weight.shape[2]
    for chirp in prange(chirps):
        which, own, part = interval[chirp], line[chirp], share[chirp]
        smooth = smoothstep(part)
        left = np.zeros((ends, echoes), dtype=np.float32)
        real, imaginary = np.zeros((2, nodes, ends, echoes), dtype=np.float32)
        fade = np.empty(echoes, dtype=np.float32)
        for end in range(ends):
            for side in range(2):
                old, new = (
                    np.float32(tx_weight[chirp, side] * (1 - smooth)),
                    np.float32(tx_weight[chirp, side] * smooth),
                )
                for echo in range(echoes):
                    left[end, echo] += (
                        old * seen_before[which, own, side, end, echo]
                        + new * seen_after[which, own, side, end, echo]
                    )
                old, new = (
                    np.float32(tx_weight[chirp, side] * (1 - part)),
                    np.float32(tx_weight[chirp, side] * part),
                )
                for node in range(nodes):
                    first, last = (
                        before[which, node, own, side, end],
                        after[which, node, own, side, end],
                    )
                    for echo in range(echoes):
                        real[node, end, echo] += old * first[echo].real + new * last[echo].real
                        imaginary[node, end, echo] += old * first[echo].imag + new * last[echo].imag
        for receiver in range(receivers):
            weights, bare = rx_weight[chirp, receiver], amplitude[chirp, receiver]
            fade[:] = 0
            for end in range(ends):
                weight = np.float32(weights[end])
                for echo in range(echoes):
                    fade[echo] += weight * left[end, echo]
            for echo in range(echoes):
                fade[echo] *= np.float32(bare[echo])
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
