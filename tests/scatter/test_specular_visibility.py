"""Which specular points are seen, and how they fade: on bodies whose shadows are known."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.radar import Radar
from rtradar.scatter import build_model, specular_points
from rtradar.scatter.common.poses import keyframe_step
from rtradar.scatter.specular_points import (
    SpecularVisibility,
    unobstructed,
)
from rtradar.trace.backend import Backend, use
from rtradar.trace.tracers import BodyTracer

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Curtain:
    """A small sphere at the origin, and 1 m before it a large one that passes y = 0 at 0.1 s."""

    speed: float
    duration_s: float = 1.0
    part_names: tuple[str, ...] = ("target", "curtain")

    @property
    def semi_axes(self) -> Array:
        return np.array([[0.05, 0.05, 0.05], [0.3, 0.3, 0.3]])

    def at(self, times: Array) -> Poses:
        y = self.speed * (np.asarray(times) - 0.1)
        zero = np.zeros_like(y)
        centres = np.stack(
            [np.stack([zero, zero, zero], -1), np.stack([zero - 1.0, y, zero], -1)], axis=1
        )
        return Poses(centres, np.broadcast_to(np.eye(3), (len(y), 2, 3, 3)), self.semi_axes)


def small_radar(**fields: object) -> Radar:
    """Two Tx and two Rx in a line along y, 1 ms a chirp."""
    given = {
        "tx_y": 2,
        "tx_z": 0,
        "rx_y": 2,
        "rx_z": 0,
        "chirp_duration_s": 1e-3,
        "position_m": (-4.0, 0.0, 0.0),
    }
    return Radar(**(given | fields))  # type: ignore[arg-type]


def weights(backend: Backend, radar: Radar, body: Curtain, chirps: Array) -> Array:
    tracer = BodyTracer(use(backend), body.semi_axes)
    return SpecularVisibility(radar, body, tracer).at(np.asarray(chirps))[0]  # type: ignore[arg-type]


def test_points_behind_another_part_are_hidden_on_either_leg(backend: Backend) -> None:
    poses = Curtain(0.0).at(np.zeros(1))
    tracer = BodyTracer(use(backend), poses.semi_axes)
    tracer.pose(poses.centres[0], poses.frames[0])
    points = np.array([[-0.05, 0.0, 0.0], [-1.3, 0.0, 0.0]])
    straight, aside = np.array([-4.0, 0, 0]), np.array([-1.0, 4.0, 0])
    tx = np.array([straight, straight, aside])
    rx = np.array([straight, aside, aside])[:, None]
    seen = unobstructed(tracer, tx, rx, np.broadcast_to(points, (3, 1, 2, 3)))[:, 0]
    # The curtain's own point faces only the first antenna, but only other parts count.
    np.testing.assert_array_equal(seen[:, 0], [False, False, True])
    np.testing.assert_array_equal(seen[:, 1], [True, True, True])


def test_a_fade_is_smooth_monotone_and_ends_at_the_keyframes(backend: Backend) -> None:
    # The curtain frees the line of sight once within the second; what changes there is one interval
    # between keyframes.
    radar, body = small_radar(), Curtain(3.0)
    step = keyframe_step(radar)
    assert step == 10
    chirps = np.arange(100, 400)
    weight = weights(backend, radar, body, chirps)[:, 0, 0]
    assert weight.min() == 0
    assert weight.max() == 1
    fade = np.flatnonzero((weight > 0) & (weight < 1))
    assert len(fade) > 0
    # Tx take turns and see the edge at instants of their own, at most one interval apart.
    assert fade[-1] - fade[0] < 2 * step
    for tx in (0, 1):
        own = weight[tx::2]
        assert (np.diff(own) >= 0).all()
        # Smoothstep of 10 ms at 2 ms a chirp: no step exceeds 1.5 * 0.2.
        assert np.diff(own).max() <= 0.3 + 1e-12
    np.testing.assert_array_equal(np.isin(weight[::step], [0.0, 1.0]), True)


def test_the_fade_meets_the_instant_of_the_edge(backend: Backend) -> None:
    radar, body = small_radar(tx_y=1, rx_y=1), Curtain(3.0)
    chirps = np.arange(100, 400)
    weight = weights(backend, radar, body, chirps)[:, 0, 0]
    # Monostatic, the ray runs along x: free as soon as the curtain's centre is its radius away.
    free = 0.1 + 0.3 / 3.0
    half = radar.chirp_duration_s * (chirps[np.flatnonzero(weight >= 0.5)[0]] + 0.5)
    # Between two keyframes 10 ms apart the instant is not known better than to half of that.
    assert abs(half - free) <= 5e-3 + radar.chirp_duration_s


def test_any_block_of_chirps_gets_the_same_weights(backend: Backend) -> None:
    radar, body = small_radar(), Curtain(3.0)
    whole = weights(backend, radar, body, np.arange(150, 260))
    pieces = [
        weights(backend, radar, body, block)
        for block in (np.arange(150, 163), np.arange(163, 164), np.arange(164, 260))
    ]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)


@pytest.mark.parametrize("polarization", ["v", "h"])
def test_the_model_has_nothing_from_a_hidden_part_and_all_from_a_free_one(
    backend: Backend, polarization: str
) -> None:
    radar = small_radar(polarization=polarization)
    chirps = np.arange(0, 20)
    hidden = build_model("specular", radar, Curtain(0.0), variant=backend.kind).echoes(chirps)  # type: ignore[arg-type]
    assert hidden.amplitude.shape == (1, 20, 2, 2)
    np.testing.assert_array_equal(hidden.amplitude[..., 0], 0)
    assert (hidden.amplitude[..., 1].real > 0).all()
    # A hidden echo has a length all the same.
    np.testing.assert_allclose(hidden.length[..., 0], 2 * 3.95, atol=0.02)
    np.testing.assert_array_equal(hidden.tx, chirps % 2)
    np.testing.assert_array_equal(hidden.bounces, 1)


def test_past_the_end_the_last_pose_stays(backend: Backend) -> None:
    radar, body = small_radar(), Curtain(3.0, duration_s=0.1)
    model = build_model("specular", radar, body, variant=backend.kind)  # type: ignore[arg-type]
    echoes = model.echoes(np.arange(90, 130))
    np.testing.assert_array_equal(
        echoes.length[12::2], np.broadcast_to(echoes.length[12], (14, 2, 2))
    )


def test_keyframes_are_the_same_where_only_a_few_are_remembered(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    radar, body = small_radar(), Curtain(3.0)
    whole = weights(backend, radar, body, np.arange(150, 260))
    monkeypatch.setattr(specular_points, "_KEPT_KEYFRAMES", 4)
    traced, trace = [], SpecularVisibility.keyframe

    def counted(own: SpecularVisibility, chirp: int) -> specular_points.Keyframe:
        traced.append(chirp)
        return trace(own, chirp)

    monkeypatch.setattr(SpecularVisibility, "keyframe", counted)
    few = SpecularVisibility(radar, body, BodyTracer(use(backend), body.semi_axes))  # type: ignore[arg-type]
    keyframes = np.arange(150, 261, 10)
    few.at(keyframes)
    assert len(traced) == len({*traced}) == 12
    # Cut inside intervals: each needs the keyframes on both sides of it, which must still be there.
    pieces = [few.at(block)[0] for block in np.split(np.arange(150, 260), [13, 14, 57, 88])]
    np.testing.assert_array_equal(np.concatenate(pieces), whole)
    # The first two stayed; each of the others is traced once more.
    assert len(traced) == 12 + 10
