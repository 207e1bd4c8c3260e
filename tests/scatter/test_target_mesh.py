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
    "a vertex is infinite": (lambda: mesh(moved(3, np.inf), FACES), "not finite"),
    "a vertex is beyond all bounds": (lambda: mesh(moved(3, 1e200), FACES), "more than 1e"),
    "a vertex that no face names is NaN": (
        lambda: mesh(np.vstack([CORNERS, [np.nan] * 3]), FACES),
        "not finite",
    ),
    "vertices in a plane of two axes": (
        lambda: mesh(CORNERS[:, :2], FACES),
        r"must be \(vertex, 3\)",
    ),
    "no vertices": (trimesh.Trimesh, "no triangles"),
    "no faces": (lambda: mesh(CORNERS, np.zeros((0, 3), int)), "no triangles"),
    "all corners alike": (lambda: mesh(np.zeros((3, 3)), [[0, 1, 2]]), "no triangle with an area"),
    "corners on a line": (
        lambda: mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]),
        "no triangle with an area",
    ),
    "a corner named twice": (lambda: mesh(CORNERS, [[0, 0, 1]]), "no triangle with an area"),
    "too small for float64": (lambda: mesh(CORNERS * 1e-200, FACES), "no triangle with an area"),
    "an index too high": (
        lambda: mesh(CORNERS, np.vstack([FACES, [0, 1, 99]])),
        "vertex that is not there",
    ),
    "an index below zero": (
        lambda: mesh(CORNERS, np.vstack([FACES, [0, 1, -1]])),
        "vertex that is not there",
    ),
    "a face wound the other way": (
        lambda: mesh(CORNERS, [FACES[0, ::-1], *FACES[1:]]),
        "which side is outside",
    ),
    "vertices and faces, but no trimesh": (NoTrimesh, "the target is a NoTrimesh; allowed"),
    "points": (lambda: trimesh.PointCloud(CORNERS), "the target is a PointCloud; allowed"),
    "a scene": (lambda: trimesh.Scene([BOX]), "the target is a Scene; allowed"),
    "words": (lambda: "a person", "the target is a str; allowed"),
    "nothing": (lambda: None, "the target is a NoneType; allowed"),
}


def test_every_model_is_told_of() -> None:
    assert {*WITH_MESHES, *WITHOUT} == set(models_that("scattering"))


@pytest.mark.parametrize("pairs", [1, 0])
@pytest.mark.parametrize("fidelity", WITH_MESHES)
@pytest.mark.parametrize("case", BAD)
def test_bad_meshes_are_refused_alike(case: str, fidelity: str, pairs: int) -> None:
    make, said = BAD[case]
    tx = np.tile(AWAY, (pairs, 1))
    with pytest.raises(InputError, match=said) as caught:
        rt.scattering_length(make(), tx, tx, 3e9, fidelity=fidelity)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("fidelity", WITHOUT)
@pytest.mark.parametrize(
    "make", [lambda: BOX, *(make for make, _ in BAD.values())], ids=["a good mesh", *BAD]
)
def test_models_that_take_no_meshes_say_so(make: Callable[[], Any], fidelity: str) -> None:
    with pytest.raises(InputError, match=f"'{fidelity}' takes rt.Ellipsoids, not") as caught:
        rt.scattering_length(make(), AWAY, AWAY, 3e9, fidelity=fidelity)
    assert "\n" not in str(caught.value)


SHEET = mesh(
    [[0, -0.2, -0.2], [0, 0.2, -0.2], [0, 0.2, 0.2], [0, -0.2, 0.2]], [[0, 1, 2], [0, 2, 3]]
)


@pytest.mark.parametrize("fidelity", WITH_MESHES)
@pytest.mark.parametrize("name", ["tx", "rx"])
@pytest.mark.parametrize(
    ("target", "place"),
    [
        (BOX, (0, 0, 0)),
        (BOX, (0.1, 0.01, 0.02)),
        (BOX, tuple(CORNERS[0])),
        (SHEET, (0, 0.01, 0.05)),
        (SHEET, (0, 0.2, 0.2)),
    ],
    ids=["inside", "on a face", "on a corner", "on a sheet", "on a sheet's corner"],
)
def test_antennas_stand_outside(
    target: Any, place: tuple[float, float, float], name: str, fidelity: str
) -> None:
    antennas = {"tx": [AWAY, AWAY], "rx": [AWAY, AWAY]} | {
        name: [AWAY, np.array(place, dtype=np.float64)]
    }
    with pytest.raises(
        InputError, match=rf"{name}\[1\] is .*on.*; antennas must stand outside the target"
    ):
        rt.scattering_length(target, antennas["tx"], antennas["rx"], 3e9, fidelity=fidelity)


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
