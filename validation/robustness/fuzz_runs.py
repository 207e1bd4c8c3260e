"""Targets of `fuzz_readers.py` in the folder of a run, as `rtradar view` reads it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
from fuzz_kit import Target, as_text, hdf5, npz
from fuzz_small import ARRAYS, JSON, RADAR, RADAR_WORDS, RDT, SPATIAL, SUMMARY

from rtradar.pipeline.output.view import load_run_view
from rtradar.report.run_view import view_data

MAPS = {
    "time": np.array([0.002, 0.004]),
    "range": RADAR.range_m,
    "velocity": RADAR.velocity_mps(4),
    "range_doppler": np.arange(32, dtype=np.float32).reshape(2, 4, 4),
    "spectrogram_time": np.array([0.002, 0.003]),
    "spectrogram_velocity": np.array([-1.0, 0.0, 1.0]),
    "spectrogram": np.ones((2, 3), dtype=np.float32),
}
MOMENTS = {
    "format": np.array(1),
    "times": np.array([0.002, 0.004]),
    "window": np.array([0, 1]),
    "part_names": np.array(["head"]),
    "poses": np.ones((2, 1, 4, 3), dtype=np.float32),
    "path_names": np.array(["body", "body > floor"]),
    "echo_path": np.array([0, 1]),
    "echo_part": np.array([0, 0]),
    "echo_bounces": np.array([1, 2]),
    "range_m": np.ones((2, 2)),
    "velocity_mps": np.zeros((2, 2)),
    "power_m2": np.ones((2, 2)),
    "corners": np.ones((2, 2, 1, 3), dtype=np.float32),
    "wall_names": np.array(["left"]),
    "walls": np.ones((1, 4, 3)),
    "furniture_names": np.array(["chair"]),
    "furniture_vertices": np.eye(3, dtype=np.float32),
    "furniture_faces": np.array([[0, 1, 2]]),
    "furniture_piece": np.array([0, 0, 0]),
}


def _look(change: Callable[[Path, bytes], object]) -> Callable[[Path, bytes], None]:
    """A run's folder that is all good except for what ``change`` writes into it."""

    def read(folder: Path, data: bytes) -> None:
        if not (folder / "good").is_dir():
            (folder / "good").mkdir()
            _whole_run(folder / "good")
        for file in ("summary.json", "view.npz", "maps.h5", "cloud_rdt.npz", "cloud_xyz.npz"):
            shutil.copyfile(folder / "good" / file, folder / file)
        change(folder, data)
        linked = load_run_view(folder)
        json.dumps(view_data(linked), allow_nan=False)  # as its page does

    return read


def _whole_run(folder: Path) -> None:
    (folder / "summary.json").write_text(json.dumps(SUMMARY))
    npz(folder / "view.npz", MOMENTS)
    hdf5(folder / "maps.h5", MAPS)
    npz(folder / "cloud_rdt.npz", RDT)
    npz(folder / "cloud_xyz.npz", SPATIAL)


def _both_clouds(folder: Path, data: bytes) -> None:
    rdt, _, spatial = data.partition(b"CUT")
    npz(folder / "cloud_rdt.npz", RDT, rdt)
    npz(folder / "cloud_xyz.npz", SPATIAL, spatial)


TARGETS = {
    "view summary": Target(
        _look(lambda folder, data: (folder / "summary.json").write_bytes(data)),
        lambda: [json.dumps(SUMMARY).encode()],
        JSON + RADAR_WORDS,
    ),
    "view.npz": Target(
        _look(lambda folder, data: npz(folder / "view.npz", MOMENTS, data)),
        lambda: [as_text(MOMENTS)],
        ARRAYS,
    ),
    "maps.h5": Target(
        _look(lambda folder, data: hdf5(folder / "maps.h5", MAPS, data)),
        lambda: [as_text(MAPS)],
        ARRAYS,
    ),
    "view clouds": Target(
        _look(_both_clouds), lambda: [as_text(RDT) + b"CUT" + as_text(SPATIAL)], ARRAYS
    ),
}
