"""Facets: the integral over one, closed forms of many, laws of scattering, shadows, bad input."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.scatter.facets import Facets, Views, Waves
from rtradar.kernels.scatter.triangles import positive_fraction
from rtradar.scatter import build_model
from rtradar.scatter.common.polarization import Polarization, copolar
from rtradar.scatter.facets.radiation import (
    body_facets,
    ellipsoid_facets,
    facet_integral,
    facet_normals,
    mesh_facets,
)
from rtradar.scatter.facets.target import facet_scattering
from rtradar.trace.backend import use
from rtradar.trace.tracers import BodyTracer

Array = NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)


def ellipsoid(
    *axes: float, centre: object = (0.0, 0.0, 0.0), frame: object = None
) -> rt.Ellipsoids:
    return rt.Ellipsoids([centre], [np.eye(3) if frame is None else frame], [axes])


def square(side: float, x: float = 0.0, y: float = 0.0) -> trimesh.Trimesh:
    half = side / 2
    corners = [[x, y - half, -half], [x, y + half, -half], [x, y + half, half], [x, y - half, half]]
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def both(*meshes: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.util.concatenate(meshes)


def field(
    target: object, tx: Array, rx: Array, frequency: float, **model_options: object
) -> NDArray[np.complex128]:
    tx, rx = np.atleast_2d(tx), np.atleast_2d(rx)
    return facet_scattering(target, tx, rx, np.full(len(tx), frequency), **model_options)  # type: ignore[arg-type]


def clearance(antenna: Array, point: Array, centre: Array, frame: Array, axes: Array) -> float:
    """Least distance of the way from an ellipsoid's middle, in its own unit, less 1."""
    start, end = ((place - centre) @ frame / axes for place in (antenna, point))
    nearest = np.clip(-(start @ (end - start)) / np.sum((end - start) ** 2), 0, 1)
    return float(np.linalg.norm(start + nearest * (end - start)) - 1)


def directions(rng: np.random.Generator, n: int) -> Array:
    random = rng.normal(size=(n, 3))
    return random / np.linalg.norm(random, axis=1, keepdims=True)


# -- one facet -------------------------------------------------------------------------------------


def mean_over_triangle(phases: Array, lit: Array | None = None, cells: int = 400) -> complex:
    """Mean of exp(j phase), phase linear between its three corner values, by the midpoints of small
    triangles; 0 where a function that is linear, too, is not positive, if its corner values are
    given."""
    i, j = np.meshgrid(np.arange(cells), np.arange(cells), indexing="ij")
    up, down = i + j < cells, i + j < cells - 1
    u = np.concatenate([(i[up] + 1 / 3) / cells, (i[down] + 2 / 3) / cells])
    v = np.concatenate([(j[up] + 1 / 3) / cells, (j[down] + 2 / 3) / cells])
    phase, kept = (
        own[0] + (own[1] - own[0]) * u + (own[2] - own[0]) * v
        for own in (phases, np.ones(3) if lit is None else lit)
    )
    return complex((np.exp(1j * phase) * (kept > 0)).mean())


def integral_of_one(
    facets: Facets,
    antennas: np.ndarray,
    k: float,
    seen: np.ndarray | None = None,
    *edges: np.ndarray,
    **currents: np.ndarray,
) -> complex:
    """Integral over the facets of one part for one pair of Tx and Rx, which see it in whole."""
    pair, each = np.array([[0, 1]]), np.zeros(1, dtype=int)
    seen = np.ones((2, 1), np.float32) if seen is None else seen
    carrier = np.full((1, 1), np.linalg.norm(antennas, axis=1).sum())
    waves = Waves(pair, carrier, np.array([[k]]), spreading=False, **currents)
    views = Views(each, antennas[None], pair, each, seen, *edges)
    return complex(facet_integral(facets, views, waves)[0, 0, 0])


@settings(max_examples=40)
@given(seeds, st.floats(-3, 1.7))
def test_linear_phase_is_integrated_exactly(seed: int, size: float) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(3, 3))
    facets = mesh_facets(corners, np.array([[0, 1, 2]]), both_sides=True)
    # As far as this its waves are plane to 1e-7 rad.
    antenna = 1e9 * directions(rng, 1)[0]
    path = 2 * (np.linalg.norm(corners - antenna, axis=1) - np.linalg.norm(antenna))
    # From all alike to 50 rad of difference, through series and differences alike.
    k = 10**size / np.ptp(path)
    got = integral_of_one(facets, np.stack([antenna, antenna]), k)
    facing = abs(facets.normals[0] @ antenna) / np.linalg.norm(antenna)
    expected = 1j * k / np.sqrt(np.pi) * facing * facets.areas[0] * mean_over_triangle(-k * path)
    # The midpoint sum is within (50 / 400)^2 / 24 of the exact mean; paths of 1e9 m have 1e-7 m of
    # rounding.
    scale = k / np.sqrt(np.pi) * facing * facets.areas[0]
    assert abs(got - expected) < 1e-3 * scale


@settings(max_examples=40)
@given(seeds, st.floats(-1, 1))
def test_of_a_facet_that_an_edge_cuts_the_lit_piece_is_integrated_exactly(
    seed: int, size: float
) -> None:
    rng = np.random.default_rng(seed)
    corners, edge = rng.normal(size=(3, 3)), rng.normal(size=3)
    facets = mesh_facets(corners, np.array([[0, 1, 2]]), both_sides=True)
    antenna = 1e9 * directions(rng, 1)[0]
    path = 2 * (np.linalg.norm(corners - antenna, axis=1) - np.linalg.norm(antenna))
    k = 10**size / np.ptp(path)
    # Lit by the Tx as the edge says, and in whole by the Rx.
    edges = np.stack([edge, np.ones(3)]).astype(np.float32)[:, None]
    seen = np.array([[positive_fraction(*edge)], [1.0]], dtype=np.float32)
    got = integral_of_one(facets, np.stack([antenna, antenna]), k, seen, edges)
    scale = k / np.sqrt(np.pi) * facets.areas[0]
    scale *= abs(facets.normals[0] @ antenna) / np.linalg.norm(antenna)
    # By many points, of which an edge takes half a row at the most.
    assert abs(got - 1j * scale * mean_over_triangle(-k * path, edge)) < 4e-3 * scale


@settings(max_examples=40)
@given(seeds, st.floats(-1, 1))
def test_of_a_facet_that_the_terminator_cuts_the_lit_piece_is_integrated_exactly(
    seed: int, size: float
) -> None:
    rng = np.random.default_rng(seed)
    axes, place = rng.uniform(0.5, 2, 3), directions(rng, 1)[0]
    # A facet about a place of an ellipsoid to which the Tx is tangential.
    outward = place / axes / np.linalg.norm(place / axes)
    tx = place * axes + 1e9 * np.cross(outward, directions(rng, 1)[0])
    ball = place + 0.1 * np.cross(place, rng.normal(size=(3, 3)))
    corners = axes * ball / np.linalg.norm(ball, axis=1, keepdims=True)
    if np.linalg.det(corners) < 0:
        corners = corners[::-1].copy()
    faces = np.array([[0, 1, 2]], dtype=np.int32)
    ends, (normals, areas) = np.array([[0, 0], [3, 1]]), facet_normals(corners, faces)
    facets = Facets(
        corners, faces, normals, areas, np.ones(1), np.zeros(1), ends, semi_axes=axes[None]
    )
    antennas = np.stack([tx, 1e9 * directions(rng, 1)[0]])
    path = np.linalg.norm(corners - antennas[:, None], axis=2).sum(axis=0)
    k = 10**size / np.ptp(path)
    carrier = np.linalg.norm(antennas, axis=1).sum()
    # Of the currents only what does not fall to 0 at the terminator by itself.
    vector = rng.normal(size=3)
    currents = np.array([[[0, *vector, 0, 1]]], dtype=float)
    got = integral_of_one(facets, antennas, k, currents=currents)
    # Lit is where the normal of the ellipsoid faces the Tx.
    edge = np.sum(corners / axes**2 * (tx - corners), axis=1) / 1e9
    scale = k / np.sqrt(np.pi) * areas[0]
    mean = mean_over_triangle(-k * (path - carrier), edge) * (vector @ normals[0])
    assert abs(got - 1j * scale * mean) < 4e-3 * scale * np.linalg.norm(vector)


@settings(max_examples=20)
@given(seeds)
def test_flat_and_steep_facets_of_one_mesh_add_up(seed: int) -> None:
    # Flat facets are summed by series and steep ones by differences, whichever stand beside them.
    rng = np.random.default_rng(seed)
    sizes = 10 ** rng.uniform(-4, 0, 12)
    corners = rng.normal(size=(12, 3, 3)) * sizes[:, None, None]
    antennas = (50 * directions(rng, 1) + rng.normal(size=(2, 3)))[None]
    k = np.array([[20.0]])

    def integral(some: Array) -> complex:
        facets = mesh_facets(
            some.reshape(-1, 3), np.arange(3 * len(some)).reshape(-1, 3), both_sides=True
        )
        shape = np.zeros((1, 2), int), np.zeros(1, int), np.ones((1, len(some)), np.float32)
        waves = Waves(np.array([[0, 1]]), np.array([[100.0]]), k, spreading=True)
        views = Views(np.zeros(1, int), antennas, *shape)
        return complex(facet_integral(facets, views, waves)[0, 0, 0])

    each = [integral(one[None]) for one in corners]
    scale = np.sum(np.abs(each))
    # The series leaves out 1e-7 of a facet, differences as much of one as small as these.
    assert abs(integral(corners) - np.sum(each)) < 1e-6 * scale
    # Those of no weight in that, beside one whose own rounding is 1e-13 of itself.
    small, steep = corners[sizes < 1e-2], corners[[np.argmax(sizes)]]
    beside = integral(np.concatenate([small, steep])) - integral(steep)
    expected = [integral(one[None]) for one in small]
    assert abs(beside - np.sum(expected)) <= 1e-6 * np.sum(np.abs(expected)) + 1e-13 * abs(
        integral(steep)
    )


# -- closed forms ----------------------------------------------------------------------------------


@pytest.mark.parametrize("ka", [5.0, 10.0, 29.34, 80.0])
def test_a_sphere_has_the_closed_form_of_physical_optics(ka: float) -> None:
    frequency = ka * SPEED_OF_LIGHT_MPS / (2 * np.pi * 0.1)
    tx = 1e6 * directions(np.random.default_rng(1), 4)
    decibel = 20 * np.log10(
        np.abs(
            field(ellipsoid(0.1, 0.1, 0.1), tx, tx, frequency) / rt.rcs.sphere(0.1, frequency, "po")
        )
    )
    np.testing.assert_allclose(decibel, 0, atol=0.1)  # the accuracy promised


@pytest.mark.parametrize("frequency", [1e9, 3e9])
def test_a_large_plate_returns_four_pi_area_squared_over_wavelength_squared(
    frequency: float,
) -> None:
    tx = np.array([[1e7, 0, 0], [-1e7, 0, 0]])  # a sheet has two sides
    wavelength = SPEED_OF_LIGHT_MPS / frequency
    # Waves from 1e7 m bend over 5 m by 1e-4 rad.
    np.testing.assert_allclose(
        np.abs(field(square(5.0), tx, tx, frequency)) ** 2,
        4 * np.pi * 25**2 / wavelength**2,
        rtol=1e-6,
    )


def test_a_plate_aslant_has_side_lobes_of_a_square() -> None:
    angle, k = np.radians(10), 2 * np.pi * 1e9 / SPEED_OF_LIGHT_MPS
    tx = 1e7 * np.array([np.cos(angle), np.sin(angle), 0])
    expected = (
        k / np.sqrt(np.pi) * 25 * np.cos(angle) * np.abs(np.sinc(k * 5 * np.sin(angle) / np.pi))
    )
    np.testing.assert_allclose(np.abs(field(square(5.0), tx, tx, 1e9)), expected, rtol=1e-5)


def test_a_mesh_of_a_sphere_is_a_sphere() -> None:
    mesh = trimesh.creation.icosphere(5, radius=0.1)
    tx, rx = np.array([[4.0, 0.3, 0.0]]), np.array([[4.0, -0.2, 0.1]])
    fine = field(ellipsoid(0.1, 0.1, 0.1), tx, rx, 12e9, facets=20 * 4**5)
    # The mesh lies 0.4 % of a facet inside the sphere: 2 k sag is 0.01.
    np.testing.assert_allclose(field(mesh, tx, rx, 12e9), fine, rtol=0.02)
    mesh.invert()  # outward is told by the volume
    np.testing.assert_allclose(field(mesh, tx, rx, 12e9), fine, rtol=0.02)


def test_polarization_of_a_mirror_by_hand() -> None:
    # Tx along x, Rx along y: the mirror is at 45 degrees. v lies along its surface and is reversed,
    # as everywhere; h is carried over from y to x, and kept.
    tx, rx = np.array([1.0, 0, 0]), np.array([0, 2.0, 0])
    for polarization in (Polarization("v"), Polarization("h")):
        assert copolar(tx, rx, polarization) == pytest.approx(1)
        assert copolar(tx, tx, polarization) == 1
        assert copolar(tx, -tx, polarization) == 1
        assert copolar(np.array([0, 0, 1.0]), np.array([0, 0, 1.0]), polarization) == 1


# -- shadows ---------------------------------------------------------------------------------------


def test_a_plate_in_the_shadow_of_another_shows_its_free_half() -> None:
    # The front one ends at y = 0 as seen from the antenna, in the middle of the one behind.
    tx = np.array([1e5, 0.0, 0.0])
    front, behind = square(1.2, 2.0, -0.6), square(1.0)
    half = trimesh.Trimesh(
        [[0, 0, -0.5], [0, 0.5, -0.5], [0, 0.5, 0.5], [0, 0, 0.5]],
        [[0, 1, 2], [0, 2, 3]],
        process=False,
    )
    whole, alone, free = (
        field(target, tx, tx, 3e9) for target in (both(front, behind), front, half)
    )
    # The edge is found within a quarter of a wavelength, 25 mm of 500, and by half of that in the
    # mean.
    assert abs(whole - alone - free)[0] < 0.025 * abs(free)[0]


def test_a_shadow_moves_over_a_body_without_jumps(backend: object) -> None:
    # A sphere passes before an ellipsoid in steps of half a millimetre, a tenth of a facet.
    kind = backend.kind  # type: ignore[attr-defined]
    tx = np.array([[-4.0, 0.0, 0.0]])
    y = np.arange(-10, 11) * 0.5e-3
    alone = field(ellipsoid(0.07, 0.07, 0.2), tx, tx, 6e9, facets=1280)[0]
    values = []
    for place in y[:: 10 if kind == "scalar" else 1]:
        sphere = ellipsoid(0.06, 0.06, 0.06, centre=(-0.5, place + 0.06, 0))
        target = rt.Ellipsoids(
            [[0, 0, 0], *sphere.centres],
            np.tile(np.eye(3), (2, 1, 1)),
            [[0.07, 0.07, 0.2], *sphere.semi_axes],
        )
        shadowed = field(target, tx, tx, 6e9, facets=1280, variant=kind) - field(
            sphere, tx, tx, 6e9, facets=1280
        )
        values.append(shadowed[0] / alone)
    # Over 10 mm a fifth of the field comes free; a facet that popped would be a step of 0.02 among
    # those of 0.012.
    assert abs(values[-1] - values[0]) > 0.15
    if kind != "scalar":
        assert np.abs(np.diff(values, 2)).max() < 0.002


def test_what_hides_a_vertex_is_what_the_line_of_sight_meets(backend: object) -> None:
    rng = np.random.default_rng(0)
    tracer_axes = rng.uniform(0.05, 0.25, (6, 3))
    tracer = BodyTracer(use(backend), tracer_axes)  # type: ignore[arg-type]
    # Of each part as many as it takes.
    facets = ellipsoid_facets(tracer_axes, np.array([320, 80, 320, 500, 320, 20]))
    every, first = facets.vertices, facets.ends[:, 0].copy()
    near, outlines, asked = 0, 0, 0
    for _ in range(3):
        centres, frames = (
            rng.uniform(-0.4, 0.4, (6, 3)),
            Rotation.random(6, random_state=rng).as_matrix(),
        )
        antennas = np.array([-4.0, 0, 0]) + rng.normal(size=(3, 3)) * 0.3
        parts = np.array([4, 1, 2])
        given = centres, frames, antennas, parts
        hidden = tracer.occluders(*given, every.T.copy(), first, 0.0)
        for a, antenna in enumerate(antennas):
            for part in parts:
                vertices = every[first[part] : first[part + 1]]
                world = vertices @ frames[part].T + centres[part]
                normals = (vertices / tracer_axes[part] ** 2) @ frames[part].T
                for vertex in np.flatnonzero(np.sum(normals * (antenna - world), axis=1) > 0):
                    gaps = np.array(
                        [
                            clearance(
                                antenna,
                                world[vertex],
                                centres[other],
                                frames[other],
                                tracer_axes[other],
                            )
                            if other != part
                            else np.inf
                            for other in range(6)
                        ]
                    )
                    asked += 1
                    outlines += abs(gaps.min()) < 0.01
                    # Triangles stand out of the unit ball by 0.07 % and sag into it by 0.03 %.
                    if abs(gaps.min()) > 1e-3:
                        found = hidden[a, first[part] + vertex]
                        assert (found >= 0) == (gaps.min() < 0)
                        assert found < 0 or gaps[found] < 1e-3
                    else:
                        near += 1
    # Both ways were used: the closed form, and rays along outlines, to which the nearest are left.
    assert 5 * near < outlines < asked / 5


def test_what_faces_away_returns_nothing_and_no_nan() -> None:
    edge_on = np.array([0.0, 4.0, 0.0])
    np.testing.assert_allclose(field(square(0.5), edge_on, edge_on, 3e9), 0, atol=1e-12)


# -- bad input -------------------------------------------------------------------------------------


def test_too_large_a_part_is_refused_unless_its_facets_are_asked_for() -> None:
    tx, frequency = np.array([4.0, 0, 0]), 420 * SPEED_OF_LIGHT_MPS / (2 * np.pi * 0.1)
    with pytest.raises(
        InputError, match=r"ka = 420, above 400, needs \d+ facets an ellipsoid; set facets=\d+"
    ):
        field(ellipsoid(0.1, 0.1, 0.1), tx, tx, frequency)
    with pytest.raises(InputError, match="needs"):
        field(ellipsoid(0.1, 0.1, 0.1), tx, tx, frequency, facets=5120)
    with pytest.raises(InputError, match="take 'specular'"):
        field(ellipsoid(1.0, 1.0, 1.0), tx, tx, frequency)
    with pytest.raises(
        InputError, match=r"smooth mesh with ka = 420, above 400, needs \d+ facets; it has 1280"
    ):
        field(trimesh.creation.icosphere(3, radius=0.1), tx, tx, frequency)


@pytest.mark.parametrize("facets", [0, 19, 2.5, True, 10**9, "many"])
def test_facets_must_be_a_count(facets: object) -> None:
    with pytest.raises(InputError, match=r"facets = .* whole number from 20"):
        field(ellipsoid(0.1, 0.1, 0.1), np.ones(3), np.ones(3), 1e9, facets=facets)


@pytest.mark.parametrize("level", ["physical-optics", "reference"])
@pytest.mark.parametrize("facets", [0, 19, 2.5, True, 10**9, "many"])
def test_facets_of_a_level_must_be_a_count(level: str, facets: object) -> None:
    body = Body.from_motion(rt.synthetic_motion("walk", duration_s=0.1))
    with pytest.raises(InputError, match=r"facets = .* whole number from 20"):
        build_model(level, rt.Radar.preset("iwr6843"), body, facets=facets)


def test_parts_have_at_least_the_facets_that_they_are_asked_for() -> None:
    facets = ellipsoid_facets(np.ones((5, 3)), np.array([20, 21, 80, 5120, 5121]))
    assert np.diff(facets.ends[:, 1]).tolist() == [20, 80, 80, 5120, 5780]
    assert facets.ends[-1].tolist() == [len(facets.vertices), len(facets.faces)]


@pytest.mark.parametrize("ka", [8.0, 20.0, 60.0, 150.0])
def test_a_sphere_of_the_facets_of_a_body_has_the_closed_form(ka: float) -> None:
    frequency = ka * SPEED_OF_LIGHT_MPS / (2 * np.pi * 0.1)
    tx = 1e6 * directions(np.random.default_rng(1), 4)
    (facets,) = body_facets(np.full((1, 3), 0.1), ka / 0.1).tolist()
    assert facets == max(1280, 100 * ka)
    found = field(ellipsoid(0.1, 0.1, 0.1), tx, tx, frequency, facets=facets)
    decibel = 20 * np.log10(np.abs(found / rt.rcs.sphere(0.1, frequency, "po")))
    # A sag of 0.1 rad, at which the terminator is not smooth any more.
    np.testing.assert_allclose(decibel, 0, atol=0.25)


def test_a_mesh_takes_no_number_of_facets() -> None:
    tx = np.array([4.0, 0, 0])
    with pytest.raises(InputError, match="brings its own"):
        field(square(1.0), tx, tx, 1e9, facets=100)
