"""The IF of a room: exactly still without a person, and with one as each chirp made by itself."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.kernels.elementary import smoothstep
from rtradar.radar import Radar
from rtradar.scatter.clutter.body_shadow import ClutterShadow
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scene import Furniture, Scene, Surface, material, room_walls
from rtradar.signal import synthesize
from rtradar.signal.static_clutter import RoomIf

RADAR = Radar(tx_y=2, tx_z=2, rx_y=2, rx_z=2, samples_per_chirp=192)
SIDES = ("near", "far", "right", "left", "floor", "ceiling")
SURFACES = dict.fromkeys(
    SIDES, Surface(material=material("concrete"), thickness_m=0.2, roughness_m=0.0005)
)
ROOM = Scene(
    walls=room_walls((5.5, 4.5, 2.6), (-4.6, -2.0), SURFACES),
    furniture=(
        Furniture(name="chair", mesh="chair", material=material("wood"), position_m=(0.5, -1.0, 0)),
    ),
)


class Ball:
    """A sphere that crosses the room before its far wall."""

    part_names = ("ball",)
    duration_s = 1.0
    semi_axes = np.full((1, 3), 0.3)

    def __init__(self, start: float = 0.9) -> None:
        self._start = start

    def at(self, times: NDArray[np.float64]) -> Poses:
        times = np.asarray(times)
        centres = np.array([-1.0, 1.0, 1.0]) + (2.5 * times[:, None] - self._start) * [
            0.0,
            1.0,
            0.0,
        ]
        return Poses(
            centres[:, None], np.broadcast_to(np.eye(3), (len(times), 1, 3, 3)), self.semi_axes
        )


@pytest.fixture(scope="module")
def clutter() -> Clutter:
    return Clutter(RADAR, ROOM, variant="scalar", order=2)


def test_a_room_alone_is_exactly_still(clutter: Clutter) -> None:
    samples = RoomIf(clutter.radar, clutter.cycle()).clutter_if(np.arange(5 * RADAR.n_tx))
    cycles = samples.reshape(5, RADAR.n_tx, RADAR.n_rx, -1)
    assert samples.dtype == np.complex64
    np.testing.assert_array_equal(cycles, np.broadcast_to(cycles[0], cycles.shape))
    times = RADAR.chirp_times(RADAR.n_tx)
    expected = sum(synthesize(echoes, RADAR, times) for echoes in clutter.cycle())
    # complex64.
    np.testing.assert_allclose(cycles[0], expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def weights_of(
    shadow: ClutterShadow, chirps: NDArray[np.int64], n_echoes: int
) -> NDArray[np.float64]:
    """What is left of each echo at some chirps (chirp, rx, echo), one by one."""
    out = np.ones((len(chirps), RADAR.n_rx, n_echoes))
    for own, chirp, tx in zip(out, chirps, RADAR.tx_of_chirp(chirps), strict=True):
        keyframe, rest = divmod(int(chirp), shadow.step)
        after = smoothstep(rest / shadow.step)
        for number, weight in ((keyframe, 1 - after), (keyframe + 1, after)):
            lost = shadow.at(number)
            own[:, lost.echo] -= weight * lost.fraction[tx]
    return out


@pytest.mark.parametrize("blocks", [1, 3])
def test_a_shadow_moves_as_in_chirps_made_one_by_one(clutter: Clutter, blocks: int) -> None:
    ball = Ball()
    room, shadow = (
        RoomIf(RADAR, clutter.cycle(), ClutterShadow(clutter, ball, variant="scalar")),
        ClutterShadow(clutter, ball, variant="scalar"),
    )
    chirps = np.arange(9, 900, 37)
    got = np.concatenate([room.clutter_if(part) for part in np.array_split(chirps, blocks)])
    tx, weights = RADAR.tx_of_chirp(chirps), weights_of(shadow, chirps, clutter.n_echoes)
    assert weights.min() < 1e-12  # some are occluded altogether
    # Not in a row and none of them moves: their times are those of any chirps.
    times, expected = RADAR.chirp_times(len(chirps)), np.zeros_like(got)
    for own, first in zip(clutter.cycle(), shadow.starts, strict=False):
        left = weights[..., first : first + len(own.part)]
        echoes = replace(own, length=own.length[tx], amplitude=own.amplitude[:, tx] * left, tx=tx)
        expected += synthesize(echoes, RADAR, times)
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-6 * np.abs(expected).max())


def test_a_body_that_hides_nothing_leaves_the_room_as_it_is(clutter: Clutter) -> None:
    chirps = np.arange(400)
    still = RoomIf(clutter.radar, clutter.cycle()).clutter_if(chirps)
    np.testing.assert_array_equal(
        RoomIf(
            RADAR, clutter.cycle(), ClutterShadow(clutter, Ball(start=60.0), variant="scalar")
        ).clutter_if(chirps),
        still,
    )


def test_free_space_is_silent() -> None:
    clutter = Clutter(RADAR, Scene(), variant="scalar")
    room = RoomIf(RADAR, clutter.cycle(), ClutterShadow(clutter, Ball(), variant="scalar"))
    np.testing.assert_array_equal(room.clutter_if(np.arange(3)), 0)
