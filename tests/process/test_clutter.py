"""Static-clutter removal against closed forms, and the same bits however the stream is cut."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rtradar.errors import InputError
from rtradar.process import (
    CLUTTER_REMOVALS,
    ClutterRemoval,
    SlidingWindows,
    WindowFunctions,
    clutter_removal,
    power_map,
)
from rtradar.radar import Radar

RADAR = Radar(
    tx_y=2,
    tx_z=1,
    rx_y=2,
    rx_z=2,
    samples_per_chirp=4,
    chirp_duration_s=1e-4,
    frame_duration_s=19.2e-3,
)
CYCLES = 64
HANN = WindowFunctions("hann", "hann")
"""What the closed forms of these tests are of."""
SETTINGS: list[tuple[str, dict[str, Any]]] = [
    ("none", {}),
    ("mean", {}),
    ("exponential", {"time_constant_s": 4e-3}),
    ("mti", {"pulses": 2}),
    ("mti", {"pulses": 3}),
]


def noise(n_cycles: int, seed: int = 0, radar: Radar = RADAR) -> np.ndarray:
    rng = np.random.default_rng(seed)
    shape = (n_cycles * radar.n_tx, radar.n_rx, radar.samples_per_chirp)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def tone(n_cycles: int, turns_per_cycle: float, seed: int = 0, radar: Radar = RADAR) -> np.ndarray:
    """A pure Doppler frequency in all channels and range bins, each with an amplitude of its own:
    (chirp, rx, range)."""
    amplitude = noise(1, seed, radar)
    phase = np.exp(2j * np.pi * turns_per_cycle * np.arange(n_cycles))
    return (phase[:, None, None, None] * amplitude).reshape(-1, *amplitude.shape[1:])


def removed(
    method: str, spectra: np.ndarray, *, radar: Radar = RADAR, **options: Any
) -> np.ndarray:
    """Both steps on a stream that is one window, (cycle, tx, rx, range)."""
    removal = clutter_removal(method, radar, **options)
    cube = removal.block(spectra, 0).reshape(-1, radar.n_tx, radar.n_rx, radar.samples_per_chirp)
    return removal.window(cube)


@pytest.mark.parametrize("kind", [np.complex64, np.complex128])
@pytest.mark.parametrize(("method", "options"), SETTINGS[1:])
def test_of_a_still_room_nothing_is_left(method: str, options: dict[str, Any], kind: type) -> None:
    still = tone(CYCLES, 0.0).astype(kind) * 1000
    left = removed(method, still, **options)
    assert left.dtype == kind
    if kind == np.complex64 or method != "mean":
        assert (
            left == 0
        ).all()  # differences of equal numbers; the sum of 64 equal float32 is exact in float64
    else:
        # 64 roundings of the sum at worst, each half a unit of float64 of at most 64 values.
        assert abs(left).max() <= 64 * 2**-53 * abs(still).max() * math.sqrt(2)


@pytest.mark.parametrize("cells", [1, 1024, 1025, 5000])
@pytest.mark.parametrize("kind", [np.complex64, np.complex128])
def test_the_mean_of_few_and_of_many_cells(cells: int, kind: type) -> None:
    rng = np.random.default_rng(0)
    cycles = (
        rng.standard_normal((CYCLES, cells)) + 1j * rng.standard_normal((CYCLES, cells))
    ).astype(kind)
    left = clutter_removal("mean", RADAR).window(cycles)
    assert left.dtype == kind
    # Some roundings of values up to 5.
    np.testing.assert_allclose(
        left, cycles - cycles.mean(axis=0, dtype=complex), atol=20 * np.finfo(kind).eps
    )


@pytest.mark.parametrize("pulses", [2, 3])
@given(turns=st.floats(-0.5, 0.5))
@settings(max_examples=50, deadline=None)
def test_response_of_mti(pulses: int, turns: float) -> None:
    x = tone(CYCLES, turns).reshape(CYCLES, RADAR.n_tx, RADAR.n_rx, -1)
    y = removed("mti", x.reshape(-1, *x.shape[2:]), pulses=pulses)
    order = pulses - 1
    assert (y[:order] == 0).all()
    gain = (1 - np.exp(-2j * np.pi * turns)) ** order / math.sqrt({1: 2, 2: 6}[order])
    assert abs(gain) == pytest.approx(
        abs(2 * math.sin(math.pi * turns)) ** order / math.sqrt({1: 2, 2: 6}[order]), abs=1e-14
    )
    # Rounding of float64: of the phase, 2 pi 64 at most, and of a few sums.
    np.testing.assert_allclose(y[order:], gain * x[order:], rtol=0, atol=1e-12)


@given(turns=st.floats(-0.5, 0.5), cycles_of_time=st.floats(0.3, 20.0))
@settings(max_examples=50, deadline=None)
def test_exponential_against_its_response(turns: float, cycles_of_time: float) -> None:
    n = 600
    radar = Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0, samples_per_chirp=1, chirp_duration_s=1e-3)
    x = tone(n, turns, radar=radar)[:, 0, 0]
    y = removed(
        "exponential", x[:, None, None], radar=radar, time_constant_s=cycles_of_time * 1e-3
    )[:, 0, 0, 0]
    weight = 1 - math.exp(-1 / cycles_of_time)
    turn = np.exp(-2j * np.pi * turns)
    steady = (1 - turn) / (1 - (1 - weight) * turn)
    # What the start leaves has died to exp(-500 / 20) = 1e-11 after 500 cycles.
    np.testing.assert_allclose(y[500:], steady * x[500:], rtol=0, atol=3e-11 * abs(x[0]))


@pytest.mark.parametrize(
    ("time_constant_s", "expected"),
    [
        (1e-3 / math.log(2), [0, 0, 8, -12]),  # the weight is 1/2: the background goes 8, 8, 8, 12
        (1.0, [0, 0, 8, -32 / 3]),  # the mean of all so far: 8, 8, 8, 32/3
    ],
)
def test_exponential_by_hand(time_constant_s: float, expected: list[float]) -> None:
    radar = Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0, samples_per_chirp=1, chirp_duration_s=1e-3)
    x = np.array([8.0, 8.0, 16.0, 0.0])[:, None, None]
    left = removed("exponential", x, radar=radar, time_constant_s=time_constant_s)
    np.testing.assert_allclose(left.ravel(), expected, atol=1e-13)  # rounding of the weight


@pytest.mark.parametrize("turns", [2.0, 2.5, 5.3, 17.77, 31.5, -9.2])
def test_mean_leaves_a_moving_echo_outside_the_lobe_about_zero(turns: float) -> None:
    before = tone(CYCLES, turns / CYCLES).reshape(CYCLES, RADAR.n_tx, RADAR.n_rx, -1)
    after = removed("mean", before.reshape(-1, *before.shape[2:]))
    powers = [power_map(cube, RADAR, window_functions=HANN) for cube in (before, after)]
    zero = CYCLES // 2
    lobe = np.arange(zero - 1, zero + 2)
    outside = np.setdiff1d(np.arange(CYCLES), lobe)
    peak = powers[0].max()
    # A constant fills three bins of a Hann window and no other; what differs is rounding of
    # float64.
    np.testing.assert_allclose(
        powers[1][:, outside], powers[0][:, outside], rtol=0, atol=1e-13 * peak
    )
    # At zero it leaves the mean of the tone as a ghost: sin(pi d) / (N sin(pi d / N)), halved in
    # the bins beside it.
    mean = abs(np.exp(2j * np.pi * turns / CYCLES * np.arange(CYCLES)).mean())
    assert mean == pytest.approx(
        abs(math.sin(math.pi * turns) / (CYCLES * math.sin(math.pi * turns / CYCLES))), abs=1e-12
    )
    amplitude = (abs(before[0]) ** 2).sum(axis=(0, 1))
    hann = np.sin(np.pi * np.arange(CYCLES) / CYCLES) ** 2
    hann_leak = np.array(
        [
            abs(np.fft.fft(np.exp(2j * np.pi * turns / CYCLES * np.arange(CYCLES)) * hann)[0])
            / (CYCLES / 2)
        ]
    )
    assert (abs(np.sqrt(powers[1][:, zero] / amplitude) - mean) <= hann_leak + 1e-12).all()


@pytest.mark.parametrize("kind", [np.complex64, np.complex128])
@pytest.mark.parametrize(("method", "options"), SETTINGS)
@given(cuts=st.lists(st.integers(0, CYCLES), max_size=12), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None)
def test_any_cut_gives_the_same_bits(
    method: str, options: dict[str, Any], kind: type, cuts: list[int], seed: int
) -> None:
    x = noise(CYCLES, seed).astype(kind)
    whole = clutter_removal(method, RADAR, **options).block(x, 0)
    removal = clutter_removal(method, RADAR, **options)
    given_parts, first = [], 0
    for part in np.split(x, [cut * RADAR.n_tx for cut in sorted(cuts)]):
        given_parts.append(removal.block(part, first))
        first += len(part)
    together = np.concatenate(given_parts)
    assert together.dtype == whole.dtype == kind
    assert together.tobytes() == whole.tobytes()


@pytest.mark.parametrize(("method", "options"), SETTINGS)
def test_what_is_given_is_not_written_to(method: str, options: dict[str, Any]) -> None:
    x = noise(CYCLES).astype(np.complex64)
    kept = x.copy()
    x.flags.writeable = False  # as the windows are
    removed(method, x, **options)
    np.testing.assert_array_equal(x, kept)


@pytest.mark.parametrize(("method", "options"), SETTINGS)
def test_a_stream_may_begin_anywhere_and_through_windows(
    method: str, options: dict[str, Any]
) -> None:
    x = (tone(6 * CYCLES, 0.0) * 100 + tone(6 * CYCLES, 0.25, seed=1)).astype(np.complex64)
    removal, windows = clutter_removal(method, RADAR, **options), SlidingWindows(RADAR)
    block = 20 * RADAR.n_tx
    maps = []
    for first in range(0, len(x), block):
        left = removal.block(x[first : first + block], first + 30 * RADAR.n_tx)
        maps += [power_map(removal.window(cube), RADAR) for _, _, cube in windows.push(left)]
    assert len(maps) >= 3
    zero = CYCLES // 2
    for power in maps[
        2:
    ]:  # the first windows hold the start of the stream, and its background the mover
        still, mover = power[:, zero].sum(), power[:, zero + CYCLES // 4].sum()
        assert (still > 1e3 * mover) if method == "none" else (still < 1e-8 * mover)


def test_memory_does_not_grow() -> None:
    def held(removal: ClutterRemoval) -> int:
        arrays = [value for value in vars(removal).values() if isinstance(value, np.ndarray)]
        assert all(value.base is None or value.base.nbytes == value.nbytes for value in arrays)
        return sum(value.nbytes for value in arrays)

    for method, options in SETTINGS:
        removal = clutter_removal(method, RADAR, **options)
        sizes = set()
        for block in range(5):
            removal.block(noise(40).astype(np.complex64), block * 40 * RADAR.n_tx)
            sizes.add(held(removal))
        assert len(sizes) == 1
        assert max(sizes) <= 2 * RADAR.n_channels * RADAR.samples_per_chirp * 8


def test_none_and_the_other_half_pass_through() -> None:
    x = noise(CYCLES).astype(np.complex64)
    cube = x.reshape(CYCLES, RADAR.n_tx, RADAR.n_rx, -1)
    for method in CLUTTER_REMOVALS:
        removal = clutter_removal(method, RADAR)
        if method in ("none", "mean"):
            np.testing.assert_array_equal(removal.block(x, 0), x)
        if method != "mean":
            assert removal.window(cube) is cube


def test_real_spectra_become_complex() -> None:
    assert clutter_removal("mean", RADAR).window(np.ones((4, 2), np.float32)).dtype == np.complex64
    assert clutter_removal("mti", RADAR).block(np.ones((6, 2, 4)), 0).dtype == np.complex128


@pytest.mark.parametrize(
    ("method", "options", "message"),
    [
        ("median", {}, "allowed: none, mean, exponential, mti"),
        ("mean", {"time_constant_s": 1.0}, "no time_constant_s"),
        ("exponential", {"pulses": 2}, "no pulses"),
        ("exponential", {"time_constant_s": 0.0}, "positive and finite"),
        ("exponential", {"time_constant_s": math.nan}, "positive and finite"),
        ("exponential", {"time_constant_s": math.inf}, "positive and finite"),
        ("exponential", {"time_constant_s": "1"}, "number of seconds"),
        ("exponential", {"time_constant_s": True}, "number of seconds"),
        ("mti", {"pulses": 4}, "allowed: 2, 3"),
        ("mti", {"pulses": 1}, "allowed: 2, 3"),
    ],
)
def test_bad_settings(method: str, options: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        clutter_removal(method, RADAR, **options)
    assert "\n" not in str(error.value)


def test_mean_needs_two_cycles() -> None:
    radar = Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0, chirp_duration_s=1e-3, frame_duration_s=1.5e-3)
    with pytest.raises(InputError, match="one TDM cycle"):
        clutter_removal("mean", radar)


@pytest.mark.parametrize(("method", "options"), SETTINGS)
def test_bad_spectra(method: str, options: dict[str, Any]) -> None:
    removal = clutter_removal(method, RADAR, **options)
    good = np.zeros((6, 2, 4), np.complex64)
    for spectra, first, message in [
        (good[0], 0, "needs"),
        (good[:, :1], 0, "needs"),
        (good[..., :3], 0, "needs"),
        (good[:4], 0, "whole TDM cycles"),
        (good, 1, "whole TDM cycles"),
        (good.astype(str), 0, "complex numbers"),
    ]:
        with pytest.raises(InputError, match=message) as error:
            removal.block(spectra, first)
        assert "\n" not in str(error.value)
    removal.block(good, 9)
    for first in (9, 12, 18):
        with pytest.raises(InputError, match="without a gap") as error:
            removal.block(good, first)
        assert "\n" not in str(error.value)
    removal.block(good, 15)
    for cycles in (np.zeros((0, 3)), np.complex64(1)):
        with pytest.raises(InputError, match="at least one cycle") as error:
            removal.window(cycles)
        assert "\n" not in str(error.value)
