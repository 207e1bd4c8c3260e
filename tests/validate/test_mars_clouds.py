"""People of MARS before the radar: where the camera has them, and what the chip makes of them."""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import rtradar as rt
from rtradar.body.people import body_of_people
from rtradar.motion.skeleton import NODES
from rtradar.settings import RunSettings

KINECT = {
    "spine_base": "root",
    "spine_mid": "upperback",
    "spine_shoulder": "thorax",
    "neck": "neck",
    "head": "head",
    **{
        f"{theirs}_{side}": f"{side[0]}_{ours}"
        for side in ("left", "right")
        for theirs, ours in (
            *((name, name) for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")),
            ("foot", "toe"),
            ("hand_tip", "hand"),
        )
    },
}


@pytest.fixture(scope="module")
def mars(script: Callable[[str], ModuleType]) -> ModuleType:
    return script("measurements/mars_clouds.py")


def take_of(mars: ModuleType, turn_deg: float) -> Any:
    """A punch before a camera, as if it were a take; the person is turned from the camera."""
    motion = rt.synthetic_motion("punch", duration_s=1.6)
    angle = np.radians(turn_deg)
    cosine, sine = np.cos(angle), np.sin(angle)
    about = np.array([[cosine, -sine, 0], [sine, cosine, 0], [0, 0, 1]])
    nodes = motion.at(np.arange(16) * 0.1)[0][:, [NODES.index(name) for name in KINECT.values()]]
    x, y, z = np.moveaxis(nodes @ about.T + [2.0, -0.3, -0.9], -1, 0)
    joints = np.stack([-y, x, z], axis=-1)  # right, away, up
    nothing = mars.Points(np.zeros((0, 3)), *(np.zeros(0, dtype=np.int64) for _ in range(4)))
    return mars.Take(1, 0, np.arange(16), joints, tuple(KINECT), nothing)


@pytest.mark.parametrize("turn_deg", [0.0, 25.0, -60.0])
@pytest.mark.parametrize("lag_s", [-0.05, 0.02])
def test_the_person_stands_where_the_camera_has_them(
    mars: ModuleType, turn_deg: float, lag_s: float
) -> None:
    take, offset = take_of(mars, turn_deg), np.array([0.2, -0.1, -0.3])
    person, height_m, first = mars._before_radar(take, mars.Mounting(tuple(offset), lag_s))
    body = body_of_people([person], RunSettings())
    joints = body.motion.at([0.0])[0][0]
    at_s = lag_s + 0.1 * first
    seen = [np.interp(at_s, np.arange(16) * 0.1, column) for column in take.joints[:, 0].T]
    right, away, up = np.array(seen) - offset
    # Between frames of the camera the base of the spine goes by a spline, not straight: some mm.
    np.testing.assert_allclose(joints[0] - [0, 0, height_m], [away, -right, up], atol=0.01)
    hips = [NODES.index(name) for name in ("l_hip", "r_hip")]
    ours = joints[hips[0]] - joints[hips[1]]
    hips = [list(KINECT).index(name) for name in ("hip_right", "hip_left")]
    theirs = np.diff(take.joints[round(at_s * 10), hips], axis=0)[0]
    facing = np.array([theirs[1], -theirs[0]])
    # Half a frame lies between both, in which the hips of a punch turn.
    np.testing.assert_allclose(ours[:2], facing, atol=0.05)
    assert first == int(lag_s < 0)


def test_a_point_is_where_its_echo_comes_from(mars: ModuleType) -> None:
    """One echo from the right, ahead and above, receding, with what stands still beside it."""
    radar = rt.Radar.preset("mars")
    place, speed = np.array([0.4, 1.9, 0.3]), 3 * mars.DOPPLER_BIN_MPS
    chirps = np.arange(radar.chirps_per_frame)
    there = np.array([place[1], -place[0], place[2]])
    ranges = np.linalg.norm(there) + speed * (radar.chirp_times(len(chirps)) - 2.6e-3)
    at = there / np.linalg.norm(there) * ranges[:, None]
    length = np.linalg.norm(at - radar.tx[chirps % 3] + radar.position_m, axis=1)[:, None]
    length = length + np.linalg.norm(at[:, None] - radar.rx + radar.position_m, axis=2)
    still = 2.5 * 2 + np.zeros_like(length)
    fast = np.arange(80) / radar.sample_rate_hz * radar.bandwidth_hz / radar.chirp_duration_s
    wave = radar.centre_frequency_hz + fast - fast.mean()
    samples = sum(
        level * np.exp(2j * np.pi * wave * (own / 299_792_458.0)[..., None])
        for level, own in ((1.0, length), (30.0, still))
    )
    # Without noise all side lobes were points, and the list full before it came to this Doppler.
    noise = np.random.default_rng(0).standard_normal((*samples.shape, 2)).view(complex)[..., 0]
    samples = samples + 0.1 * noise
    cube = np.fft.fft(samples.reshape(-1, 3, 4, 80) * np.blackman(81)[:80], mars.RANGE_BINS)
    points = mars.detected(cube, 7, removal=True, threshold_db=15.0)
    strongest = points.level.argmax()
    assert points.doppler[strongest] == 3
    # A range bin is 3 cm, a bin of the sine of azimuth 6 cm there; elevation is by two rows alone.
    np.testing.assert_allclose(points.places[strongest], place, atol=0.08)
    np.testing.assert_allclose(points.range_m, np.linalg.norm(points.places, axis=1))
    assert set(points.frame) == {7}
    moved = points.shifted((0.1, 0.2, 0.3))
    np.testing.assert_allclose(moved.places - points.places, [[0.1, 0.2, 0.3]] * len(points.level))
    np.testing.assert_allclose(moved.range_m - points.range_m, 0.2)
    without = mars.detected(cube, 7, removal=False, threshold_db=15.0)
    assert without.doppler[without.level.argmax()] == 0
