"""The specular point: against spheres in closed form, Fermat, and the symmetries of space."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.specular_points import solve_specular_points

Array = NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)


def solve(
    tx: Array,
    rx: Array,
    axes: Array,
    frame: Array | None = None,
    centre: Array | None = None,
    *,
    polarization: str = "v",
    turned: Array | None = None,
    **how: object,
) -> tuple:
    """One ellipsoid, pair by pair: length (n,), amplitude (n,), point (n, 3)."""
    sent = Polarization(polarization, np.eye(3) if turned is None else turned)
    tx, rx = np.atleast_2d(tx), np.atleast_2d(rx)
    n = len(tx)
    frames = np.broadcast_to(np.eye(3) if frame is None else frame, (n, 1, 3, 3))
    centres = np.broadcast_to(np.zeros(3) if centre is None else centre, (n, 1, 3))
    length, amplitude, point = solve_specular_points(
        Geometry(tx, rx[:, None], centres, frames, np.array([axes], float)),
        polarization=sent,
        points=True,
        **how,
    )
    return length[:, 0, 0], amplitude[:, 0, 0], point[:, 0, 0]


def unit(vectors: Array) -> Array:
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def somewhere(rng: np.random.Generator, n: int, apart: float = 0.6) -> tuple[Array, Array]:
    """Antennas 1 to 10 m away and up to ``apart`` from each other."""
    tx = unit(rng.normal(size=(n, 3))) * rng.uniform(1.0, 10.0, (n, 1))
    return tx, tx + unit(rng.normal(size=(n, 3))) * rng.uniform(0, apart, (n, 1))


@pytest.mark.parametrize("polarization", ["v", "h"])
@pytest.mark.parametrize(
    ("distance", "half_angle"),
    [(0.4, 0.0), (0.4, 0.8), (4.0, 0.1), (4.0, 1.4), (1e3, 0.0), (1e3, 1.5)],
)
def test_a_sphere_between_equally_distant_antennas(
    distance: float, half_angle: float, polarization: str
) -> None:
    a = 0.1
    tx, rx = (distance * np.array([np.cos(x), np.sin(x), 0.0]) for x in (half_angle, -half_angle))
    length, amplitude, point = solve(tx, rx, np.full(3, a), polarization=polarization)
    # By symmetry the specular point lies on the bisector.
    leg = np.sqrt(distance**2 + a**2 - 2 * distance * a * np.cos(half_angle))
    cosine = (distance * np.cos(half_angle) - a) / leg
    # Divergence of a bundle in the plane of incidence and across it; co-polar is 1, for E_r = 2
    # (n.E) n - E_i there.
    divergence = (2 * cosine**2 / leg + 2 * cosine / a) * (2 / leg + 2 * cosine / a)
    np.testing.assert_allclose(point[0], [a, 0, 0], atol=1e-9 * a)
    np.testing.assert_allclose(length, 2 * leg, rtol=1e-14)
    # The point is good to 1e-7 of the radius, or the square of it by Newton's last step.
    np.testing.assert_allclose(
        amplitude, 2 * np.sqrt(np.pi) * cosine / np.sqrt(divergence) / leg**2, rtol=1e-7
    )


@given(seeds, st.tuples(*[st.floats(0.01, 0.5)] * 3))
def test_the_law_of_reflection_holds_at_a_point_of_the_surface(
    seed: int, axes: tuple[float, float, float]
) -> None:
    tx, rx = somewhere(np.random.default_rng(seed), 20)
    length, _, point = solve(tx, rx, np.array(axes))
    np.testing.assert_allclose(((point / axes) ** 2).sum(axis=1), 1, rtol=1e-12)
    normal, half = unit(point / np.square(axes)), unit(unit(tx - point) + unit(rx - point))
    # A step of 1e-7 of the least semi-axis turns the normal by 1e-7 of the ratio of the axes.
    np.testing.assert_allclose(half, normal, atol=1e-5)
    way = np.linalg.norm(tx - point, axis=1) + np.linalg.norm(rx - point, axis=1)
    np.testing.assert_allclose(length, way, rtol=1e-12)


@given(seeds, st.tuples(*[st.floats(0.02, 0.5)] * 3))
def test_no_way_over_the_surface_is_shorter(seed: int, axes: tuple[float, float, float]) -> None:
    rng = np.random.default_rng(seed)
    tx, rx = somewhere(rng, 5)
    length, _, point = solve(tx, rx, np.array(axes))
    others = (
        unit(
            np.concatenate(
                [rng.normal(size=(200, 3)), point[0] / axes + 0.01 * rng.normal(size=(200, 3))]
            )
        )
        * axes
    )
    ways = np.linalg.norm(tx[:, None] - others, axis=2) + np.linalg.norm(
        rx[:, None] - others, axis=2
    )
    # Rounding of lengths of up to 20 m.
    assert (ways >= length[:, None] - 1e-13).all()


@given(seeds, st.tuples(*[st.floats(0.02, 0.5)] * 3), st.sampled_from(["v", "h"]))
def test_neither_the_order_of_antennas_nor_place_turn_and_size_matter(
    seed: int, axes: tuple[float, float, float], polarization: str
) -> None:
    rng = np.random.default_rng(seed)
    tx, rx = somewhere(rng, 10)
    frame, turn = Rotation.random(2, random_state=seed)
    shift, size, own = rng.normal(0, 5, 3), 10 ** rng.uniform(-2, 3), np.array(axes)
    how = {"polarization": polarization, "spreading": False}
    here = solve(tx, rx, own, frame.as_matrix(), **how)
    back = solve(rx, tx, own, frame.as_matrix(), **how)
    large = solve(size * tx, size * rx, size * own, frame.as_matrix(), **how)
    ends = turn.apply(tx) + shift, turn.apply(rx) + shift
    pose = (turn * frame).as_matrix(), shift
    moved = solve(*ends, own, *pose, turned=turn.as_matrix(), **how)
    for there in (back, [array / size for array in large], moved):
        np.testing.assert_allclose(there[0], here[0], atol=1e-13)
        # The last step of the search is at most 1e-7 of the least semi-axis.
        np.testing.assert_allclose(there[1], here[1], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(moved[2], turn.apply(here[2]) + shift, atol=1e-6)


def test_the_nearer_the_antenna_the_weaker_a_flat_side() -> None:
    axes = np.array([0.05, 0.05, 0.3])
    for distance in (0.5, 2.0, 8.0):
        tx = np.array([distance + axes[0], 0.0, 0.0])
        _, amplitude, _ = solve(tx, tx, axes, spreading=False)
        radii = np.array([axes[0], axes[2] ** 2 / axes[0]])
        # Monostatic, along an axis: 1/R of the wavefront adds to both curvatures.
        np.testing.assert_allclose(
            amplitude**2, np.pi / np.prod(1 / radii + 1 / distance), rtol=1e-12
        )


def test_spreading_is_one_over_both_legs() -> None:
    tx, rx = somewhere(np.random.default_rng(5), 30)
    axes = np.array([0.05, 0.08, 0.2])
    _, spread, point = solve(tx, rx, axes)
    _, plain, _ = solve(tx, rx, axes, spreading=False)
    legs = np.linalg.norm(tx - point, axis=1) * np.linalg.norm(rx - point, axis=1)
    np.testing.assert_allclose(spread * legs, plain, rtol=1e-13)


@given(
    seeds,
    st.sampled_from([(0.04, 0.1, 0.25), (0.07, 0.07, 0.21), (0.01, 0.3, 0.3), (0.02, 0.02, 0.4)]),
)
def test_where_the_search_begins_does_not_matter(
    seed: int, lengths: tuple[float, float, float]
) -> None:
    # A long or flat body has a shortest way over its dark side too, where the antenna is nearer
    # than its curvature.
    rng = np.random.default_rng(seed)
    tx, rx = somewhere(rng, 20)
    axes = np.array(lengths)
    start = (unit(rng.normal(size=(20, 3))) * axes)[:, None]
    for cold, warm in zip(solve(tx, rx, axes), solve(tx, rx, axes, start=start), strict=True):
        np.testing.assert_allclose(warm, cold, rtol=1e-6, atol=1e-7)


def test_a_capture_is_its_chirps_one_by_one() -> None:
    # Many chirps may go another way than few: in threads.
    rng = np.random.default_rng(0)
    chirps, parts = 200, 5
    tx, rx = somewhere(rng, chirps)
    receivers = rx[:, None] + rng.normal(0, 0.05, (1, 8, 3))
    centres = rng.normal(0, 0.3, (chirps, parts, 3))
    frames = (
        Rotation.random(chirps * parts, random_state=0).as_matrix().reshape(chirps, parts, 3, 3)
    )
    axes = rng.uniform(0.03, 0.2, (parts, 3))
    whole = solve_specular_points(
        Geometry(tx * 3, receivers * 3, centres, frames, axes), points=True
    )
    for i in (0, 77, 199):
        alone = solve_specular_points(
            Geometry(
                *(array[i : i + 1] for array in (tx * 3, receivers * 3, centres, frames)), axes
            ),
            points=True,
        )
        for one, many in zip(alone, whole, strict=True):
            np.testing.assert_allclose(one[0], many[i], rtol=1e-13)
    assert solve_specular_points(Geometry(tx, receivers, centres, frames, axes))[2].size == 0


@pytest.mark.parametrize(
    "axes", [(0.003, 0.003, 0.3), (0.003, 0.3, 0.3), (0.003, 0.1, 0.3), (0.5, 0.5, 0.5)]
)
@pytest.mark.parametrize("distance", [0.3, 5.0, 1000.0])
def test_needles_and_discs_near_and_far(axes: tuple[float, float, float], distance: float) -> None:
    rng = np.random.default_rng(1)
    foot = unit(rng.normal(size=(500, 3))) * axes
    tx = foot + distance * unit(foot / np.square(axes))
    rx = tx + rng.normal(0, 0.02 * distance / (distance + 1), tx.shape)
    length, amplitude, point = solve(tx, rx, np.array(axes), spreading=False)
    assert np.isfinite(length).all()
    # Co-polar turns its sign for antennas on either side of the zenith, so only its size is sure.
    assert np.isfinite(amplitude).all()
    assert (unit(tx - point) * point / np.square(axes)).sum(axis=1).min() > 0
    half = unit(unit(tx - point) + unit(rx - point))
    # As above, the axes in a ratio of 100.
    np.testing.assert_allclose(half, unit(point / np.square(axes)), atol=1e-4)


@given(seeds, st.sampled_from([(0.1, 0.1, 0.1), (0.07, 0.07, 0.21), (0.02, 0.3, 0.4)]))
def test_there_is_no_mirror_where_the_body_stands_between_the_antennas(
    seed: int, axes: tuple[float, float, float]
) -> None:
    rng = np.random.default_rng(seed)
    tx, through = unit(rng.normal(size=(20, 3))) * 3, rng.uniform(-0.5, 0.5, (20, 3)) * axes
    _, amplitude, _ = solve(
        tx, through + (through - tx) * rng.uniform(0.5, 2, (20, 1)), np.array(axes)
    )
    assert (amplitude == 0).all()


def test_grazing_rays_have_no_reflection_but_a_length() -> None:
    # Tx and Rx on opposite sides, and a sphere that crosses the line between them.
    across = np.linspace(-0.3, 0.3, 2001)
    centres = np.zeros((len(across), 1, 3))
    centres[:, 0, 1] = across
    frames = np.broadcast_to(np.eye(3), (len(across), 1, 3, 3))
    tx, rx = np.tile([-4.0, 0, 0], (len(across), 1)), np.tile([[5.0, 0, 0]], (len(across), 1, 1))
    length, amplitude, _ = solve_specular_points(
        Geometry(tx, rx, centres, frames, np.full((1, 3), 0.12))
    )
    assert np.isfinite(length).all()
    assert np.isfinite(amplitude).all()
    # Where the sphere stands in the line there is no specular point, and well beside it there is
    # one.
    assert (amplitude[np.abs(across) < 0.11] == 0).all()
    assert (amplitude[np.abs(across) > 0.13] > 0).all()
