"""IF samples without a run: whole or in blocks, those that a run keeps, to the bit."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
import zarr

import rtradar as rt
from rtradar.errors import InputError
from rtradar.pipeline import processing
from rtradar.settings import SimulationOptions

OPTIONS: SimulationOptions = {"fidelity": "analytic", "duration_s": 0.23, "snr_db": 10.0}


@pytest.mark.parametrize("multiplexing", ["tdm", "ddm"])
def test_samples_and_blocks_are_what_a_run_keeps(
    kick: rt.Motion, small: rt.Radar, multiplexing: str, tmp_path: Path
) -> None:
    radar = dataclasses.replace(small, multiplexing=multiplexing)
    capture = rt.simulate(kick, radar, **OPTIONS)
    rt.run(kick, radar, out=tmp_path / "out", save_if=True, **OPTIONS)
    kept = zarr.open_array(tmp_path / "out" / "if.zarr", mode="r")[:]
    assert capture.samples.dtype == np.complex64
    assert capture.samples.shape == capture.shape
    np.testing.assert_array_equal(capture.samples, kept)
    blocks = list(capture.blocks())
    assert len(blocks) > 3
    xr.testing.assert_identical(xr.concat(blocks, "chirp"), capture.samples)


def test_samples_have_the_times_and_transmitters_of_their_chirps(
    kick: rt.Motion, small: rt.Radar
) -> None:
    samples = rt.simulate(kick, small, **OPTIONS).samples
    assert samples.dims == ("chirp", "rx", "sample")
    np.testing.assert_array_equal(samples.time, small.chirp_times(len(samples)))
    assert samples.tx[:5].values.tolist() == [0, 1, 0, 1, 0]
    assert float(samples.fast_time[1]) == 1 / small.sample_rate_hz
    assert (samples.attrs["units"], samples.time.attrs["units"]) == ("m", "s")


def test_samples_too_large_for_memory_are_refused_and_blocks_are_not(
    kick: rt.Motion, small: rt.Radar, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processing, "MEMORY_LIMIT_BYTES", 1e5)
    capture = rt.simulate(kick, small, **OPTIONS)
    with pytest.raises(InputError, match=r"IF samples of 0.23 s .* block by block, blocks\(\), or"):
        _ = capture.samples
    assert next(capture.blocks()).shape == (100, 4, 128)


def test_a_simulation_says_what_it_will_give(kick: rt.Motion, small: rt.Radar) -> None:
    text = repr(rt.simulate(kick, small, **OPTIONS))
    assert "samples: chirp 920, rx 4, sample 128" in text
