"""`specular` with a gradual visibility: what is left of a part behind an edge, and how it fades."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.special import erfc

import rtradar as rt
from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter import build_model
from rtradar.scatter.facets.target import visible_fractions
from rtradar.scatter.models.specular import Specular
from rtradar.trace.backend import Backend

Array = NDArray[np.float64]
C = 299_792_458.0
ANTENNA = np.array([-4.0, 0.0, 0.0])
GRADUAL = {"visibility": "gradual"}


@dataclass(frozen=True)
class Curtain:
    """A small ellipsoid, and 0.5 m before it a large sphere whose edge passes y = 0 at 0.1 s."""

    speed: float = 0.0
    edge: float = 0.0
    duration_s: float = 1.0
    part_names: tuple[str, ...] = ("target", "curtain")

    @property
    def semi_axes(self) -> Array:
        return np.array([[0.07, 0.07, 0.2], [0.3, 0.3, 0.3]])

    @property
    def owner(self) -> NDArray[np.int64]:
        return np.zeros(len(self.semi_axes), dtype=np.int64)

    def at(self, times: Array) -> Poses:
        y = 0.3 + self.edge + self.speed * (np.asarray(times) - 0.1)
        centres = np.zeros((len(y), 2, 3))
        centres[:, 1, 0], centres[:, 1, 1] = -0.5, y
        return Poses(centres, np.broadcast_to(np.eye(3), (len(y), 2, 3, 3)), self.semi_axes)


def small_radar(**fields: object) -> Radar:
    """One Tx and one Rx in one place, 1 ms a chirp, 12 to 16 GHz."""
    given = {
        "tx_y": 1,
        "tx_z": 0,
        "rx_y": 1,
        "rx_z": 0,
        "chirp_duration_s": 1e-3,
        "position_m": tuple(ANTENNA),
    }
    return Radar(**(given | fields))  # type: ignore[arg-type]


def gradual(radar: Radar, body: object, **options: Any) -> Specular:
    return Specular(radar, body, visibility="gradual", **options)  # type: ignore[arg-type]


def target_of(poses: Poses, number: int = 0) -> rt.Ellipsoids:
    return rt.Ellipsoids(poses.centres[number], poses.frames[number], poses.semi_axes)


def share_behind_plate(radius: float, frequency: float, edge: float) -> complex:
    """Fraction left of a sphere's return where a plate half way shadows all below z = ``edge``."""
    below = ANTENNA[0] / 2, 0.0, edge / 2 - 1.0
    target = rt.Ellipsoids(
        [np.zeros(3), below], np.tile(np.eye(3), (2, 1, 1)), [[radius] * 3, [1e-4, 20.0, 1.0]]
    )
    pair = ANTENNA[None], ANTENNA[None], np.array([frequency])
    return complex(visible_fractions(target, *pair, "v", "cpu")[0, 0])


@pytest.mark.parametrize(
    ("radius", "frequency"), [pytest.param(0.1, 79e9, marks=pytest.mark.slow), (0.2, 14e9)]
)
def test_a_straight_edge_leaves_the_fresnel_integral(radius: float, frequency: float) -> None:
    k = 2 * np.pi * frequency / C
    # k dL = z^2 k h / 2 with h = 2 / R + 2 / radius; across the edge the integral of exp(-j u^2)
    # from the edge on.
    h = 2 / (4 - radius) + 2 / radius
    u = np.linspace(-3, 3, 21)
    edges = u / np.sqrt(k * h / 2)
    got = np.array(
        [share_behind_plate(radius, frequency, edge / (1 - radius / 4)) for edge in edges]
    )
    exact = erfc(np.exp(0.25j * np.pi) * u) / 2
    # Curvature of the sphere beyond z^2 adds 2 %.
    assert np.sqrt(np.mean(np.abs(got - exact) ** 2)) < 0.02
    assert np.abs(got - exact).max() < 0.04


@pytest.mark.slow
def test_an_edge_that_wanders_changes_the_share_without_jumps() -> None:
    # Steps of 2e-3, where the edge is in sight, at its corner and where it vanishes.
    u = (np.array([-0.8, 0.0, 0.6])[:, None] + np.linspace(-0.02, 0.02, 21)).ravel()
    k = 2 * np.pi * 14e9 / C
    edges = u / np.sqrt(k * (2 / 3.9 + 2 / 0.1) / 2)
    share = np.array([share_behind_plate(0.1, 14e9, edge) for edge in edges])
    # exp(-j u^2) bends by 2 u / sqrt(pi) a unit squared: 5e-6 at a step of 2e-3.
    assert np.abs(np.diff(share.reshape(3, -1), 2)).max() < 1e-4


def test_full_view_is_one_and_full_cover_exactly_nothing(backend: Backend) -> None:
    radar, chirps = small_radar(tx_y=3, rx_y=2, tx_spacing_wavelengths=1.0), np.arange(30)
    for body, target in ((Curtain(edge=0.5), 1.0), (Curtain(edge=-0.3), 0.0)):
        model = gradual(radar, body, variant=backend.kind)
        echoes = model.echoes(chirps)
        assert model.variant == backend.kind
        assert echoes.amplitude.shape == (3, 30, 2, 2)
        specular = Specular(radar, body, variant=backend.kind).echoes(chirps)  # type: ignore[arg-type]
        np.testing.assert_array_equal(echoes.amplitude[..., 0] != 0, target)
        # The searches begin at different points, and meet within 1e-7.
        np.testing.assert_allclose(
            echoes.amplitude, np.broadcast_to(specular.amplitude, (3, 30, 2, 2)), rtol=1e-6
        )
        np.testing.assert_allclose(echoes.length, specular.length, rtol=1e-12)
        pair = ANTENNA[None], ANTENNA[None], np.array([14e9])
        shares = visible_fractions(target_of(body.at(np.zeros(1))), *pair, "v", backend.kind)
        assert shares.tolist() == [[target, 1.0]]


@pytest.mark.parametrize("edge", [-0.01, 0.0, 0.015])
def test_the_model_and_the_function_agree_phase_and_all(backend: Backend, edge: float) -> None:
    radar, body = small_radar(), Curtain(edge=edge)
    echoes = gradual(radar, body, variant=backend.kind).echoes(np.arange(3))
    assert 0.1 < np.abs(echoes.amplitude[0, 0, 0, 0] / echoes.amplitude[0, 0, 0, 1]) * 3 / 0.7 < 20
    target = target_of(body.at(np.zeros(1)))
    for frequency, amplitude in zip(echoes.frequency, echoes.amplitude, strict=True):
        received = np.sum(
            amplitude[0, 0].conj() * np.exp(-2j * np.pi * frequency / C * echoes.length[0, 0])
        )
        field = rt.scattering_length(
            target, ANTENNA, ANTENNA, frequency, variant=backend.kind, **GRADUAL
        )
        there_and_back = np.exp(-2j * np.pi * frequency / C * 8.0) / 16
        np.testing.assert_allclose(received, field[0] * there_and_back, rtol=0.01)


@pytest.mark.slow
def test_tx_and_rx_may_be_swapped_and_stand_far_apart(backend: Backend) -> None:
    target = target_of(Curtain(edge=0.01).at(np.zeros(1)))
    tx = ANTENNA + np.random.default_rng(0).normal(0, 0.1, (10, 3))
    rx, given = tx[::-1].copy(), {"variant": backend.kind, **GRADUAL}
    there, back = (
        rt.scattering_length(target, *pair, 14e9, **given) for pair in ((tx, rx), (rx, tx))
    )
    np.testing.assert_allclose(back, there, rtol=1e-6)
    # A quarter turn away nothing stands before the target on the way to Rx; half of its light is
    # left.
    aside = np.array([[0.0, -4.0, 0.0]])
    sharp, soft = (
        rt.scattering_length(target, ANTENNA, aside, 14e9, variant=backend.kind, **options)
        - rt.scattering_length(
            rt.Ellipsoids(target.centres[1:], target.frames[1:], target.semi_axes[1:]),
            ANTENNA, aside, 14e9, variant=backend.kind,
        )
        for options in ({}, GRADUAL)
    )  # fmt: skip
    assert 0 < abs(soft[0] - sharp[0]) < abs(sharp[0])


def test_the_fade_is_smooth_and_meets_the_edge(backend: Backend) -> None:
    radar, body = small_radar(chirp_duration_s=0.25e-3), Curtain(speed=1.0)
    model = gradual(radar, body, variant=backend.kind)
    chirps = np.arange(200, 601)
    alone = model.echoes(np.array([4000 - 1])).amplitude[1, 0, 0, 0]
    share = model.echoes(chirps).amplitude[1, :, 0, 0].conj() / np.abs(alone)
    # 5 cm on either side, four Fresnel radii: a round edge diffracts more than the 0.1 of a
    # straight one. These are sums over the points of validation/other_methods/physical_optics.py
    # that the discriminant of ray and sphere leaves in view.
    assert share[0] == pytest.approx(-0.1169 + 0.1322j, abs=0.02)
    assert share[-1] == pytest.approx(0.9869 - 0.0219j, abs=0.02)
    # The specular point becomes visible as the edge crosses y = 0: a straight edge leaves a half
    # there, a round one a little more.
    assert share[200] == pytest.approx(0.5, abs=0.1)
    poses = body.at(radar.chirp_times(len(chirps), 200))
    pair = ANTENNA[None], ANTENNA[None], np.array([14e9])
    exact = [
        visible_fractions(target_of(poses, i), *pair, "v", backend.kind)[0, 0]
        for i in range(0, 401, 20)
    ]
    # What the cubics between keyframes leave out.
    np.testing.assert_allclose(share[::20], exact, atol=0.02)
    # Within 3 cm, 2.2 Fresnel radii, exp(-j u^2) bends by 1e-3 a chirp; corners of straight pieces
    # 1.25 ms long, by 5e-3.
    assert np.abs(np.diff(share[80:321], 2)).max() < 3e-3


def test_a_part_inside_another_is_hidden(backend: Backend) -> None:
    target = rt.Ellipsoids(
        np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), [[0.05, 0.05, 0.1], [0.1, 0.1, 0.2]]
    )
    alone = rt.Ellipsoids(np.zeros((1, 3)), np.eye(3)[None], [[0.1, 0.1, 0.2]])
    whole, outer = (
        rt.scattering_length(t, ANTENNA, ANTENNA, 14e9, variant=backend.kind, **GRADUAL)
        for t in (target, alone)
    )
    np.testing.assert_array_equal(whole, outer)


@pytest.mark.filterwarnings("ignore:.*radius of curvature:rtradar.errors.ValidityWarning")
@pytest.mark.parametrize("frequency", [1e9, 24e9])
def test_extremes_stay_numbers_of_at_most_two(frequency: float) -> None:
    sight = np.random.default_rng(1).normal(size=(20, 3))
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    for axes in ((0.003, 0.003, 0.3), (0.1, 0.1, 0.0001), (1e-4, 1e-4, 1e-4), (0.1, 0.1, 0.1)):
        for reach in (0.1, 1e3):
            tx = sight * (max(axes) + reach)
            # One just before it, half over the line of sight.
            target = rt.Ellipsoids(
                [np.zeros(3), sight[7] * (max(axes) + reach / 2)],
                np.tile(np.eye(3), (2, 1, 1)),
                [axes, np.full(3, min(reach / 5, 0.5))],
            )
            given = tx, tx + 0.01 * reach * sight[::-1], np.full(len(tx), frequency)
            shares = np.abs(visible_fractions(target, *given, "v", "auto"))
            assert (shares <= 2 + 1e-12).all()


def test_both_terms_and_two_bounces_go_with_it() -> None:
    body = Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=0.3))
    radar, chirps = rt.Radar.preset("paper-12ghz"), np.array([100, 400])
    one, two, both = (
        build_model("specular", radar, body, **GRADUAL, **options).echoes(chirps)
        for options in ({}, {"terms": 2}, {"bounces": 2})
    )
    np.testing.assert_array_equal(both.amplitude[..., both.bounces == 1], one.amplitude)
    assert (both.bounces == 2).any()
    sharp = [
        build_model("specular", radar, body, terms=terms).echoes(chirps).amplitude[0]
        for terms in (1, 2)
    ]
    there = sharp[0] != 0
    for node in range(3):
        ratio = two.amplitude[node][there] / one.amplitude[node][there]
        np.testing.assert_allclose(ratio, sharp[1][there] / sharp[0][there], rtol=1e-4)


def test_each_path_over_walls_has_its_own() -> None:
    radar, body = small_radar(), Curtain()
    assert not gradual(radar, body).fast_over_walls
    assert Specular(radar, body).fast_over_walls  # type: ignore[arg-type]


@pytest.mark.parametrize("wrong", ["soft", "", None, 1, ["gradual"]])
def test_another_visibility_is_refused_in_one_line(wrong: Any) -> None:
    target = target_of(Curtain().at(np.zeros(1)))
    for call in (
        lambda: Specular(small_radar(), Curtain(), visibility=wrong),  # type: ignore[arg-type]
        lambda: rt.scattering_length(target, ANTENNA, ANTENNA, 14e9, visibility=wrong),
    ):
        with pytest.raises(
            InputError, match=r"visibility.*; it must be sharp or gradual"
        ) as caught:
            call()
        assert "\n" not in str(caught.value)
