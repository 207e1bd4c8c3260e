"""The echo model `analytic`: specular range, closed-form cross-section, the paper's plane waves."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.rcs import ellipsoid
from rtradar.scatter.models.analytic import Analytic, AnalyticPaper, far_field_echo, plane_wave_echo
from rtradar.signal import synthesize

Array = NDArray[np.float64]

LOW = Radar.preset("paper-12ghz")
FLAT = Radar(position_m=(0.0, 0.0, 0.0))
"""The paper's array in the origin."""

AHEAD = (4.0, 0.0, 1.0)


@dataclass
class Toy:
    """As much of a body as a model asks for: parts that move without turning."""

    centres: Array
    frames: Array
    semi_axes: Array
    velocity: Array = field(default_factory=lambda: np.zeros(3))
    duration_s: float = 3.0

    def at(self, times: Array) -> tuple[Array, Array, Array]:
        shift = np.asarray(times)[:, None, None] * self.velocity
        return (
            self.centres + shift,
            np.broadcast_to(self.frames, (len(times), *self.frames.shape)),
            self.semi_axes,
        )


def toy(
    parts: int = 3, seed: int = 0, at: tuple[float, float, float] = (0.0, 0.0, 1.0), **more: Any
) -> Any:
    rng = np.random.default_rng(seed)
    frames = Rotation.random(parts, rng=rng).as_matrix()
    return Toy(
        rng.uniform(-0.5, 0.5, (parts, 3)) + np.array(at),
        frames,
        rng.uniform(0.04, 0.25, (parts, 3)),
        **more,
    )


def one(tx: ArrayLike, rx: ArrayLike, body: Any, **options: bool) -> tuple[Array, Array]:
    """Length and amplitude (part,) for one Tx and one Rx."""
    transmitter, receiver = np.asarray(tx, float)[None], np.asarray(rx, float)[None, None]
    length, amplitude = far_field_echo(
        Geometry(transmitter, receiver, body.centres[None], body.frames[None], body.semi_axes),
        **options,
    )
    return length[0, 0], amplitude[0, 0]


def bisectors(tx: ArrayLike, rx: ArrayLike, body: Any) -> tuple[Array, Array, Array]:
    """Unit bisector of Tx and Rx in each part's axes (part, 3), |u_tx + u_rx|, path (part,)."""
    ways = [np.asarray(place) - body.centres for place in (tx, rx)]
    ranges = [np.linalg.norm(way, axis=1) for way in ways]
    both = sum(way / distance[:, None] for way, distance in zip(ways, ranges, strict=True))
    local = np.stack(
        [frame.T @ direction for frame, direction in zip(body.frames, both, strict=True)]
    )
    size = np.linalg.norm(both, axis=1)
    return local / size[:, None], size, ranges[0] + ranges[1]


directions = st.tuples(st.floats(-1, 1), st.floats(-math.pi, math.pi)).map(
    lambda at: np.array(
        [
            math.sqrt(1 - at[0] ** 2) * math.cos(at[1]),
            math.sqrt(1 - at[0] ** 2) * math.sin(at[1]),
            at[0],
        ]
    )
)
seeds = st.integers(0, 999)


# -- specular range --------------------------------------------------------------------------------


@given(to_tx=directions, to_rx=directions, seed=seeds)
@settings(max_examples=50)
def test_far_away_the_path_is_shorter_by_the_support_function(
    to_tx: Array, to_rx: Array, seed: int
) -> None:
    # A plane wave meets the surface h(n) = |A n| before the centre, on both legs.
    assume(np.linalg.norm(to_tx + to_rx) > 0.1)  # straight on there is no bisector
    body, far = toy(seed=seed), 1e6
    length, _ = one(far * to_tx, far * to_rx, body)
    normal, size, centre_path = bisectors(far * to_tx, far * to_rx, body)
    support = np.linalg.norm(body.semi_axes * normal, axis=1)
    # a^2 / R = 6e-8 m of wavefront curvature; 1e-9 m of float64.
    np.testing.assert_allclose(centre_path - length, size * support, rtol=0, atol=2e-7)


@pytest.mark.parametrize("seed", range(4))
def test_at_four_metres_it_is_the_shortest_path_but_for_a_millimetre(seed: int) -> None:
    # Fermat: the true specular point makes the path over the surface shortest. The model takes the
    # point that a far radar would see.
    body = toy(parts=1, seed=seed)
    tx, rx = np.array([-4.0, 1.2, 1.0]), np.array([-4.0, 0.9, 1.0])
    length, _ = one(tx, rx, body)

    def path(angles: Array) -> float:
        theta, phi = angles
        local = body.semi_axes[0] * [
            math.sin(theta) * math.cos(phi),
            math.sin(theta) * math.sin(phi),
            math.cos(theta),
        ]
        at = body.centres[0] + body.frames[0] @ local
        return float(np.linalg.norm(tx - at) + np.linalg.norm(rx - at))

    grid = [(theta, phi) for theta in np.linspace(0.2, 2.9, 12) for phi in np.linspace(-3, 3, 24)]
    shortest = minimize(
        path, min(grid, key=lambda angles: path(np.array(angles))), method="Nelder-Mead", tol=1e-10
    ).fun
    # Measured: 0.01 to 0.4 mm, most where the part is long and thin.
    assert -1e-9 < length[0] - shortest < 1e-3


def test_straight_through_there_is_no_reflection() -> None:
    body = toy(parts=1)
    centre = body.centres[0]
    length, amplitude = one(centre + np.array([3.0, 0, 0]), centre - np.array([5.0, 0, 0]), body)
    assert length.tolist() == pytest.approx([8.0])
    assert amplitude.tolist() == [0.0]


# -- cross-section ---------------------------------------------------------------------------------


@given(tx=directions, rx=directions, seed=seeds)
@settings(max_examples=50)
def test_power_is_the_cross_section_along_the_bisector(tx: Array, rx: Array, seed: int) -> None:
    assume(np.linalg.norm(tx + rx) > 0.1)
    body = toy(seed=seed)
    _, amplitude = one(4 * tx, 4 * rx, body, spreading=False)
    normal, _, _ = bisectors(4 * tx, 4 * rx, body)
    theta, phi = np.arccos(np.clip(normal[:, 2], -1, 1)), np.arctan2(normal[:, 1], normal[:, 0])
    a, b, c = body.semi_axes.T
    assert amplitude.dtype == np.float64  # real and positive: a conductor's specular echo
    assert (amplitude > 0).all()
    np.testing.assert_allclose(
        amplitude**2, ellipsoid(a, b, c, theta, phi), rtol=1e-9
    )  # angles near the poles


@given(seed=seeds)
@settings(max_examples=20)
def test_spreading_is_one_over_both_legs(seed: int) -> None:
    # Antennas on one line through the centre: the legs are the distances to the surface, there
    # along the c axis.
    body = toy(parts=1, seed=seed)
    outward, c = body.frames[0][:, 2], body.semi_axes[0, 2]
    near, far = body.centres[0] + 2.0 * outward, body.centres[0] + 5.0 * outward
    length, spread = one(near, far, body)
    _, bare = one(near, far, body, spreading=False)
    assert length[0] == pytest.approx(7 - 2 * c, rel=1e-13)
    assert bare[0] / spread[0] == pytest.approx((2 - c) * (5 - c), rel=1e-12)


# -- laws ------------------------------------------------------------------------------------------

both_models = pytest.mark.parametrize("paper", [False, True], ids=["specular range", "paper"])


def model(
    paper: bool, tx: Array, rx: Array, body: Any, *, spreading: bool = True
) -> tuple[Array, Array]:
    """Length and amplitude (part,) for one Tx and one Rx, with the array's centre at the origin."""
    if not paper:
        return one(tx, rx, body, spreading=spreading)
    pose = (body.centres[None], body.frames[None], body.semi_axes)
    at = Geometry(tx[None], rx[None, None], *pose)
    middles = FLAT.tx.mean(axis=0)[None], FLAT.rx.mean(axis=0)[None]
    length, amplitude = plane_wave_echo(at, middles, spreading=spreading)
    return length[0, 0], amplitude[0, 0]


@both_models
@given(turn=st.integers(0, 999), seed=seeds)
@settings(max_examples=20)
def test_neither_names_of_ends_and_axes_nor_turns_and_sizes_matter(
    paper: bool, turn: int, seed: int
) -> None:
    body = toy(seed=seed, at=AHEAD)
    rotation = Rotation.random(rng=np.random.default_rng(turn)).as_matrix()
    tx, rx = np.array([0, 0.2, -0.1]), np.array([0.1, -0.3, 0])
    here = model(paper, tx, rx, body, spreading=False)

    def others(size: float, ends: tuple[Array, Array], *pose: Array) -> None:
        there = model(paper, *ends, Toy(*pose), spreading=False)
        np.testing.assert_allclose(there, np.multiply(size, here), rtol=1e-10)

    centres, frames, axes = body.centres, body.frames, body.semi_axes
    others(1, (rx, tx), centres, frames, axes)
    others(1, (rotation @ tx, rotation @ rx), centres @ rotation.T, rotation @ frames, axes)
    others(1, (tx, rx), centres, frames[:, :, [1, 2, 0]], axes[:, [1, 2, 0]])
    others(2, (2 * tx, 2 * rx), 2 * centres, frames, 2 * axes)


# -- the paper's model -----------------------------------------------------------------------------


def at_angles(range_m: float, azimuth: float, elevation: float) -> Any:
    """One part, seen from the origin in this direction [rad]."""
    flat = range_m * math.cos(elevation)
    centre = [flat * math.cos(azimuth), flat * math.sin(azimuth), range_m * math.sin(elevation)]
    body = toy(parts=1, seed=3)
    body.centres = np.array([centre])
    return body


@pytest.mark.parametrize("angle_deg", [-30.0, -14.0, 0.0, 3.0, 45.0])
@pytest.mark.parametrize("line", ["y", "z"])
def test_plane_waves_reach_the_array_as_in_the_paper(angle_deg: float, line: str) -> None:
    # Eqs 10 and 11: the received phase of channel 8 t + r rises by k d_R sin(angle), d_R half a
    # start wavelength, toward a target on the side where the index rises; nothing on the other
    # line. Range: of the centre.
    angle, range_m = math.radians(angle_deg), 4.0
    body = at_angles(range_m, angle if line == "y" else 0.0, 0.0 if line == "y" else angle)
    echoes = AnalyticPaper(FLAT, body).echoes(np.arange(12))
    lead = 2 * range_m - echoes.length[..., 0]
    index = 8 * (np.arange(6)[:, None] - 2.5) + (np.arange(8) - 3.5)
    expected = index * FLAT.start_wavelength_m / 2 * math.sin(angle)
    on_line, off_line = (lead[:6], lead[6:]) if line == "y" else (lead[6:], lead[:6])
    np.testing.assert_allclose(on_line, expected, rtol=0, atol=1e-14)
    np.testing.assert_allclose(off_line, 0, atol=1e-14)
    # In the IF, which is the transmitted wave times the conjugate of the received one, that phase
    # falls with the index.
    first = synthesize(echoes, FLAT, FLAT.chirp_times(12))[:, :, 0]
    steps = np.angle(first[:, 1:] / first[:, :-1])[slice(6) if line == "y" else slice(6, 12)]
    # s tau^2 / 2 also changes a little: 2 pi s tau times the difference of tau between channels is
    # up to 3e-4.
    np.testing.assert_allclose(steps, -math.pi * math.sin(angle), rtol=0, atol=5e-4)


@pytest.mark.parametrize("place", [(1.0, 0.0, 0.0), (0.9, 0.4, -0.2), (0.5, -0.5, 0.7)])
def test_far_away_plane_waves_are_exact(place: tuple[float, float, float]) -> None:
    far = 1e6
    body = toy(parts=1)
    body.centres = far * np.array([place])
    length = AnalyticPaper(FLAT, body).echoes(np.arange(12)).length[..., 0]
    exact = np.linalg.norm(FLAT.tx - body.centres, axis=1)[:, None] + np.linalg.norm(
        FLAT.rx[FLAT.rx_of_tx] - body.centres, axis=2
    )
    # (0.25 m)^2 / 2 R = 3e-8 m of wavefront curvature and 1e-9 m of float64, where off the
    # boresight leads are up to 0.2 m.
    np.testing.assert_allclose(length, exact, rtol=0, atol=1e-7)


@pytest.mark.parametrize("spreading", [True, False])
def test_the_papers_amplitude_is_that_of_the_line_of_sight(spreading: bool) -> None:
    body = at_angles(4.0, 0.3, -0.2)
    amplitude = (
        AnalyticPaper(FLAT, body, spreading=spreading).echoes(np.arange(12)).amplitude[0, ..., 0]
    )
    local = -body.frames[0].T @ body.centres[0] / 4.0
    sigma = ellipsoid(*body.semi_axes[0], math.acos(local[2]), math.atan2(local[1], local[0]))
    expected = math.sqrt(sigma) / (16.0 if spreading else 1.0)
    np.testing.assert_allclose(amplitude, expected, rtol=1e-12)  # every channel alike, and real


# -- as a model ------------------------------------------------------------------------------------


@both_models
@pytest.mark.parametrize("channels", ["pairs", "all"])
def test_echoes_keep_the_contract(paper: bool, channels: Any) -> None:
    radar = Radar(channels=channels)
    chirps = np.arange(24) + 7
    echoes = (AnalyticPaper if paper else Analytic)(radar, toy(parts=4)).echoes(chirps)
    assert echoes.length.shape == (24, radar.n_rx, 4)
    assert echoes.amplitude.shape == (1, 24, radar.n_rx, 4)
    assert echoes.frequency.tolist() == [radar.centre_frequency_hz]
    assert echoes.tx.tolist() == [(7 + m) % 12 for m in range(24)]
    assert echoes.part.tolist() == [0, 1, 2, 3]
    assert echoes.bounces.tolist() == [1, 1, 1, 1]
    assert (echoes.amplitude.imag == 0).all()
    assert (echoes.amplitude.real > 0).all()


def test_each_chirp_has_its_own_transmitter_receivers_and_pose() -> None:
    body = toy(velocity=np.array([1.0, -2.0, 0.5]))
    chirps = np.array([0, 5, 6, 11, 4000, 4007])
    echoes = Analytic(LOW, body).echoes(chirps)
    for m, chirp in enumerate(chirps):
        moved: Any = Toy(
            body.centres + (chirp + 0.5) * 62.5e-6 * body.velocity, body.frames, body.semi_axes
        )
        line = slice(0, 8) if chirp % 12 < 6 else slice(8, 16)
        for r, rx in enumerate(LOW.rx[line]):
            length, amplitude = one(LOW.tx[chirp % 12], rx, moved)
            np.testing.assert_allclose(echoes.length[m, r], length, rtol=1e-14)
            np.testing.assert_allclose(echoes.amplitude[0, m, r], amplitude, rtol=1e-11)
