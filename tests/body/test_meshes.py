from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh

from rtradar.body import Body, ellipsoid_meshes, unit_sphere
from rtradar.body.body import geodesic_sphere
from rtradar.errors import InputError
from rtradar.motion import synthetic_motion


@pytest.mark.parametrize("subdivisions", [0, 1, 2, 3, 4])
def test_unit_sphere_is_the_right_size_in_the_mean(subdivisions: int) -> None:
    vertices, faces = unit_sphere(subdivisions)
    assert faces.shape == (20 * 4**subdivisions, 3)
    assert vertices.shape == (10 * 4**subdivisions + 2, 3)
    # Mean of |x|^2 by the midpoints of the edges, exact for squares.
    corners = vertices[faces]
    midpoints = (corners + np.roll(corners, 1, axis=1)) / 2
    areas = (
        np.linalg.norm(
            np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
        )
        / 2
    )
    mean = np.sum(areas * np.mean(np.sum(midpoints**2, axis=2), axis=1)) / areas.sum()
    assert mean == pytest.approx(1.0, abs=1e-14)
    radii = np.linalg.norm(vertices, axis=1)
    assert np.ptp(radii) < 1e-14
    assert radii[0] > 1


@pytest.mark.parametrize("frequency", [1, 3, 7, 16])
def test_edges_of_a_geodesic_sphere_are_divided_into_any_number_of_parts(frequency: int) -> None:
    vertices, faces = geodesic_sphere(frequency)
    assert type(vertices) is type(faces) is np.ndarray
    assert len(vertices) == 10 * frequency**2 + 2
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    assert len(faces) == 20 * frequency**2
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    # No facet is larger than the icosahedron's own, seen from the centre, nor much smaller.
    assert mesh.area_faces.max() < 2.1 * mesh.area_faces.min()


def test_sphere_is_kept_and_cannot_be_spoilt() -> None:
    vertices, _ = unit_sphere(2)
    assert unit_sphere(2)[0] is vertices
    with pytest.raises(ValueError, match="read-only"):
        vertices[0, 0] = 5.0


@pytest.mark.parametrize("subdivisions", [-1, 9])
def test_subdivisions_out_of_range(subdivisions: int) -> None:
    with pytest.raises(InputError, match="0 to 8"):
        unit_sphere(subdivisions)


def test_meshes_of_a_body_are_closed_and_face_outward() -> None:
    pose = Body.from_motion(synthetic_motion("kick")).ellipsoids(0.9)
    vertices, faces = ellipsoid_meshes(pose, 3)
    assert vertices.shape == (21, 642, 3)
    for corners, centre, axes in zip(vertices, pose.centres, pose.semi_axes, strict=True):
        mesh = trimesh.Trimesh(corners, faces, process=False)
        assert mesh.is_watertight
        assert mesh.is_winding_consistent
        # A mesh turned inside out has a negative volume. 1280 facets: 0.9 % of volume at most.
        assert mesh.volume == pytest.approx(4 / 3 * math.pi * np.prod(axes), rel=0.009)
        np.testing.assert_allclose(mesh.center_mass, centre, atol=1e-6)


def test_vertices_lie_on_scaled_ellipsoids() -> None:
    pose = Body.from_motion(synthetic_motion("walk")).ellipsoids(0.2)
    vertices, _ = ellipsoid_meshes(pose, 2)
    local = (vertices - pose.centres[:, None]) @ pose.frames / pose.semi_axes[:, None]
    np.testing.assert_allclose(
        np.linalg.norm(local, axis=2), np.linalg.norm(unit_sphere(2)[0][0]), rtol=1e-12
    )
