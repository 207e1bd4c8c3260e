"""What is made of range spectra, whatever the pieces they come in, and the file of the maps."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

import rtradar as rt
from rtradar.pipeline import processing
from rtradar.pipeline.output.writer import MapStore, RunWriter, read_maps
from rtradar.pipeline.processing import Processing
from rtradar.pipeline.timing import forget_peak_memory, peak_memory_mb
from rtradar.process import power_map
from rtradar.settings import RunSettings

RADAR = rt.Radar(
    name="small",
    tx_y=2,
    tx_z=0,
    rx_y=4,
    rx_z=0,
    chirp_duration_s=250e-6,
    samples_per_chirp=64,
    frame_duration_s=0.05,
)


@pytest.mark.parametrize("method", ["none", "mean"])
def test_pieces_give_what_the_whole_gives(
    method: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processing, "_MAX_BYTES", 1)
    random = np.random.default_rng(0)
    chirps = np.arange(800)
    tone = (
        np.exp(2j * np.pi * 0.1 * chirps)[:, None, None]
        * np.ones((1, 4, 1))
        * (np.arange(64) == 20)
    )
    spectra = (tone + 0.01 * random.standard_normal((800, 4, 64))).astype(np.complex64)
    found = []
    for name, cut in (("whole", False), ("pieces", True)):
        settings = RunSettings(pfa=1e-4, clutter_removal=method)
        made = RunWriter(tmp_path / f"{name}.h5", Processing.of(RADAR, settings), "")
        # 10 cycles of 0.5 ms are a step of range-time; a hop of the windows is 50 of them.
        assert made.max_chirps == 10 * RADAR.n_tx
        for block in range(0, 800, 100):
            for first in range(block, block + 100, made.max_chirps if cut else 100):
                last = min(first + made.max_chirps, block + 100) if cut else block + 100
                made.push(spectra[first:last], first)
        clouds = made.finish()
        with h5py.File(tmp_path / f"{name}.h5") as maps:
            found.append(
                {key: maps[key][:] for key in maps}
                | {"rdt": clouds.rdt.points, "xyz": clouds.spatial.points}
            )
    assert len(found[0]["rdt"]) == processing.CLOUD_POINTS
    assert found[0].keys() == found[1].keys()
    for key, values in found[0].items():
        np.testing.assert_array_equal(found[1][key], values, err_msg=key)


SAID = {
    "none": dict.fromkeys(
        ("range_doppler", "detections", "range_time", "spectrogram", "range_azimuth"), "none"
    ),
    # 100 cycles of 0.5 ms are a window; 128 one of the spectrogram.
    "mean": dict.fromkeys(
        ("range_doppler", "detections", "range_time", "range_azimuth"),
        "mean over 100 cycles (0.05 s)",
    )
    | {"spectrogram": "mean over 128 cycles (0.064 s)"},
    "exponential": {"spectrogram": "exponential background, time constant 1 s"},
    "mti": {"range_time": "MTI canceller of 2 pulses"},
}


@pytest.mark.parametrize("method", SAID)
def test_clutter_is_removed_from_every_map_and_each_says_how(method: str, tmp_path: Path) -> None:
    """A room of amplitude 1000 in one range bin, a walker of 1 in another."""
    chirps = np.arange(1600)
    walker = np.exp(4j * np.pi * 1.5 * (chirps // 2) * RADAR.cycle_duration_s / RADAR.wavelength_m)
    own = 1000.0 * (np.arange(64) == 10) + walker[:, None] * (np.arange(64) == 20)
    noise = 1e-3 * np.random.default_rng(0).standard_normal((1600, 4, 64))
    spectra = (own[:, None] + noise).astype(np.complex64)
    settings = RunSettings(pfa=1e-4, clutter_removal=method)
    made = RunWriter(tmp_path / "maps.h5", Processing.of(RADAR, settings), "")
    for first in range(0, 1600, 100):
        made.push(spectra[first : first + 100], first)
    made.finish()
    with h5py.File(tmp_path / "maps.h5") as maps:
        zero_doppler = float(maps["spectrogram"][20:, 64].max())
        still, moving = (float(maps["range_time"][40:, bin_].max()) for bin_ in (10, 20))
        assert {name: maps[name].attrs["clutter_removal"] for name in SAID[method]} == SAID[method]
        assert len(maps["slow_time"]) == 80
        assert (np.diff(maps["slow_time"]) > 0).all()
    if method == "none":
        assert zero_doppler == pytest.approx(1e6, rel=0.01)
        assert still == pytest.approx(1e6, rel=0.01)
    else:
        assert zero_doppler < 0.1  # of the walker's skirts
        assert still < 1e-2
    assert moving > 0.05  # MTI weakens 1.5 m/s by 10 dB


def test_the_middle_frame_is_kept_as_it_was_received(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    spectra = random.standard_normal((800, 4, 128)).astype(np.float32).view(np.complex64)
    starts = RADAR.window_starts(800)
    processing = Processing.of(RADAR, RunSettings(clutter_removal="mti"))
    with RunWriter(tmp_path / "maps.h5", processing, "", starts) as made:
        for first in range(0, 800, 62):
            made.push(spectra[first : first + 62], first)
    first = starts[len(starts) // 2] * RADAR.n_tx
    cube = spectra[first : first + RADAR.chirps_per_frame].reshape(-1, 2, 4, 64)
    with read_maps(tmp_path / "maps.h5") as maps:
        kept = maps["range_doppler_received"]
        assert kept.attrs["time_s"] == RADAR.window_times(starts)[len(starts) // 2]
        np.testing.assert_array_equal(kept, power_map(cube, RADAR))


FIXED = {"range": np.arange(256.0), "velocity": np.arange(128.0)}


def test_maps_grow_step_by_step_however_many_come_at_once(tmp_path: Path) -> None:
    power = np.random.default_rng(0).random((150, 256)).astype(np.float32)
    times = np.arange(150.0)
    store = MapStore(tmp_path / "maps.h5", FIXED, {"title": "some"})
    for part in np.split(np.arange(150), [1, 63, 64, 65, 130]):
        store.extend("slow_time", times[part], range_time=power[part])
    store.close()
    store.close()
    with h5py.File(tmp_path / "maps.h5") as maps:
        np.testing.assert_array_equal(maps["range_time"][:], power)
        np.testing.assert_array_equal(maps["slow_time"][:], times)
        assert maps.attrs["title"] == "some"
        assert "range_azimuth" not in maps  # no such axis


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux can forget a peak")
def test_a_long_file_takes_no_more_memory_than_a_short_one(tmp_path: Path) -> None:
    store = MapStore(tmp_path / "maps.h5", FIXED, {})
    power, mask, rows = (
        np.ones((1, 256, 128), np.float32),
        np.ones((1, 256, 128), bool),
        np.ones((64, 256), np.float32),
    )

    def write(windows: range) -> None:
        for window in windows:
            store.extend("time", [window], range_doppler=power, detections=mask)
            store.extend("slow_time", window + np.arange(64) / 64, range_time=rows)

    write(range(20))  # 5 MB, some of which have waited to be written together
    forget_peak_memory()
    before = peak_memory_mb()
    write(range(20, 220))
    # 46 MB are written; HDF5 would keep 8 MB of each map. Its own book-keeping takes a few hundred
    # kB.
    assert peak_memory_mb() - before < 4
    store.close()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux can forget a peak")
def test_reading_a_long_file_through_takes_no_more_memory_than_a_frame(tmp_path: Path) -> None:
    store = MapStore(tmp_path / "maps.h5", FIXED, {})
    ones = np.ones((1, 256, 128), np.float32)
    for window in range(200):
        store.extend("time", [window], range_doppler=ones, detections=ones > 0)
    store.close()
    with read_maps(tmp_path / "maps.h5") as maps:
        power, mask = maps["range_doppler"], maps["detections"]
        assert power[0].all()
        assert mask[0].all()
        forget_peak_memory()
        before = peak_memory_mb()
        for window in range(200):
            assert power[window].all()
            assert mask[window].all()
    # 33 MB are read; HDF5 would keep 8 MB of each map.
    assert peak_memory_mb() - before < 4
