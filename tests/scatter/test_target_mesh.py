"""Meshes as targets of `scattering_length`: one check, whatever the model."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import rtradar as rt
from rtradar.errors import InputError
from rtradar.scatter.echo_models import models_that

WITH_MESHES = ("physical-optics", "reference", "rays")
WITHOUT = ("analytic", "specular")
AWAY = np.array([4.0, 0.3, 0.2])
BOX = trimesh.creation.box((0.2, 0.3, 0.1))
CORNERS, FACES = np.array(BOX.vertices), np.array(BOX.faces)


def mesh(vertices: Any, faces: Any) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, faces, process=False)


def moved(vertex: int, to: float) -> NDArray[np.float64]:
    changed = CORNERS.copy()
    changed[vertex, 1] = to
    return changed


class NoTrimesh:
    vertices, faces = CORNERS, FACES


BAD: dict[str, tuple[Callable[[], Any], str]] = {
    "a vertex is NaN": (lambda: mesh(moved(3, np.nan), FACES), "not finite"),
    "vertices in a plane of two axes": (
        lambda: mesh(CORNERS[:, :2], FACES),
        r"must be \(vertex, 3\)",
    ),
    "no faces": (lambda: mesh(CORNERS, np.zeros((0, 3), int)), "no triangles"),
    "a vertex is beyond all bounds": (lambda: mesh(moved(3, 1e200), FACES), "more than 1e"),
    "an index too high": (
        lambda: mesh(CORNERS, np.vstack([FACES, [0, 1, 99]])),
        "vertex that is not there",
    ),
    "too small for float64": (lambda: mesh(CORNERS * 1e-200, FACES), "no triangle with an area"),
    "a face wound the other way": (
        lambda: mesh(CORNERS, [FACES[0, ::-1], *FACES[1:]]),
        "which side is outside",
    ),
    "vertices and faces, but no trimesh": (NoTrimesh, "the target is a NoTrimesh; allowed"),
    "points": (lambda: trimesh.PointCloud(CORNERS), "the target is a PointCloud; allowed"),
    "nothing": (lambda: None, "the target is a NoneType; allowed"),
}


def test_every_model_is_told_of() -> None:
    assert {*WITH_MESHES, *WITHOUT} == set(models_that("scattering"))


@pytest.mark.parametrize(
    ("case", "fidelity"),
    [*((case, "physical-optics") for case in BAD), ("points", "reference"), ("points", "rays")],
)
def test_bad_meshes_are_refused_alike(case: str, fidelity: str) -> None:
    make, said = BAD[case]
    for pairs in (1, 0):
        tx = np.tile(AWAY, (pairs, 1))
        with pytest.raises(InputError, match=said) as caught:
            rt.scattering_length(make(), tx, tx, 3e9, fidelity=fidelity)
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("fidelity", WITHOUT)
def test_models_that_take_no_meshes_say_so(fidelity: str) -> None:
    for target in (BOX, trimesh.PointCloud(CORNERS), "a person"):
        with pytest.raises(InputError, match=f"'{fidelity}' takes rt.Ellipsoids, not") as caught:
            rt.scattering_length(target, AWAY, AWAY, 3e9, fidelity=fidelity)  # type: ignore[arg-type]
        assert "\n" not in str(caught.value)


SHEET = mesh(
    [[0, -0.2, -0.2], [0, 0.2, -0.2], [0, 0.2, 0.2], [0, -0.2, 0.2]], [[0, 1, 2], [0, 2, 3]]
)


@pytest.mark.parametrize(
    ("target", "place", "fidelity"),
    [
        (BOX, (0, 0, 0), "physical-optics"),
        (BOX, (0.1, 0.01, 0.02), "reference"),
        (BOX, tuple(CORNERS[0]), "rays"),
        (SHEET, (0, 0.01, 0.05), "physical-optics"),
        (SHEET, (0, 0.2, 0.2), "rays"),
    ],
    ids=["inside", "on a face", "on a corner", "on a sheet", "on a sheet's corner"],
)
def test_antennas_stand_outside(
    target: Any, place: tuple[float, float, float], fidelity: str
) -> None:
    there, away = [AWAY, np.array(place, dtype=np.float64)], [AWAY, AWAY]
    for name, antennas in (("tx", (there, away)), ("rx", (away, there))):
        said = rf"{name}\[1\] is .*on.*; antennas must stand outside the target"
        with pytest.raises(InputError, match=said):
            rt.scattering_length(target, *antennas, 3e9, fidelity=fidelity)


def sphere(radius: float, y: float = 0.0) -> trimesh.Trimesh:
    ball = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    ball.apply_translation([0.0, y, 0.0])
    return ball


def inside_out(target: trimesh.Trimesh) -> trimesh.Trimesh:
    turned = target.copy()
    turned.invert()
    return turned


@pytest.mark.parametrize("fidelity", ["physical-optics", "rays"])
def test_each_piece_of_a_mesh_is_turned_outward(fidelity: str) -> None:
    large, small = sphere(0.1), sphere(0.05, y=0.5)
    expected = rt.scattering_length(large + small, AWAY, AWAY, 3e9, fidelity=fidelity)
    for pair in (
        (large, inside_out(small)),
        (inside_out(large), small),
        (inside_out(large), inside_out(small)),
    ):
        found = rt.scattering_length(pair[0] + pair[1], AWAY, AWAY, 3e9, fidelity=fidelity)
        np.testing.assert_array_equal(found, expected)


@pytest.mark.parametrize("fidelity", ["physical-optics", "rays"])
def test_a_cavity_may_hold_antennas_and_is_seen_from_within(fidelity: str) -> None:
    shell = sphere(0.4) + inside_out(sphere(0.3))
    place = np.array([0.05, 0.02, 0.0])
    within = rt.scattering_length(shell, place, place, 3e9, fidelity=fidelity)
    for turned in (inside_out(shell), shell):
        np.testing.assert_array_equal(
            rt.scattering_length(turned, place, place, 3e9, fidelity=fidelity), within
        )
    assert abs(within[0]) > 0
    with pytest.raises(InputError, match=r"tx\[0\] is inside the mesh"):
        rt.scattering_length(shell, [0.35, 0.0, 0.0], place, 3e9, fidelity=fidelity)
