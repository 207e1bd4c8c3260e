"""Directions of many cells, a few at a time."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from rtradar.pipeline import processing
from rtradar.pipeline.processing import frame_angles
from rtradar.radar import Radar

RADAR = Radar(
    tx_y=2,
    tx_z=2,
    rx_y=4,
    rx_z=4,
    chirp_duration_s=250e-6,
    samples_per_chirp=64,
    frame_duration_s=0.016,
)


@pytest.mark.parametrize("radar", [RADAR, dataclasses.replace(RADAR, tx_z=0, rx_z=0)])
@pytest.mark.parametrize("n_cells", [0, 7, 30])
def test_cells_a_few_at_a_time(monkeypatch: pytest.MonkeyPatch, radar: Radar, n_cells: int) -> None:
    rng = np.random.default_rng(n_cells)
    shape = radar.cycles_per_frame, radar.n_tx, radar.n_rx, radar.samples_per_chirp
    cube = (rng.normal(size=shape) + 1j * rng.normal(size=shape)).astype(np.complex64)
    mask = np.zeros((radar.samples_per_chirp, radar.cycles_per_frame), dtype=bool)
    mask.flat[rng.choice(mask.size, n_cells, replace=False)] = True
    whole = frame_angles(cube, mask, radar)
    monkeypatch.setattr(processing, "_CELLS_AT_ONCE", 7)
    pieces = frame_angles(cube, mask, radar)
    assert len(whole.range_m) == n_cells
    for field in dataclasses.fields(whole):
        ours, theirs = getattr(pieces, field.name), getattr(whole, field.name)
        if theirs is None:
            assert ours is None
            assert radar.rx_z == 0
            assert field.name == "z"
        else:
            np.testing.assert_allclose(
                ours, theirs, rtol=1e-4, atol=1e-9, err_msg=field.name
            )  # FFTs in float32
