"""Clutter-map CFAR: its law against closed forms and integrals, its map against sums by hand, its
schedule."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import gammaincc, gammaln

from rtradar.errors import InputError
from rtradar.process import ClutterMap, WindowFunctions, ca_scale, clutter_map_scale
from rtradar.radar import Radar


def tiny_radar(cycles_per_frame: int, cycles_per_hop: float) -> Radar:
    return Radar(
        tx_y=1,
        tx_z=0,
        rx_y=1,
        rx_z=0,
        chirp_duration_s=1e-3,
        frame_duration_s=cycles_per_frame * 1e-3,
        frame_hop_s=cycles_per_hop * 1e-3,
    )


APART = tiny_radar(16, 16)
OVERLAPPING = tiny_radar(16, 4)
HANN = WindowFunctions("hann", "hann")
"""What the closed forms of these tests are of."""


@given(
    n=st.integers(1, 200),
    looks=st.sampled_from([1, 2, 12, 96]),
    log_pfa=st.floats(math.log(1e-12), math.log(0.9)),
)
@settings(max_examples=60, deadline=None)
def test_equal_weights_are_cell_averaging(n: int, looks: int, log_pfa: float) -> None:
    pfa = math.exp(log_pfa)
    # Both are solved to about 1e-11; at 0.9 the rate hardly depends on the multiplier.
    assert clutter_map_scale(np.full(n, 1 / n), pfa, looks) == pytest.approx(
        ca_scale(n, pfa, looks), rel=1e-9
    )


@given(weight=st.floats(0.01, 0.9), log_pfa=st.floats(math.log(1e-10), math.log(0.5)))
@settings(max_examples=40, deadline=None)
def test_one_look_of_the_exponential_filter_is_nitzbergs_product(
    weight: float, log_pfa: float
) -> None:
    weights = weight * (1 - weight) ** np.arange(2000)
    alpha = clutter_map_scale(weights, math.exp(log_pfa))
    assert -np.log1p(alpha * weights).sum() == pytest.approx(
        log_pfa, abs=1e-8
    )  # the rate is 30 times as steep as alpha


@pytest.mark.parametrize(("looks", "pfa"), [(1, 1e-3), (4, 1e-2), (12, 1e-6)])
def test_two_weights_against_the_integral(looks: int, pfa: float) -> None:
    weights = np.array([0.7, 0.3])
    alpha = clutter_map_scale(weights, pfa, looks)
    density = lambda x: np.exp((looks - 1) * np.log(x) - x - gammaln(looks))  # noqa: E731

    def inner(x: float) -> float:
        f = lambda y: density(y) * gammaincc(looks, alpha * (weights[0] * x + weights[1] * y))  # noqa: E731
        return quad(f, 0, 100, points=[0.01, 1, looks], epsabs=0, epsrel=1e-9, limit=200)[0]

    rate = quad(
        lambda x: density(x) * inner(x),
        0,
        100,
        points=[0.01, 1, looks],
        epsabs=0,
        epsrel=1e-8,
        limit=200,
    )[0]
    assert rate == pytest.approx(pfa, rel=1e-6)  # the two quadratures


@given(
    weights=st.lists(st.floats(0.01, 1.0), min_size=1, max_size=8),
    factor=st.floats(1e-6, 1e6),
    looks=st.sampled_from([1, 5, 400]),
)
@settings(max_examples=30, deadline=None)
def test_unit_of_the_weights(weights: list[float], factor: float, looks: int) -> None:
    alpha = clutter_map_scale(weights, 1e-4, looks)
    assert clutter_map_scale(
        np.array([*weights, 0.0]) * factor, 1e-4, looks
    ) * factor == pytest.approx(alpha, rel=1e-9)


def test_many_looks_do_not_overflow() -> None:
    assert clutter_map_scale(np.full(3, 1 / 3), 1e-6, 3000) == pytest.approx(
        ca_scale(3, 1e-6, 3000), rel=1e-9
    )


@given(data=st.data())
@settings(max_examples=40, deadline=None)
def test_map_against_weights_by_hand(data: st.DataObject) -> None:
    radar = tiny_radar(16, data.draw(st.sampled_from([4, 5.4, 8, 16, 40]), "hop"))
    hop = radar.frame_hop_s
    time_constant_s = data.draw(st.floats(0.5, 5.0), "time constant") * hop
    n = data.draw(st.integers(1, 25), "windows")
    power = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1), "seed")).exponential(
        size=(n, 3, 5)
    )
    scale = 1.7
    clutter = ClutterMap(radar, time_constant_s=time_constant_s, scale=scale)
    weight = 1 - math.exp(-hop / time_constant_s)
    starts = radar.window_starts(10_000)
    for window in range(n):
        found = clutter.push(power[window])
        # Windows that end before this one begins; of 5.4 cycles' hop the third may just miss it by
        # the rounding.
        lag = math.ceil(16 / (hop / 1e-3))
        past = window - lag + 1
        if past < 1:
            assert not found.any()
            continue
        assert starts[window] - starts[past - 1] >= 16
        weights = np.array([1.0])
        for count in range(2, past + 1):
            step = max(weight, 1 / count)
            weights = np.append(weights * (1 - step), step)
        level = np.tensordot(weights, power[:past], axes=1)
        clear = abs(power[window] - scale * level) > 1e-12  # ties go either way by rounding
        np.testing.assert_array_equal(found[clear], (power[window] > scale * level)[clear])


@pytest.mark.parametrize("radar", [APART, OVERLAPPING])
def test_a_still_room_is_learnt_and_a_mover_is_found(radar: Radar) -> None:
    rng = np.random.default_rng(0)
    clutter = ClutterMap(radar, looks=96, pfa=1e-6)
    found = []
    for window in range(40):
        power = rng.gamma(96, size=(30, 16))
        power[10, 8] += 1e6  # the room
        power[window % 30, 3] *= (
            4  # the mover, of 5 dB of signal to noise, changes its range cell from window to window
        )
        found.append(clutter.push(power))
    for window in range(8, 30):
        assert found[window][window % 30, 3]
    assert not any(mask[10, 8] for mask in found)
    assert sum(mask.sum() for mask in found[:30]) == sum(mask[:, 3].sum() for mask in found[:30])


def test_who_stands_still_fades() -> None:
    clutter = ClutterMap(APART, time_constant_s=10 * APART.frame_hop_s, scale=2.0)
    masks = []
    for window in range(80):
        power = np.ones((2, 2))
        power[0, 0] = 11.0 if window >= 40 else 1.0
        masks.append(bool(clutter.push(power)[0, 0]))
    # The map reaches 5.5, half of 11, when 1 - exp(-k / 10) = 0.45: k = 5.98.
    assert masks == [False] * 40 + [True] * 6 + [False] * 34


@pytest.mark.parametrize("radar", [APART, OVERLAPPING])
def test_multipliers_fall_as_the_map_grows_and_then_stay(radar: Radar) -> None:
    clutter = ClutterMap(
        radar, time_constant_s=20 * radar.frame_hop_s, pfa=1e-3, window_functions=HANN
    )
    scales = []
    for _ in range(400):
        clutter.push(np.ones((1, 1)))
        if clutter._count:
            scales.append(clutter._multiplier())
    steps = np.diff(scales)
    # Rounded starts could make the rate of one count differ from the next; here the hop is a whole
    # number of cycles.
    assert (steps <= 1e-9).all()
    assert scales[-1] == scales[-100]
    weight = 1 - math.exp(-1 / 20)
    steady = clutter_map_scale(weight * (1 - weight) ** np.arange(400), 1e-3)
    if radar is APART:
        assert scales[-1] == pytest.approx(steady, rel=2e-3)  # a few windows less than all
    else:
        assert scales[-1] > 1.05 * steady  # windows that share chirps are worth less


def test_overlapping_windows_by_brute_force() -> None:
    # 9 windows in the map, 75 % overlap; the level is simulated from white noise, the tested cell
    # by its survival function.
    radar, n, hop, count = OVERLAPPING, 16, 4, 9
    rng = np.random.default_rng(1)
    x = rng.standard_normal((200_000, n + hop * (count - 1), 2)).view(np.complex128)[..., 0]
    window = np.sin(np.pi * np.arange(n) / n) ** 2
    level = np.mean([abs(x[:, i * hop : i * hop + n] @ window) ** 2 for i in range(count)], axis=0)
    level /= level.mean()
    clutter = ClutterMap(radar, time_constant_s=1.0, pfa=1e-2, window_functions=HANN)
    for _ in range(count + 3):
        clutter.push(np.ones((1, 1)))
    rate = np.exp(-clutter._multiplier() * level)
    assert clutter._count == count
    assert rate.mean() == pytest.approx(
        1e-2, rel=5 * rate.std() / rate.mean() / math.sqrt(len(rate))
    )  # five deviations
    assert 5 * rate.std() / rate.mean() / math.sqrt(len(rate)) < 0.05


def test_what_was_given_may_change() -> None:
    clutter, power = ClutterMap(OVERLAPPING, scale=2.0), np.ones((2, 2))
    for _ in range(6):
        clutter.push(power)
    power[:] = 100.0
    assert clutter.push(power).all()


def test_memory_does_not_grow() -> None:
    clutter = ClutterMap(OVERLAPPING, scale=2.0)
    for _ in range(50):
        clutter.push(np.ones((2, 2), np.float32))
    assert len(clutter._waiting) == 3


@pytest.mark.parametrize("time_constant_s", [1e-300, 1e-9, 1e6, 1e300])
def test_extreme_time_constants(time_constant_s: float) -> None:
    clutter = ClutterMap(APART, time_constant_s=time_constant_s, pfa=1e-3)
    for _ in range(5):
        assert not clutter.push(np.ones((2, 2))).any()
    assert 1 < clutter._multiplier() < 1000


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"pfa": 0.0}, "false-alarm rate"),
        ({"pfa": math.nan}, "false-alarm rate"),
        ({"looks": 0}, "looks"),
        ({"looks": 1.5}, "looks"),
        ({"time_constant_s": 0.0}, "time_constant_s"),
        ({"time_constant_s": math.nan}, "time_constant_s"),
        ({"time_constant_s": "1"}, "time_constant_s"),
        ({"scale": 0.0}, "scale"),
        ({"scale": math.inf}, "scale"),
    ],
)
def test_bad_settings(options: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        ClutterMap(APART, **options)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("power", "message"),
    [
        (np.ones(5), "range, velocity"),
        (np.ones((2, 2), complex), "range, velocity"),
        (np.ones((3, 2)), "must be alike"),
        (np.full((2, 2), np.nan), "NaN"),
        (np.full((2, 2), np.inf), "infinity"),
        (-np.ones((2, 2)), "decibels"),
    ],
)
@pytest.mark.parametrize("radar", [APART, OVERLAPPING])
def test_bad_maps(radar: Radar, power: np.ndarray, message: str) -> None:
    clutter = ClutterMap(radar)
    clutter.push(np.ones((2, 2)))
    with pytest.raises(InputError, match=message) as error:
        clutter.push(power)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("weights", "message"),
    [
        ([], "sum to 0"),
        ([0.0], "sum to 0"),
        ([-1.0], "at least 0"),
        ([[1.0]], "at least 0"),
        ("a", "finite"),
    ],
)
def test_bad_weights(weights: object, message: str) -> None:
    with pytest.raises(InputError, match=message):
        clutter_map_scale(weights, 1e-3)
