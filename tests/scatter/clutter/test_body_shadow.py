"""What a person hides of a room: against straight lines past a sphere."""

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.radar import Radar
from rtradar.scatter.clutter.body_shadow import ClutterShadow
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scene import Furniture, Scene, Surface, material, room_walls

Array = NDArray[np.float64]
RADAR = Radar(tx_y=3, tx_z=2, rx_y=2, rx_z=2)
SIDES = ("near", "far", "right", "left", "floor", "ceiling")
SURFACES = dict.fromkeys(
    SIDES, Surface(material=material("concrete"), thickness_m=0.2, roughness_m=0.0005)
)
ROOM = Scene(
    walls=room_walls((6.0, 4.5, 2.6), (-4.8, -2.0), SURFACES),
    furniture=(
        Furniture(name="chair", mesh="chair", material=material("wood"), position_m=(0.5, -1.0, 0)),
    ),
)


@dataclass(frozen=True)
class Ball:
    """A sphere that flies across the room in front of its far wall."""

    velocity: float = 2.0
    radius: float = 0.3
    place: tuple[float, float, float] = (-1.0, 1.0, 1.0)
    part_names: tuple[str, ...] = ("ball",)
    duration_s: float = 1.0

    @property
    def semi_axes(self) -> Array:
        return np.full((1, 3), self.radius)

    def at(self, times: Array) -> Poses:
        times = np.asarray(times)
        centres = np.array(self.place) + self.velocity * times[:, None] * [0.0, -1.0, 0.0]
        return Poses(
            centres[:, None], np.broadcast_to(np.eye(3), (len(times), 1, 3, 3)), self.semi_axes
        )


@pytest.fixture(scope="module")
def clutter() -> Clutter:
    return Clutter(RADAR, ROOM, variant="scalar", order=2)


def gap(starts: Array, ends: Array, centre: Array) -> Array:
    """Distance of straight legs (..., 3) from a place."""
    ways = ends - starts
    size = np.linalg.norm(ways, axis=-1)
    ways = ways / np.where(size > 0, size, 1.0)[..., None]
    along = np.clip(((centre - starts) * ways).sum(axis=-1), 0, size)
    return np.linalg.norm(starts + along[..., None] * ways - centre, axis=-1)


def covered(offset: Array, radius: Array, ball: float) -> Array:
    """Fraction of discs that a ball covers, by many random points.

    The discs have these radii, and their middles these distances from the ball's.
    """
    rng = np.random.default_rng(0)
    points = np.sqrt(rng.random(4000))[:, None] * np.exp(2j * np.pi * rng.random((4000, 1)))
    return (
        (np.abs(points * radius.ravel() - offset.ravel()) < ball).mean(axis=0).reshape(offset.shape)
    )


@pytest.mark.parametrize("keyframe", [0, 8, 60])
def test_mirror_paths_lose_what_the_ball_covers_of_their_fresnel_zone(
    clutter: Clutter, keyframe: int
) -> None:
    ball = Ball()
    shadow = ClutterShadow(clutter, ball, variant="scalar")
    fraction = _dense(shadow, keyframe, clutter)
    centre = ball.at(np.array([(keyframe * shadow.step + 0.5) * RADAR.chirp_duration_s])).centres[
        0, 0
    ]
    rx = RADAR.rx[RADAR.rx_of_tx]
    expected = []
    for own, first in zip(clutter.objects, shadow.starts[:-1], strict=True):
        # The ball stands in the middle of the room: of a path over one wall it meets one leg, and
        # not the end of it.
        if own.kind != "mirror" or own.name not in ("far", "left"):
            continue
        point, length = own.points[:, :, 0, 0], own.length[..., 0]
        legs = []
        for antenna in (np.broadcast_to(RADAR.tx[:, None], rx.shape), rx):
            way = (point - antenna) / np.linalg.norm(point - antenna, axis=-1, keepdims=True)
            along = ((centre - antenna) * way).sum(axis=-1)
            offset = np.linalg.norm(antenna + along[..., None] * way - centre, axis=-1)
            radius = np.sqrt(
                RADAR.wavelength_m * np.maximum(along * (length - along), 1e-12) / length
            )
            legs.append(covered(offset, radius, ball.radius))
        expected.append(np.maximum(*legs))
        # Of 24 points spread evenly, a straight edge through a disc finds the fraction to some two.
        np.testing.assert_allclose(fraction[..., first], expected[-1], atol=0.1)
    largest = np.max(expected)
    assert (largest > 0.5) == (keyframe < 60)


def test_points_behind_the_ball_are_hidden_and_others_not(clutter: Clutter) -> None:
    ball = Ball()
    shadow = ClutterShadow(clutter, ball, variant="scalar")
    lost = shadow.at(0)
    centre = ball.at(np.array([0.5 * RADAR.chirp_duration_s])).centres[0, 0]
    antennas = np.concatenate([RADAR.tx, RADAR.rx])
    for own, first, last in zip(
        clutter.objects, shadow.starts[:-1], shadow.starts[1:], strict=True
    ):
        if own.kind == "mirror":
            continue
        nearest = gap(antennas[:, None], own.points[0, 0, :, 0], centre)
        inside = (lost.echo >= first) & (lost.echo < last)
        fraction = np.zeros((RADAR.n_tx, RADAR.n_rx, own.n_echoes))
        fraction[..., lost.echo[inside] - first] = lost.fraction[..., inside]
        # Along a line of antennas the fraction changes linearly between its ends: certain where all
        # antennas agree.
        assert (fraction[..., (nearest < ball.radius * 0.999).all(axis=0)] == 1).all()
        assert (fraction[..., (nearest > ball.radius * 1.001).all(axis=0)] == 0).all()
        assert fraction.min() >= 0
        assert fraction.max() <= 1
    assert len(lost.echo) > 20


def _dense(shadow: ClutterShadow, keyframe: int, clutter: Clutter) -> Array:
    fraction = np.zeros((RADAR.n_tx, RADAR.n_rx, clutter.n_echoes))
    lost = shadow.at(keyframe)
    fraction[..., lost.echo] = lost.fraction
    return fraction


def test_a_body_outside_hides_nothing(clutter: Clutter) -> None:
    shadow = ClutterShadow(clutter, Ball(place=(30.0, 0.0, 1.0)), variant="scalar")
    assert len(shadow.at(3).echo) == 0
