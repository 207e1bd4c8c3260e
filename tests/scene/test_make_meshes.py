"""The built-in meshes are made again to the same bit, are closed, and have their sizes."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import trimesh

from rtradar.scene.mesh_files import mesh_names, read_mesh
from rtradar.system.files import shipped_folder

SHEETS = ("dihedral", "trihedral")
MOVING = ("door-leaf", "fan")
FURNITURE = [name for name in mesh_names() if name not in (*SHEETS, *MOVING)]


@pytest.fixture(scope="module")
def make() -> ModuleType:
    found = importlib.util.spec_from_file_location(
        "make_meshes", shipped_folder("meshes") / "make.py"
    )
    assert found is not None
    assert found.loader is not None
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def test_made_again_they_are_the_same(make: ModuleType, tmp_path: Path) -> None:
    make.main(tmp_path)
    assert sorted(file.stem for file in tmp_path.iterdir()) == list(mesh_names())
    for name in mesh_names():
        assert (tmp_path / f"{name}.ply").read_bytes() == (
            shipped_folder("meshes") / f"{name}.ply"
        ).read_bytes(), name


@pytest.mark.parametrize("name", FURNITURE)
def test_furniture_is_closed_with_normals_outward(name: str) -> None:
    # By trimesh alone, as the file stands.
    mesh = trimesh.load_mesh(shipped_folder("meshes") / f"{name}.ply", process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert mesh.body_count == 1
    assert 12 <= len(mesh.faces) <= 1000
    assert mesh.area_faces.min() > 0
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)
    size = np.ptp(mesh.vertices, axis=0)
    assert np.all((size >= 0.05) & (size <= 2.2))


@pytest.mark.parametrize(
    ("name", "bodies", "size"),
    [("door-leaf", 1, (0.1, 0.9, 2.0)), ("fan", 4, (0.06, 0.567284, 0.491282))],
)
def test_what_moves_is_closed_and_turns_about_its_axis(
    name: str, bodies: int, size: tuple[float, float, float]
) -> None:
    mesh = trimesh.load_mesh(shipped_folder("meshes") / f"{name}.ply", process=False)
    assert mesh.is_watertight
    assert mesh.body_count == bodies
    assert min(part.volume for part in mesh.split()) > 0
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), size, atol=1e-6)
    # The leaf hangs at the z axis; a third of a turn about x takes the fan onto itself.
    if name == "door-leaf":
        assert mesh.bounds[0][1] == 0
    else:
        turn = trimesh.transformations.rotation_matrix(2 * np.pi / 3, [1, 0, 0])[:3, :3]
        blades = mesh.vertices[np.linalg.norm(mesh.vertices[:, 1:], axis=1) > 0.041]
        turned = blades @ turn.T
        gaps = np.linalg.norm(turned[:, None] - blades, axis=-1).min(axis=1)
        assert gaps.max() < 1e-8


@pytest.mark.parametrize("name", [name for name in FURNITURE if name not in ("door", "radiator")])
def test_furniture_stands_centred_on_the_floor(name: str) -> None:
    low, high = trimesh.load_mesh(shipped_folder("meshes") / f"{name}.ply", process=False).bounds
    assert low[2] == 0
    # Handles and seats stand out by 3 cm.
    np.testing.assert_allclose((low + high)[:2] / 2, 0, atol=0.03)


def test_volumes_by_hand(make: ModuleType) -> None:
    tub = read_mesh(shipped_folder("meshes") / "bathtub.ply")
    assert trimesh.Trimesh(tub.vertices, tub.faces).volume == pytest.approx(
        0.75 * 1.7 * 0.58 - 0.61 * 1.54 * 0.44
    )
    vertices, faces = make.boxes(
        [(0, 1, 0, 1, 0, 1), (0.5, 2, 0, 1, 0, 1)], hollow=[(0.4, 0.6, 0.4, 0.6, 0.4, 0.6)]
    )
    assert trimesh.Trimesh(vertices, faces, process=False).volume == pytest.approx(2.0 - 0.008)


@pytest.mark.parametrize("name", SHEETS)
def test_corner_reflectors(name: str) -> None:
    mesh = read_mesh(shipped_folder("meshes") / f"{name}.ply")
    assert not mesh.closed
    a, b, c = (mesh.corners[:, k] for k in range(3))
    normals = np.cross(b - a, c - a)
    areas = np.linalg.norm(normals, axis=1) / 2
    normals /= 2 * areas[:, None]
    # They look out of the corner, along +x alike, and stand at right angles to each other or are
    # one plate.
    expected = 1 / np.sqrt(3) if name == "trihedral" else 1 / np.sqrt(2)
    np.testing.assert_allclose(normals[:, 0], expected, atol=1e-15)
    angles = normals @ normals.T
    assert np.all(np.isclose(angles, 0, atol=1e-15) | np.isclose(angles, 1, atol=1e-15))
    assert areas.sum() == pytest.approx(3 * 0.4**2 / 2 if name == "trihedral" else 2 * 0.4**2)
    if name == "trihedral":
        corner = mesh.vertices[np.linalg.norm(mesh.vertices, axis=1) == 0]
        assert len(corner) == 1
        tips = mesh.vertices[np.linalg.norm(mesh.vertices, axis=1) > 0]
        np.testing.assert_allclose(np.linalg.norm(tips, axis=1), 0.4, rtol=1e-15)
        np.testing.assert_allclose(tips @ tips.T, 0.16 * np.eye(3), atol=1e-16)
