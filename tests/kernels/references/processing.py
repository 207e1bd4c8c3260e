"""Expected echoes, Doppler spectra and angles."""

from __future__ import annotations

import numpy as np
import scipy.fft

from references.cases import Pair, filled, kernel_case, samples
from rtradar.kernels.cells import (
    EchoesAtInstants,
    Steering,
    add_interpolated,
    beam_power,
    fields_in_bins,
    follow_echoes,
    highest_maxima,
)

# -- expected echoes -------------------------------------------------------------------------------


def follow_echoes_reference(first, cycles, looks, turns_per_m, steps_per_m):
    """Steps and fields of `follow_echoes` for some cycles, by NumPy."""
    at, cycle_s, range_m, rate_mps, power_m2 = looks
    cycle = first + np.arange(cycles)[:, None]
    before = np.clip(np.searchsorted(at, cycle[:, 0], side="right"), 1, len(at) - 1) - 1
    apart = np.maximum(np.diff(at), 1)[before, None]
    t, apart_s = (cycle - at[before, None]) / apart, apart * cycle_s
    p0, p1 = power_m2[before], power_m2[before + 1]
    (r0, r1), (v0, v1) = ((own[before], own[before + 1]) for own in (range_m, rate_mps))
    q0, u0 = np.where(p0 == 0, (r1 - apart_s * v1, v1), (r0, v0))
    q1, u1 = np.where(p1 == 0, (r0 + apart_s * v0, v0), (r1, v1))
    place = q0 * (1 + 2 * t) * (1 - t) ** 2 + apart_s * u0 * t * (1 - t) ** 2
    place += q1 * t**2 * (3 - 2 * t) + apart_s * u1 * t**2 * (t - 1)
    fields = np.sqrt((1 - t) * p0 + t * p1) * np.exp(2j * np.pi * turns_per_m * place)
    return np.rint(steps_per_m * place), fields


@kernel_case(follow_echoes, 1e-6)
def _follow() -> Pair:
    rng, shape = np.random.default_rng(0), (9, 63)
    power = rng.random(shape) * (rng.random(shape) > 0.2)  # some are not seen
    looks = EchoesAtInstants(
        np.arange(9) * 17 + 3, 7.5e-4, 2 + rng.random(shape), rng.normal(size=shape), power
    )
    out = np.empty((136, 63), dtype=np.int32), np.empty((136, 63), dtype=np.complex64)
    found = filled(follow_echoes, 0, 136, 3, looks, 93.4, 13000.0, out=out)
    return found, follow_echoes_reference(3, 136, looks, 93.4, 13000.0)


def fields_in_bins_reference(echo, away, steps, fields, spread):
    """The fields of `fields_in_bins`, by NumPy."""
    step = away - steps[:, echo]
    inside = (step >= 0) & (step < len(spread))
    return np.where(inside, spread.take(step, mode="clip") * fields[:, echo], 0)


@kernel_case(fields_in_bins, 1e-6)
def _in_bins() -> Pair:
    rng = np.random.default_rng(0)
    steps = rng.integers(20000, 30000, (41, 63), dtype=np.int32)
    echo, away = rng.integers(0, 63, 517), rng.integers(22000, 34000, 517)
    given = echo, away, steps, samples(41, 63, seed=1), rng.random(4097, dtype=np.float32)
    out = (np.empty((41, 517), np.complex64),)
    return filled(fields_in_bins, *given, out=out), fields_in_bins_reference(*given)


# -- Doppler ---------------------------------------------------------------------------------------


def doppler_power_reference(spectra, channels, weights):
    """The power that `add_doppler_power` adds, by SciPy."""
    chosen = spectra[:, channels.start : channels.stop].astype(np.complex128)
    return (np.abs(scipy.fft.fft(chosen * weights[:, None, None], axis=0)) ** 2).sum(axis=1)


# -- angles ----------------------------------------------------------------------------------------


def beam_power_reference(values, still, place, channels, steering):
    """Power (cell, sine) of `beam_power`, by NumPy."""
    weights, runs, starts = steering
    offsets = np.zeros(weights.shape, dtype=np.int64)
    whose = np.repeat(np.arange(len(weights)), np.diff(starts))
    for own, (element, offset, first, last) in zip(whose, runs, strict=True):
        offsets[own, element, first:last] = offset
    cell, channel = np.arange(len(values))[:, None, None], channels[:, None]
    read = (values * still[:, None])[cell, offsets[place], channel].astype(np.complex128)
    return np.abs((read * weights[place]).sum(axis=1)) ** 2


@kernel_case(beam_power, 1e-5)
def _beam_power() -> Pair:
    values, still, place = samples(21, 3, 96), samples(21, 96), np.arange(21) % 8
    runs = [
        (element, (element + half) % 3, 43 * half, 43 * half + 43)
        for _ in range(8)
        for element in range(48)
        for half in range(2)
    ]
    steering = Steering(samples(8, 48, 86), np.array(runs), 96 * np.arange(9))
    given, out = (values, still, place, np.arange(0, 96, 2), steering), np.empty((21, 86), "f4")
    return filled(beam_power, 0, 21, *given, out=(out,)), beam_power_reference(*given)


def highest_maxima_reference(power, below, above, peaks):
    """Index and count of `highest_maxima`, by NumPy."""
    before, after = np.full_like(power, -1), np.full_like(power, -1)
    before[:, 1:] = power[:, :-1]
    for n in range(power.shape[1] - 2, -1, -1):
        equal = power[:, n] == power[:, n + 1]
        after[:, n] = np.where(equal, after[:, n + 1], power[:, n + 1])
    good = (power > before) & (power > after) & (power > 0)
    highest = power.max(axis=1, keepdims=True)
    good &= power >= highest * below
    lower = (power[:, None] * above <= power[:, :, None]).sum(axis=2)
    good &= (power == highest) | (2 * lower > power.shape[1])
    count = np.minimum(good.sum(axis=1), peaks)
    order = np.argsort(np.where(good, -power, np.inf), axis=1, kind="stable")[:, :peaks]
    index = np.where(np.arange(peaks) < count[:, None], order, order[:, :1])
    return np.where(count[:, None] > 0, index, power.argmax(axis=1)[:, None]), count


@kernel_case(highest_maxima, 0)
def _maxima() -> Pair:
    power = np.random.default_rng(0).exponential(size=(150, 200)).astype(np.float32) ** 4
    power[75:] = np.rint(power[75:] / 64)  # with neighbours that are equal
    given, out = (power, np.float32(0.25), np.float32(12)), (np.empty((150, 3), int),)
    found = filled(highest_maxima, *given, out=(*out, np.empty(150, int)))
    return found, highest_maxima_reference(*given, 3)


def add_interpolated_reference(power, sines, first, step, bins, shape):
    """The map (bin, angle) that `add_interpolated` adds, by NumPy."""
    total = np.zeros(shape)
    grid = first + step * np.arange(power.shape[1])
    read = [np.interp(own, grid, values) for own, values in zip(sines, power, strict=True)]
    np.add.at(total, bins, read)
    return total


@kernel_case(add_interpolated, 1e-6)
def _interpolated() -> Pair:
    rng, first, step = np.random.default_rng(0), -0.9, 1.8 / 199
    power, sines = rng.exponential(size=(500, 200)).astype("f4"), rng.uniform(-1, 1, (500, 200))
    given, out = (power, sines.clip(-0.9, 0.9), first, step, rng.integers(0, 128, 500)), (128, 200)
    found = filled(add_interpolated, *given, out=(np.empty(out),), adds=True)
    return found, add_interpolated_reference(*given, out)
