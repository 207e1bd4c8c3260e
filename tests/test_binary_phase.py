"""Binary phase modulation: all Tx in each chirp, told apart by their signs."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.exchange import Dca1000Layout, export, open_samples
from rtradar.process import angle, range_doppler, range_spectrum, ti_oob
from rtradar.signal import separate

HALF = 1.93e-3  # of a wavelength at the middle of the sweep [m]
FOUR = rt.Radar(
    name="four signs",
    start_frequency_hz=77e9,
    bandwidth_hz=1.5e9,
    chirp_duration_s=30e-6,
    samples_per_chirp=64,
    tx_positions_m=[[0, 0, 0], [0, -4 * HALF, 0], [0, 0, HALF], [0, -4 * HALF, HALF]],
    rx_positions_m=[[0, -number * HALF, 0] for number in range(4)],
    position_m=(-3, 0, 1),
    chirps_per_frame=4 * 32,
    multiplexing="bpm",
)
TWO = dataclasses.replace(
    FOUR, name="two signs", tx_positions_m=[[0, 0, 0], [0, -4 * HALF, 0]], chirps_per_frame=64
)


def samples_of(radar: rt.Radar, place: np.ndarray, rate: float) -> np.ndarray:
    """IF samples (chirp, rx, sample) of a point that recedes, by its paths alone."""
    chirps = np.arange(radar.chirps_per_frame)
    away = rate * (chirps - chirps.mean()) * radar.chirp_duration_s
    points = radar.position_m + place * (1 + away / np.linalg.norm(place))[:, None]
    n = radar.samples_per_chirp
    fast = radar.start_frequency_hz + np.arange(n) / n * radar.bandwidth_hz
    paths = [np.linalg.norm(points[:, None] - ends, axis=2) for ends in (radar.tx, radar.rx)]
    delay = (paths[0][:, :, None] + paths[1][:, None]) / SPEED_OF_LIGHT_MPS
    signs = scipy.linalg.hadamard(radar.n_tx)[chirps % radar.n_tx]
    return np.einsum("ct,ctrs->crs", signs, np.exp(2j * np.pi * delay[..., None] * fast))


@settings(max_examples=12)
@given(
    place=st.tuples(st.floats(-0.6, 0.6), st.floats(-0.4, 0.4), st.floats(1.5, 4.5)),
    share=st.floats(-0.4, 0.4),
)
@pytest.mark.parametrize("radar", [TWO, FOUR], ids=lambda one: one.name)
def test_a_point_reads_back(
    radar: rt.Radar, place: tuple[float, float, float], share: float
) -> None:
    azimuth, elevation, far = place if radar is FOUR else (place[0], 0.0, place[2])
    rate = share * radar.max_velocity_mps
    level = np.cos(elevation)
    ahead = np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    parted = separate(samples_of(radar, far * ahead, rate), radar, 0)
    power = (np.abs(range_doppler(parted, radar).values) ** 2).sum(axis=2)
    assert power.max() == pytest.approx(radar.n_channels, rel=0.6)  # of each Tx alone it is 1
    row, column = np.unravel_index(power.argmax(), power.shape)
    assert abs(row - far / radar.range_bin_m) < 0.6
    assert abs(radar.velocity_mps(32)[column] - rate) < 0.51 * radar.velocity_bin_mps
    found = angle(parted.astype(np.complex64), radar, far, rate)
    beams = np.radians([13, 57])  # of 8 and of 2 elements at half a wavelength
    for ours, true, beam in zip(found, (azimuth, elevation), beams, strict=True):
        assert abs(ours - true) < 0.1 * beam or (radar is TWO and np.isnan(ours))
    # The chain of the chips, too, which reads azimuths on a grid of 64 bins.
    cube = range_spectrum(parted, radar).reshape(32, radar.n_tx, 4, -1)
    mask, sines = ti_oob(cube, radar)
    (own,) = np.flatnonzero((np.argwhere(mask) == [row, column]).all(axis=1))
    true = [ahead[1], ahead[2] if radar is FOUR else np.nan]
    np.testing.assert_allclose(sines[own], true, atol=0.02)


def test_a_run_finds_the_person_where_tdm_does() -> None:
    motion = rt.synthetic_motion("walk", duration_s=0.3)
    board = dataclasses.replace(TWO, samples_per_chirp=128)
    found = []
    for multiplexing in ("tdm", "bpm"):
        radar = dataclasses.replace(board, multiplexing=multiplexing)
        result = rt.run(motion, radar, fidelity="analytic", snr_db=30, seed=1, duration_s=0.02)
        found.append(np.average(result.spatial.points[:, :2], axis=0, weights=result.spatial.power))
    np.testing.assert_allclose(found[1], found[0], atol=0.02)


def test_samples_that_were_written_give_the_maps_of_the_run(tmp_path: Path) -> None:
    motion = rt.synthetic_motion("walk", duration_s=0.1)
    folder = tmp_path / "run"
    ran = rt.run(motion, TWO, fidelity="analytic", out=folder, save_if=True)
    maps = []
    for name, layout in ("run", None), ("sums.npy", None), ("adc.bin", Dca1000Layout()):
        if name != "run":
            export(folder, tmp_path / name, dca1000=layout)
        read = open_samples(tmp_path / name)
        assert read.radar in (TWO, None)  # a .npy file does not say it
        maps.append(rt.process_samples(read[:], TWO).maps["range_doppler"].values)
    np.testing.assert_array_equal(maps[0], ran.maps["range_doppler"].values)
    np.testing.assert_array_equal(maps[1], maps[0])
    np.testing.assert_allclose(np.sqrt(maps[2]), np.sqrt(maps[0]), atol=1e-3 * maps[0].max() ** 0.5)
    with pytest.raises(InputError, match=r"sum of all Tx, as multiplexing = 'bpm' receives it"):
        export(folder, tmp_path / "sums.mat")


def test_what_is_not_simulated_is_refused_in_one_line() -> None:
    with pytest.raises(InputError, match=r"'bpm' needs 2, 4, 8 \.\.\. Tx, here 3; leave some out$"):
        dataclasses.replace(FOUR, tx_positions_m=FOUR.tx_positions_m[:3], chirps_per_frame=96)
    with pytest.raises(InputError, match="receiver: it is not simulated under multiplexing"):
        dataclasses.replace(TWO, receiver=rt.Receiver(iq_gain_db=0.1), transmit_power_dbm=12)
    motion = rt.synthetic_motion("walk", duration_s=0.1)
    with pytest.raises(InputError, match="scene 'living-room': radar 'two signs' has multiplexing"):
        rt.run(motion, TWO, rt.Scene.load("living-room"))
