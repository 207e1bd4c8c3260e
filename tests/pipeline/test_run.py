"""The whole chain from Python: noise where asked for, and the same answer for any block size."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import zarr

import rtradar as rt
from rtradar.antenna import Antenna
from rtradar.errors import InputError, ValidityWarning
from rtradar.scatter import MODELS

RADAR = rt.Radar(
    name="small",
    tx_y=2,
    tx_z=0,
    rx_y=4,
    rx_z=0,
    chirp_duration_s=250e-6,
    samples_per_chirp=128,
    frame_duration_s=0.05,
)
MOTION = rt.synthetic_motion("kick", seed=1, duration_s=1.0)


def run(out: Path, **options: Any) -> tuple[rt.Result, np.ndarray[Any, Any]]:
    """A run of 0.3 s and its IF samples."""
    result = rt.run(
        MOTION,
        RADAR,
        out=out,
        **({"fidelity": "analytic", "duration_s": 0.3, "save_if": True} | options),
    )
    return result, np.asarray(zarr.open_array(out / "if.zarr", mode="r")[:])


def test_noise_has_the_power_that_is_asked_for(tmp_path: Path) -> None:
    quiet, echo = run(tmp_path / "quiet", snr_db=math.inf)
    noisy, samples = run(tmp_path / "noisy", snr_db=10.0)
    assert quiet.summary["noise_power_m2"] == 0
    assert noisy.summary["echo_power_m2"] == quiet.summary["echo_power_m2"]
    assert noisy.summary["noise_power_m2"] == pytest.approx(noisy.summary["echo_power_m2"] / 10)
    noise = samples - echo
    # |n|^2 of a complex Gaussian has the standard deviation of its mean: five of them, and
    # float32's rounding.
    found = float(np.mean(np.abs(noise) ** 2))
    assert found == pytest.approx(
        noisy.summary["noise_power_m2"], rel=5 / math.sqrt(noise.size) + 1e-5
    )
    # The IF's power is the sum of the echoes' but for interference between 21 parts, twice here.
    assert 1 / 4 < np.mean(np.abs(echo) ** 2) / quiet.summary["echo_power_m2"] < 4


def test_only_the_noise_depends_on_the_seed(tmp_path: Path) -> None:
    _, first = run(tmp_path / "a", seed=1)
    _, again = run(tmp_path / "b", seed=1)
    _, other = run(tmp_path / "c", seed=2)
    np.testing.assert_array_equal(first, again)
    assert not np.isclose(first, other).any(axis=None)


def test_a_longer_capture_begins_with_the_shorter_one(tmp_path: Path) -> None:
    # The interval's place depends on its length (its mean is at the origin), so the body does not
    # move here.
    still = rt.Motion(
        name="still",
        joints=MOTION.joints,
        parents=MOTION.parents,
        offsets=MOTION.offsets,
        root_positions=np.repeat(MOTION.root_positions[:1], 101, axis=0),
        rotations=np.repeat(MOTION.rotations[:1], 101, axis=0),
        rate_hz=100.0,
    )
    maps = []
    for duration in (0.2, 0.3):
        rt.run(
            still,
            RADAR,
            out=tmp_path / "out",
            fidelity="specular",
            duration_s=duration,
            snr_db=math.inf,
        )
        with h5py.File(tmp_path / "out" / "maps.h5") as file:
            maps.append(file["range_doppler"][:])
    assert len(maps[1]) > len(maps[0]) > 3
    np.testing.assert_array_equal(maps[1][: len(maps[0])], maps[0])


def test_without_spreading_the_echo_is_the_cross_section(tmp_path: Path) -> None:
    with_loss, _ = run(tmp_path / "a")
    without, _ = run(tmp_path / "b", spreading=False)
    ratio = without.summary["echo_power_m2"] / with_loss.summary["echo_power_m2"]
    assert (
        4.0**4 < ratio < 4.3**4
    )  # the radar is 4.1 m from the upright person, whose near side counts most


def test_a_person_who_turns_is_another_echo(tmp_path: Path) -> None:
    facing, _ = run(tmp_path / "a")
    aside, _ = run(tmp_path / "b", heading_deg=90.0)
    assert facing.summary["part_power_m2"]["left foot"] != pytest.approx(
        aside.summary["part_power_m2"]["left foot"], rel=0.1
    )


@pytest.mark.drawn
def test_noise_alone_leaves_an_empty_cloud_and_says_so(tmp_path: Path) -> None:
    with pytest.warns(ValidityWarning, match="nothing was detected"):
        result, _ = run(tmp_path / "out", snr_db=-90.0, pfa=1e-12)
    assert result.points.shape == (0, 3)
    assert result.summary["rdt_points"] == 0
    assert (tmp_path / "out" / "cloud_rdt.png").exists()


def test_the_summary_is_json_that_anyone_reads(tmp_path: Path) -> None:
    result, _ = run(tmp_path / "out", snr_db=math.inf)
    assert json.loads((tmp_path / "out" / "summary.json").read_text()) == result.summary
    # Nothing is traced in the closed form.
    assert result.summary["variant"] is None
    assert (result.summary["occlusion"], result.summary["rays_traced"]) == ("none", 0)
    assert sum(result.summary["stages"].values()) < result.summary["wall_s"]


def test_scalars_of_numpy_do_as_well(tmp_path: Path) -> None:
    result, _ = run(
        tmp_path / "out",
        seed=np.int64(3),
        snr_db=np.int32(15),
        duration_s=np.float32(0.25),
        keep_all=np.True_,
    )
    assert result.summary["seed"] == 3
    assert {name: result.summary["parameters"][name] for name in ("snr_db", "keep_all")} == {
        "snr_db": 15,
        "keep_all": True,
    }
    assert (
        "np." not in (tmp_path / "out" / "report.html").read_text().partition('id="report-data"')[0]
    )


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"snr_db": math.nan}, "snr_db = nan"),
        ({"snr_db": 1e4}, "snr_db"),
        ({"noise_power_m2": -1.0}, "noise_power_m2 = -1"),
        ({"noise_power_m2": math.nan}, "noise_power_m2 = nan"),
        ({"pfa": 1.0}, "pfa = 1"),
        ({"seed": -1}, "seed = -1"),
        ({"order": -3}, "order = -3 of reflections at walls; it must be a whole number from 0"),
        ({"order": 4}, "order = 4"),
        ({"order": True}, "order = True"),
        ({"fidelity": "perfect"}, f"allowed: {', '.join(MODELS)}$"),
        ({"duration_s": 0.01}, "no whole frame"),
        ({"start_s": 5.0}, "5"),
        ({"variant": "metal", "fidelity": "specular"}, "allowed: auto, cpu, llvm, scalar, cuda"),
    ],
)
def test_bad_values_are_refused_and_leave_nothing(
    tmp_path: Path, options: dict[str, Any], says: str
) -> None:
    with pytest.raises(InputError, match=says):
        run(tmp_path / "out", **options)
    assert not (tmp_path / "out").exists()


def test_physical_noise_that_float32_cannot_hold_beside_the_echo_is_refused(tmp_path: Path) -> None:
    faint = dataclasses.replace(
        RADAR, transmit_power_dbm=-200.0, noise_figure_db=100.0, tx_antenna=Antenna(gain_dbi=-100)
    )
    with pytest.raises(
        InputError, match="more than 200 dB above the echo; look at transmit_power_dbm"
    ):
        rt.run(
            MOTION,
            faint,
            out=tmp_path / "out",
            fidelity="analytic",
            duration_s=0.1,
            snr_db="physical",
        )
    assert not (tmp_path / "out").exists()


def test_windows_far_apart_are_streamed_in_blocks_of_no_more_than_one(tmp_path: Path) -> None:
    rare = dataclasses.replace(RADAR, frame_hop_s=1e6)
    result = rt.run(
        MOTION, rare, out=tmp_path / "out", fidelity="analytic", duration_s=0.13, save_if=True
    )
    assert result.summary["windows"] == 1
    array = zarr.open_array(tmp_path / "out" / "if.zarr", mode="r")
    assert array.chunks == (200, 4, 128)
    assert (np.abs(array[:]) > 0).all()


@pytest.mark.parametrize(
    ("lines", "there"),
    [({"tx_y": 1, "rx_y": 1}, set()), ({"tx_y": 2, "rx_y": 4}, {"range_azimuth"})],
)
def test_a_radar_without_a_line_has_no_angles_along_it(
    lines: dict[str, int], there: set[str], tmp_path: Path
) -> None:
    radar = rt.Radar(
        tx_z=0,
        rx_z=0,
        chirp_duration_s=500e-6,
        samples_per_chirp=128,
        frame_duration_s=0.05,
        **lines,
    )
    rt.run(MOTION, radar, out=tmp_path, fidelity="analytic", duration_s=0.2)
    with h5py.File(tmp_path / "maps.h5") as maps:
        assert {"range_azimuth", "range_elevation"} & set(maps) == there
    assert (tmp_path / "range_angle.png").exists() == bool(there)
    assert (len(np.load(tmp_path / "cloud_xyz.npz")["points"]) > 0) == bool(there)
    assert (tmp_path / "report.html").exists()


def test_a_capture_shorter_than_the_spectrograms_window_has_none(tmp_path: Path) -> None:
    radar = rt.Radar(
        tx_y=2,
        tx_z=0,
        rx_y=4,
        rx_z=0,
        chirp_duration_s=1e-3,
        samples_per_chirp=128,
        frame_duration_s=0.05,
    )
    rt.run(MOTION, radar, out=tmp_path, fidelity="analytic", duration_s=0.2)  # 100 cycles of 128
    with h5py.File(tmp_path / "maps.h5") as maps:
        assert maps["spectrogram"].shape == (0, 128)
    assert not (tmp_path / "spectrogram.png").exists()
