"""Reflections from one part to another: against independent paths, laws, and what hides them."""

import dataclasses
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import rtradar as rt
from references.double_reflections import solve_double_reference
from rtradar.body import Body
from rtradar.body.people import body_of_people
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.motion import cut
from rtradar.scatter import build_model
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.double_reflections import DoubleReflections, pairs_apart, solve_doubles
from rtradar.settings import RunSettings
from rtradar.trace.backend import select, use
from rtradar.trace.tracers import BodyTracer

V = Polarization("v")
K = 2 * np.pi * 12e9 / SPEED_OF_LIGHT_MPS
RADAR = dataclasses.replace(rt.Radar.preset("paper-12ghz"), tx_y=1, tx_z=0, rx_y=2, rx_z=0)


def two(apart: float, *more: tuple[float, float, float], radius: float = 0.05) -> rt.Ellipsoids:
    """Spheres one above the other, their surfaces so far apart, and more at other places."""
    z = radius + apart / 2
    centres = [(0.0, 0.0, z), (0.0, 0.0, -z), *more]
    return rt.Ellipsoids(centres, [np.eye(3)] * len(centres), [(radius,) * 3] * len(centres))


def change(target: rt.Ellipsoids, tx: Any, rx: Any, polarization: str = "v", **options: Any) -> Any:
    """What reflections over two parts add to the scattering length."""
    given = {"polarization": polarization, **options}
    one, both = (
        rt.scattering_length(target, tx, rx, 12e9, "specular", bounces=bounces, **given)
        for bounces in (1, 2)
    )
    return (both - one)[0]


def random_pair(seed: int) -> Geometry:
    rng = np.random.default_rng(seed)
    centres = np.array([[[4.0, 0.0, 1.0], [4.2, 0.9, 0.8]]]) + rng.normal(0, 0.05, (1, 2, 3))
    frames = Rotation.random(2, random_state=seed).as_matrix()[None]
    axes = rng.uniform(0.05, 0.25, (2, 3))
    return Geometry(
        rng.normal(0, 0.2, (1, 3)), rng.normal(0, 0.2, (1, 1, 3)), centres, frames, axes
    )


@settings(max_examples=10)
@given(st.integers(0, 2**20))
def test_paths_are_those_of_a_minimiser(seed: int) -> None:
    at, pairs = random_pair(seed), np.array([[0, 1]])
    for polarization in ("v", "h"):
        found = solve_doubles(at, pairs, polarization=Polarization(polarization))
        length, amplitude = solve_double_reference(at, pairs, polarization == "h")
        np.testing.assert_allclose(found.length, length, atol=1e-8)
        np.testing.assert_allclose(found.amplitude, amplitude, rtol=3e-3, atol=1e-9)


@settings(max_examples=10)
@given(st.integers(0, 2**20))
def test_the_way_back_returns_the_same(seed: int) -> None:
    at = random_pair(seed)
    back = at._replace(tx=at.rx[:, 0], rx=at.tx[:, None])
    there = solve_doubles(at, np.array([[0, 1]]), polarization=V)
    again = solve_doubles(back, np.array([[1, 0]]), polarization=V)
    np.testing.assert_allclose(again.length, there.length, atol=1e-9)
    np.testing.assert_allclose(again.amplitude, there.amplitude, rtol=3e-3)


def test_two_spheres_across_the_line_of_sight_by_hand() -> None:
    # Far away and far apart each reflects at 45 degrees: Gaussian curvature and cos(i) leave the
    # divergence a / 2 of either, and nothing is left of the curvature of the wave between them.
    radius, apart, far = 0.05, 20.0, 1e7
    found = change(two(apart, radius=radius), [far, 0, 0], [far, 0, 0], "h")
    # Two paths, one in each sense, of the same length; h is reversed against one reflection.
    distance = apart + 2 * radius - 2 * radius / np.sqrt(2)
    expected = 2 * 2 * np.sqrt(np.pi) * (radius / 2) ** 2 / distance
    assert abs(found) == pytest.approx(expected, rel=0.01)
    beyond = distance - 2 * radius / np.sqrt(2)
    assert np.angle(-found * np.exp(1j * K * beyond)) == pytest.approx(0, abs=0.05)


def test_polarisations_have_opposite_signs() -> None:
    antenna = [30.0, 0.0, 4.0]
    v, h = (change(two(0.1), antenna, antenna, polarization) for polarization in ("v", "h"))
    assert v == pytest.approx(-h, rel=1e-2)


def test_a_third_sphere_between_hides_one_from_the_other() -> None:
    antenna = [30.0, 0.0, 0.0]
    alone, hidden = two(0.4), two(0.4, (0.0, 0.0, 0.0))
    assert abs(change(alone, antenna, antenna)) > 0.001
    # What is left goes by the one between.
    pairs = pairs_apart(hidden.centres, hidden.frames, hidden.semi_axes)
    assert [0, 1] in pairs.tolist()
    near = abs(change(hidden, antenna, antenna))
    expected = 2 * change(two(0.15), antenna, antenna)
    assert near == pytest.approx(abs(expected), rel=0.1)


@pytest.mark.parametrize(("apart", "number"), [(0.001, 2), (-0.001, 0)])
def test_spheres_that_touch_are_no_pair(apart: float, number: int) -> None:
    target = two(apart)
    assert len(pairs_apart(target.centres, target.frames, target.semi_axes)) == number


@pytest.mark.parametrize(
    ("fidelity", "options"),
    [
        ("specular", {}),
        pytest.param("specular", {"visibility": "gradual"}, marks=pytest.mark.slow),
        ("physical-optics", {}),
    ],
)
def test_on_a_walker_they_are_listed_and_each_has_an_echo(
    fidelity: str, options: dict[str, Any]
) -> None:
    body = Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=0.3))
    chirps = np.array([100, 400])
    one = build_model(fidelity, RADAR, body, bounces=1, **options).echoes(chirps)
    model: Any = build_model(fidelity, RADAR, body, bounces=2, **options)
    both = model.echoes(chirps)
    listed = model.account()["double_reflections"]
    assert {(row["first"], row["last"]) for row in listed} >= {("right thigh", "left thigh")}
    assert all(row["over_single_reflections_db"] > -30 for row in listed)
    single, double = both.bounces == 1, both.bounces == 2
    assert double.sum() == len(listed)
    np.testing.assert_array_equal(both.length[..., single], one.length)
    assert np.abs(both.amplitude[..., double]).max() > 0


def test_keyframes_change_nothing_but_fades() -> None:
    body = Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=0.3))
    tracer = BodyTracer(use(select("auto")), body.semi_axes)
    doubles = DoubleReflections(RADAR, body, tracer)
    chirps = np.arange(90, 110)
    single = build_model("specular", RADAR, body).echoes(chirps)
    found = doubles.beside(single, chirps)
    kept = found.bounces == 2
    poses = body.at(RADAR.centres_of(chirps))
    tx, rx = RADAR.tx[found.tx], RADAR.rx[RADAR.rx_of_tx[found.tx]]
    number = {name: part for part, name in enumerate(body.part_names)}
    pairs = [
        (number[row["first"]], number[row["last"]])
        for row in doubles.account()["double_reflections"]
    ]
    cold = solve_doubles(Geometry(tx, rx, *poses), np.array(sorted(pairs)), polarization=V)
    there = (cold.amplitude != 0) & (found.amplitude[0][..., kept] != 0)
    assert there.mean() > 0.3
    np.testing.assert_allclose(found.length[..., kept][there], cold.length[there], atol=1e-7)


def people(**places: tuple[float, float]) -> Body:
    """Synthetic people at places, by what they do."""
    everyone = [
        rt.Person(rt.synthetic_motion(activity, seed=0, duration_s=0.2), place)
        for activity, place in places.items()
    ]
    return body_of_people(everyone, RunSettings())


def doubles_of(body: Body, chirps: Any) -> Any:
    """Field of the reflections over two parts (chirp, rx)."""
    doubles = DoubleReflections(RADAR, body, BodyTracer(use(select("auto")), body.semi_axes))
    both = doubles.beside(build_model("specular", RADAR, body).echoes(chirps), chirps)
    two = both.bounces == 2
    turns = 2 * np.pi / RADAR.wavelength_m * both.length[..., two]
    return (both.amplitude[0][..., two] * np.exp(1j * turns)).sum(axis=-1)


def test_two_people_are_the_sum_of_each_alone() -> None:
    # 8 m apart, side by side before the radar, so that neither hides the other.
    left, right, chirps = (0.0, 5.0), (0.0, -3.0), np.arange(0, 900, 50)
    together = doubles_of(people(walk=left, kick=right), chirps)
    alone = doubles_of(people(walk=left), chirps) + doubles_of(people(kick=right), chirps)
    assert np.abs(alone).max() > 0
    np.testing.assert_allclose(together, alone, atol=1e-6 * np.abs(alone).max())


def test_the_beginning_does_not_depend_on_what_follows() -> None:
    walk, chirps = rt.synthetic_motion("walk", seed=0, duration_s=2.0), np.arange(0, 900, 50)
    short, whole = (doubles_of(Body.from_motion(cut(walk, 0.0, end)), chirps) for end in (0.2, 2.0))
    assert np.abs(whole).max() > 0
    np.testing.assert_allclose(short, whole, atol=1e-9 * np.abs(whole).max())


def test_a_pair_fades_where_it_begins_to_return() -> None:
    body = Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=1.0))
    doubles = DoubleReflections(RADAR, body, BodyTracer(use(select("auto")), body.semi_axes))
    chirps = np.arange(0, RADAR.chirps_in(1.0), 4)
    single = build_model("specular", RADAR, body).echoes(chirps)
    found = doubles.beside(single, chirps)
    two = found.bounces == 2
    amplitude = np.abs(found.amplitude[0, :, 0][:, two])
    assert ((amplitude == 0).any(axis=0) & (amplitude > 0).any(axis=0)).sum() > 3
    steps = np.abs(np.diff(amplitude, axis=0)).max(axis=0)
    assert steps.max() < 0.1 * amplitude.max()


def test_parts_in_one_place_end_the_search() -> None:
    at = random_pair(0)
    at = at._replace(centres=np.repeat(at.centres[:, :1], 2, axis=1))
    assert not solve_doubles(at, np.array([[0, 1]]), polarization=V).amplitude.any()


@pytest.mark.parametrize("bounces", [0, 3])
def test_other_numbers_are_refused(bounces: int) -> None:
    with pytest.raises(InputError, match="it must be 1, or 2 for reflections from part to part"):
        rt.scattering_length(two(0.1), [4, 0, 0], [4, 0, 0], 12e9, "specular", bounces=bounces)


def test_a_mesh_has_none() -> None:
    import trimesh

    with pytest.raises(InputError, match="those of ellipsoids"):
        rt.scattering_length(
            trimesh.creation.icosphere(2, 0.1), [4, 0, 0], [4, 0, 0], 5e9, "physical-optics",
            bounces=2,
        )  # fmt: skip
