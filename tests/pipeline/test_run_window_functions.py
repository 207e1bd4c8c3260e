"""The window functions of a run reach every map that it writes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest

import rtradar as rt
from rtradar.cli.values import window
from rtradar.errors import InputError
from rtradar.motion import synthetic_motion

MOTION = synthetic_motion("walk", seed=1, duration_s=0.3)
RADAR = rt.Radar(
    tx_y=2,
    tx_z=0,
    rx_y=4,
    rx_z=0,
    chirp_duration_s=125e-6,
    samples_per_chirp=128,
    frame_duration_s=0.05,
)


def maps(out: Path, **options: Any) -> dict[str, np.ndarray]:
    given = {"fidelity": "analytic", "clutter_removal": "mean", "pictures": False}
    rt.run(MOTION, RADAR, out=out, **given, **options)
    with h5py.File(out / "maps.h5") as file:
        stored = [name for name in file if isinstance(file[name], h5py.Dataset)]
        names = [name for name in stored if file[name].ndim > 1 and file[name].dtype.kind == "f"]
        return {name: file[name][()] for name in names}


@pytest.mark.parametrize(
    ("options", "kept"),
    [
        ({"range_window": "blackman"}, set()),
        # The range-time map is not transformed over slow time.
        ({"doppler_window": ("chebwin", 80.0)}, {"range_time"}),
    ],
)
def test_they_reach_every_map(tmp_path: Path, options: dict[str, Any], kept: set[str]) -> None:
    hann = {"range_window": "hann", "doppler_window": "hann"}
    usual, found = maps(tmp_path / "hann", **hann), maps(tmp_path / "other", **(hann | options))
    assert {"range_doppler", "range_doppler_received", "spectrogram", "range_time"} < usual.keys()
    assert found.keys() == usual.keys()
    for name, values in found.items():
        difference = np.abs(values - usual[name]).max() / usual[name].max()
        truth = name.startswith(("person", "joint"))
        assert (difference == 0) if truth or name in kept else (difference > 0.01), name


def test_an_unknown_one_is_refused_before_anything_is_written(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="range window 'hat' is unknown; allowed: barthann"):
        maps(tmp_path / "out", range_window="hat")
    assert not (tmp_path / "out").exists()


def test_the_command_line_gives_a_name_or_a_name_and_its_parameter() -> None:
    assert window("blackman") == "blackman"
    assert window("chebwin:80") == ("chebwin", 80.0)
    with pytest.raises(ValueError, match="much"):
        window("kaiser:much")
