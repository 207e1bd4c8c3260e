"""The fast sum of echoes against the plain one, the phase convention from the physics, and laws of
the sum."""

from __future__ import annotations

import dataclasses
import warnings
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.errors import ValidityWarning
from rtradar.process import range_doppler
from rtradar.radar import Radar
from rtradar.signal import in_band, synthesize

LOW, HIGH = Radar.preset("paper-12ghz"), Radar.preset("paper-77ghz")
SMALL = Radar(tx_y=2, tx_z=1, rx_y=2, rx_z=2, samples_per_chirp=40, frame_duration_s=3.75e-3)
LONE = Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0)

Complex = NDArray[np.complex128]


def make_echoes(
    length: object, amplitude: object, frequency: object = (14e9,), tx: object = None
) -> Echoes:
    lengths = np.asarray(length, dtype=np.float64)
    count = lengths.shape[2]
    transmitters = np.arange(lengths.shape[0]) if tx is None else tx
    return Echoes(
        length=lengths,
        amplitude=np.asarray(amplitude),
        frequency=np.asarray(frequency),
        tx=transmitters,
        part=np.zeros(count),
        bounces=np.ones(count),
    )


def random_echoes(
    radar: Radar, chirps: int, count: int, *, nodes: int = 1, seed: int = 0
) -> Echoes:
    """Echoes anywhere in the band, of every phase."""
    rng = np.random.default_rng(seed)
    shape = (chirps, radar.n_rx, count)
    amplitude = rng.standard_normal((nodes, *shape)) + 1j * rng.standard_normal((nodes, *shape))
    span = (
        np.linspace(0, radar.bandwidth_hz, nodes)
        if nodes > 1
        else np.array([radar.bandwidth_hz / 2])
    )
    return make_echoes(
        rng.uniform(0.01, 0.999, shape) * 2 * radar.max_range_m,
        amplitude,
        radar.start_frequency_hz + span,
        radar.tx_of_chirp(np.arange(chirps)),
    )


def together(first: Echoes, second: Echoes) -> Echoes:
    return make_echoes(
        np.concatenate([first.length, second.length], axis=2),
        np.concatenate([first.amplitude, second.amplitude], axis=3),
        first.frequency,
        first.tx,
    )


def synthesize_block(
    echoes: Echoes, radar: Radar, dtype: type[np.complexfloating] = np.complex128
) -> Complex:
    """All chirps as one block. The random lengths jump from chirp to chirp, which is not what is
    looked at here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ValidityWarning)
        return synthesize(echoes, radar, radar.chirp_times(len(echoes.length)), dtype=dtype)


def plain_sum(echoes: Echoes, radar: Radar) -> Complex:
    """x[n] = sum_e A_e(f_n) exp(+j 2 pi (f_c tau + s tau t_n - s tau^2 / 2)) term by term, the
    turns in long double."""
    t = (
        np.arange(radar.samples_per_chirp, dtype=np.longdouble)
        * radar.chirp_duration_s
        / radar.samples_per_chirp
    )
    slope = np.longdouble(radar.bandwidth_hz) / radar.chirp_duration_s
    f = radar.start_frequency_hz + slope * t
    amplitude = np.zeros((*echoes.length.shape, len(t)), dtype=np.complex128)
    for j, node in enumerate(echoes.frequency):  # Lagrange's polynomials through the nodes
        others = np.delete(echoes.frequency, j)
        weight = np.prod([(f - other) / (node - other) for other in others], axis=0)
        amplitude += echoes.amplitude[j][..., None] * np.asarray(weight, dtype=np.float64)
    tau = (echoes.length.astype(np.longdouble) / SPEED_OF_LIGHT_MPS)[..., None]
    turns = radar.start_frequency_hz * tau + slope * tau * t - slope * tau**2 / 2
    phase = 2 * np.pi * (turns - np.floor(turns)).astype(np.float64)
    return np.asarray((amplitude * np.exp(1j * phase)).sum(axis=2))


def relative_error(ours: Complex, reference: Complex) -> float:
    return float(np.linalg.norm(ours - reference) / np.linalg.norm(reference))


TOLERANCE = 1e-11
"""Of float64: up to 77 GHz x 64 ns = 4900 turns are known to 3e-12 rad. Measured: 3e-13 at 12 GHz,
2e-12 at 77 GHz."""


# -- the sum itself --------------------------------------------------------------------------------


@pytest.mark.parametrize("radar", [LOW, HIGH], ids=["12 GHz", "77 GHz"])
@pytest.mark.parametrize("nodes", [1, 2, 3, 4, 5, 9])
def test_fast_sum_is_the_plain_sum(radar: Radar, nodes: int) -> None:
    echoes = random_echoes(radar, chirps=6, count=20, nodes=nodes)
    # Powers of the sample number take up to two digits where nine values are drawn at random.
    tolerance = TOLERANCE if nodes < 9 else 100 * TOLERANCE
    assert relative_error(synthesize_block(echoes, radar), plain_sum(echoes, radar)) < tolerance


@pytest.mark.parametrize("nodes", [1, 3, 5])
@pytest.mark.parametrize("samples", [1, 2, 15, 16, 17, 31, 32, 33, 100, 257])
def test_any_number_of_samples(samples: int, nodes: int) -> None:
    radar = dataclasses.replace(SMALL, samples_per_chirp=samples)
    echoes = random_echoes(radar, chirps=3, count=4, nodes=nodes)
    ours = synthesize_block(echoes, radar)
    assert ours.shape == (3, radar.n_rx, samples)
    assert relative_error(ours, plain_sum(echoes, radar)) < TOLERANCE


@pytest.mark.parametrize(("chirps", "count"), [(0, 2), (4, 0), (0, 0)])
def test_nothing_gives_silence(chirps: int, count: int) -> None:
    x = synthesize_block(random_echoes(SMALL, chirps, count), SMALL)
    assert x.shape == (chirps, SMALL.n_rx, SMALL.samples_per_chirp)
    assert not x.any()


def test_nodes_anywhere_in_any_order() -> None:
    # A parabola through three nodes is the same parabola through three others.
    def parabola(frequency: NDArray[np.float64]) -> Complex:
        u = (frequency - LOW.start_frequency_hz) / LOW.bandwidth_hz
        return np.asarray((1 + 2j) - (3 - 0.5j) * u + (0.7 + 1j) * u**2)

    results = []
    for nodes in ([12e9, 14e9, 16e9], [15e9, 12.5e9, 13e9], [11e9, 17e9, 14e9]):
        frequency = np.array(nodes)
        amplitude = np.broadcast_to(parabola(frequency)[:, None, None, None], (3, 2, 8, 1))
        results.append(
            synthesize_block(make_echoes(np.full((2, 8, 1), 8.0), amplitude, frequency), LOW)
        )
    assert relative_error(results[1], results[0]) < TOLERANCE
    assert relative_error(results[2], results[0]) < TOLERANCE
    # The amplitude of sample n is that at 12 GHz + n / 256 x 4 GHz.
    truth = parabola(LOW.start_frequency_hz + np.arange(256) / 256 * LOW.bandwidth_hz)
    np.testing.assert_allclose(np.abs(results[0][0, 0]), np.abs(truth), rtol=TOLERANCE)


# -- many echoes, by the NUFFT --------------------------------------------------------------------


# One grid up to three nodes, two up to six; beyond, or with few samples, no grid. Ten times the
# rounding of complex64.
@pytest.mark.parametrize("nodes", [1, 2, 3, 4, 6, 7])
@pytest.mark.parametrize("samples", [256, 45, 16, 2, 1])
def test_many_echoes_are_the_plain_sum_to_float32(samples: int, nodes: int) -> None:
    few = dataclasses.replace(SMALL, samples_per_chirp=samples, bandwidth_hz=1e8)
    radar = LOW if samples == 256 else few
    rng, shape = np.random.default_rng(nodes), (radar.n_rx, 300)
    parts = rng.standard_normal((2, nodes, 3, *shape))
    # Some are out of the band, and add nothing.
    length = rng.uniform(-0.1, 1.1, shape) * 2 * radar.max_range_m + np.zeros((3, *shape))
    places = -np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes) / 2
    frequency = radar.centre_frequency_hz + radar.bandwidth_hz * places
    tx = radar.tx_of_chirp(np.arange(3))
    echoes = make_echoes(length, parts[0] + 1j * parts[1], frequency, tx)
    within = (echoes.length >= 0) & (echoes.length < 2 * radar.max_range_m)
    received = dataclasses.replace(echoes, amplitude=echoes.amplitude * within)
    found = synthesize_block(echoes, radar, np.complex64)
    assert found.dtype == np.complex64
    assert relative_error(found, plain_sum(received, radar)) < 6e-7


def test_one_echo_among_silent_ones_is_a_clean_tone() -> None:
    """What is left out of a tone lies far below it at every other beat frequency."""
    alone = np.zeros((1, 1, LOW.n_rx, 300))
    alone[..., 5] = 1.0
    one = make_echoes(np.full(alone.shape[1:], 5.4321), alone)
    x = synthesize_block(one, LOW, np.complex64)[0, 0]
    spectrum = np.abs(np.fft.fft(x * np.blackman(256) ** 2)) / 256
    peak = int(spectrum.argmax())
    assert np.delete(spectrum, np.arange(peak - 20, peak + 21) % 256).max() < 1e-6 * spectrum[peak]


# -- the convention of phase, from the physics -----------------------------------------------------


@pytest.mark.parametrize("radar", [LOW, HIGH], ids=["12 GHz", "77 GHz"])
@pytest.mark.parametrize("reflection", [1, -1, 1j, 0.3 - 0.8j])
def test_if_is_the_chirp_times_the_conjugate_of_what_comes_back(
    radar: Radar, reflection: complex
) -> None:
    # With exp(+j omega t) a chirp leaves, comes back tau later and multiplied by the reflection
    # coefficient, and is mixed.
    tau = 8.4 / SPEED_OF_LIGHT_MPS
    slope = np.longdouble(radar.bandwidth_hz) / radar.chirp_duration_s
    t = np.arange(256, dtype=np.longdouble) / radar.sample_rate_hz

    def chirp(at: NDArray[np.longdouble]) -> Complex:
        turns = radar.start_frequency_hz * at + slope * at**2 / 2
        return np.asarray(np.exp(2j * np.pi * (turns - np.floor(turns)).astype(np.float64)))

    received = reflection * chirp(t - np.longdouble(tau))
    mixed = chirp(t) * np.conj(received)
    # `amplitude` is the conjugate of the scattering length.
    echoes = make_echoes([[[8.4]]], [[[[np.conj(reflection)]]]])
    # A carrier of up to 960 000 turns, known to float64 where long double is no longer than that:
    # 1e-9 rad.
    np.testing.assert_allclose(synthesize_block(echoes, radar)[0, 0], mixed, rtol=0, atol=1e-8)


@pytest.mark.parametrize("velocity", [1.0, -1.0])
def test_receding_is_a_positive_doppler_frequency(velocity: float) -> None:
    radar = dataclasses.replace(LONE, chirp_duration_s=0.75e-3)
    n = radar.cycles_per_frame
    times = radar.chirp_times(n)
    length = 2 * (4.0 + velocity * times)[:, None, None]
    x = synthesize(make_echoes(length, np.ones((1, n, 1, 1)), tx=np.zeros(n)), radar, times)
    turns = np.angle(x[1:, 0, 0] / x[:-1, 0, 0]) / (2 * np.pi * radar.chirp_duration_s)
    # At the first sample the wave is at 12 GHz, less the beat frequency s tau of 0.14 MHz.
    np.testing.assert_allclose(turns, 2 * velocity * 12e9 / SPEED_OF_LIGHT_MPS, rtol=5e-5)
    spectra = range_doppler(x, radar)
    peak = np.abs(spectra.values[..., 0]).max(axis=0).argmax()
    assert np.sign(spectra.velocity[peak]) == np.sign(velocity)


# -- laws ------------------------------------------------------------------------------------------


@given(
    cuts=st.lists(st.integers(0, 30), max_size=4),
    kind=st.sampled_from([(3, np.complex128), (300, np.complex64)]),
)
@settings(max_examples=30)
def test_how_a_capture_is_cut_into_blocks_does_not_matter(
    cuts: list[int], kind: tuple[int, type[np.complexfloating]]
) -> None:
    count, dtype = kind
    echoes = random_echoes(SMALL, 30, count, nodes=3)
    whole = synthesize_block(echoes, SMALL, dtype)
    edges = [0, *sorted(cuts), 30]
    blocks = []
    for first, last in pairwise(edges):
        part = slice(first, last)
        block = make_echoes(
            echoes.length[part], echoes.amplitude[:, part], echoes.frequency, echoes.tx[part]
        )
        blocks.append(synthesize_block(block, SMALL, dtype))
    np.testing.assert_array_equal(np.concatenate(blocks), whole)


def test_hidden_echoes_add_nothing() -> None:
    echoes = random_echoes(SMALL, 6, 3)
    hidden = random_echoes(SMALL, 6, 2, seed=1)
    hidden = dataclasses.replace(hidden, amplitude=0 * hidden.amplitude)
    np.testing.assert_array_equal(
        synthesize_block(together(echoes, hidden), SMALL), synthesize_block(echoes, SMALL)
    )


def test_an_amplitude_that_vanishes_at_one_node_is_not_hidden() -> None:
    echoes = make_echoes([[[8.0]]], np.array([0, 1, 0])[:, None, None, None], [12e9, 14e9, 16e9])
    x = synthesize_block(echoes, LONE)
    assert abs(x[0, 0, 0]) < TOLERANCE
    assert abs(x[0, 0, 128]) == pytest.approx(1, abs=TOLERANCE)


@pytest.mark.parametrize("radar", [LOW, HIGH], ids=["12 GHz", "77 GHz"])
def test_echoes_out_of_band_are_left_out(radar: Radar) -> None:
    edge = 2 * radar.max_range_m
    length = np.array([-1.0, 0.0, edge * (1 - 1e-9), edge * (1 + 1e-9), 100.0])
    inside = [False, True, True, False, False]
    shape = (1, radar.n_rx, 1)
    for one, expected in zip(length, inside, strict=True):
        echoes = make_echoes(np.full(shape, one), np.ones((1, *shape)))
        assert (in_band(echoes, radar) == expected).all()
        assert synthesize_block(echoes, radar).any() == expected
    everything = make_echoes(
        np.broadcast_to(length, (1, radar.n_rx, 5)), np.ones((1, 1, radar.n_rx, 5))
    )
    kept = make_echoes(
        np.broadcast_to(length[inside], (1, radar.n_rx, 2)), np.ones((1, 1, radar.n_rx, 2))
    )
    np.testing.assert_array_equal(
        synthesize_block(everything, radar), synthesize_block(kept, radar)
    )


@pytest.mark.parametrize("nodes", [1, 3, 4])
def test_single_precision_is_the_double_to_a_millionth(nodes: int) -> None:
    echoes = random_echoes(SMALL, 6, 4, nodes=nodes)
    double = synthesize_block(echoes, SMALL)
    with pytest.warns(ValidityWarning):  # the random lengths jump
        single = synthesize(echoes, SMALL, SMALL.chirp_times(6), dtype=np.complex64)
    assert double.dtype == np.complex128
    assert single.dtype == np.complex64
    # float32 has 6e-8; a tone is a product of three such numbers, and there are four tones.
    # Polynomials between the nodes are at most three times as large as the amplitudes.
    magnitudes = 3 * np.abs(echoes.amplitude).max(axis=0).sum(axis=-1, keepdims=True)
    np.testing.assert_array_less(
        np.abs(single - double), 1e-6 * np.broadcast_to(magnitudes, double.shape)
    )


def test_amplitudes_of_single_precision_do() -> None:
    echoes = random_echoes(SMALL, 3, 4)
    single = dataclasses.replace(echoes, amplitude=echoes.amplitude.astype(np.complex64))
    np.testing.assert_allclose(
        synthesize_block(single, SMALL), synthesize_block(echoes, SMALL), rtol=0, atol=1e-6
    )


# -- what is asked of times ------------------------------------------------------------------------


def moving(radar: Radar, velocity: float, chirps: int) -> tuple[Echoes, Radar, NDArray[np.float64]]:
    """A point on the boresight, with the differences in length that the array makes from Tx to
    Tx."""
    times = radar.chirp_times(chirps)
    tx = radar.tx_of_chirp(np.arange(chirps))
    place = np.asarray(radar.position_m) + (4 + velocity * times)[:, None] * np.array([1.0, 0, 0])
    there = np.linalg.norm(radar.tx[tx] - place, axis=1)
    back = np.linalg.norm(radar.rx[radar.rx_of_tx[tx]] - place[:, None], axis=2)
    length = (there[:, None] + back)[..., None]
    return make_echoes(length, np.ones((1, *length.shape)), tx=tx), radar, times


@pytest.mark.parametrize("radar", [LOW, HIGH], ids=["12 GHz", "77 GHz"])
@pytest.mark.parametrize("sign", [1, -1])
def test_warns_of_an_echo_that_moves_a_tenth_of_a_bin_in_a_chirp(radar: Radar, sign: int) -> None:
    limit = 0.1 * radar.range_bin_m / radar.chirp_duration_s  # 60 m/s at 12 GHz, 300 m/s at 77 GHz
    with pytest.warns(ValidityWarning, match=r"moves 0\.11 range bins inside one chirp") as caught:
        synthesize(*moving(radar, sign * 1.1 * limit, 36))
    assert len(caught) == 1
    assert caught[0].filename == __file__  # the caller's line, not the library's
    for velocity in (0.9 * limit, 2.0, 0.0):  # warnings are errors in tests
        synthesize(*moving(radar, sign * velocity, 36))


def test_an_echo_out_of_band_gives_no_warning_of_motion() -> None:
    echoes, radar, times = moving(LOW, 1000.0, 36)
    hidden = dataclasses.replace(echoes, amplitude=np.zeros_like(echoes.amplitude))
    assert not synthesize(hidden, radar, times).any()  # warnings are errors in tests
    beyond = dataclasses.replace(echoes, length=echoes.length + 2 * radar.max_range_m)
    assert not synthesize(beyond, radar, times).any()


def test_less_than_a_cycle_says_nothing_of_motion() -> None:
    assert synthesize(*moving(LOW, 1000.0, 12)).any()


@pytest.mark.parametrize("times", [np.zeros(5), np.zeros((6, 1)), 0.0])
def test_times_belong_to_the_chirps(times: object) -> None:
    with pytest.raises(ValueError, match=r"times has shape .*must be \(6,\)"):
        synthesize(random_echoes(SMALL, 6, 1), SMALL, times)


@pytest.mark.filterwarnings("ignore:an echo moves")  # the random lengths jump from chirp to chirp
@pytest.mark.parametrize("kind", [np.complex64, np.complex128])
@pytest.mark.parametrize("count", [0, 3, 200])
@pytest.mark.parametrize("nodes", [1, 3])
def test_into_an_array_that_is_there(kind: type, count: int, nodes: int) -> None:
    echoes, times = random_echoes(SMALL, 6, count, nodes=nodes), SMALL.chirp_times(6)
    out = np.full((6, SMALL.n_rx, SMALL.samples_per_chirp), np.nan, kind)
    assert synthesize(echoes, SMALL, times, dtype=kind, out=out) is out
    np.testing.assert_array_equal(out, synthesize(echoes, SMALL, times, dtype=kind))


def test_an_array_that_cannot_be_filled() -> None:
    with pytest.raises(
        ValueError, match=r"synthesize: out has shape \(6, 4, 40\), type complex64; .*complex128"
    ):
        synthesize(
            random_echoes(SMALL, 6, 0),
            SMALL,
            SMALL.chirp_times(6),
            out=np.empty((6, 4, 40), np.complex64),
        )
