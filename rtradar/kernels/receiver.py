"""What a receiver does to its samples, row by row: noise, filters, converters, other radars.

Each row is computed by itself, so that how a capture is cut into blocks changes no bit.
"""

from __future__ import annotations

import math

import numpy as np

from rtradar.kernels.elementary import phasor, phasor_float32
from rtradar.kernels.jit import compiled, inlined

# Arithmetic stays in float32, and so in twice as many vector lanes, if every constant is float32.
_ONE, _TWO, _HALF, _STEP = np.float32(1), np.float32(2), np.float32(0.5), np.float32(2.0**-31)
_LN_2, _TURNS = np.float32(math.log(2)), np.float32(2.0**-32)
# The bits of sqrt(1/2) in float32, and how many of its bits hold the fraction.
_ROOT_HALF_BITS, _FRACTION_BITS, _FRACTION = np.int32(0x3F3504F3), 23, np.int32((1 << 23) - 1)
_L3, _L5, _L7, _L9 = (np.float32(2 / odd) for odd in (3, 5, 7, 9))


@compiled(fastmath={"contract"})
def add_noise(streams, rows, sigma, out):
    """Add complex normal numbers to ``out (chirp, rx, sample)``, from 64 random bits each.

    Either part has the standard deviation ``sigma``. ``streams (cycle, 4)`` are states of the
    generator SFC64 (Doty-Humphrey, PractRand), each for ``rows`` chirps, with NumPy's bits.
    The transform of Box and Muller (1958), sigma sqrt(-2 ln u) at the angle 2 pi t, needs a
    logarithm and a sine, but no branch. 31 bits make u, the middles of 2^31 equal steps, and 32
    bits t; so no number exceeds 6.66 sigma, where a true tail has one sample in 4e9.
    """
    n_samples = out.shape[2]
    # The bits of one row are drawn before any is used: the generator is serial, and what is made of
    # its bits runs in vector lanes.
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


_LANES = 32
"""Most receivers of several rows that are filtered side by side; those of one row always are."""
_UNROLLED = 4
"""Samples that are added to a state at once, because the state is stored every time."""


@compiled(fastmath={"contract"})
def turn_by_noise(phase, out):
    """Multiply ``out (chirp, rx, sample)`` by 1 + j ``phase (chirp, sample)``, both in float32."""
    for chirp in range(len(out)):
        # The phase is small: 1 + j phase stands for exp(j phase).
        small = phase[chirp]
        for receiver in range(out.shape[1]):
            own = out[chirp, receiver]
            for i in range(len(own)):
                z = own[i]
                own[i] = complex(z.real - small[i] * z.imag, z.imag + small[i] * z.real)


@compiled(fastmath={"contract"})
def add_still(tx, still, phase, fields, gain, out):
    """Add to ``out (chirp, rx, sample)`` what is still, with its phase noise, and multiply by gain.

    The terms are ``still (tx, rx, sample)``, and j times the sum over nodes of ``phase (chirp,
    node, sample)`` times ``fields (tx, rx, node, sample)``. All is multiplied by ``gain (tx, rx)``.
    """
    for chirp in range(len(tx)):
        for receiver in range(out.shape[1]):
            own, constant = out[chirp, receiver], still[tx[chirp], receiver]
            factor = gain[tx[chirp], receiver]
            # What is still, as if the oscillator had no noise.
            for i in range(len(own)):
                own[i] += constant[i]
            # To first order phase noise adds j times the phase times the field. The phase depends
            # on the delay, so each node has its own.
            for node in range(fields.shape[2]):
                small, field = phase[chirp, node], fields[tx[chirp], receiver, node]
                for i in range(len(own)):
                    own[i] += complex(-small[i] * field[i].imag, small[i] * field[i].real)
            if factor != np.complex64(1):
                for i in range(len(own)):
                    own[i] *= factor


@compiled(fastmath={"contract"})
def high_pass(corners, out):
    """Apply high-pass filters of first order to ``out (row, rx, sample)``, one after the other.

    ``corners (filter,)`` float32 are pi f_c / Fs (bilinear transform, right at low frequencies).
    The samples after the first one are taken, mirrored, as those before it, until the filter has
    settled. Receivers and rows go side by side, in vector lanes.
    """
    n_rx, n_samples = out.shape[1:]
    # The sum for the state takes several samples at once; those beyond the last have no weight.
    padded = -(-n_samples // _UNROLLED) * _UNROLLED
    together = max(1, _LANES // n_rx)
    # A filter runs from sample to sample: only receivers and rows can share vector lanes.
    n_lanes = 2 * n_rx * together
    lanes = np.zeros((padded, n_lanes), np.float32)
    pairs, state = lanes.view(np.complex64), np.empty(n_lanes, np.float32)
    weights = np.zeros((len(corners), padded), np.float32)
    # Weights of the samples in the state of each filter at the first sample.
    for number, corner in enumerate(corners):
        _settle(corner, n_samples, weights[number])
    for first in range(0, len(out), together):
        rows = out[first : first + together]
        # Put sample after sample, with the real and imaginary parts of all receivers side by side.
        for row in range(len(rows)):
            for receiver in range(n_rx):
                for i in range(n_samples):
                    pairs[i, row * n_rx + receiver] = rows[row, receiver, i]
        for number, corner in enumerate(corners):
            # y[n] = kept y[n-1] + passed (x[n] - x[n-1]); the state is kept y - passed x of the
            # last sample.
            kept, passed = (_ONE - corner) / (_ONE + corner), _ONE / (_ONE + corner)
            weight = weights[number]
            state[:] = 0
            # The state after what is mirrored before the first sample.
            for i in range(0, padded, _UNROLLED):
                for lane in range(n_lanes):
                    pair = weight[i] * lanes[i, lane] + weight[i + 1] * lanes[i + 1, lane]
                    next_pair = (
                        weight[i + 2] * lanes[i + 2, lane] + weight[i + 3] * lanes[i + 3, lane]
                    )
                    state[lane] += pair + next_pair
            # The filter itself.
            for i in range(n_samples):
                for lane in range(n_lanes):
                    new = passed * lanes[i, lane]
                    filtered = new + state[lane]
                    lanes[i, lane], state[lane] = filtered, kept * filtered - new
        # Put the filtered samples back in their rows.
        for row in range(len(rows)):
            for receiver in range(n_rx):
                for i in range(n_samples):
                    rows[row, receiver, i] = pairs[i, row * n_rx + receiver]


@inlined()
def _settle(corner, n_samples, weight):
    """Set the weights of samples in the state of a filter that has settled on them, mirrored."""
    kept, passed = (1 - float(corner)) / (1 + float(corner)), 1 / (1 + float(corner))
    # The filter settles within some of its time constants, 1 / (2 corner) samples each.
    ahead = min(n_samples - 1, int(np.float32(4) / corner) + 1)
    left = 1.0
    # A sample x adds (kept - 1) passed x to the state, and the state decays by kept from sample to
    # sample.
    for i in range(1, ahead):
        weight[i] = passed * (kept - 1) * left
        left *= kept
    # At the sample farthest ahead the output is taken as the input, less the mean of all of them.
    weight[ahead] = (kept - passed) * left
    # A slower one has taken away the mean, and nothing else.
    for i in range(ahead + 1):
        weight[i] -= kept * left / (ahead + 1)


@compiled(fastmath={"contract"})
def mirror(own, image, out):
    """Replace each z of ``out (row, rx, sample)`` by own z + image conj(z)."""
    samples = out.reshape(-1)
    for i in range(len(samples)):
        samples[i] = own * samples[i] + image * samples[i].conjugate()


@compiled(fastmath={"contract"})
def convert(dc, step, limit, out):
    """Add ``dc`` to ``out (row, rx, sample)``, round both parts to steps, and clip them.

    There are no steps if ``step`` is 0. The highest value is a step below ``limit``, the lowest its
    negative.
    """
    half, samples = np.float32(0.5), out.reshape(-1)
    for i in range(len(samples)):
        real, imaginary = samples[i].real + dc.real, samples[i].imag + dc.imag
        if step > 0:
            # To the nearest step; halves go up.
            real = step * np.floor(real / step + half)
            imaginary = step * np.floor(imaginary / step + half)
        samples[i] = complex(
            min(max(real, -limit), limit - step), min(max(imaginary, -limit), limit - step)
        )


@compiled(fastmath={"contract"})
def add_ramps(starts, frequency, tx, slope, rate, ramps, steering, out):
    """Add another radar's ramps to ``out (row, rx, sample)`` while they are in the band of the IF.

    Rows begin at ``starts (row,)`` at ``frequency (row,)`` with our ``slope``. ``ramps`` are start
    frequency and slope, duration, period and first start of the other radar's. ``steering (tx,
    rx)`` are complex amplitudes, and ``tx (row,)`` is the transmitter of each row.
    """
    other, other_slope, ramp_s, period_s, first_s = ramps
    n_samples = out.shape[2]
    for row in range(len(starts)):
        # The ramps of the other radar that are on during the row: the first may have begun before
        # it.
        since = starts[row] - first_s
        begin = max(0, int(np.floor((since - ramp_s) / period_s)))
        for number in range(begin, int(np.floor((since + n_samples / rate) / period_s)) + 1):
            # How long this ramp has been on when the row begins, then the beat frequency and the
            # other's phase [turns] at that time.
            late = since - number * period_s
            offset = frequency[row] - other - other_slope * late
            at_start = (other + other_slope / 2 * late) * late
            for i in range(n_samples):
                t = i / rate
                beat = offset + (slope - other_slope) * t
                if 0 <= late + t < ramp_s and 0 <= beat < rate:
                    # The phase of our sweep less that of the other: the mixer conjugates what is
                    # received.
                    turns = (offset + (slope - other_slope) / 2 * t) * t - at_start
                    real, imaginary = phasor(turns)
                    wave = complex(real, imaginary)
                    for receiver in range(out.shape[1]):
                        out[row, receiver, i] += steering[tx[row], receiver] * wave
