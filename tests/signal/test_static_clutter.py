"""The IF of a room: exactly still without a person, and with one as each chirp made by itself."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline

from rtradar.body.body import Poses
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.clutter.body_shadow import ClutterShadow
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scatter.common.interpolation import interpolation_weights, sweep_nodes
from rtradar.scene import Furniture, Scene, Surface, material, room_walls
from rtradar.signal import clutter as room_if
from rtradar.signal import synthesize
from rtradar.signal.clutter import RoomIf

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


def left_of(
    shadow: ClutterShadow, chirps: NDArray[np.int64], objects: list[Echoes]
) -> list[NDArray[np.complex128]]:
    """What is left of each object's echoes at some chirps (node, chirp, rx, echo)."""
    out = []
    for number, own in enumerate(objects):
        left = np.ones((len(own.frequency), len(chirps), RADAR.n_rx, len(own.part)), complex)
        to_nodes = interpolation_weights(shadow.frequency, own.frequency)
        for row, (chirp, tx) in enumerate(zip(chirps, RADAR.tx_of_chirp(chirps), strict=True)):
            keyframe, rest = divmod(int(chirp), shadow.step)
            times, at = np.arange(-1.0, 3.0), rest / shadow.step
            slopes = np.array([[-0.5, 0, 0.5, 0], [0, -0.5, 0, 0.5]])
            weights = [
                CubicHermiteSpline([0, 1], unit[1:3], slopes @ unit)(at) for unit in np.eye(4)
            ]
            for weight, offset in zip(weights, times, strict=True):
                lost = shadow.at(keyframe + int(offset))
                if number in shadow.mirrors:
                    for of_mirror in lost.of_mirror[lost.mirror == number]:
                        left[:, row] -= weight * (to_nodes @ of_mirror[tx].T)[..., None]
                else:
                    echo = lost.echo - shadow.starts[number]
                    inside = (echo >= 0) & (echo < len(own.part))
                    left[:, row][..., echo[inside]] -= weight * lost.fraction[:, tx][..., inside]
        out.append(left)
    return out


@pytest.mark.parametrize("blocks", [pytest.param(1, marks=pytest.mark.slow), 3])
def test_a_shadow_moves_as_in_chirps_made_one_by_one(clutter: Clutter, blocks: int) -> None:
    # Mirrors that the amplitude's polynomial follows with the shadow in it: at seven nodes.
    ball, objects = Ball(), list(clutter.cycle())
    shadow = ClutterShadow(clutter, ball)
    room = RoomIf(RADAR, objects, ClutterShadow(clutter, ball))
    chirps = np.arange(9, 900, 37)
    got = np.concatenate([room.clutter_if(part) for part in np.array_split(chirps, blocks)])
    tx, nodes = RADAR.tx_of_chirp(chirps), sweep_nodes(RADAR, 11)
    # Not in a row and none of them moves: their times are those of any chirps.
    times, expected = RADAR.chirp_times(len(chirps)), np.zeros_like(got)
    wholes = list(objects)
    for number, own in enumerate(objects):
        # What is lost of points is a parabola over the sweep.
        of_points = sweep_nodes(RADAR, len(shadow.point_frequency))
        own_nodes = nodes if number in shadow.mirrors else of_points
        fine = interpolation_weights(own.frequency, own_nodes)
        amplitude = np.tensordot(fine, own.amplitude, 1)
        objects[number] = replace(own, amplitude=amplitude, frequency=own_nodes)
    for whole, own, left in zip(wholes, objects, left_of(shadow, chirps, objects), strict=True):
        lost = own.amplitude[:, tx] * (1 - left)
        for echoes, sign, amplitude in ((whole, 1, whole.amplitude[:, tx]), (own, -1, lost)):
            echoes = replace(echoes, length=own.length[tx], amplitude=amplitude, tx=tx)
            expected += sign * synthesize(echoes, RADAR, times)
    np.testing.assert_allclose(got, expected, rtol=0, atol=3e-6 * np.abs(expected).max())
    still = RoomIf(RADAR, objects).clutter_if(chirps)
    assert np.abs(got - still).max() > 0.003 * np.abs(still).max()


def test_a_room_is_as_before_after_an_error(
    clutter: Clutter, monkeypatch: pytest.MonkeyPatch
) -> None:
    chirps, shadow = np.arange(9, 200), ClutterShadow(clutter, Ball())
    expected = RoomIf(RADAR, clutter.cycle(), shadow).clutter_if(chirps)
    room, at, errors = RoomIf(RADAR, clutter.cycle(), shadow), shadow.at, [KeyboardInterrupt()]

    def once_interrupted(keyframe: int) -> object:
        if errors:
            raise errors.pop()
        return at(keyframe)

    monkeypatch.setattr(shadow, "at", once_interrupted)
    with pytest.raises(KeyboardInterrupt):
        room.clutter_if(chirps)
    np.testing.assert_array_equal(room.clutter_if(chirps), expected)


def test_what_was_begun_is_not_computed_again(
    clutter: Clutter, monkeypatch: pytest.MonkeyPatch
) -> None:
    chirps, shadow = np.arange(9, 900), ClutterShadow(clutter, Ball())
    expected = RoomIf(RADAR, clutter.cycle(), shadow).clutter_if(chirps)
    room, asked = RoomIf(RADAR, clutter.cycle(), shadow), list[int]()
    room.begin(chirps)
    np.testing.assert_array_equal(room.clutter_if(chirps[:9]), expected[:9])
    monkeypatch.setattr(shadow, "at", asked.append)
    np.testing.assert_array_equal(room.clutter_if(chirps), expected)
    # Of the same keyframes parts need no more than the whole.
    room.begin(chirps[400:])
    assert asked == []


def test_samples_at_rest_are_made_once_for_the_same_echoes_before_the_same_radar(
    clutter: Clutter, monkeypatch: pytest.MonkeyPatch
) -> None:
    made, real = list[int](), room_if.synthesize

    def counted(*given: Any, **options: Any) -> Any:
        made.append(1)
        return real(*given, **options)

    room_if._at_rest.cache_clear()
    monkeypatch.setattr(room_if, "synthesize", counted)
    first, again = (RoomIf(RADAR, clutter.cycle()) for _ in range(2))
    once = len(made)
    assert once == len(first.cycle)
    np.testing.assert_array_equal(first.clutter_if(np.arange(3)), again.clutter_if(np.arange(3)))
    # The same numbers in other arrays, and another radar, are another room.
    copies = [replace(own, length=own.length.copy()) for own in clutter.cycle()]
    RoomIf(RADAR, copies)
    RoomIf(replace(RADAR, name="other"), clutter.cycle())
    assert len(made) == 3 * once


def test_a_body_that_hides_nothing_leaves_the_room_as_it_is(clutter: Clutter) -> None:
    chirps = np.arange(400)
    still = RoomIf(clutter.radar, clutter.cycle()).clutter_if(chirps)
    np.testing.assert_array_equal(
        RoomIf(RADAR, clutter.cycle(), ClutterShadow(clutter, Ball(start=60.0))).clutter_if(chirps),
        still,
    )


def test_free_space_is_silent() -> None:
    clutter = Clutter(RADAR, Scene(), variant="scalar")
    room = RoomIf(RADAR, clutter.cycle(), ClutterShadow(clutter, Ball()))
    np.testing.assert_array_equal(room.clutter_if(np.arange(3)), 0)
