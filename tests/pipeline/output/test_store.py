"""The file of maps: what is in it, and that it holds none of it in memory."""

from __future__ import annotations

import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

from rtradar.pipeline.output.writer import MapStore, read_maps
from rtradar.pipeline.timing import forget_peak_memory, peak_memory_mb

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
