"""`scattering_length`: its phase, its normalisation, its laws, and what it refuses."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError

Array = NDArray[np.float64]
FIDELITIES = ("specular", "analytic")
# How nearly a law holds at each level: the first two know a specular point to 1e-5 of the field.
LAWS = {"specular": 1e-5, "analytic": 1e-5, "physical-optics": 1e-8, "rays": 1e-8}
FACETS, RAYS = {"facets": 1280}, {"bounces": 1, "rays_per_wavelength": 1.0}
OPTIONS: dict[str, dict[str, float]] = {"physical-optics": FACETS, "rays": RAYS}
seeds = st.integers(0, 2**32 - 1)

# Laws hold for any size, also where optics is no longer true.
pytestmark = pytest.mark.filterwarnings(
    "ignore:.*radius of curvature:rtradar.errors.ValidityWarning"
)


def ellipsoid(
    *axes: float, centre: object = (0.0, 0.0, 0.0), frame: object = None
) -> rt.Ellipsoids:
    return rt.Ellipsoids([centre], [np.eye(3) if frame is None else frame], [axes])


def both(first: rt.Ellipsoids, second: rt.Ellipsoids) -> rt.Ellipsoids:
    fields = ("centres", "frames", "semi_axes")
    return rt.Ellipsoids(
        *(np.concatenate([getattr(first, field), getattr(second, field)]) for field in fields)
    )


def directions(rng: np.random.Generator, n: int) -> Array:
    random = rng.normal(size=(n, 3))
    return random / np.linalg.norm(random, axis=1, keepdims=True)


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_a_far_sphere_has_the_optical_field_phase_and_all(fidelity: str) -> None:
    far = 1e6 * directions(np.random.default_rng(0), 20)
    for frequency in (12e9, 79e9):
        field = rt.scattering_length(ellipsoid(0.1, 0.1, 0.1), far, far, frequency, fidelity)
        # 1e6 m are 1e9 rad at 79 GHz, of which float64 keeps 1e-7 or so.
        np.testing.assert_allclose(field, rt.rcs.sphere(0.1, frequency, "go"), rtol=2e-5)


def length(target: rt.Ellipsoids, tx: Array, rx: Array, hz: float, level: str, **more: str) -> Any:
    """Scattering length by few facets and rays."""
    return rt.scattering_length(target, tx, rx, hz, level, **OPTIONS.get(level, {}), **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("level", LAWS)
def test_phase_belongs_to_the_path_over_the_origin(level: str) -> None:
    # 0.3 m farther away: the path is 0.6 m longer, and with exp(+j omega t) a longer path turns
    # back.
    tx = np.array([1e6, 0.0, 0.0])
    spheres = (ellipsoid(0.1, 0.1, 0.1), ellipsoid(0.1, 0.1, 0.1, centre=(-0.3, 0, 0)))
    here, there = (length(sphere, tx, tx, 1e9, level) for sphere in spheres)
    turn = np.exp(-2j * np.pi * 1e9 / SPEED_OF_LIGHT_MPS * 0.6)
    np.testing.assert_allclose(there / here, [turn], atol=1e-5)


@settings(max_examples=40)
@given(seeds, st.sampled_from(list(LAWS)), st.sampled_from("vh"))
def test_ends_may_be_swapped_and_all_be_turned_about_the_vertical(
    seed: int, fidelity: str, polarization: str
) -> None:
    rng = np.random.default_rng(seed)
    frames = Rotation.random(2, random_state=seed).as_matrix()
    target = both(
        ellipsoid(0.05, 0.07, 0.2, frame=frames[0]),
        ellipsoid(0.06, 0.05, 0.08, centre=(0.1, 0.2, 0.1), frame=frames[1]),
    )
    tx = directions(rng, 5) * rng.uniform(1, 10, (5, 1))
    # Within a tenth of the distance: farther apart it is the currents that Tx drives which count.
    rx = tx + 0.05 * np.linalg.norm(tx, axis=1, keepdims=True) * rng.uniform(-1, 1, (5, 3))
    turn = Rotation.from_euler("z", rng.uniform(0, 2 * np.pi)).as_matrix()
    # Of one part, for whether the edge of a shadow takes a corner of a facet is left to rounding.
    alone = ellipsoid(0.06, 0.05, 0.2, centre=(0.1, 0.0, 0.2), frame=frames[0])
    turned = rt.Ellipsoids(alone.centres @ turn.T, turn @ alone.frames, alone.semi_axes)
    there, back, upright, aslant = (
        length(own, *ends, 5e9, fidelity, polarization=polarization)
        for own, ends in (
            (target, (tx, rx)),
            (target, (rx, tx)),
            (alone, (tx, rx)),
            (turned, (tx @ turn.T, rx @ turn.T)),
        )
    )
    np.testing.assert_allclose(back, there, rtol=LAWS[fidelity], atol=1e-9)
    np.testing.assert_allclose(aslant, upright, rtol=LAWS[fidelity], atol=1e-9)


@settings(max_examples=20)
@given(seeds, st.sampled_from(FIDELITIES))
def test_twice_as_large_at_half_the_frequency_is_twice_the_field(seed: int, fidelity: str) -> None:
    rng = np.random.default_rng(seed)
    frame, tx = Rotation.random(random_state=seed).as_matrix(), 4 * directions(rng, 5)
    small = rt.scattering_length(ellipsoid(0.05, 0.07, 0.2, frame=frame), tx, tx, 12e9, fidelity)
    large = rt.scattering_length(
        ellipsoid(0.1, 0.14, 0.4, frame=frame), 2 * tx, 2 * tx, 6e9, fidelity
    )
    np.testing.assert_allclose(large, 2 * small, rtol=1e-5)


@pytest.mark.parametrize("level", LAWS)
def test_parts_beside_each_other_add_up(level: str) -> None:
    rng = np.random.default_rng(2)
    first, second = (
        ellipsoid(0.1, 0.1, 0.1, centre=(0, 0.5, 0)),
        ellipsoid(0.05, 0.05, 0.2, centre=(0.2, -0.5, 0.1)),
    )
    tx = np.array([-4.0, 0.0, 0.0]) + rng.normal(0, 0.2, (10, 3))
    rx = tx + np.array([0.0, 0.1, 0.0])
    whole, *parts = (length(t, tx, rx, 6e9, level) for t in (both(first, second), first, second))
    np.testing.assert_allclose(whole, sum(parts), rtol=1e-9)


@pytest.mark.parametrize("level", ["specular", "physical-optics", "rays"])
def test_a_part_straight_behind_another_returns_nothing_and_comes_back_beside_it(
    level: str,
) -> None:
    tx = np.array([[-4.0, 0.0, 0.0], [-4.0, 0.1, 0.05], [0.0, -4.0, 0.0]])
    front, back = ellipsoid(0.1, 0.2, 0.2, centre=(-0.4, 0, 0)), ellipsoid(0.05, 0.05, 0.1)
    whole, alone, behind = (length(t, tx, tx, 6e9, level) for t in (both(front, back), front, back))
    np.testing.assert_allclose(whole[:2], alone[:2], rtol=1e-12)
    # The third antenna sees both.
    np.testing.assert_allclose(whole[2], alone[2] + behind[2], rtol=1e-9)


@pytest.mark.parametrize("level", ["specular", "rays"])
def test_either_leg_alone_is_enough_to_hide_a_part(level: str) -> None:
    # The plate stands between target and Tx only.
    tx, rx = np.array([-4.0, 0.5, 0.0]), np.array([-4.0, -0.5, 0.0])
    plate, target = ellipsoid(0.01, 0.1, 0.3, centre=(-2.0, 0.25, 0)), ellipsoid(0.05, 0.05, 0.1)
    for pair in ((tx, rx), (rx, tx)):
        whole, alone = (length(t, *pair, 12e9, level) for t in (both(plate, target), plate))
        np.testing.assert_allclose(whole, alone, rtol=1e-9)
    seen, alone = (length(t, rx, rx, 12e9, level) for t in (both(plate, target), plate))
    assert abs(seen - alone) > 0.01


@pytest.mark.parametrize("fidelity", ["specular", "physical-optics", "reference", "rays"])
@pytest.mark.parametrize("copies", [2, 5])
def test_parts_that_fill_the_same_place_are_one(copies: int, fidelity: str) -> None:
    tx, frame = np.array([3.0, 1.0, 0.5]), Rotation.random(random_state=0).as_matrix()
    one = rt.Ellipsoids([[0.01, 0.02, 0.03]], [frame], [[0.05, 0.06, 0.1]])
    # The same ellipsoid again with its axes in another order and direction, and a hair away.
    turned = np.stack([-frame[:, 2], frame[:, 1], frame[:, 0]], axis=1)
    again = rt.Ellipsoids([[0.01, 0.02, 0.03 + 1e-7]], [turned], [[0.1, 0.06, 0.05]])
    other = ellipsoid(0.04, 0.05, 0.05, centre=(0.0, 0.5, 0.0))
    many = both(one, other)
    for copy in range(copies - 1):
        many = both(many, (one, again)[copy % 2])
    expected = rt.scattering_length(both(one, other), tx, tx, 12e9, fidelity)
    np.testing.assert_array_equal(rt.scattering_length(many, tx, tx, 12e9, fidelity), expected)


def test_specular_and_analytic_meet_far_away() -> None:
    sight = directions(np.random.default_rng(3), 50)
    target = ellipsoid(0.05, 0.09, 0.2)
    fields = [
        rt.scattering_length(target, 1e5 * sight, 1e5 * sight, 12e9, fidelity)
        for fidelity in FIDELITIES
    ]
    # The near field adds R1 / R of amplitude, and a quarter of a^2 / R of path.
    np.testing.assert_allclose(*fields, rtol=1e-4)


@pytest.mark.parametrize("polarization", ["v", "h"])
@pytest.mark.parametrize("direction", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0, 1, 0), (1e-9, 0, 1)])
def test_a_sphere_is_alike_from_everywhere_and_polarised_either_way(
    direction: tuple[float, ...], polarization: str
) -> None:
    # Straight above, v has no direction across the line of sight: a sphere must not notice.
    tx = 4 * np.array(direction)
    field = rt.scattering_length(ellipsoid(0.1, 0.1, 0.1), tx, tx, 12e9, polarization=polarization)  # type: ignore[arg-type]
    reference = rt.scattering_length(ellipsoid(0.1, 0.1, 0.1), [4.0, 0, 0], [4.0, 0, 0], 12e9)
    np.testing.assert_allclose(field, reference, rtol=1e-9)


def test_one_antenna_serves_many_and_each_pair_may_have_its_frequency() -> None:
    target, tx = ellipsoid(0.05, 0.07, 0.2), np.array([[4.0, 0, 0], [4.0, 0.1, 0], [4.0, 0.2, 0.3]])
    frequency = np.array([12e9, 14e9, 16e9])
    together = rt.scattering_length(target, tx, tx[0], frequency)
    one_by_one = [
        rt.scattering_length(target, t, tx[0], f)[0] for t, f in zip(tx, frequency, strict=True)
    ]
    assert together.shape == (3,)
    assert together.dtype == np.complex128
    np.testing.assert_allclose(together, one_by_one, rtol=1e-12)


def test_without_pairs_there_are_no_numbers() -> None:
    field = rt.scattering_length(ellipsoid(0.1, 0.1, 0.1), np.empty((0, 3)), np.empty((0, 3)), 12e9)
    assert field.shape == (0,)


def test_antennas_on_either_side_of_the_body_get_nothing() -> None:
    field = rt.scattering_length(
        ellipsoid(0.1, 0.1, 0.1), [4.0, 0, 0], [[-4.0, 0, 0], [-4.0, 0.05, 0]], 12e9
    )
    np.testing.assert_array_equal(field, 0)


@pytest.mark.parametrize(
    "axes", [(0.003, 0.003, 0.3), (0.3, 0.3, 0.003), (0.001, 0.001, 0.001), (1.0, 1.0, 1.0)]
)
@pytest.mark.parametrize("gap", [0.3, 4.0, 1000.0, 1e6])
@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_extremes_stay_numbers(axes: tuple[float, float, float], gap: float, fidelity: str) -> None:
    sight = np.concatenate([np.eye(3), -np.eye(3), directions(np.random.default_rng(4), 20)])
    tx = sight * (gap + max(axes))
    field = rt.scattering_length(
        ellipsoid(*axes), tx, tx + np.array([0.0, 0.01, 0.0]), 79e9, fidelity
    )
    assert np.isfinite(field).all()


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_an_antenna_inside_the_target_is_refused(fidelity: str) -> None:
    target = both(ellipsoid(0.1, 0.1, 0.1), ellipsoid(0.05, 0.05, 0.3, centre=(1, 0, 0)))
    with pytest.raises(InputError, match=r"rx\[1\] is inside ellipsoid 1"):
        rt.scattering_length(target, [4.0, 0, 0], [[4.0, 0, 0], [1.0, 0.01, 0.2]], 12e9, fidelity)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"tx": [4.0, 0.0]}, "shape"),
        ({"tx": np.ones((2, 3)), "rx": np.ones((3, 3))}, "shape"),
        ({"frequency": [12e9, 13e9], "tx": np.ones((3, 3))}, "shape"),
        ({"tx": "here"}, "numbers"),
        ({"polarization": "x"}, "unknown; allowed"),
        ({"rays": 3}, "no option 'rays'"),
        ({"rx": [np.nan, 0.0, 0.0]}, "finite"),
        ({"frequency": 0.0}, "positive"),
        ({"frequency": np.inf}, "finite"),
        ({"fidelity": "x-ray"}, "unknown; allowed"),
        ({"fidelity": "analytic", "variant": "llvm"}, "no option 'variant'"),
        ({"variant": "abacus"}, "unknown; allowed"),
        ({"target": "a person"}, "takes rt.Ellipsoids"),
    ],
)
def test_bad_input_is_told_in_one_line(change: dict[str, object], said: str) -> None:
    good: dict[str, object] = {
        "target": ellipsoid(0.1, 0.1, 0.1),
        "tx": [4.0, 0, 0],
        "rx": [4.0, 0, 0],
        "frequency": 12e9,
    }
    with pytest.raises(InputError, match=said) as caught:
        rt.scattering_length(**(good | change))  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
