"""What is made of range spectra does not depend on the pieces they come in."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

import rtradar as rt
from rtradar.pipeline import cloud_maker, products
from rtradar.pipeline.timing import Stages
from rtradar.process import build_detector, clutter_removal

RADAR = rt.Radar(
    name="small", tx_y=2, tx_z=0, rx_y=4, rx_z=0, chirp_duration_s=250e-6, samples_per_chirp=64, frame_duration_s=0.05
)


def test_pieces_give_what_the_whole_gives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cloud_maker, "_PIECE_BYTES", 1)
    random = np.random.default_rng(0)
    chirps = np.arange(800)
    tone = np.exp(2j * np.pi * 0.1 * chirps)[:, None, None] * np.ones((1, 4, 1)) * (np.arange(64) == 20)
    spectra = (tone + 0.01 * random.standard_normal((800, 4, 64))).astype(np.complex64)
    found = []
    for name, cut in (("whole", False), ("pieces", True)):
        path, removal = tmp_path / f"{name}.h5", clutter_removal("none", RADAR)
        made = products.Products(
            path,
            RADAR,
            detect=build_detector("os-cfar", pfa=1e-4, looks=RADAR.n_channels),
            seed=0,
            stages=Stages(),
            title="",
            removal=removal,
        )
        # 10 cycles of 0.5 ms are a step of range-time; a hop of the windows is 50 of them.
        assert made.piece == 10 * RADAR.n_tx
        for block in range(0, 800, 100):
            for first in range(block, block + 100, made.piece if cut else 100):
                made.take(spectra[first : min(first + made.piece, block + 100)] if cut else spectra[block : block + 100], first)
        clouds = made.finish()
        with h5py.File(tmp_path / f"{name}.h5") as maps:
            found.append({key: maps[key][:] for key in maps} | {"rdt": clouds.rdt.points, "xyz": clouds.spatial.points})
    assert len(found[0]["rdt"]) == cloud_maker.CLOUD_POINTS
    assert found[0].keys() == found[1].keys()
    for key, values in found[0].items():
        np.testing.assert_array_equal(found[1][key], values, err_msg=key)
