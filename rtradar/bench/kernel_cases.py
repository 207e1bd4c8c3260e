"""Cases of `rtradar.bench.kernel_table` for the kernels of motion, signal and processing."""

from __future__ import annotations

from typing import Any

import numpy as np

from rtradar.bench.kernel_table import Calls, filled, kernel_case
from rtradar.kernels.tone_sum import Tones, tone_sum_reference

# -- general ---------------------------------------------------------------------------------------


@kernel_case("elementary.fill_phasors", "unit phasors of 100 000 phases", 1e-15)
def _phasors(k: Any) -> Calls:
    turns = np.random.default_rng(0).uniform(-1e3, 1e3, 100_000)
    out = np.empty(len(turns), dtype=np.complex128)
    return filled(k.fill_phasors, turns, out=(out,)), lambda: k.phasor_reference(turns)


@kernel_case("motion.pose", "joints of a skeleton of 23, at 3000 times")
def _pose(k: Any) -> Calls:
    rng, joints, knots = np.random.default_rng(0), 23, np.linspace(0.0, 3.0, 91)
    root, rotation = rng.normal(size=(4, 90, 3)), rng.normal(size=(4, 90, 4 * joints))
    offsets, parents = rng.normal(size=(joints, 3)), np.maximum(np.arange(-1, joints - 1) // 2, -1)
    times, which = rng.uniform(0, 3, 3000), np.arange(3000)
    skeleton = knots, root, rotation, offsets, parents
    out = np.empty((3000, joints, 3)), np.empty((3000, 4 * joints))
    call = filled(k.pose, times, which, *skeleton, out=out)
    return call, lambda: k.pose_reference(times, *skeleton)


@kernel_case("motion.pose_ellipsoids", "centres and axes of 21 ellipsoids, at 3000 times")
def _pose_ellipsoids(k: Any) -> Calls:
    rng, parents = np.random.default_rng(0), np.maximum(np.arange(-1, 21) // 2, -1)
    positions, quaternions = rng.normal(size=(3000, 22, 3)), rng.normal(size=(3000, 22, 4))
    quaternions /= np.linalg.norm(quaternions, axis=2, keepdims=True)
    given = positions, quaternions, parents, rng.normal(size=(21, 3, 3))
    out = np.empty((3000, 21, 3)), np.empty((3000, 21, 3, 3))
    return filled(k.pose_ellipsoids, *given, out=out), lambda: k.pose_ellipsoids_reference(*given)


# -- signal ----------------------------------------------------------------------------------------


def _tones(nodes: int, echoes: int, chirps: int) -> Any:
    rng, shape = np.random.default_rng(0), (chirps, 8, echoes)
    length = np.broadcast_to(rng.uniform(0, 15, shape[1:]), shape).copy()
    amplitude = rng.standard_normal((nodes, *shape)) + 1j * rng.standard_normal((nodes, *shape))
    powers = np.linalg.inv(np.vander(np.linspace(-0.5, 0.5, nodes), increasing=True))
    return Tones(
        length, amplitude, np.asarray(powers, dtype=np.float64), 12e9, 4e9 / 60e-6, 256 / 60e-6
    )


@kernel_case("tone_sum.add_tones", "IF of 48 chirps, 8 receivers, 21 echoes, 256 samples", 1e-6)
def _tone_sum(k: Any) -> Calls:
    tones, out = _tones(1, 21, 48), np.empty((48, 8, 256), dtype=np.complex64)
    call = filled(k.add_tones, 0, 48, tones, k.tone_tables(np.float32), out=(out,))
    return call, lambda: k.tone_sum_reference(tones, 256, k.MIDDLE)


@kernel_case("nufft.sum_by_nufft", "IF of 12 chirps, 8 receivers, 315 echoes, 256 samples", 1e-6)
def _nufft(k: Any) -> Calls:
    tones, out = _tones(3, 315, 12), np.empty((12, 8, 256), dtype=np.complex64)
    call = filled(k.sum_by_nufft, tones, out=(out,))
    return call, lambda: tone_sum_reference(tones, 256, 0.0)


_OTHERS = np.array([[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]])
"""Anchors beside each of four, at whose places its weight is 0."""


@kernel_case(
    "anchored_tones.add_anchored_tones",
    "IF of 12 chirps, 8 receivers, 315 echoes, 256 samples, between anchors",
    2e-3,
)
def _anchored(k: Any) -> Calls:
    rng, shape, chirps = np.random.default_rng(0), (6, 2, 8, 315), np.arange(12)
    start, rate = rng.uniform(1, 6, shape[3]), rng.uniform(-0.05, 0.05, shape[3])
    length = start + rate * np.arange(6)[:, None, None, None] + rng.uniform(0, 0.01, (2, 8, 1))
    level, *change = rng.normal(size=(3, 2, *shape)).astype(np.float32)
    anchors = k.Anchors(length, level, np.array(change)[..., :60].copy())
    fraction = rng.uniform(0, 1, (12, 1))
    weight = np.prod(fraction[:, None] + 1 - _OTHERS, axis=2) / [-6, 2, -2, 6]
    between = k.Between(chirps % 3, weight, chirps % 2, np.full(12, 10e9))
    out = np.empty((12, 8, 256), dtype=np.complex64)
    given = anchors, between, k.Sweep(7e13, 4e6)
    call = filled(k.add_anchored_tones, *given, out=(out,), adds=True)
    return call, lambda: k.anchored_tones_reference(*given, 256)


@kernel_case("anchored_tones.fill_anchors", "321 echoes at 3 anchors of 12 Tx, 8 receivers", 1e-6)
def _fill_anchors(k: Any) -> Calls:
    rng, echoes, changing = np.random.default_rng(0), 321, 60
    chirps, which = rng.permutation(36).reshape(3, 12), rng.permutation(echoes)
    length, weights = rng.random((36, 8, echoes)), rng.normal(size=(4, 3)).astype(np.float32)
    amplitude = _samples(3, 36, 8, echoes)
    shape, dtype = (3, 12, 8), np.float32
    level = np.empty((2, *shape, echoes), dtype), np.empty((2, 2, *shape, changing), dtype)
    anchors = k.Anchors(np.empty((*shape, echoes)), *level)

    def call() -> Any:
        k.fill_anchors(0, 36, chirps, length, amplitude, which, weights, tuple(anchors))
        return anchors

    given = chirps, length, amplitude, which, weights, changing
    return call, lambda: k.fill_anchors_reference(*given)


@kernel_case("gaussian_noise.add_noise", "noise of 192 chirps, 8 receivers, 256 samples", 2e-6)
def _noise(k: Any) -> Calls:
    streams = np.array([np.random.SFC64(n).state["state"]["state"] for n in range(16)])
    out = np.empty((192, 8, 256), dtype=np.complex64)
    given = streams, 12, np.float32(0.5)
    call = filled(k.add_noise, *given, out=(out,), adds=True)
    return call, lambda: k.noise_reference(*given, out.shape)


# -- expected echoes -------------------------------------------------------------------------------


@kernel_case("expected_echoes.follow_echoes", "315 echoes, 136 cycles, 9 instants", 1e-6)
def _follow(k: Any) -> Calls:
    rng, shape = np.random.default_rng(0), (9, 315)
    power = rng.random(shape) * (rng.random(shape) > 0.2)  # some are not seen
    looks = k.Looks(
        np.arange(9) * 17 + 3, 7.5e-4, 2 + rng.random(shape), rng.normal(size=shape), power
    )
    out = np.empty((136, 315), dtype=np.int32), np.empty((136, 315), dtype=np.complex64)
    call = filled(k.follow_echoes, 0, 136, 3, looks, 93.4, 13000.0, out=out)
    return call, lambda: k.follow_echoes_reference(3, 136, looks, 93.4, 13000.0)


@kernel_case("expected_echoes.fields_in_bins", "2048 echoes and bins, 136 cycles", 1e-6)
def _in_bins(k: Any) -> Calls:
    rng = np.random.default_rng(0)
    steps = rng.integers(20000, 30000, (136, 315), dtype=np.int32)
    echo, away = rng.integers(0, 315, 2048), rng.integers(22000, 34000, 2048)
    given = echo, away, steps, _samples(136, 315), rng.random(4097, dtype=np.float32)
    call = filled(k.fields_in_bins, *given, out=(np.empty((136, 2048), np.complex64),))
    return call, lambda: k.fields_in_bins_reference(*given)


# -- receiver --------------------------------------------------------------------------------------


def _samples(*shape: int) -> Any:
    parts = np.random.default_rng(1).standard_normal((*shape, 2), dtype=np.float32)
    return parts.view(np.complex64)[..., 0]


def _in_place(kernel: Any, *given: Any) -> Any:
    samples = _samples(48, 8, 256)

    def call() -> Any:
        out = samples.copy()
        kernel(*given, out)
        return out

    return call, samples


@kernel_case("receiver.turn_by_noise", "phase noise of 48 chirps, 8 receivers, 256 samples", 2e-7)
def _turn_by_noise(k: Any) -> Calls:
    phase = np.random.default_rng(0).normal(0, 0.1, (48, 256)).astype(np.float32)
    call, samples = _in_place(k.turn_by_noise, phase)
    return call, lambda: k.turn_by_noise_reference(phase, samples)


@kernel_case("receiver.add_still", "leakage and its noise, 48 chirps, 8 receivers", 5e-7)
def _add_still(k: Any) -> Calls:
    phase = np.random.default_rng(0).normal(0, 0.1, (48, 2, 256)).astype(np.float32)
    given = (
        np.arange(48) % 12,
        _samples(12, 8, 256),
        phase,
        _samples(12, 8, 2, 256),
        _samples(12, 8),
    )
    call, samples = _in_place(k.add_still, *given)
    return call, lambda: k.add_still_reference(*given, samples)


@kernel_case("receiver.mirror", "IQ errors of 48 chirps, 8 receivers, 256 samples", 2e-7)
def _mirror(k: Any) -> Calls:
    given = np.complex64(1.01 + 0.02j), np.complex64(0.03 - 0.01j)
    call, samples = _in_place(k.mirror, *given)
    return call, lambda: k.mirror_reference(*given, samples)


@kernel_case("receiver.high_pass", "two filters, 48 chirps, 8 receivers, 256 samples", 2e-6)
def _high_pass(k: Any) -> Calls:
    corners = np.array([0.05, 0.2], np.float32)
    call, samples = _in_place(k.high_pass, corners)
    return call, lambda: k.high_pass_reference(corners, samples)


@kernel_case("receiver.convert", "an ADC of 6 bits, 48 chirps, 8 receivers, 256 samples", 0)
def _convert(k: Any) -> Calls:
    # A power of two, so that steps are the same numbers in both.
    given = np.complex64(0.25 - 0.125j), np.float32(2.0**-4), np.float32(2)
    call, samples = _in_place(k.convert, *given)
    return call, lambda: k.convert_reference(*given, samples)


@kernel_case("receiver.add_ramps", "another radar in 48 chirps, 8 receivers, 256 samples", 1e-5)
def _add_ramps(k: Any) -> Calls:
    starts, tx = np.arange(48) * 62.5e-6, np.arange(48) % 12
    ramps = 12e9, 1.1e14, 30e-6, 40.7e-6, 1e-5
    given = starts, np.full(48, 12e9), tx, 6.4e13, 4.096e6, ramps, _samples(12, 8)
    out = np.empty((48, 8, 256), np.complex64)
    call = filled(k.add_ramps, *given, out=(out,), adds=True)
    return call, lambda: k.add_ramps_reference(*given, out.shape)


# -- processing ------------------------------------------------------------------------------------


def _spectra(*shape: int) -> Any:
    parts = np.random.default_rng(0).standard_normal((*shape, 2), dtype=np.float32)
    return parts.view(np.complex64)[..., 0]


@kernel_case("prime_factor_dft.add_doppler_power", "133 cycles, 8 channels, 256 bins", 3e-6)
def _doppler_power(k: Any) -> Calls:
    spectra, weights = _spectra(133, 8, 256), np.linspace(0, 1, 133, dtype=np.float32)
    out = np.empty((133, 256), dtype=np.float32)
    given = spectra, range(8), weights, k.prime_factor_dft(133)
    call = filled(k.add_doppler_power, *given, out=(out,), adds=True)
    return call, lambda: k.doppler_power_reference(spectra, range(8), weights)


@kernel_case(
    "prime_factor_dft.pick_cells", "3600 cells of 133 cycles, 8 channels, 142 of 256 bins", 3e-6
)
def _pick_cells(k: Any) -> Calls:
    spectra, weights = _spectra(133, 8, 256), np.linspace(0, 1, 133, dtype=np.float32)
    cell = np.arange(400)
    cells = cell * 7 % 133, cell[:, None] // 3 + np.arange(9), np.arange(142) + 60
    out = np.empty((400, 9, 8), dtype=np.complex64)
    given = spectra, range(8), weights, k.prime_factor_dft(133), cells
    call = filled(k.pick_cells, *given, out=(out,))
    return call, lambda: k.pick_cells_reference(spectra, weights, cells)


def _map() -> Any:
    """Power, thresholds, ranks and numbers of training cells of the CFAR cases."""
    power = np.random.default_rng(0).exponential(size=(256, 133)).astype(np.float32)
    i, j = (np.arange(n) for n in power.shape)
    outer = _overlap(i, 6)[:, None] * _overlap(j, 6)
    counts = (outer - _overlap(i, 2)[:, None] * _overlap(j, 2)).astype(np.int32)
    return power, power / np.float32(3), np.ceil(0.75 * counts).astype(np.int32), counts


def _overlap(i: Any, half: int) -> Any:
    return np.minimum(i + half, i[-1]) - np.maximum(i - half, 0) + 1


@kernel_case("cfar.os_cfar_rows", "order-statistic CFAR of a map of 256 x 133", 0)
def _os_cfar(k: Any) -> Calls:
    power, thresholds, ranks, counts = _map()
    mask = np.empty(power.shape, dtype=np.bool_)
    call = filled(k.os_cfar_rows, 0, 256, power, thresholds, ranks, counts, 2, 6, out=(mask,))
    return call, lambda: k.os_cfar_reference(power, thresholds, ranks, 2, 6)


@kernel_case("angles.beam_power", "beams of 64 cells on a line of 48, 200 sines", 1e-5)
def _beam_power(k: Any) -> Calls:
    values, still, place = _spectra(64, 3, 96), _spectra(64, 96), np.arange(64) % 8
    runs = [
        (element, (element + half) % 3, 100 * half, 100 * half + 100)
        for _ in range(8)
        for element in range(48)
        for half in range(2)
    ]
    steering = k.Steering(_spectra(8, 48, 200), np.array(runs), 96 * np.arange(9))
    given, out = (values, still, place, np.arange(0, 96, 2), steering), np.empty((64, 200), "f4")
    return filled(k.beam_power, 0, 64, *given, out=(out,)), lambda: k.beam_power_reference(*given)


@kernel_case("angles.highest_maxima", "3 peaks of each of 1000 spectra of 200 sines", 0)
def _maxima(k: Any) -> Calls:
    power = np.random.default_rng(0).exponential(size=(1000, 200)).astype(np.float32) ** 4
    limits, out = (
        (np.float32(0.25), np.float32(12)),
        (np.empty((1000, 3), int), np.empty(1000, int)),
    )
    call = filled(k.highest_maxima, power, *limits, out=out)
    return call, lambda: k.highest_maxima_reference(power, *limits, 3)


@kernel_case("angles.add_interpolated", "1000 spectra of 200 sines onto 200 angles", 1e-6)
def _interpolated(k: Any) -> Calls:
    rng, first, step = np.random.default_rng(0), -0.9, 1.8 / 199
    power, sines = rng.exponential(size=(1000, 200)).astype("f4"), rng.uniform(-1, 1, (1000, 200))
    given, out = (power, sines.clip(-0.9, 0.9), first, step, rng.integers(0, 256, 1000)), (256, 200)
    call = filled(k.add_interpolated, *given, out=(np.empty(out),), adds=True)
    return call, lambda: k.add_interpolated_reference(*given, out)
