"""The whole chain from Python: noise where asked for, the same answer for any block size, and IF
samples without a run."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
import xarray as xr
import zarr

import rtradar as rt
from rtradar.cli.values import window
from rtradar.errors import InputError, ValidityWarning
from rtradar.front_end import Antenna
from rtradar.motion import synthetic_motion
from rtradar.pipeline import processing
from rtradar.scatter import MODELS
from rtradar.settings import RunOptions, SimulationOptions

SHORT: RunOptions = {"fidelity": "analytic", "duration_s": 0.3}


def test_noise_has_the_power_that_is_asked_for(kick: rt.Motion, small: rt.Radar) -> None:
    quiet = rt.simulate(kick, small, **SHORT, snr_db=math.inf)
    noisy = rt.simulate(kick, small, **SHORT, snr_db=10.0)
    assert quiet.noise_power_m2 == 0
    assert noisy.link_budget.power == quiet.link_budget.power
    assert noisy.noise_power_m2 == pytest.approx(noisy.link_budget.power / 10)
    echo = quiet.samples.values
    noise = noisy.samples.values - echo
    # |n|^2 of a complex Gaussian has the standard deviation of its mean: five of them, and
    # float32's rounding.
    found = float(np.mean(np.abs(noise) ** 2))
    assert found == pytest.approx(noisy.noise_power_m2, rel=5 / math.sqrt(noise.size) + 1e-5)
    # The IF's power is the sum of the echoes' but for interference between 21 parts, twice here.
    assert 1 / 4 < np.mean(np.abs(echo) ** 2) / quiet.link_budget.power < 4


def test_only_the_noise_depends_on_the_seed(kick: rt.Motion, small: rt.Radar) -> None:
    first, again, other = (
        rt.simulate(kick, small, **SHORT, seed=seed).samples.values for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.isclose(first, other).any(axis=None)


def test_a_longer_capture_begins_with_the_shorter_one(kick: rt.Motion, small: rt.Radar) -> None:
    # The interval's place depends on its length (its mean is at the origin), so the body does not
    # move here.
    still = rt.Motion(
        name="still",
        joints=kick.joints,
        parents=kick.parents,
        offsets=kick.offsets,
        root_positions=np.repeat(kick.root_positions[:1], 101, axis=0),
        rotations=np.repeat(kick.rotations[:1], 101, axis=0),
        rate_hz=100.0,
    )
    maps = [
        rt.run(still, small, fidelity="specular", duration_s=duration, snr_db=math.inf)
        .maps["range_doppler"]
        .values
        for duration in (0.2, 0.3)
    ]
    assert len(maps[1]) > len(maps[0]) > 3
    np.testing.assert_array_equal(maps[1][: len(maps[0])], maps[0])


def test_without_spreading_the_echo_is_the_cross_section(kick: rt.Motion, small: rt.Radar) -> None:
    without, with_loss = (
        rt.simulate(kick, small, **SHORT, spreading=spreading).link_budget.power
        for spreading in (False, True)
    )
    # The radar is 4.1 m from the upright person, whose near side counts most.
    assert 4.0**4 < without / with_loss < 4.3**4


def test_a_person_who_turns_is_another_echo(kick: rt.Motion, small: rt.Radar) -> None:
    facing, aside = (
        rt.simulate(kick, small, **SHORT, heading_deg=heading).link_budget.part_power
        for heading in (0.0, 90.0)
    )
    assert facing["left foot"] != pytest.approx(aside["left foot"], rel=0.1)


@pytest.mark.drawn
def test_noise_alone_leaves_an_empty_cloud_and_says_so(
    kick: rt.Motion, small: rt.Radar, tmp_path: Path
) -> None:
    options: Any = {**SHORT, "pictures": True, "snr_db": -90.0, "pfa": 1e-12}
    with pytest.warns(ValidityWarning, match="nothing was detected"):
        result = rt.run(kick, small, out=tmp_path / "out", **options)
    assert result.points.shape == (0, 3)
    assert result.summary["rdt_points"] == 0
    assert (tmp_path / "out" / "cloud_rdt.png").exists()


def test_the_summary_is_json_that_anyone_reads(
    kick: rt.Motion, small: rt.Radar, tmp_path: Path
) -> None:
    result = rt.run(kick, small, out=tmp_path / "out", **SHORT, snr_db=math.inf)
    assert json.loads((tmp_path / "out" / "summary.json").read_text()) == result.summary
    # Nothing is traced in the closed form.
    assert result.summary["variant"] is None
    assert (result.summary["occlusion"], result.summary["rays_traced"]) == ("none", 0)
    assert sum(result.summary["stages"].values()) < result.summary["wall_s"]


def test_scalars_of_numpy_do_as_well(kick: rt.Motion, small: rt.Radar, tmp_path: Path) -> None:
    options: Any = {"duration_s": np.float32(0.25), "keep_all": np.True_, "seed": np.int64(3)}
    result = rt.run(
        kick, small, out=tmp_path / "out", fidelity="analytic", snr_db=np.int32(15), **options
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
        ({"order": -3}, "order = -3; it must be a whole number from 0"),
        ({"order": 4}, "order = 4"),
        ({"order": True}, "order = True"),
        ({"fidelity": "perfect"}, f"allowed: {', '.join(MODELS)}$"),
        ({"duration_s": 0.01}, "no whole frame"),
        ({"start_s": 5.0}, "5"),
        ({"start_s": math.nan}, "start_s = nan"),
        ({"range_window": "hat"}, "range window 'hat' is unknown; allowed: barthann"),
        ({"variant": "metal", "fidelity": "specular"}, "allowed: auto, cpu, llvm, scalar, cuda"),
    ],
)
def test_bad_values_are_refused_and_leave_nothing(
    kick: rt.Motion, small: rt.Radar, tmp_path: Path, options: dict[str, Any], says: str
) -> None:
    with pytest.raises(InputError, match=says):
        rt.run(kick, small, out=tmp_path / "out", **{**SHORT, "save_if": True, **options})
    assert not (tmp_path / "out").exists()


def test_what_is_no_radar_and_no_scene_is_refused(kick: rt.Motion, small: rt.Radar) -> None:
    for wrong in (12, None):
        with pytest.raises(InputError, match=r"radar = .*rt.Radar.preset"):
            rt.run(kick, wrong)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"scene = .*rt.Scene.load"):
        rt.simulate(kick, small, 5)  # type: ignore[arg-type]
    for wrong_name in ("paper", ""):
        with pytest.raises(InputError, match="allowed"):
            rt.run(kick, wrong_name)
        with pytest.raises(InputError, match="allowed"):
            rt.simulate(kick, small, wrong_name)


def test_physical_noise_that_float32_cannot_hold_beside_the_echo_is_refused(
    kick: rt.Motion, small: rt.Radar, tmp_path: Path
) -> None:
    faint = dataclasses.replace(
        small, transmit_power_dbm=-200.0, noise_figure_db=100.0, tx_antenna=Antenna(gain_dbi=-100)
    )
    with pytest.raises(
        InputError, match="more than 200 dB above the echo; look at transmit_power_dbm"
    ):
        rt.run(
            kick,
            faint,
            out=tmp_path / "out",
            fidelity="analytic",
            duration_s=0.1,
            snr_db="physical",
        )
    assert not (tmp_path / "out").exists()


def test_windows_far_apart_are_streamed_in_blocks_of_no_more_than_one(
    kick: rt.Motion, small: rt.Radar, tmp_path: Path
) -> None:
    rare = dataclasses.replace(small, frame_hop_s=1e6)
    result = rt.run(
        kick, rare, out=tmp_path / "out", fidelity="analytic", duration_s=0.13, save_if=True
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
    small: rt.Radar, lines: dict[str, int], there: set[str], tmp_path: Path
) -> None:
    radar = dataclasses.replace(small, chirp_duration_s=500e-6, **lines)
    walk = rt.synthetic_motion("walk", seed=0, duration_s=1.0)
    rt.run(walk, radar, out=tmp_path, pictures=True, fidelity="analytic", duration_s=0.2)
    with h5py.File(tmp_path / "maps.h5") as maps:
        assert {"range_azimuth", "range_elevation"} & set(maps) == there
    assert (tmp_path / "range_angle.png").exists() == bool(there)
    assert (len(np.load(tmp_path / "cloud_xyz.npz")["points"]) > 0) == bool(there)
    assert (tmp_path / "report.html").exists()


SAMPLES: SimulationOptions = {"fidelity": "analytic", "duration_s": 0.23, "snr_db": 10.0}


@pytest.mark.parametrize("multiplexing", ["tdm", "ddm"])
def test_samples_and_blocks_are_what_a_run_keeps(
    kick: rt.Motion, small: rt.Radar, multiplexing: str, tmp_path: Path
) -> None:
    radar = dataclasses.replace(small, multiplexing=multiplexing)
    capture = rt.simulate(kick, radar, **SAMPLES)
    rt.run(kick, radar, out=tmp_path / "out", save_if=True, **SAMPLES)
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
    samples = rt.simulate(kick, small, **SAMPLES).samples
    assert samples.dims == ("chirp", "rx", "sample")
    np.testing.assert_array_equal(samples.time, small.chirp_times(len(samples)))
    assert samples.tx[:5].values.tolist() == [0, 1, 0, 1, 0]
    assert float(samples.fast_time[1]) == 1 / small.sample_rate_hz
    assert (samples.attrs["units"], samples.time.attrs["units"]) == ("m", "s")


def test_samples_too_large_for_memory_are_refused_and_blocks_are_not(
    kick: rt.Motion, small: rt.Radar, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(processing, "MEMORY_LIMIT_BYTES", 1e5)
    capture = rt.simulate(kick, small, **SAMPLES)
    with pytest.raises(InputError, match=r"IF samples of 0.23 s .* block by block, blocks\(\), or"):
        _ = capture.samples
    assert next(capture.blocks()).shape == (100, 4, 128)


def test_a_simulation_says_what_it_will_give(kick: rt.Motion, small: rt.Radar) -> None:
    text = repr(rt.simulate(kick, small, **SAMPLES))
    assert "samples  chirp 920, rx 4, sample 128" in text


WALK = synthetic_motion("walk", seed=1, duration_s=0.3)


def maps(radar: rt.Radar, out: Path, **options: Any) -> dict[str, np.ndarray]:
    given = {"fidelity": "analytic", "clutter_removal": "mean"}
    rt.run(WALK, radar, out=out, **given, **options)
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
def test_window_functions_reach_every_map(
    small: rt.Radar, tmp_path: Path, options: dict[str, Any], kept: set[str]
) -> None:
    hann = {"range_window": "hann", "doppler_window": "hann"}
    usual, found = (
        maps(small, tmp_path / "hann", **hann),
        maps(small, tmp_path / "other", **(hann | options)),
    )
    assert {"range_doppler", "range_doppler_received", "spectrogram", "range_time"} < usual.keys()
    assert found.keys() == usual.keys()
    for name, values in found.items():
        difference = np.abs(values - usual[name]).max() / usual[name].max()
        truth = name.startswith(("person", "joint"))
        assert (difference == 0) if truth or name in kept else (difference > 0.01), name


def test_the_command_line_gives_a_name_or_a_name_and_its_parameter() -> None:
    assert window("blackman") == "blackman"
    assert window("chebwin:80") == ("chebwin", 80.0)
    with pytest.raises(ValueError, match="much"):
        window("kaiser:much")
