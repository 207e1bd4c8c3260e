"""What a receiver does to its samples."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.signal import lfilter

from references.cases import Pair, filled, kernel_case, samples
from rtradar.kernels.receiver import (
    add_ramps,
    add_still,
    convert,
    high_pass,
    mirror,
    turn_by_noise,
)

# Neither rows, receivers nor samples fill the last vector.
_SHAPE = ROWS, _, SAMPLES = 21, 3, 141


def _in_place(kernel: Callable[..., None], reference: Callable[..., Any], *given: Any) -> Pair:
    before = samples(*_SHAPE, seed=1)
    after = before.copy()
    kernel(*given, after)
    return after, reference(*given, before)


def turn_by_noise_reference(phase, given):
    """`turn_by_noise` of what is given."""
    return given * (1 + 1j * phase[:, None])


@kernel_case(turn_by_noise, 2e-7)
def _turn_by_noise() -> Pair:
    phase = np.random.default_rng(0).normal(0, 0.1, (ROWS, SAMPLES)).astype(np.float32)
    return _in_place(turn_by_noise, turn_by_noise_reference, phase)


def add_still_reference(tx, still, phase, fields, gain, given):
    """`add_still` to what is given."""
    noise = 1j * np.einsum("cpn,crpn->crn", phase, fields[tx])
    return gain[tx][:, :, None] * (given + still[tx] + noise)


@kernel_case(add_still, 5e-7)
def _add_still() -> Pair:
    phase = np.random.default_rng(0).normal(0, 0.1, (ROWS, 2, SAMPLES)).astype(np.float32)
    still, fields = samples(12, 3, SAMPLES, seed=1), samples(12, 3, 2, SAMPLES, seed=1)
    given = np.arange(ROWS) % 12, still, phase, fields, samples(12, 3, seed=1)
    return _in_place(add_still, add_still_reference, *given)


def mirror_reference(own, image, given):
    """`mirror` of what is given."""
    return own * given + image * given.conj()


@kernel_case(mirror, 2e-7)
def _mirror() -> Pair:
    given = np.complex64(1.01 + 0.02j), np.complex64(0.03 - 0.01j)
    return _in_place(mirror, mirror_reference, *given)


def high_pass_reference(corners, given):
    """`high_pass` of what is given, by SciPy's filter."""

    samples = given.astype(np.complex128)
    for corner in corners:
        ahead = min(given.shape[2] - 1, int(4 / corner) + 1)
        longer = np.concatenate([samples[..., ahead:0:-1], samples], axis=-1)
        ratio = np.array([1, -1]) / (1 + corner), np.array([1, -(1 - corner) / (1 + corner)])
        start = longer[..., :1] - longer[..., : ahead + 1].mean(axis=-1, keepdims=True)
        filtered, _ = lfilter(*ratio, longer - longer[..., :1], axis=-1, zi=start)
        samples = filtered[..., ahead:]
    return samples


@kernel_case(high_pass, 2e-6)
def _high_pass() -> Pair:
    return _in_place(high_pass, high_pass_reference, np.array([0.05, 0.2], np.float32))


def convert_reference(dc, step, limit, given):
    """`convert` of what is given."""
    parts = np.stack([(given + dc).real, (given + dc).imag])
    if step > 0:
        parts = step * np.floor(parts / step + 0.5)
    parts = np.clip(parts, -limit, limit - step)
    return parts[0] + 1j * parts[1]


@kernel_case(convert, 0)
def _convert() -> Pair:
    # A power of two, so that steps are the same numbers in both.
    given = np.complex64(0.25 - 0.125j), np.float32(2.0**-4), np.float32(2)
    return _in_place(convert, convert_reference, *given)


def add_ramps_reference(starts, frequency, tx, slope, rate, ramps, steering, shape):
    """`add_ramps` to zeros, for ramps that do not overlap."""
    other, other_slope, ramp_s, period_s, first_s = ramps
    t = np.arange(shape[2]) / rate
    since = starts[:, None] + t - first_s
    late = since - np.floor(since / period_s) * period_s
    theirs = other * late + other_slope / 2 * late**2
    beat = frequency[:, None] + slope * t - other - other_slope * late
    inside = (since >= 0) & (late < ramp_s) & (beat >= 0) & (beat < rate)
    turns = frequency[:, None] * t + slope / 2 * t**2 - theirs
    return (inside * np.exp(2j * np.pi * turns))[:, None] * steering[tx][:, :, None]


@kernel_case(add_ramps, 1e-5)
def _add_ramps() -> Pair:
    starts, tx = np.arange(48) * 62.5e-6, np.arange(48) % 12
    ramps = 12e9, 1.1e14, 30e-6, 40.7e-6, 1e-5
    given = starts, np.full(48, 12e9), tx, 6.4e13, 4.096e6, ramps, samples(12, 3, seed=1)
    out = (np.empty((48, 3, 256), np.complex64),)
    return filled(add_ramps, *given, out=out, adds=True), add_ramps_reference(*given, out[0].shape)
