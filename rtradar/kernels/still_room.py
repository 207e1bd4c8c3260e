"""IF samples of a room with a moving shadow: those of keyframes, blended chirp by chirp."""

from __future__ import annotations

import numpy as np

from rtradar.kernels.jit import compiled


@compiled(fastmath={"contract"})
def add_blended(tx, weights, keyframes, whole, out):
    """Add the samples of a room to ``out (chirp, value)`` complex64.

    Of ``whole (tx, value)`` complex64 is taken off the sum over keyframes of ``weights (chirp,
    keyframe)`` float32 times ``keyframes (keyframe, tx, value)``; ``tx (chirp,)`` transmits.
    """
    for chirp in range(len(tx)):
        own, kept = out[chirp], whole[tx[chirp]]
        a, b = keyframes[0, tx[chirp]], keyframes[1, tx[chirp]]
        c, d = keyframes[2, tx[chirp]], keyframes[3, tx[chirp]]
        of_a, of_b, of_c, of_d = weights[chirp]
        for i in range(len(own)):
            own[i] += kept[i] - (of_a * a[i] + of_b * b[i] + of_c * c[i] + of_d * d[i])


def add_blended_reference(tx, weights, keyframes, whole):
    """`add_blended` to zeros."""
    return whole[tx] - np.einsum("ck,kcv->cv", weights, keyframes[:, tx])


def cubic_weights(fraction):
    """Weights (chirp, 4) of keyframes before, at, after and past an interval's ``fraction``.

    They are those of the cubic through the middle two, with the slopes of the chords beside them
    (Catmull and Rom, 1974): no keyframe makes a kink.
    """
    f = np.asarray(fraction)[:, None]
    rows = ((0, -0.5, 1, -0.5), (1, 0, -2.5, 1.5), (0, 0.5, 2, -1.5), (0, 0, -0.5, 0.5))
    return np.concatenate([a + f * (b + f * (c + f * d)) for a, b, c, d in rows], axis=1)
