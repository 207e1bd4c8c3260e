"""Window functions: their weights, and that those which are named reach every map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import get_window
from scipy.signal import windows as scipy_windows

from rtradar.errors import InputError
from rtradar.process import (
    SlidingRangeTime,
    SlidingSpectrogram,
    WindowFunctions,
    angle,
    angle_spectra,
    cell_spectra,
    clutter_removal,
    power_map,
    range_doppler,
    range_spectrum,
    range_time,
    spectrogram,
)
from rtradar.process.steering import range_walk
from rtradar.process.window_functions import (
    NAMES,
    WindowName,
    noise_bandwidth_bins,
    taylor,
    weights,
)
from rtradar.radar import Radar

CYCLES = 40
RADAR = Radar(
    tx_y=2,
    tx_z=0,
    rx_y=2,
    rx_z=0,
    samples_per_chirp=64,
    chirp_duration_s=100e-6,
    frame_duration_s=CYCLES * 200e-6,
)
OTHER = WindowFunctions("blackman", "blackmanharris")
RANGE_BIN, DOPPLER_BIN = 20.5, 7.5
"""Bins of the tone, between two where its side lobes are largest."""


def tone(n_cycles: int = CYCLES) -> np.ndarray:
    """IF samples (chirp, rx, sample) of one tone that is alike in every channel."""
    cycle = np.repeat(np.arange(n_cycles), RADAR.n_tx)[:, None, None]
    sample = np.broadcast_to(np.arange(64), (RADAR.n_rx, 64))
    return np.exp(2j * np.pi * (RANGE_BIN * sample / 64 + DOPPLER_BIN * cycle / CYCLES))


def cube(x: np.ndarray) -> np.ndarray:
    """Range spectra (cycle, tx, rx, range), in the precision that lets side lobes be seen."""
    spectra = range_spectrum(x, RADAR, window_functions=OTHER).astype(complex)
    return spectra.reshape(-1, RADAR.n_tx, RADAR.n_rx, 64)


def lobes(window: WindowName, n: int, bin_: float) -> np.ndarray:
    """Power (bin,) of a tone at some bin under a window function, by its definition."""
    w = np.asarray(get_window(window, n, fftbins=True))
    turns = np.exp(2j * np.pi * np.outer(np.arange(n), bin_ - np.arange(n)) / n)
    return np.asarray(np.abs((w / w.sum()) @ turns) ** 2)


IN_RANGE = lobes("blackman", 64, RANGE_BIN)
IN_DOPPLER = np.fft.fftshift(lobes("blackmanharris", CYCLES, DOPPLER_BIN))
BOTH = np.outer(IN_RANGE, IN_DOPPLER)
VELOCITY_BINS = np.arange(CYCLES)


def doppler_map() -> np.ndarray:
    found = range_doppler(tone(), RADAR, window_functions=OTHER)
    return np.asarray(np.abs(found.values[..., 3]) ** 2)


def slow_range_time() -> np.ndarray:
    sliding = SlidingRangeTime(RADAR, clutter_removal("none", RADAR), step_s=CYCLES * 200e-6)
    return sliding.push(range_spectrum(tone(), RADAR, window_functions=OTHER), 0)[0][0]


def sliding_spectrogram() -> np.ndarray:
    stream = SlidingSpectrogram(RADAR, window=CYCLES, window_functions=OTHER)
    return stream.push(range_spectrum(tone(), RADAR, window_functions=OTHER)).power[0]


MAPS: dict[str, tuple[Callable[[], np.ndarray], np.ndarray]] = {
    "range spectrum": (lambda: np.abs(cube(tone())[0, 0, 0]) ** 2, IN_RANGE),
    "range-Doppler spectra": (doppler_map, BOTH),
    "power map": (
        lambda: power_map(cube(tone()), RADAR, window_functions=OTHER),
        RADAR.n_channels * BOTH,
    ),
    "cells": (
        lambda: (
            np.abs(
                cell_spectra(
                    cube(tone()),
                    RADAR,
                    np.full(CYCLES, 20),
                    VELOCITY_BINS,
                    window_functions=OTHER,
                )[:, range_walk(RADAR), 2]
            )
            ** 2
        ),
        BOTH[20],
    ),
    "range-time": (
        lambda: range_time(cube(tone()).reshape(-1, 2, 64), RADAR, step_s=CYCLES * 200e-6)[0][0],
        IN_RANGE,
    ),
    "range-time of a stream": (slow_range_time, IN_RANGE),
    "spectrogram": (
        lambda: spectrogram(
            cube(tone())[:, 0, 0], RADAR, window=CYCLES, window_functions=OTHER
        ).power[0],
        IN_RANGE.sum() * IN_DOPPLER,
    ),
    "spectrogram of a stream": (sliding_spectrogram, IN_RANGE.sum() * IN_DOPPLER),
}


@pytest.mark.parametrize("name", MAPS)
def test_side_lobes_of_a_tone_are_those_of_the_window_in_every_map(name: str) -> None:
    found, expected = MAPS[name][0](), MAPS[name][1]
    assert found.shape == expected.shape
    # Range spectra are complex64: their amplitudes are rounded to 1e-7 of the tone.
    np.testing.assert_allclose(
        np.sqrt(found), np.sqrt(expected), rtol=1e-4, atol=1e-6 * np.sqrt(expected.max())
    )


def test_angles_take_the_windows() -> None:
    random = np.random.default_rng(0)
    x = random.standard_normal((80, 2, 64)) + 1j * random.standard_normal((80, 2, 64))
    velocity = 3 * RADAR.velocity_bin_mps
    values = cell_spectra(
        range_spectrum(x, RADAR, window_functions=OTHER).reshape(CYCLES, 2, 2, 64),
        RADAR,
        [10],
        [CYCLES // 2 + 3],
        window_functions=OTHER,
    )
    spectra = angle_spectra(values, RADAR, [RADAR.range_m[10]], [velocity], taper="uniform")
    assert spectra.y is not None
    found = angle(x, RADAR, RADAR.range_m[10], velocity, window_functions=OTHER)[0]
    step = spectra.sines[1] - spectra.sines[0]
    assert abs(np.sin(found) - spectra.sines[spectra.y[0].argmax()]) <= step / 2 * (1 + 1e-9)
    assert abs(found - angle(x, RADAR, RADAR.range_m[10], velocity)[0]) > 1e-3


@pytest.mark.parametrize("windows", [WindowFunctions(), OTHER, WindowFunctions("hann", "flattop")])
def test_doppler_division_removes_the_copies_as_wide_as_the_window_makes_them(
    windows: WindowFunctions,
) -> None:
    radar = replace(RADAR, multiplexing="ddm", doppler_bands=4, frame_duration_s=16e-3)
    n = radar.cycles_per_frame
    cycle, sample = np.arange(n)[:, None, None], np.broadcast_to(np.arange(64), (radar.n_rx, 64))
    echo = np.exp(2j * np.pi * (RANGE_BIN * sample / 64 + DOPPLER_BIN * cycle / n))
    # Each Tx moves the echo by a band, which separating turns back: rows of a Tx hold both.
    both = echo * (1 + np.exp(2j * np.pi * cycle / radar.n_doppler_bands))
    random = np.random.default_rng(0)
    noise = random.standard_normal((*both.shape, 2)) @ [1e-4, 1e-4j]
    spectra = range_spectrum(both + noise, radar, window_functions=windows)
    cube = np.repeat(spectra[:, None], radar.n_tx, axis=1)
    power = power_map(cube, radar, window_functions=windows)
    lobe = np.arange(-windows.main_lobe_bins[0], windows.main_lobe_bins[0] + 1)
    column = int(power.max(axis=0).argmax())
    bands = n // radar.n_doppler_bands * np.arange(1, radar.n_doppler_bands)[:, None]
    copies = power[:, (column + bands + lobe) % n]
    assert copies.max() < 1e-6 * power.max()


@pytest.mark.parametrize("name", [*NAMES, ("chebwin", 80.0), ("kaiser", 8.6)])
@pytest.mark.parametrize("n", [1, 2, 7, 64])
def test_weights_are_those_of_scipy_with_sum_1(name: WindowName, n: int) -> None:
    window = get_window(name, n, fftbins=True)
    np.testing.assert_allclose(weights(name, n), window / window.sum(), rtol=0, atol=1e-15)
    assert not weights(name, n).flags.writeable


@pytest.mark.parametrize(
    ("name", "bins"),
    [
        ("boxcar", 1),
        ("hann", 2),
        ("hamming", 2),
        ("blackman", 3),
        ("blackmanharris", 4),
        ("nuttall", 4),
        ("flattop", 5),
        (("kaiser", 0.0), 1),
    ],
)
def test_half_width_of_the_main_lobe(name: WindowName, bins: int) -> None:
    """Sums of k cosines have their first null k bins from the middle."""
    assert WindowFunctions("hann", name).main_lobe_bins == (bins, 2)
    assert WindowFunctions(name, "hann").main_lobe_bins == (2, bins)


@pytest.mark.parametrize(
    ("name", "bins"), [("boxcar", 1.0), ("hann", 1.5), ("blackman", 1.7268), ("flattop", 3.7702)]
)
def test_noise_bandwidth(name: WindowName, bins: float) -> None:
    """Of a sum of cosines with coefficients a: 1 + sum(a_k^2, k > 0) / (2 a_0^2)."""
    assert noise_bandwidth_bins(name, 64) == pytest.approx(bins, abs=5e-5)


@pytest.mark.parametrize(
    "given",
    [
        "",
        "Hann",
        "kaiser",
        ("kaiser",),
        ("kaiser", -1.0),
        ("kaiser", float("nan")),
        ("kaiser", 1.0, 2.0),
        ("hann", 2.0),
        ("chebwin", 20.0),
        ("chebwin", "80"),
        3,
        None,
    ],
)
@pytest.mark.parametrize("field", ["range", "doppler"])
def test_what_is_no_window_is_refused_in_one_line(field: str, given: object) -> None:
    with pytest.raises(InputError, match=rf"{field} window .* is unknown; allowed: .*hann") as said:
        WindowFunctions(**{field: given})  # type: ignore[arg-type]
    assert "\n" not in str(said.value)


def test_a_list_from_a_file_is_a_window() -> None:
    given: object = ["kaiser", 8]
    found = WindowFunctions(range=given)  # type: ignore[arg-type]
    assert found == WindowFunctions(range=("kaiser", 8.0))


@pytest.mark.parametrize(
    ("n", "lobes", "side_lobe_db"), [(2, 4, 30.0), (9, 5, 35.0), (32, 2, 20.0)]
)
def test_the_taylor_window_is_that_of_scipy(n: int, lobes: int, side_lobe_db: float) -> None:
    theirs = scipy_windows.taylor(n, nbar=lobes, sll=side_lobe_db, norm=False)
    np.testing.assert_allclose(taylor(n, lobes, side_lobe_db), theirs, atol=1e-14)
