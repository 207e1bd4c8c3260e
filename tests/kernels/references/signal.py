"""Sums of tones, and noise."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.polynomial.polynomial import polyvander

from references.cases import Pair, filled, kernel_case, samples
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.kernels.nufft import (
    ANCHORS,
    Anchors,
    BetweenAnchors,
    add_anchored_tones,
    fill_anchors,
    sum_by_nufft,
)
from rtradar.kernels.receiver import add_noise
from rtradar.kernels.tone_sum import Tones, add_tones, tone_tables


def place_in_sweep(samples):
    return 2 * (np.arange(samples) - samples // 2) / samples


def tone_sum_reference(tones, samples, basis):
    """The sum of `add_tones`, by NumPy; the terms are those of a ``basis(x, degree)``."""
    time = np.arange(samples) / tones.sample_rate
    delay = tones.length[..., None] / SPEED_OF_LIGHT_MPS
    beat = tones.slope * delay
    turns = tones.start_frequency * delay + beat * time - beat * delay / 2
    weights = tones.weights.T @ basis(place_in_sweep(samples), len(tones.weights) - 1).T
    amplitude = np.einsum("jcre,jn->cren", tones.amplitude, weights, optimize=True)
    received = (beat >= 0) & (beat < tones.sample_rate)
    return np.sum(np.where(received, amplitude, 0) * np.exp(2j * np.pi * turns), axis=2)


def _tones(nodes: int, echoes: int, chirps: int, basis: Any) -> Tones:
    rng, shape = np.random.default_rng(0), (chirps, 3, echoes)
    length = np.broadcast_to(rng.uniform(0, 15, shape[1:]), shape).copy()
    amplitude = rng.standard_normal((nodes, *shape)) + 1j * rng.standard_normal((nodes, *shape))
    weights = np.linalg.inv(basis(np.linspace(-1, 1, nodes), nodes - 1))
    return Tones(length, amplitude, weights, 12e9, 4e9 / 60e-6, 256 / 60e-6)


@kernel_case(add_tones, 1e-6, nodes=(1, 3), echoes=(21, 24), n_samples=(256, 150))
def _tone_sum(nodes: int, echoes: int, n_samples: int) -> Pair:
    tones = _tones(nodes, echoes, 3, polyvander)
    out = (np.empty((3, 3, n_samples), dtype=np.complex64),)
    found = filled(add_tones, 0, 3, tones, tone_tables(np.float32), out=out)
    return found, tone_sum_reference(tones, n_samples, polyvander)


def anchored_tones_reference(anchors, between, samples):
    """The sum of `add_anchored_tones` (chirp, rx, sample), by NumPy."""
    which = between.first[:, None] + np.arange(ANCHORS), between.tx[:, None]
    parts = (part[0] + 1j * part[1] for part in (anchors.level, *anchors.change))
    length, level, tilt, curve = (
        np.einsum("ck,ckre->cre", between.weight, part[which]) for part in (anchors.length, *parts)
    )
    delay = length / SPEED_OF_LIGHT_MPS
    beat, n = between.slope * delay, np.arange(samples)
    start = between.carrier[:, None, None] * delay - beat * delay / 2
    turns = start[..., None] + beat[..., None] * n / between.sample_rate
    x = place_in_sweep(samples)
    own = np.repeat(level[..., None], samples, axis=3)
    flat = level.shape[2] - tilt.shape[2]
    own[:, :, flat:] += tilt[..., None] * x + curve[..., None] * (1.5 * x**2 - 0.5)
    received = (beat >= 0) & (beat < between.sample_rate)
    return np.sum(own * received[..., None] * np.exp(2j * np.pi * turns), axis=2)


_OTHERS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
"""Anchors beside each of four, at whose places its weight is 0."""


# Of 26 chirps, two threads have a block each.
@kernel_case(sum_by_nufft, 1e-6)
def _nufft() -> Pair:
    tones, out = _tones(3, 315, 2, legvander), (np.empty((2, 3, 256), dtype=np.complex64),)
    return filled(sum_by_nufft, tones, out=out), tone_sum_reference(tones, 256, legvander)


@kernel_case(add_anchored_tones, 2e-3, chirps_a_run=(1, 3))
def _anchored(chirps_a_run: int) -> Pair:
    rng, shape, chirps = np.random.default_rng(0), (6, 2, 2, 63), np.arange(26) // chirps_a_run
    start, rate = rng.uniform(1, 6, shape[3]), rng.uniform(-0.05, 0.05, shape[3])
    length = start + rate * np.arange(6)[:, None, None, None] + rng.uniform(0, 0.01, (2, 2, 1))
    level, *change = rng.normal(size=(3, 2, *shape)).astype(np.float32)
    anchors = Anchors(length, level, np.array(change)[..., :20].copy())
    fraction = rng.uniform(0, 1, (26, 1))
    weight = np.prod(fraction[:, None] + 1 - _OTHERS, axis=2) / [-6, 2, -2, 6]
    between = BetweenAnchors(chirps % 3, weight, chirps % 2, np.full(26, 10e9), 7e13, 4e6)
    given, out = (anchors, between), (np.empty((26, 2, 256), np.complex64),)
    found = filled(add_anchored_tones, *given, out=out, adds=True)
    return found, anchored_tones_reference(*given, 256)


def fill_anchors_reference(chirps, length, amplitude, which, weights, changing):
    """The `Anchors` that `fill_anchors` fills, in plain NumPy."""
    own = np.einsum("sn,nacre->sacre", weights, amplitude[:, chirps][..., which])
    level, *others = (np.stack([part.real, part.imag]) for part in own)
    change = np.array(others)[..., len(which) - changing :]
    return Anchors(length[chirps][..., which], level, change)


@kernel_case(fill_anchors, 1e-6)
def _fill_anchors() -> Pair:
    rng, echoes, changing = np.random.default_rng(0), 61, 20
    chirps, which = rng.permutation(36).reshape(3, 12), rng.permutation(echoes)
    length, weights = rng.random((36, 3, echoes)), rng.normal(size=(3, 3)).astype(np.float32)
    given, shape = (chirps, length, samples(3, 36, 3, echoes), which, weights), (3, 12, 3)
    level = np.empty((2, *shape, echoes), np.float32)
    change = np.empty((2, 2, *shape, changing), np.float32)
    anchors = Anchors(np.empty((*shape, echoes)), level, change)
    fill_anchors(0, 36, *given, tuple(anchors))
    return tuple(anchors), tuple(fill_anchors_reference(*given, changing))


def noise_reference(streams, rows, sigma, shape):
    """The numbers (chirp, rx, sample) that `add_noise` adds, by NumPy's SFC64."""
    generator, found = np.random.SFC64(), []
    for stream in streams:
        state: Any = generator.state
        generator.state = state | {"state": {"state": stream}}
        bits = generator.random_raw(rows * shape[1] * shape[2]).reshape(rows, *shape[1:])
        u, turns = ((bits >> 33) + 0.5) / 2**31, bits.astype(np.uint32).view(np.int32) / 2.0**32
        found.append(sigma * np.sqrt(-2 * np.log(u)) * np.exp(2j * np.pi * turns))
    return np.concatenate(found)[: shape[0]]


# The last stream has fewer chirps than the others.
@kernel_case(add_noise, 2e-6)
def _noise() -> Pair:
    streams = np.array([np.random.SFC64(n).state["state"]["state"] for n in range(4)])
    given, out = (streams, 12, np.float32(0.5)), (np.empty((43, 3, 256), dtype=np.complex64),)
    return filled(add_noise, *given, out=out, adds=True), noise_reference(*given, out[0].shape)
