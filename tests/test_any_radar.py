"""Radars with antennas in lists, pauses between chirps, turned and moving."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import rtradar as rt
from rtradar.body import Body
from rtradar.errors import InputError
from rtradar.report.three_d import posed_figure, semi_axis_poses
from rtradar.scatter.echo_models import build_model

RADAR = dataclasses.replace(
    rt.Radar.preset("iwr1843"),
    tx_order=[0, 2, 1],
    chirps_per_frame=48,
    frame_period_s=1 / 30,
    position_m=(-3, 0.5, 1.2),
)
POSE = {"yaw_deg": 20.0, "pitch_deg": -6.0, "roll_deg": 4.0}
PATH = {
    "path_times_s": [0.0, 1.0],
    "path_m": [[0, 0, 0], [0.5, -0.2, 0.1]],
    "path_angles_deg": [[0, 0, 0], [20, 5, -3]],
}


def test_times_of_chirps_in_frames() -> None:
    chirps = np.array([0, 1, 47, 48, 100])
    slots = np.array([0, 1, 47, 0, 4]) * 53e-6 + np.array([0, 0, 0, 1, 2]) / 30
    np.testing.assert_allclose(RADAR.centres_of(chirps), slots + 5.5e-6 + 128 / 6.5e6, rtol=1e-12)
    np.testing.assert_allclose(RADAR.slots_of(chirps) * 53e-6, slots, atol=1e-12)
    assert RADAR.window_starts(150).tolist() == [0, 16, 32]
    assert RADAR.chirps_in(1 / 30 + 48 * 53e-6) == 96
    assert RADAR.chirps_in(1 / 30 + 47 * 53e-6) == 48
    assert RADAR.frame_hop_s == RADAR.frame_period_s
    assert dataclasses.replace(RADAR, frame_period_s=None).gaps_text == ""


def test_range_follows_from_the_sampled_part_of_the_sweep() -> None:
    assert pytest.approx(80e12 * 256 / 6.5e6) == RADAR.sampled_bandwidth_hz
    assert pytest.approx(299_792_458 / (2 * 80e12 * 256 / 6.5e6)) == RADAR.range_bin_m


def test_what_follows_of_a_frame_follows_anew_when_it_is_replaced() -> None:
    paper = rt.Radar.preset("paper-12ghz")
    assert dataclasses.replace(paper, frame_duration_s=0.05).chirps_per_frame == 66 * 12
    assert rt.Radar(**dataclasses.asdict(paper)) == paper


def test_tx_transmit_in_their_order() -> None:
    assert RADAR.tx_positions_m is not None
    np.testing.assert_array_equal(RADAR.tx_m[1], RADAR.tx_positions_m[2])


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"tx_order": [0, 1]}, "tx_order"),
        ({"chirps_per_frame": 47}, "multiple of 3"),
        ({"adc_start_s": 30e-6}, "adc_start_s"),
        ({"frame_period_s": 1e-3}, "lengthen the period"),
        ({"tx_positions_m": [[1, 2]]}, "tx_positions_m"),
        ({"path_m": [[0, 0, 0]]}, "path_times_s"),
        (PATH | {"path_times_s": [1.0, 0.0]}, "ascending"),
    ],
)
def test_values_that_do_not_fit_are_refused(values: dict[str, object], said: str) -> None:
    with pytest.raises(InputError, match=said):
        dataclasses.replace(RADAR, **values)


def test_a_moving_radar_sees_at_each_chirp_what_one_at_its_pose_sees() -> None:
    body = Body.from_motion(rt.synthetic_motion("walk", duration_s=1.0))
    moving = dataclasses.replace(RADAR, **POSE, **PATH)
    chirps = np.array([3, 100, 1000])
    echoes = build_model("specular", moving, body).echoes(chirps)
    for place, chirp in enumerate(chirps):
        part = RADAR.centres_of(chirps[place : place + 1])[0]
        at = np.array([0.5, -0.2, 0.1]) * part + RADAR.position_m
        angles = [own + part * by for own, by in zip(POSE.values(), (20, 5, -3), strict=True)]
        pose = dict(zip(POSE, angles, strict=True))
        still = dataclasses.replace(RADAR, position_m=tuple(at), **pose)
        own = build_model("specular", still, body).echoes(np.array([chirp]))
        np.testing.assert_allclose(echoes.length[place], own.length[0], atol=1e-9)
        # In the world the antennas are where the turned radar says.
        centres = body.at([part]).centres[0]
        tx = still.tx[still.tx_of_chirp(np.array([chirp]))[0]]
        most = np.linalg.norm(centres - tx, axis=1)
        most = most + np.linalg.norm(centres - still.rx[0], axis=1)
        away = most - own.length[0, 0]
        assert ((away > 0) & (away < 2 * body.semi_axes.max(axis=1) + 1e-6)).all()


def test_points_of_a_turned_moving_radar_in_frames_stay_where_the_person_is() -> None:
    motion = rt.synthetic_motion("walk", duration_s=0.6)
    options = {"fidelity": "analytic", "duration_s": 0.14, "seed": 1, "snr_db": 30}
    found = []
    for own in ({}, POSE | PATH):
        result = rt.run(motion, dataclasses.replace(RADAR, **own), **options)
        cloud = result.spatial
        found.append(np.average(cloud.points, axis=0, weights=cloud.power))
        assert "nothing is measured in between" in result.maps["spectrogram"].attrs["gaps"]
        assert len(result.maps["time"]) == 5
    # Elevation is a third of a beam of 64 degrees off at most; range and azimuth are better.
    np.testing.assert_allclose(found[1], found[0], atol=0.25)


def test_a_radar_that_turns_several_times_is_at_rest_as_any_other() -> None:
    spins = {"path_times_s": [0, 1], "path_angles_deg": [[0, 0, 0], [3600, 0, -720]]}
    radar = dataclasses.replace(RADAR, **POSE, **spins)
    for time in (0.0, 0.33, 1.0):
        (axes,), _ = radar.poses_at([time])
        np.testing.assert_allclose(radar.at(time).axes, axes, atol=1e-12)


def test_the_view_moves_the_radar_along() -> None:
    body = Body.from_motion(rt.synthetic_motion("walk", duration_s=1.0))
    times = np.array([0.0, 0.25, 0.75])
    poses = semi_axis_poses(body, times).astype(np.float32)
    moving = dataclasses.replace(RADAR, **POSE, **PATH)
    for radar, count in ((moving, 3), (RADAR, 1)):
        figure = posed_figure(body.part_names, times, poses, radar)
        assert np.shape(figure["tx"]) == (count, 3, 3)
        for step in range(count):
            axes, places = radar.poses_at(times[step : step + 1])
            expected = radar.rx_m @ axes[0].T + places[0]
            np.testing.assert_allclose(figure["rx"][step], expected, atol=1e-4)
            np.testing.assert_allclose(radar.at(times[step]).rx, expected, atol=1e-9)
