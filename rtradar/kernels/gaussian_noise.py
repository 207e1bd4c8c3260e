"""Complex Gaussian numbers from random bits, in float32 lanes."""

from __future__ import annotations

import math

import numpy as np

from rtradar.kernels.elementary import phasor_float32
from rtradar.kernels.jit import compiled

# Arithmetic stays in float32, and so in twice as many vector lanes, if every constant is float32.
_ONE, _TWO, _HALF, _STEP = np.float32(1), np.float32(2), np.float32(0.5), np.float32(2.0**-31)
_LN_2, _TURNS = np.float32(math.log(2)), np.float32(2.0**-32)
_ROOT_HALF_BITS, _FRACTION_BITS, _FRACTION = np.int32(0x3F3504F3), 23, np.int32((1 << 23) - 1)
_L3, _L5, _L7, _L9 = (np.float32(2 / odd) for odd in (3, 5, 7, 9))


@compiled(fastmath={"contract"})
def add_noise(streams, rows, sigma, out):
    """Add complex normal numbers to ``out (chirp, rx, sample)``, from 64 random bits each.

    Either part has the deviation ``sigma``. ``streams (cycle, 4)`` are states of the generator
    SFC64 (Doty-Humphrey, PractRand), each for ``rows`` chirps; it gives the same bits as NumPy's.
    The transform of Box and Muller (1958), sigma sqrt(-2 ln u) at the angle 2 pi t, needs a
    logarithm and a sine, but no branch. 31 bits make u, the middles of 2^31 equal steps, and 32
    bits t; so no number exceeds 6.66 sigma, where a true tail has one sample in 4e9.
    """
    n_samples = out.shape[2]
    for_radius, for_angle = np.empty(n_samples, dtype=np.int32), np.empty(n_samples, dtype=np.int32)
    for cycle in range(len(streams)):
        a, b, c, counter = streams[cycle]
        for chirp in range(cycle * rows, min((cycle + 1) * rows, len(out))):
            for receiver in range(out.shape[1]):
                # Draw the bits, one after the other.
                for sample in range(n_samples):
                    bits = a + b + counter
                    counter += np.uint64(1)
                    a, b = b ^ (b >> np.uint64(11)), c + (c << np.uint64(3))
                    c = ((c << np.uint64(24)) | (c >> np.uint64(40))) + bits
                    for_radius[sample] = np.int32(bits >> np.uint64(33))
                    for_angle[sample] = np.int32(np.uint32(bits))
                samples = out[chirp, receiver]
                for sample in range(n_samples):
                    # u = 2^exponent m, m from sqrt(1/2) to sqrt(2); ln m = 2 artanh((m-1) / (m+1)).
                    u = np.float32((np.float32(for_radius[sample]) + _HALF) * _STEP)
                    shifted = np.int32(np.float32(u).view(np.int32) - _ROOT_HALF_BITS)
                    m = np.int32((shifted & _FRACTION) + _ROOT_HALF_BITS).view(np.float32)
                    z = (m - _ONE) / (m + _ONE)
                    x = z * z
                    log = z * (_TWO + x * (_L3 + x * (_L5 + x * (_L7 + x * _L9))))
                    log += np.float32(np.int32(shifted >> _FRACTION_BITS)) * _LN_2
                    radius = sigma * np.sqrt(max(-_TWO * log, np.float32(0)))
                    across, up = phasor_float32(np.float32(for_angle[sample]) * _TURNS)
                    samples[sample] += complex(radius * across, radius * up)
