"""Furniture: meshes turned, sized and put in place."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from rtradar.errors import InputError
from rtradar.scene.materials import material
from rtradar.scene.objects import Furniture


def piece(**changes: Any) -> Furniture:
    return Furniture(
        **{
            "name": "it",
            "mesh": "table",
            "material": material("wood"),
            "position_m": (0, 0, 0),
            **changes,
        }
    )


@pytest.fixture
def own(tmp_path: Path) -> Path:
    trimesh.creation.box((1000.0, 500.0, 200.0)).export(tmp_path / "box.stl")
    return tmp_path / "box.stl"


@pytest.fixture
def sheet(tmp_path: Path) -> Path:
    trimesh.Trimesh([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [(0, 1, 2)]).export(tmp_path / "sheet.ply")
    return tmp_path / "sheet.ply"


def test_turned_then_moved() -> None:
    plain, moved = piece().triangles(), piece(position_m=(5, 6, 7), yaw_deg=90).triangles()
    # Seen from above, 90 degrees anticlockwise takes x to y and y to -x.
    expected = plain.vertices[:, [1, 0, 2]] * (-1, 1, 1) + (5, 6, 7)
    np.testing.assert_allclose(moved.vertices, expected, atol=1e-12)
    np.testing.assert_array_equal(moved.faces, plain.faces)
    assert moved.closed


def test_scale_and_units(own: Path) -> None:
    mesh = piece(mesh=own, metres_per_unit=0.001, scale=2).triangles()
    np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), (2.0, 1.0, 0.4))
    np.testing.assert_allclose(
        np.ptp(piece(scale=0.5).triangles().vertices, axis=0), (0.4, 0.7, 0.37)
    )


def test_a_mesh_in_memory_is_in_metres() -> None:
    box = trimesh.creation.box((1.0, 0.5, 0.2))
    own = piece(mesh=box, position_m=(5, 6, 7), scale=2).triangles()
    np.testing.assert_allclose(own.vertices, 2 * box.vertices + (5, 6, 7))
    assert own.closed
    assert piece(mesh=box).in_memory
    assert not piece().in_memory
    with pytest.raises(InputError, match="belong to a file of one's own"):
        piece(mesh=box, metres_per_unit=1.0)
    with pytest.raises(InputError, match="measures 200 m"):
        piece(mesh=trimesh.creation.box((200.0, 1.0, 1.0))).triangles()


def test_units_are_asked_for(own: Path) -> None:
    with pytest.raises(InputError, match="metres_per_unit is missing"):
        piece(mesh=own)
    with pytest.raises(InputError, match="belong to a file of one's own"):
        piece(metres_per_unit=1.0)
    with pytest.raises(
        InputError, match=r"measures 1e\+03 m; allowed are 0\.001 to 100 m: see to metres_per_unit"
    ):
        piece(mesh=own, metres_per_unit=1.0).triangles()
    with pytest.raises(InputError, match="measures 1e-05 m"):
        piece(mesh=own, metres_per_unit=1e-6, scale=0.01).triangles()


def test_sheets(sheet: Path, own: Path) -> None:
    metal = material("metal")
    with pytest.raises(InputError, match="is not closed; close its holes, or say sheet = true"):
        piece(mesh=sheet, metres_per_unit=1, material=metal).triangles()
    with pytest.raises(
        InputError, match="'wood' of a thin sheet; allowed: metal, perfect-conductor"
    ):
        piece(mesh=sheet, metres_per_unit=1, sheet=True).triangles()
    with pytest.raises(InputError, match="is closed, so it is no thin sheet"):
        piece(mesh=own, metres_per_unit=0.001, sheet=True).triangles()
    assert not piece(mesh=sheet, metres_per_unit=1, sheet=True, material=metal).triangles().closed
    with pytest.raises(InputError, match="thin sheet"):
        piece(mesh="trihedral").triangles()
    assert not piece(mesh="trihedral", material=material("perfect-conductor")).triangles().closed


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("name", " "),
        ("mesh", "throne"),
        ("mesh", "../meshes/table"),
        ("material", "wood"),
        ("position_m", (0, 0, "1")),
        ("yaw_deg", 400),
        ("scale", 0),
        ("sheet", 1),
    ],
)
def test_furniture_without_meaning(key: str, value: Any) -> None:
    with pytest.raises(InputError) as caught:
        piece(**{key: value})
    message = str(caught.value)
    assert "\n" not in message
    assert key in message


def test_equal_furniture_is_equal() -> None:
    assert piece() == piece()
    assert len({piece(), piece(), piece(yaw_deg=1)}) == 2
