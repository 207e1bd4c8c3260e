"""Edges of furniture and of moving objects against the knife edge and Kirchhoff's integral."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.special import fresnel

from rtradar import Object, Radar, Scene
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.scatter import build_model
from rtradar.scatter.multipath.solid_edges import SolidEdges
from rtradar.scene import Furniture, material
from rtradar.trace.backend import select, use
from rtradar.trace.occluders import Occluders

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

WAVE = SPEED_OF_LIGHT_MPS
TILT = Rotation.from_euler("zyx", [20, 15, 30], degrees=True).as_matrix()
CONDUCTOR = material("perfect-conductor")
ONE = ((0.0, 0.0, 0.0),)


def rms(values: NDArray[Any]) -> float:
    return float(np.sqrt(np.mean(np.abs(values) ** 2)))


def narrow(carrier_hz: float) -> Radar:
    """One Tx and one Rx at one place, and a sweep in which all that edges send arrives at once."""
    at = {"tx_positions_m": ONE, "rx_positions_m": ONE, "tx_y": 0, "tx_z": 0, "rx_y": 0, "rx_z": 0}
    sweep = {"start_frequency_hz": carrier_hz, "bandwidth_hz": 0.5e9}
    return Radar(name="narrow", position_m=(0.0, 0.0, 1.0), **sweep, **at)  # type: ignore[arg-type]


def piece(mesh: trimesh.Trimesh, folder: Path, *, moves: bool = False) -> Furniture:
    file = folder / f"piece {len(list(folder.iterdir()))}.ply"
    mesh.export(file)
    kind = Object if moves else Furniture
    given = {"position_m": (0.0, 0.0, 0.0), "metres_per_unit": 1.0}
    return kind(file.stem, file, CONDUCTOR, sheet=not mesh.is_watertight, **given)


def box(low: tuple[float, ...], high: tuple[float, ...]) -> trimesh.Trimesh:
    return trimesh.creation.box(bounds=[low, high])


def left(scene: Scene, radar: Radar, origin: Array, targets: Array) -> Field:
    edges = SolidEdges(Occluders(use(select("auto")), scene), scene, radar)
    origins = np.tile(origin, (len(targets), 1))
    return edges.left(origins, targets, np.zeros(len(targets)))


def past(sheet: trimesh.Trimesh, wavelength_m: float, source: Array, target: Array) -> complex:
    """Sum over a sheet what it takes of a leg, by Kirchhoff's obliquity, and take it off 1."""
    points, areas = sheet.triangles_center, sheet.area_faces
    away = [points - place for place in (source, target)]
    first, last = (np.linalg.norm(one, axis=1) for one in away)
    cosines = sum(
        np.abs(np.sum(one * sheet.face_normals, axis=1)) / size
        for one, size in zip(away, (first, last), strict=True)
    )
    k, straight = 2 * np.pi / wavelength_m, float(np.linalg.norm(target - source))
    total = (cosines / 2 * np.exp(-1j * k * (first + last - straight)) / (first * last)) @ areas
    return complex(1 - 1j * k / (2 * np.pi) * total * straight)


@pytest.mark.parametrize(
    ("fidelity", "moves", "carrier_hz"),
    [
        ("specular", False, 12e9),
        ("specular", True, 12e9),
        ("specular", False, 77e9),
        ("physical-optics", True, 77e9),
        ("auto", False, 12e9),
    ],
)
def test_a_sphere_behind_a_board_returns_over_its_edge(
    fidelity: str, moves: bool, carrier_hz: float, make: Any, tmp_path: Path
) -> None:
    radar, body = narrow(carrier_hz), make.one((0.1, 0.1, 0.1), (4.0, 0.0, 1.0))
    chirp = np.zeros(1, dtype=np.int64)
    bare = build_model(fidelity, radar, body).echoes(chirp).amplitude
    for offset_m in (-0.30, -0.15, -0.05, 0.02, 0.05, 0.10, 0.15, 0.30):
        board = box((1.99, -2.0, -1.0), (2.01, -offset_m / 2, 3.0))
        part = {"objects" if moves else "furniture": (piece(board, tmp_path, moves=moves),)}
        model = build_model(fidelity, radar, body, scene=Scene(**part), order=0)  # type: ignore[arg-type]
        ratio = rms(model.echoes(chirp).amplitude) / rms(bare)
        # From the radar to the near side of the sphere, 3.9 m away.
        number = offset_m / 2 * np.sqrt(2 * 3.9 / (WAVE / radar.centre_frequency_hz * 2.0 * 1.9))
        sine, cosine = fresnel(number)
        knife = abs(0.5 + (1 + 1j) / 2 * (cosine - 1j * sine)) ** 2
        off_db = 20 * np.log10(ratio / knife)
        # Over the sweep of 0.5 GHz what the edge sends is damped by a few thousandths.
        assert abs(off_db) < 0.1, offset_m


def test_a_sheet_of_any_shape_lets_past_what_it_leaves_of_kirchhoffs_sum(tmp_path: Path) -> None:
    radar, outline = narrow(12e9), np.array([[0, 0], [0.5, 0.1], [0.3, 0.5], [0.2, 0.2]])
    corners = np.insert(outline - 0.2, 0, 0.0, axis=1) @ TILT.T + [1.5, 0.0, 1.0]
    # Not convex, tilted, and smaller than the Fresnel zone here and there.
    sheet = trimesh.Trimesh(corners, [[0, 1, 3], [1, 2, 3]])
    scene = Scene(furniture=(piece(sheet, tmp_path),))
    wavelength_m = WAVE / radar.centre_frequency_hz
    fine = sheet
    for _ in range(8):
        fine = fine.subdivide()
    assert np.sqrt(fine.area_faces.max()) < wavelength_m / 8
    targets = np.linspace([3.2, -1.0, 0.7], [3.4, 0.9, 1.5], 40)
    origin = np.array(radar.position_m)
    exact = np.array([past(fine, wavelength_m, origin, place) for place in targets])
    got = left(scene, radar, origin, targets)
    assert np.abs(exact).min() < 0.3
    assert abs(np.abs(exact[[0, -1]]) - 1).max() < 0.1
    np.testing.assert_allclose(got, exact, rtol=0, atol=0.05)


def test_two_boxes_that_touch_are_one(tmp_path: Path) -> None:
    radar, origin = narrow(77e9), np.array([0.0, 0.0, 1.0])
    targets = np.linspace([4.0, -1.5, 1.0], [4.0, 1.5, 1.2], 60)
    whole, *parts = (
        piece(box((1.8, low, 0.0), (2.2, high, 2.0)), tmp_path)
        for low, high in ((-0.5, 0.5), (-0.5, 0.02), (0.02, 0.5))
    )
    one, two = (left(Scene(furniture=own), radar, origin, targets) for own in ((whole,), parts))
    assert np.abs(one).min() < 0.05
    # Each half of the upper edge is damped over the sweep by its own detour.
    np.testing.assert_allclose(two, one, rtol=0, atol=3e-3)


def test_a_box_on_the_floor_sends_nothing_over_the_edges_that_it_stands_on(
    make: Any, tmp_path: Path
) -> None:
    radar, origin = narrow(12e9), np.array([0.0, 0.0, 1.0])
    targets = np.linspace([4.0, -1.5, 0.05], [4.0, 1.5, 0.05], 60)
    stands, mirrored = (
        piece(box((2.0, -0.5, low), (2.3, 0.5, 1.5)), tmp_path) for low in (0.0, -1.5)
    )
    got = left(Scene(walls=(make.wall("floor"),), furniture=(stands,)), radar, origin, targets)
    exact = left(Scene(furniture=(mirrored,)), radar, origin, targets)
    np.testing.assert_allclose(got, exact, rtol=0, atol=1e-6)


def test_a_leg_on_the_line_of_an_edge_keeps_half(tmp_path: Path) -> None:
    radar, origin = narrow(12e9), np.array([0.0, 0.0, 1.0])
    board = Scene(furniture=(piece(box((1.9, -2.0, -2.0), (2.1, 0.0, 4.0)), tmp_path),))
    got = left(board, radar, origin, np.array([[4.0, 1e-9, 1.0], [4.0, -1e-9, 1.0], [4, 0, 1]]))
    np.testing.assert_allclose(got, 0.5, rtol=0, atol=0.02)
