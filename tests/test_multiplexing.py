"""TDM, FDM and Doppler division: a moving point under each, against closed forms."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zarr
from numpy.typing import NDArray

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.exchange.recording import open_recording
from rtradar.process import (
    WindowFunctions,
    angle,
    build_detector,
    os_cfar,
    power_map,
    range_spectrum,
    range_time,
    spectrogram,
    window_cycles,
)
from rtradar.signal import Noise, receive, separate, synthesize

ALL = ("tdm", "fdm", "ddm")
HANN = WindowFunctions("hann", "hann")
"""What the closed forms of these tests are of."""


def radar(multiplexing: str, **changes: Any) -> rt.Radar:
    """Three Tx and four Rx on each line; 64 chirps of a cycle in a frame."""
    fields = {
        "tx_y": 2,
        "tx_z": 2,
        "rx_y": 4,
        "rx_z": 4,
        "tx_spacing_wavelengths": 2.0,
        "samples_per_chirp": 256,
        "channels": "all" if multiplexing == "ddm" else "pairs",
        "position_m": (0.0, 0.0, 0.0),
    }
    made = rt.Radar(multiplexing=multiplexing, **(fields | changes))
    return rt.Radar(**{**vars_of(made), "frame_duration_s": 192 * made.cycle_duration_s})


def vars_of(made: rt.Radar) -> dict[str, Any]:
    return {name: getattr(made, name) for name in made.__dataclass_fields__}


def point(
    made: rt.Radar, place: tuple[float, float, float], rate: float, amplitude: float = 1.0
) -> NDArray[np.complexfloating]:
    """Echoes of one frame of a point that is at ``place`` in its middle and recedes at ``rate``."""
    chirps = np.arange(made.chirps_per_frame)
    # Written out: when each chirp is on the air is what is tested.
    slots = chirps if made.multiplexing == "tdm" else chirps // made.n_tx
    times = (slots + 0.5) * made.chirp_duration_s
    middle = times.mean()
    at = np.asarray(place) * (1 + rate * (times - middle) / np.linalg.norm(place))[:, None]
    tx = chirps % made.n_tx
    there = np.linalg.norm(at - made.tx[tx], axis=1)[:, None]
    back = np.linalg.norm(at[:, None] - made.rx[made.rx_of_tx[tx]], axis=2)
    return synthesize(echo(there + back, tx, amplitude), made, times)


def echo(length: NDArray[np.float64], tx: NDArray[np.int64], amplitude: float = 1.0) -> rt.Echoes:
    return rt.Echoes(
        length=length[..., None],
        amplitude=np.full((1, *length.shape, 1), amplitude, dtype=np.complex128),
        frequency=np.array([14e9]),
        tx=tx,
        part=np.zeros(1, np.int64),
        bounces=np.ones(1, np.int64),
    )


def window(made: rt.Radar, rows: NDArray[np.complexfloating]) -> NDArray[np.complexfloating]:
    """The echoes through the receiver, as the cube of one frame."""
    spectra = range_spectrum(separate(receive(rows, made, 0), made, 0), made)
    return spectra.reshape(-1, made.n_tx, *spectra.shape[1:])


@pytest.mark.parametrize("bands", [5, 8])
def test_the_unambiguous_velocity(bands: int) -> None:
    # lambda / (4 T), where T is the time until a Tx transmits again: 62.5 us, or 4 times that.
    quarter = SPEED_OF_LIGHT_MPS / 14e9 / 4
    found = [radar("tdm"), radar("fdm"), radar("ddm", doppler_bands=bands)]
    assert [made.max_velocity_mps for made in found] == pytest.approx(
        [quarter / 250e-6, quarter / 62.5e-6, quarter / 62.5e-6]
    )
    assert [made.cycles_per_frame % made.n_doppler_bands for made in found] == [0, 0, 0]


@pytest.mark.parametrize("multiplexing", ALL)
@pytest.mark.parametrize("rate", [0.0, 3.7, -9.3])
def test_a_moving_point_has_its_range_velocity_and_direction(
    multiplexing: str, rate: float
) -> None:
    made = radar(multiplexing)
    assert abs(rate) < made.max_velocity_mps
    azimuth, elevation, distance = math.radians(14), math.radians(-9), 4.2
    across = math.cos(elevation)
    place = (
        across * math.cos(azimuth) * distance,
        across * math.sin(azimuth) * distance,
        math.sin(elevation) * distance,
    )
    rows = point(made, place, rate)
    power = power_map(window(made, rows), made)
    row, column = np.unravel_index(power.argmax(), power.shape)
    velocity = made.velocity_mps(power.shape[1])[column]
    assert made.range_m[row] == pytest.approx(distance, abs=made.range_bin_m)
    assert velocity == pytest.approx(rate, abs=0.51 * made.velocity_bin_mps)
    parted = separate(receive(rows, made, 0), made, 0)
    found = angle(parted, made, made.range_m[row], velocity)
    # A tenth of the beam of these short lines, about 7 degrees.
    assert np.degrees(found) == pytest.approx([14, -9], abs=0.7)


@pytest.mark.parametrize(
    ("multiplexing", "reads"), [("tdm", 25.0 - 2 * 21.414), ("fdm", 25.0), ("ddm", 25.0)]
)
def test_what_is_too_fast_for_tdm_folds_there_and_nowhere_else(
    multiplexing: str, reads: float
) -> None:
    made = radar(multiplexing)
    power = power_map(window(made, point(made, (5.0, 0.0, 0.0), 25.0)), made)
    column = int(power.sum(axis=0).argmax())
    assert made.velocity_mps(power.shape[1])[column] == pytest.approx(
        reads, abs=made.velocity_bin_mps
    )


@pytest.mark.parametrize("multiplexing", ALL)
def test_power_adds_up_over_the_channels(multiplexing: str) -> None:
    made = radar(multiplexing, tx_z=0, rx_z=0)
    # In the middle of a bin of range and velocity, broadside, so far away that no channel leaves
    # the bin; and at rest, because a moving point would leave it.
    place, amplitude = (128 * made.range_bin_m, 0.0, 0.0), 0.3
    rows = point(made, place, 0.0, amplitude)
    power = power_map(window(made, rows), made)
    # Coherent gain 1 in every channel; 0.5 % because not all lengths are exactly those of the bin.
    assert power.max() == pytest.approx(made.n_channels * amplitude**2, rel=5e-3)
    row, column = np.unravel_index(power.argmax(), power.shape)
    assert (row, column - power.shape[1] // 2) == (128, 0)
    # Beyond the skirts of the echo nothing is left, so there is no copy.
    beside = np.abs(np.arange(power.shape[1]) - column) > 12
    assert power[:, beside].max() < 1e-5 * power.max()


def test_the_sum_that_doppler_division_receives() -> None:
    made = radar("ddm", doppler_bands=7)
    rows = point(made, (3.0, 0.4, 0.2), 2.0)
    first = 5 * made.n_tx
    received = receive(rows, made, first)
    expected = np.zeros_like(received)
    for chirp, row in enumerate(rows):
        cycle, tx = divmod(chirp, made.n_tx)
        expected[cycle] += np.exp(2j * np.pi * tx * (cycle + 5) / 7) * row
    np.testing.assert_allclose(received, expected, atol=1e-6)
    # For one Tx alone, its row is what it sent, whatever the others would be.
    for tx in range(made.n_tx):
        alone = np.where((np.arange(len(rows)) % made.n_tx == tx)[:, None, None], rows, 0)
        again = separate(receive(alone, made, first), made, first)
        np.testing.assert_allclose(again[tx :: made.n_tx], alone[tx :: made.n_tx], atol=1e-6)

    # Each Tx has bins of its own, so the power of the sum is that of the parts: one echo, no noise.
    def energy(samples: NDArray[np.complexfloating]) -> float:
        return float((np.abs(samples) ** 2).sum())

    assert energy(received) == pytest.approx(energy(rows), rel=1e-3)


def test_each_carrier_of_fdm_turns_by_its_own_frequency() -> None:
    made = radar("fdm", carrier_step_hz=10e6)
    length, tx = np.full((4, 4), 7.3), np.arange(4)
    samples = synthesize(echo(length, tx), made, made.chirp_times(4))
    delay, time = 7.3 / SPEED_OF_LIGHT_MPS, np.arange(256) / made.sample_rate_hz
    slope = 4e9 / 62.5e-6
    for k, start in enumerate((12e9 - 15e6, 12e9 - 5e6, 12e9 + 5e6, 12e9 + 15e6)):
        phase = start * delay + slope * delay * time - slope * delay**2 / 2
        np.testing.assert_allclose(
            samples[k], np.exp(2j * np.pi * phase)[None].repeat(4, axis=0), atol=1e-7
        )
    assert made.occupied_bandwidth_hz == pytest.approx(4.03e9)
    assert made.receiver_rate_hz == pytest.approx(256 / 62.5e-6 + 30e6)


def test_the_least_carrier_step_is_the_width_of_a_band() -> None:
    made = radar("fdm")
    np.testing.assert_allclose(np.diff(made.tx_offset_hz), made.sample_rate_hz)
    assert made.receiver_rate_hz == pytest.approx(4 * made.sample_rate_hz)


def test_noise_of_one_receiver_and_its_false_alarms() -> None:
    made = radar("ddm", samples_per_chirp=128)
    pfa, alarms, cells, mean = 1e-3, 0, 0, []
    for seed in range(4):
        received = np.zeros(
            (made.cycles_per_frame, made.n_rx, made.samples_per_chirp), np.complex64
        )
        Noise(2.0, seed).add(received, made, 0)
        assert (np.abs(received) ** 2).mean() == pytest.approx(
            2.0, rel=5 / math.sqrt(received.size)
        )
        spectra = range_spectrum(separate(received, made, 0), made, window_functions=HANN)
        cube = spectra.reshape(-1, made.n_tx, *spectra.shape[1:])
        power = power_map(cube, made, window_functions=HANN)
        mean.append(power.mean())
        alarms += int(os_cfar(power, pfa=pfa, looks=made.n_channels).sum())
        cells += power.size
    # Hann, coherent gain 1: a bin takes 1.5 / n of the noise in each of both transforms.
    expected = 2.0 * 1.5**2 / (made.samples_per_chirp * made.cycles_per_frame) * made.n_channels
    assert np.mean(mean) == pytest.approx(expected, rel=0.01)
    # Neighbours under a Hann window are not independent, and false alarms come in twos and threes.
    assert 0.5 * pfa * cells < alarms < 1.5 * pfa * cells


def test_two_echoes_and_noise_are_detected_where_they_are_and_nowhere_else() -> None:
    made = radar("ddm")
    rows = point(made, (3.0, 0.0, 0.0), -30.0) + point(made, (5.0, 0.0, 0.0), 8.0, 0.1)
    received = receive(rows, made, 0).astype(np.complex64)
    Noise(1.0, 0).add(received, made, 0)
    spectra = range_spectrum(separate(received, made, 0), made, window_functions=HANN)
    power = power_map(
        spectra.reshape(-1, made.n_tx, *spectra.shape[1:]), made, window_functions=HANN
    )
    mask = build_detector("os-cfar", pfa=1e-6, looks=made.n_channels)(power)
    velocity = made.velocity_mps(power.shape[1])
    rows_found, columns = np.nonzero(mask)
    near_first = (np.abs(made.range_m[rows_found] - 3) < 0.3) & (np.abs(velocity[columns] + 30) < 4)
    near_second = (np.abs(made.range_m[rows_found] - 5) < 0.3) & (np.abs(velocity[columns] - 8) < 4)
    assert near_first.any()
    assert near_second.any()
    assert (near_first | near_second).all()


@pytest.mark.parametrize("tx", [0, 1, 3])
def test_the_spectrogram_of_doppler_division_shows_one_line(tx: int) -> None:
    made = radar("ddm")
    spectra = window(made, point(made, (4.0, 0.0, 0.0), 20.0, 0.5))
    cycles = 16 * made.n_doppler_bands
    found = spectrogram(spectra[:, tx, 0], made, tx=tx, window=cycles)
    column = found.power.argmax(axis=1)
    assert np.abs(found.velocity[column] - 20.0).max() < 2 * SPEED_OF_LIGHT_MPS / 28e9 / (
        cycles * 62.5e-6
    )
    beside = np.abs(found.velocity - 20) > 10
    assert found.power[:, beside].max() < 1e-4 * found.power.max()
    assert window_cycles(made) % made.n_doppler_bands == 0
    assert window_cycles(made) * made.cycle_duration_s == pytest.approx(
        window_cycles(radar("tdm")) * 250e-6, rel=0.02
    )


@pytest.mark.slow
@pytest.mark.parametrize("multiplexing", ["fdm", "ddm"])
def test_a_run(tmp_path: Path, multiplexing: str) -> None:
    made = rt.Radar(
        tx_y=4,
        tx_z=0,
        rx_y=4,
        rx_z=0,
        chirp_duration_s=100e-6,
        samples_per_chirp=128,
        frame_duration_s=0.05,
        multiplexing=multiplexing,
    )
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.2)
    result = rt.run(motion, made, out=tmp_path / "out", fidelity="analytic", save_if=True, pfa=1e-9)
    rows = 2000 * (4 if multiplexing == "fdm" else 1)
    assert zarr.open_array(tmp_path / "out" / "if.zarr", mode="r").shape == (rows, 4, 128)
    assert result.summary["capture_s"] == pytest.approx(0.2)
    assert result.summary["detections"] > 0
    # Under DDM a chirp holds the sum of all Tx.
    n_tx = 1 if multiplexing == "ddm" else 4
    assert open_recording(tmp_path / "out").cube_shape == (2000, n_tx, 4, 128)
    # The limbs of a walk, in a map up to 54 m/s; where four Tx fade against each other, a copy may
    # be taken for the echo.
    assert (np.abs(result.points[:, 2]) < 6.0).mean() > 0.99


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"multiplexing": "cdm"}, "allowed: tdm, fdm, ddm"),
        ({"multiplexing": "fdm", "carrier_step_hz": 4e6}, "bands of the IF are 4.096e"),
        ({"multiplexing": "fdm", "carrier_step_hz": 12e9 / 5.5}, "at no positive frequency"),
        (
            {
                "multiplexing": "fdm",
                "start_frequency_hz": 1e9,
                "bandwidth_hz": 9e8,
                "samples_per_chirp": 16000,
            },
            "12 carriers 2.56e.08 Hz apart begin 1.408",
        ),
        ({"carrier_step_hz": 4e6}, "belongs to multiplexing = 'fdm'"),
        ({"multiplexing": "fdm", "doppler_bands": 16}, "belongs to multiplexing = 'ddm'"),
        (
            {"multiplexing": "ddm", "channels": "all", "doppler_bands": 12},
            "above 12, the number of Tx",
        ),
        ({"multiplexing": "ddm"}, "every Rx receives all Tx; set channels = 'all'"),
        (
            {"multiplexing": "ddm", "channels": "all", "frame_duration_s": 900e-6},
            "no whole DDM cycle of 0.001 s",
        ),
    ],
)
def test_what_has_no_meaning_is_refused(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(rt.InputError, match=said):
        rt.Radar(**changes)


def test_clutter_removal_is_refused_where_it_would_leave_copies() -> None:
    from rtradar.process import clutter_removal

    with pytest.raises(rt.InputError, match="a Doppler of its own for each Tx"):
        clutter_removal("mean", radar("ddm"))
    assert clutter_removal("none", radar("ddm")) is not None


@pytest.mark.parametrize("multiplexing", ALL)
def test_range_time_is_the_mean_power_of_a_channel(multiplexing: str) -> None:
    made = radar(multiplexing, tx_z=0, rx_z=0)
    # At rest in the middle of bin 128, broadside; motion between chirps would spread DDM.
    cube = window(made, point(made, (128 * made.range_bin_m, 0.0, 0.0), 0.0, 0.3))
    power, times = range_time(cube.reshape(-1, *cube.shape[2:]), made, step_s=made.frame_duration_s)
    assert power[0, 128] == pytest.approx(0.3**2, rel=5e-3)
    assert times[0] == pytest.approx(made.cycles_per_frame * made.cycle_duration_s / 2)
