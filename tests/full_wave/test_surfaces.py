"""Closed conducting meshes by the combined field: against Mie, modes, and the laws of fields."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import trimesh
from numpy.typing import NDArray

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.full_wave import ClosedMesh, ConductingSurface
from rtradar.full_wave.antennas import antenna_moments
from rtradar.full_wave.surfaces import rules

solves = pytest.mark.slow
"""What solves compiles for 40 s, and no level of a run does."""

RADIUS_M = 0.1
FAR = np.array([[1e5, 0.0, 0.0]])


def frequency_of(ka: float) -> float:
    return ka / RADIUS_M * SPEED_OF_LIGHT_MPS / (2 * np.pi)


def ball(subdivisions: int) -> Any:
    """A sphere whose flat triangles have its volume."""
    mesh = trimesh.creation.icosphere(subdivisions=subdivisions, radius=RADIUS_M)
    mesh.apply_scale((4 / 3 * np.pi * RADIUS_M**3 / mesh.volume) ** (1 / 3))
    return mesh


def closed(mesh: Any) -> ClosedMesh:
    return ClosedMesh(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64))


def decibels(ratio: Any) -> float:
    return float(np.abs(20 * np.log10(np.abs(ratio))).max())


# 2.7437 and 4.4934 are resonances of the inside: TM 101 and TE 101.
@solves
@pytest.mark.parametrize(("ka", "tolerance_db"), [(1.0, 0.05), (2.7437, 0.1), (3.0, 0.1)])
@pytest.mark.parametrize("polarization", ["v", "h"])
def test_a_sphere_scatters_as_mie_has_it(ka: float, tolerance_db: float, polarization: Any) -> None:
    """480 edges, of 0.05 to 0.14 wavelengths; the error goes as their square."""
    frequency = frequency_of(ka)
    found = ConductingSurface(closed(ball(2)), frequency).scattering_length(FAR, FAR, polarization)
    mie = rt.rcs.sphere(RADIUS_M, frequency)
    assert decibels(found / mie) <= tolerance_db
    assert abs(found[0] / mie - 1) <= 0.02


@solves
def test_mirror_planes_change_nothing_but_the_cost() -> None:
    """A turn about z leaves one of the three mirror planes of the mesh."""
    turned = ball(1)
    turn = trimesh.transformations.rotation_matrix(0.3, [0, 0, 1])
    turned.apply_transform(turn)
    fields = []
    for mesh, rotation in ((ball(1), np.eye(3)), (turned, turn[:3, :3])):
        surface = ConductingSurface(closed(mesh), frequency_of(1.0))
        fields.append(
            surface.scattering_length(
                np.array([[2.0, 0.4, 0.3]]) @ rotation.T, np.array([[-1.0, 2, 1]]) @ rotation.T, "v"
            )[0]
        )
    assert closed(ball(1)).mirror_axes == (0, 1, 2)
    assert closed(turned).mirror_axes == (2,)
    # Triangles that touch begin at other corners, and their integrals are good to 1e-4.
    assert fields[0] == pytest.approx(fields[1], rel=1e-4)


@solves
def test_near_antennas_see_what_the_modes_give() -> None:
    sphere = rt.Ellipsoids(np.zeros((1, 3)), np.eye(3)[None], np.full((1, 3), RADIUS_M))
    near, beside = [0.4, 0.1, 0.2], [0.2, 0.35, -0.1]
    by_modes, by_surface = (
        rt.scattering_length(target, near, beside, frequency_of(2.0), fidelity="full-wave")
        for target in (sphere, ball(2))
    )
    assert by_surface == pytest.approx(by_modes, rel=0.02)


def test_coarse_meshes_are_divided() -> None:
    block = closed(trimesh.creation.box((0.1, 0.1, 0.1)))
    surface = ConductingSurface(block, 2e9)  # edges of 115 mm, of which an eighth is allowed: 19
    assert surface.mesh.unknowns == 4**3 * block.unknowns
    corners = surface.mesh.triangles.corners
    volume = np.einsum("ti,ti->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    assert volume == pytest.approx(1e-3)


@solves
def test_integrals_of_touching_triangles() -> None:
    """Polynomials exactly, and the mean of 1/R on one triangle by its closed form.

    The closed form is that of T. F. Eibert, V. Hansen, IEEE Trans. Antennas Propag. 43, 1995.
    """
    for pairs in rules(6).pairs[1:]:
        one, other, weights = pairs[:, :3], pairs[:, 3:6], pairs[:, 6]
        moment = np.sum(weights * one[:, 0] * one[:, 1] ** 2 * other[:, 0] * other[:, 2] ** 2)
        assert moment == pytest.approx((2 * 2 / 120) ** 2)  # 2 a! b! c! / (a + b + c + 2)! squared
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    sides = np.array([1, 1, np.sqrt(2)])
    mean = -4 / 3 * np.sum(np.log(1 - sides / (sides.sum() / 2)) / sides)
    same = rules(6).pairs[3]
    distance = np.linalg.norm((same[:, :3] - same[:, 3:6]) @ corners, axis=1)
    assert np.sum(same[:, 6] / distance) == pytest.approx(mean, rel=1e-5)


def open_box() -> Any:
    mesh = trimesh.creation.box((0.1, 0.1, 0.1))
    mesh.update_faces(np.arange(len(mesh.faces)) > 1)
    return mesh


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"target": open_box()}, "the mesh is open; .*close its holes"),
        ({"material": "skin"}, "perfect conductors alone"),
        ({"frequency": 100e9}, r"at 100 GHz the mesh has \d+ edges.*48083 are allowed"),
    ],
)
def test_what_cannot_be_solved_is_refused(options: dict[str, Any], message: str) -> None:
    given: dict[str, Any] = {"target": ball(1), "tx": FAR, "rx": FAR, "frequency": 1e9} | options
    with pytest.raises(InputError, match=message):
        rt.scattering_length(fidelity="full-wave", **given)


def test_meshes_must_be_closed_and_face_outward() -> None:
    vertices, faces = np.eye(4, 3), np.array([[3, 1, 0], [3, 2, 1], [3, 0, 2], [0, 1, 2]])
    assert ClosedMesh(vertices, faces).unknowns == 6
    with pytest.raises(InputError, match="not closed"):
        ClosedMesh(vertices, faces[:3])
    with pytest.raises(InputError, match="clockwise"):
        ClosedMesh(vertices, faces[:, ::-1])


@solves
def test_two_bodies_are_one_problem() -> None:
    """Far apart they scatter as the sum of both, each with its own phase."""
    frequency, place = frequency_of(1.0), np.array([0.0, 40 * RADIUS_M, 0.0])
    one, other = ball(1), ball(1)
    other.apply_translation(place)
    both = ConductingSurface(closed(trimesh.util.concatenate([one, other])), frequency)
    tx: NDArray[np.float64] = FAR
    alone = ConductingSurface(closed(one), frequency).scattering_length(tx, tx, "v")
    # What they send each other falls with the distance: here by 1/40.
    assert both.scattering_length(tx, tx, "v") == pytest.approx(2 * alone, rel=0.05)


def dipole_by_derivatives(at: Any, position: Any, moment: Any, k: float) -> Any:
    """Electric field of a dipole (I + grad grad / k^2) G m, over that of its carrier at the origin.

    The derivatives are central differences, which need no closed form of the near field.
    """
    far, step = np.linalg.norm(position), 1e-4

    def green(x: Any) -> Any:
        distance = np.linalg.norm(x - position, axis=-1)
        return far / distance * np.exp(-1j * k * (distance - far))

    field = green(at)[..., None] * np.asarray(moment, dtype=complex)
    for i, one in enumerate(step * np.eye(3)):
        for j, other in enumerate(step * np.eye(3)):
            signs = ((1, 1), (1, -1), (-1, 1), (-1, -1))
            second = sum(a * b * green(at + a * one + b * other) for a, b in signs)
            field[..., i] += moment[j] * second / (4 * step**2 * k**2)
    return field


def test_currents_meet_the_near_fields_of_the_dipoles() -> None:
    """An antenna 0.1 m from the surface, at ka = 3; H by the curl of E, which is -j k H."""
    surface = ConductingSurface(closed(ball(0)), frequency_of(3.0))
    mesh, k = surface.mesh, 3.0 / RADIUS_M
    antenna, rule = np.array([[0.2, 0.05, 0.03]]), rules(4)
    moment = antenna_moments(antenna, "v")[0]
    points = np.einsum("pc,tcx->tpx", rule.places, mesh.triangles.corners)

    def electric(at: Any) -> Any:
        return dipole_by_derivatives(at, antenna[0], moment, k)

    step = 1e-3 * np.eye(3)
    slopes = np.array([(electric(points + one) - electric(points - one)) / 2e-3 for one in step])
    turned = [slopes[i - 2, ..., i - 1] - slopes[i - 1, ..., i - 2] for i in range(3)]
    jump = np.cross(mesh.triangles.normals[:, None], 1j / k * np.stack(turned, axis=-1))
    products = surface._products(antenna, "v")
    for found, field in zip(
        products, (electric(points), 0.8 * electric(points) + 0.2 * jump), strict=True
    ):
        expected = np.zeros(mesh.unknowns, dtype=complex)
        for triangle, edges in enumerate(mesh.edge_of):
            for corner, edge in enumerate(edges):
                flow = points[triangle] - mesh.triangles.corners[triangle, corner]
                flux = np.einsum("px,px,p->", flow, field[triangle], rule.weights)
                size = mesh.triangles.scales[triangle, corner] * mesh.triangles.areas[triangle]
                expected[edge] += size * flux
        # What the differences leave.
        assert np.abs(found[0] - expected).max() < 3e-4 * np.abs(expected).max()
