"""What a person hides of a room: against straight lines past a sphere."""

from dataclasses import dataclass

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

from rtradar.body.body import Poses
from rtradar.radar import Radar
from rtradar.scatter.clutter.body_shadow import ClutterShadow
from rtradar.scatter.clutter.point_shadow import FADE
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scene import FollowingPath, Furniture, Object, Scene, Surface, material, room_walls

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


def kirchhoff(offset: float, zone: float, ball: float) -> complex:
    """Fraction of a wave that a disc takes, its middle beside the ray: Lommel's integral.

    In rings about the ray, of each of which the disc covers an arc.
    """
    radius = (np.arange(8000) + 0.5) * 4 * zone / 8000
    with np.errstate(invalid="ignore"):
        cosine = (radius**2 + offset**2 - ball**2) / (2 * radius * offset)
    arc = 2 * np.arccos(np.clip(cosine, -1, 1))
    # Faded as a beam wide against the zone would.
    wave = np.exp((1j - FADE) * np.pi * (radius / zone) ** 2)
    return complex((FADE - 1j) * (arc * wave * radius).sum() * radius[0] * 2 / zone**2)


@pytest.mark.parametrize("keyframe", [0, 4, 8, 60])
def test_a_mirror_path_loses_the_kirchhoff_integral_over_the_ball(
    clutter: Clutter, keyframe: int
) -> None:
    ball = Ball()
    shadow = ClutterShadow(clutter, ball)
    lost = shadow.at(keyframe)
    centre = ball.at(np.array([(keyframe * shadow.step + 0.5) * RADAR.chirp_duration_s])).centres[
        0, 0
    ]
    number = next(n for n in shadow.mirrors if clutter.objects[n].name == "far")
    own = clutter.objects[number]
    found = lost.of_mirror[lost.mirror == number]
    for tx, rx in ((0, 0), (2, 1), (4, 0)):
        places = RADAR.tx[tx], own.points[tx, rx, 0, 0], RADAR.rx[RADAR.rx_of_tx[tx, rx]]
        length = np.linalg.norm(places[1] - places[0]) + np.linalg.norm(places[2] - places[1])
        for node, frequency in enumerate(shadow.frequency):
            left = 1.0 + 0j
            for antenna in (places[0], places[2]):
                way = (places[1] - antenna) / np.linalg.norm(places[1] - antenna)
                along = (centre - antenna) @ way
                offset = float(np.linalg.norm(antenna + along * way - centre))
                zone = np.sqrt(299792458.0 / frequency * along * (length - along) / length)
                left *= 1 - kirchhoff(offset, zone, ball.radius)
            got = found[0, tx, rx, node] if len(found) else 0.0
            assert abs(got - (1 - left)) < 0.02
    assert (len(found) > 0) == (keyframe < 60)


def test_a_mirror_path_loses_the_kirchhoff_integral_over_a_ball_of_triangles() -> None:
    smooth = dict.fromkeys(SIDES, Surface(material=material("concrete"), thickness_m=0.2))
    walls = room_walls((6.0, 4.5, 2.6), (-4.8, -2.0), smooth)
    clutter = Clutter(RADAR, Scene(walls=walls), variant="scalar", order=2)
    away = Ball(place=(30.0, 0.0, 1.0))
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.3)
    path = FollowingPath(velocity_mps=(0.0, -2.0, 0.0))
    moving = Object("ball", ball, "metal", position_m=(-1.0, 1.0, 1.0), motion=path)
    shadow, expected = ClutterShadow(clutter, away, (moving,)), ClutterShadow(clutter, Ball())
    posed = shadow._posed(700), expected._posed(700)
    (which, lost), (others, of_ball) = (
        own._of_mirrors(at) for own, at in zip((shadow, expected), posed, strict=True)
    )
    np.testing.assert_array_equal(which, others)
    assert np.abs(of_ball).max() > 0.2
    # The mesh is 0.5 % smaller than the ball, and some legs of the path are both hidden.
    np.testing.assert_allclose(lost, of_ball, rtol=0, atol=0.04)


def test_points_behind_the_ball_are_hidden_and_others_not(clutter: Clutter) -> None:
    ball = Ball()
    shadow = ClutterShadow(clutter, ball)
    lost = shadow.at(0)
    centre = ball.at(np.array([0.5 * RADAR.chirp_duration_s])).centres[0, 0]
    antennas = np.concatenate([RADAR.tx, RADAR.rx])
    zone = np.sqrt(RADAR.wavelength_m * 2.0)  # a leg's first zone is less than twice as wide
    hidden = 0
    for own, first, last in zip(
        clutter.objects, shadow.starts[:-1], shadow.starts[1:], strict=True
    ):
        if own.kind == "mirror":
            continue
        nearest = gap(antennas[:, None], own.points[0, 0, :, 0], centre)
        inside = (lost.echo >= first) & (lost.echo < last)
        some = lost.echo[inside] - first
        fraction = lost.fraction[0][..., inside]
        clear = (nearest[:, some] > ball.radius + 2 * zone).all(axis=0)
        assert np.abs(fraction[..., clear]).max(initial=0) < 0.1
        # Behind its middle there is Poisson's spot, which fades as all far fringes do.
        behind = (nearest[:, some] < 0.5 * ball.radius).all(axis=0)
        np.testing.assert_allclose(fraction[..., behind], 1, atol=0.35)
        hidden += behind.sum()
    assert hidden > 20
    assert (np.diff(lost.echo) > 0).all()


def test_the_shadow_is_smooth_in_time(clutter: Clutter) -> None:
    shadow = ClutterShadow(clutter, Ball())
    steps = np.array([_dense(shadow, keyframe, clutter)[0, 0] for keyframe in range(12)])
    bends, changes = np.abs(np.diff(steps, n=3, axis=0)), np.abs(np.diff(steps, axis=0))
    # Cubics through keyframes are off by some 1/16 of the third differences.
    assert (bends**2).sum() / 16**2 < 10**-2.5 * ((changes.sum(axis=0)) ** 2).sum()


def _dense(shadow: ClutterShadow, keyframe: int, clutter: Clutter) -> Array:
    fraction = np.zeros((RADAR.n_tx, RADAR.n_rx, clutter.n_echoes), dtype=np.complex128)
    lost = shadow.at(keyframe)
    fraction[..., lost.echo] = lost.fraction[0]
    return fraction
