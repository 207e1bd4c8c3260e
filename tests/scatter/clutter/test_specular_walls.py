"""Mirror reflections of walls: images by hand, amplitudes by the radar equation of a mirror."""

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import trimesh

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.radar import Radar
from rtradar.scatter.clutter.returns import RoomEchoes
from rtradar.scatter.clutter.static_clutter import specular_returns
from rtradar.scene import Furniture, Scene, Surface, Wall, material, room_walls, slab
from rtradar.trace.backend import select, use
from rtradar.trace.occluders import Occluders

SIZE, CORNER = (6.0, 4.5, 2.6), (-4.8, -2.0)
METAL = Surface(material=material("perfect-conductor"), thickness_m=0.1)
RADAR = Radar(tx_y=2, tx_z=2, rx_y=3, rx_z=3, samples_per_chirp=1024)
SIDES = {
    "near": (0, -4.8),
    "far": (0, 1.2),
    "right": (1, -2.0),
    "left": (1, 2.5),
    "floor": (2, 0.0),
    "ceiling": (2, 2.6),
}


def box(surface: Surface = METAL) -> Scene:
    return Scene(walls=room_walls(SIZE, CORNER, dict.fromkeys(SIDES, surface)))


def mirrors(radar: Radar, scene: Scene, order: int) -> list[RoomEchoes]:
    return list(specular_returns(radar, scene, Occluders(use(select("scalar")), scene), order))


def gain(echoes: RoomEchoes) -> np.ndarray:
    """|amplitude| over that of a perfect mirror with the same path, (tx, rx), at the last node."""
    return np.abs(echoes.amplitude[-1, ..., 0]) * echoes.length[..., 0] / (2 * np.sqrt(np.pi))


def test_a_box_has_all_images_of_two_orders_once_each() -> None:
    tx, rx = RADAR.tx[:, None], RADAR.rx[RADAR.rx_of_tx]
    found: dict[frozenset[str], float | np.ndarray] = {}
    for echoes in mirrors(RADAR, box(), 2):
        names = echoes.name.split(" + ")
        image = tx
        for name in names:
            axis, place = SIDES[name]
            image = np.where(np.arange(3) == axis, 2 * place - image, image)
        there = gain(echoes) > 0
        # Sums and differences of a few metres in float64.
        expected = np.linalg.norm(image - rx, axis=-1)
        np.testing.assert_allclose(
            echoes.length[..., 0][there], expected[there], rtol=0, atol=1e-13
        )
        opposite = len(names) == 2 and SIDES[names[0]][0] == SIDES[names[1]][0]
        key = echoes.name if opposite else frozenset(names)
        found[key] = found.get(key, 0.0) + gain(echoes)
    # Six walls, six sequences of two opposite ones, and twelve edges, over which two orders
    # have one path in common.
    assert len(found) == 6 + 6 + 12
    for name, total in found.items():
        # A conductor mirrors v into v, whatever the angles.
        np.testing.assert_allclose(total, 1, rtol=0, atol=1e-12, err_msg=str(name))


def test_furniture_hides_a_wall(tmp_path: Path) -> None:
    trimesh.creation.box((0.5, 1.0, 1.0)).export(tmp_path / "box.ply")
    piece = Furniture(
        name="box",
        mesh=tmp_path / "box.ply",
        material=material("wood"),
        position_m=(0, 1, 1),
        metres_per_unit=1.0,
    )
    scene = replace(box(), furniture=(piece,))
    names = [{echoes.name for echoes in mirrors(RADAR, each, 1)} for each in (scene, box())]
    assert names[1] - names[0] == {"far"}


def test_a_wall_on_the_way_is_passed_twice() -> None:
    pane = Wall(
        name="pane",
        corner_m=(-2.0, -2.0, 0.0),
        edge_u_m=(0.0, 4.5, 0.0),
        edge_v_m=(0.0, 0.0, 2.6),
        material=material("glass"),
        thickness_m=0.005,
    )
    radar = Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0, bandwidth_hz=1e6)
    scene = replace(box(), walls=(*box().walls, pane))
    far = {echoes.name: echoes for echoes in mirrors(radar, scene, 1)}
    _, through = slab(pane.material.eta(12e9), 0.005, 12e9, 1.0, "te")
    through = through * np.exp(2j * np.pi * 12e9 / SPEED_OF_LIGHT_MPS * 0.005)
    expected = 2 * np.sqrt(np.pi) / 10.4 * np.conj(through**2)
    # The band of 1 MHz turns it by less than this.
    np.testing.assert_allclose(far["far"].amplitude, expected, rtol=1e-3)
    # Its normal points along +x, away from the radar, which meets the back, 5 mm nearer.
    np.testing.assert_allclose(far["pane"].length, 2 * (2.0 - 0.005), rtol=0, atol=1e-12)


def test_tx_and_rx_may_change_places() -> None:
    surface = Surface(material=material("concrete"), thickness_m=0.15)
    there = Radar(
        tx_y=2, tx_z=0, rx_y=2, rx_z=0, tx_spacing_wavelengths=80, rx_spacing_wavelengths=3
    )
    back = Radar(
        tx_y=2, tx_z=0, rx_y=2, rx_z=0, tx_spacing_wavelengths=3, rx_spacing_wavelengths=80
    )
    first, second = (
        {echoes.name: echoes for echoes in mirrors(radar, box(surface), 2)}
        for radar in (there, back)
    )
    assert set(first) == {" + ".join(reversed(name.split(" + "))) for name in second}
    frequency = np.array([12.5e9, 14e9, 15.5e9])
    for name, echoes in first.items():
        other = second[" + ".join(reversed(name.split(" + ")))]
        np.testing.assert_allclose(echoes.length, other.length.transpose(1, 0, 2), rtol=1e-12)
        mine, its = (echoes.at_nodes(frequency), other.at_nodes(frequency).transpose(0, 2, 1, 3))
        np.testing.assert_allclose(mine, its, rtol=0, atol=1e-9)


def test_every_point_lies_on_its_wall() -> None:
    for echoes, (tx, rx) in product(mirrors(RADAR, box(), 2), ((0, 0), (1, 2), (3, 1))):
        for hop, name in enumerate(echoes.name.split(" + ")):
            axis, place = SIDES[name]
            point = echoes.points[tx, rx, 0, hop]
            if echoes.amplitude[0, tx, rx, 0] != 0:
                assert point[axis] == pytest.approx(place, abs=1e-12)
