"""Echoes over walls against the image theorem, paths by hand, and images at every chirp."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body.body import Poses
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.motion.placement import place
from rtradar.radar import Radar
from rtradar.scatter.common.poses import chirp_poses
from rtradar.scatter.multipath.image_paths import images, wall_paths
from rtradar.scatter.specular_points import solve_specular_points
from rtradar.scene import Surface, Wall, material, room_walls

Array = NDArray[np.float64]


def unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


# -- paths -----------------------------------------------------------------------------------------


def box(name: str = "concrete") -> tuple[Wall, ...]:
    surface = Surface(material=material(name), thickness_m=0.2)
    sides = dict.fromkeys(("near", "far", "right", "left", "floor", "ceiling"), surface)
    return room_walls((7.0, 5.0, 2.5), (-4.5, -2.5), sides)


def test_the_paths_of_a_box_are_counted() -> None:
    # Order 2: two reflections out (6 x 5, no wall twice running), two back, or one on each way (6 x
    # 6).
    counts = [len(wall_paths(box(), np.array([-4.0, 1.0, 1.0]), order)) for order in (0, 1, 2)]
    assert counts == [1, 13, 13 + 30 + 30 + 36]
    paths = wall_paths(box(), np.array([-4.0, 1.0, 1.0]), 2)
    assert [path.name for path in paths[:3]] == ["body", "body > near", "body > far"]
    assert len({path.name for path in paths}) == len(paths)


def test_an_image_over_two_walls_keeps_the_length_of_the_path() -> None:
    antenna, point = np.array([-4.0, 1.0, 1.0]), np.array([0.3, 0.2, 1.4])
    (path,) = (p for p in wall_paths(box(), antenna, 2) if p.name == "floor > left > body")
    # Over the floor and the left wall, y = 2.5, in whatever order: both coordinates mirrored.
    np.testing.assert_allclose(images(path.out, antenna), [-4.0, 4.0, -1.0])
    assert np.linalg.norm(images(path.out, antenna) - point) == pytest.approx(
        np.sqrt(4.3**2 + 3.8**2 + 2.4**2), abs=1e-12
    )


# -- the image theorem -----------------------------------------------------------------------------


def test_floor_out_and_a_side_wall_back_by_hand(make: Any) -> None:
    # Concrete a metre thick is a half-space: 0.36 S/m leave exp(-30) of what goes through.
    radius, centre = 0.2, np.array([0.5, 0.2, 1.1])
    body, radar = make.one((radius,) * 3, tuple(centre)), make.single()
    walls = (make.wall("floor", "concrete", 1.0), make.wall("left", "concrete", 1.0))
    model = make.room(radar, body, *walls, order=2)
    echoes = model.echoes(np.arange(1))
    antenna = np.array(radar.position_m)
    tx, rx = antenna * [1, 1, -1], antenna * [1, -1, 1] + [0, 5, 0]
    at = Poses(centre[None, None], np.eye(3)[None, None], np.full((1, 3), radius))
    length, bare, point = (
        value[0, 0, 0]
        for value in solve_specular_points(Geometry(tx[None], rx[None, None], *at), points=True)
    )
    eta = material("concrete").eta(echoes.frequency[0])

    def reflected(arriving: Array, field: Array, normal: Array) -> Array:
        """ITU-R P.2040-3, eqs (31a, b), TE and TM apart; TM along the rest of the field."""
        across = unit(np.cross(arriving, normal))
        leaving = arriving - 2 * (arriving @ normal) * normal
        cosine = -arriving @ normal
        root = np.sqrt(eta - 1 + cosine**2)
        te = (cosine - root) / (cosine + root)
        tm = (eta * cosine - root) / (eta * cosine + root)
        return te * (field @ across) * across + tm * (
            field @ np.cross(across, arriving)
        ) * np.cross(across, leaving)

    up = np.array([0.0, 0.0, 1.0])
    down, aside = (point - tx) * [1, 1, -1], (point - rx) * [1, -1, 1]
    fields = []
    for way, normal in ((unit(down), up), (unit(aside), np.array([0.0, -1.0, 0.0]))):
        fields.append(reflected(way, unit(up - (up @ way) * way), normal))
    normal = unit(point - centre)
    expected = -bare * fields[1] @ (2 * (normal @ fields[0]) * normal - fields[0])
    number = model.path_names.index("floor > body > left")
    assert echoes.length[0, 0, number] == pytest.approx(length, abs=1e-9)
    # Amplitudes of Echoes are conjugate. Half-space and slab, and the polynomial over the sweep,
    # agree to 1e-3 here.
    assert echoes.amplitude[0, 0, 0, number] == pytest.approx(np.conj(expected), rel=2e-3)


# -- against mirror, chirp by chirp ----------------------------------------------------------------


def test_lengths_over_walls_are_those_of_mirror_at_every_chirp(make: Any) -> None:
    body = rt.Body.from_motion(
        place(rt.synthetic_motion("kick", seed=1), start_s=0.9, duration_s=0.2)
    )
    radar = Radar.preset("paper-12ghz")
    model = make.room(radar, body, *box())
    chirps = np.arange(0, 2000, 41)
    echoes, at = model.echoes(chirps), chirp_poses(radar, body, chirps)
    off, strength = [], []
    for number, path in enumerate(model.paths[1:], start=1):
        own = slice(21 * number, 21 * (number + 1))
        seen = np.abs(echoes.amplitude[0, ..., own]) > 0
        length, amplitude, _ = solve_specular_points(
            Geometry(images(path.out, at.tx), images(path.back, at.rx), *at[3:6])
        )
        off.append(np.abs(echoes.length[..., own] - length)[seen])
        assert np.isfinite(echoes.length).all()
        strength.append(amplitude[seen].size)
    assert sum(strength) > 10_000
    # A phase of 0.01 rad at 77 GHz is 6 um.
    assert np.concatenate(off).max() < 1e-6


def test_any_block_of_chirps_gets_the_same_echoes(make: Any) -> None:
    body = make.one(velocity=(-1.0, 0.5, 0.0))
    radar = make.single(tx_y=2, rx_y=2)
    chirps = np.arange(13, 60)
    whole = make.room(radar, body, *box()).echoes(chirps)
    model = make.room(radar, body, *box())
    pieces = [model.echoes(block) for block in np.split(chirps, [7, 8, 30])]
    np.testing.assert_array_equal(np.concatenate([piece.length for piece in pieces]), whole.length)
    np.testing.assert_array_equal(
        np.concatenate([piece.amplitude for piece in pieces], axis=1), whole.amplitude
    )
