"""The visible fraction of Fresnel zones, against a straight edge, and in the model."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from scipy.special import erfc

import rtradar as rt
from rtradar.body.body import Poses
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.fresnel_zones import keyframes as fresnel_keyframes
from rtradar.scatter.fresnel_zones.visible_fraction import Zones, zone_fractions
from rtradar.scatter.models import fresnel
from rtradar.scatter.models.fresnel import Fresnel, fresnel_scattering, zone_nodes
from rtradar.scatter.models.specular import Specular
from rtradar.trace.backends.backend import Backend, select, use
from rtradar.trace.body_tracer import BodyTracer

Array = NDArray[np.float64]
C = 299_792_458.0
ANTENNA = np.array([-4.0, 0.0, 0.0])


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


def share_behind_plate(radius: float, frequency: float, edge: float) -> complex:
    """Fraction left of a sphere's return where a plate half way shadows all below z = ``edge``."""
    k = np.array([2 * np.pi * frequency / C])
    below = ANTENNA[0] / 2, 0.0, edge / 2 - 1.0
    poses = Poses(
        np.array([[np.zeros(3), below]]),
        np.tile(np.eye(3), (1, 2, 1, 1)),
        np.array([[radius] * 3, [1e-4, 20.0, 1.0]]),
    )
    point = np.array([[-radius, 0.0, 0.0]])
    ends, zero = ANTENNA[None], np.zeros(1, dtype=np.int64)
    tracer = BodyTracer(use(select("cpu")), poses.semi_axes)
    zones = Zones(ends, ends, point, zero, zero, ends[None], k)
    fraction = zone_fractions(tracer, zones, poses, np.array([[0, 0]]), k[None])
    assert fraction.shape == (1, 1, 1)
    return complex(fraction[0, 0, 0])


@pytest.mark.parametrize(("radius", "frequency"), [(0.1, 79e9), (0.3, 79e9), (0.3, 14e9)])
def test_a_straight_edge_leaves_the_fresnel_integral(radius: float, frequency: float) -> None:
    k = 2 * np.pi * frequency / C
    # k dL = z^2 k h / 2 with h = 2 / R + 2 / radius; across the edge the integral of exp(-j u^2)
    # from the edge on.
    h = 2 / (4 - radius) + 2 / radius
    u = np.linspace(-3, 3, 41)
    edges = u / np.sqrt(k * h / 2)
    got = np.array(
        [share_behind_plate(radius, frequency, edge / (1 - radius / 4)) for edge in edges]
    )
    exact = erfc(np.exp(0.25j * np.pi) * u) / 2
    # The window takes away what is more than RIM away, a wave of 1 / (2 sqrt(pi) RIM) = 4 % at most
    # there; curvature adds 1 %.
    assert np.sqrt(np.mean(np.abs(got - exact) ** 2)) < 0.02
    assert np.abs(got - exact).max() < 0.04


def test_an_edge_that_wanders_changes_the_share_without_jumps() -> None:
    # Steps of 2e-3, where the edge is in sight, at its corner and where it vanishes.
    u = (np.array([-0.8, 0.0, 0.6])[:, None] + np.linspace(-0.06, 0.06, 61)).ravel()
    k = 2 * np.pi * 79e9 / C
    edges = u / np.sqrt(k * (2 / 3.9 + 2 / 0.1) / 2)
    share = np.array([share_behind_plate(0.1, 79e9, edge) for edge in edges])
    # exp(-j u^2) bends by 2 u / sqrt(pi) a unit squared: 5e-6 at a step of 2e-3. Each side of a
    # cell has the edge to 1 / 16384 of it, in all 6e-5; a corner that pops would be 1e-2.
    assert np.abs(np.diff(share.reshape(3, -1), 2)).max() < 1e-4


def test_full_view_is_exactly_one_and_full_cover_exactly_nothing(backend: Backend) -> None:
    radar, chirps = small_radar(tx_y=3, rx_y=2, tx_spacing_wavelengths=1.0), np.arange(30)
    for body, target in ((Curtain(edge=0.5), 1.0), (Curtain(edge=-0.3), 0.0)):
        model = Fresnel(radar, body, variant=backend.kind)  # type: ignore[arg-type]
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


@pytest.mark.parametrize("edge", [-0.01, 0.0, 0.015])
def test_the_model_and_the_function_agree_phase_and_all(backend: Backend, edge: float) -> None:
    radar, body = small_radar(), Curtain(edge=edge)
    echoes = Fresnel(radar, body, variant=backend.kind).echoes(np.arange(3))  # type: ignore[arg-type]
    assert 0.1 < np.abs(echoes.amplitude[0, 0, 0, 0] / echoes.amplitude[0, 0, 0, 1]) * 3 / 0.7 < 20
    poses = body.at(np.zeros(1))
    target = rt.Ellipsoids(poses.centres[0], poses.frames[0], poses.semi_axes)
    for frequency, amplitude in zip(echoes.frequency, echoes.amplitude, strict=True):
        received = np.sum(
            amplitude[0, 0].conj() * np.exp(-2j * np.pi * frequency / C * echoes.length[0, 0])
        )
        field = fresnel_scattering(
            target, ANTENNA[None], ANTENNA[None], np.array([frequency]), variant=backend.kind
        )
        there_and_back = np.exp(-2j * np.pi * frequency / C * 8.0) / 16
        # The same search, but zones laid out for each frequency, and for the middle of the sweep in
        # the model.
        np.testing.assert_allclose(received, field[0] * there_and_back, rtol=0.03)


def test_tx_and_rx_may_be_swapped(backend: Backend) -> None:
    poses = Curtain(edge=0.01).at(np.zeros(1))
    target = rt.Ellipsoids(poses.centres[0], poses.frames[0], poses.semi_axes)
    tx = ANTENNA + np.random.default_rng(0).normal(0, 0.1, (10, 3))
    rx, frequency = tx[::-1].copy(), np.full(10, 14e9)
    there, back = (
        fresnel_scattering(target, *pair, frequency, variant=backend.kind)
        for pair in ((tx, rx), (rx, tx))
    )
    np.testing.assert_allclose(back, there, rtol=1e-6)


def test_any_block_of_chirps_gets_the_same_echoes(backend: Backend) -> None:
    radar, body = small_radar(tx_y=2, rx_y=2), Curtain(speed=1.0)
    model = Fresnel(radar, body, variant=backend.kind)  # type: ignore[arg-type]
    whole = model.echoes(np.arange(70, 150)).amplitude
    for block in (np.arange(131, 150), np.arange(70, 71), np.arange(71, 131)):
        afresh = Fresnel(radar, body, variant=backend.kind)  # type: ignore[arg-type]
        # A keyframe alone goes without its neighbours: the same but for the last digit.
        np.testing.assert_allclose(afresh.echoes(block).amplitude, whole[:, block - 70], rtol=1e-13)


def test_shares_of_some_parts_are_as_among_all_and_no_others_are_found(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    radar, body = small_radar(tx_y=2, rx_y=2), Curtain(speed=1.0)
    chirps = np.arange(85, 115)
    whole = Fresnel(radar, body, variant=backend.kind).fractions.at(chirps)  # type: ignore[arg-type]
    found: list[NDArray[np.int64]] = []

    def counted(tracer: BodyTracer, zones: Zones, *given: Any) -> Any:
        found.append(zones.part)
        return zone_fractions(tracer, zones, *given)

    monkeypatch.setattr(fresnel_keyframes, "zone_fractions", counted)
    shares = Fresnel(radar, body, variant=backend.kind).fractions  # type: ignore[arg-type]
    np.testing.assert_array_equal(shares.at(chirps, np.array([1])), whole[..., [1]])
    keyframes = len(found)
    np.testing.assert_array_equal(shares.at(chirps, np.array([1])), whole[..., [1]])
    assert len(found) == keyframes  # nothing twice
    np.testing.assert_array_equal(shares.at(chirps, np.array([1, 0])), whole[..., [1, 0]])
    between = np.concatenate(found[keyframes:])
    assert (between == 0).all()
    # The edge passes part 0 in these intervals: all their nodes, and at most one on either side.
    inner = shares._fine - 1
    assert 0 < len(between) <= 4 * inner + 2
    assert len(between) % inner in (0, 1, 2)


def test_the_fade_is_smooth_and_meets_the_edge(backend: Backend) -> None:
    radar, body = small_radar(chirp_duration_s=0.25e-3), Curtain(speed=1.0)
    model = Fresnel(radar, body, variant=backend.kind)  # type: ignore[arg-type]
    chirps = np.arange(200, 601)
    share = model.fractions.at(chirps)[1, :, 0, 0]
    # 5 cm on either side, four Fresnel radii: a round edge diffracts a little more than the 0.1 of
    # a straight one.
    assert np.abs(share[0]) < 0.15
    assert np.abs(share[-1] - 1) < 0.15
    # The specular point becomes visible as the edge crosses y = 0: a straight edge leaves a half
    # there, a round one a little more.
    assert share[200] == pytest.approx(0.5, abs=0.1)
    poses = body.at(radar.chirp_times(len(chirps), 200))
    exact = []
    for i in range(0, 401, 20):
        target = rt.Ellipsoids(poses.centres[i], poses.frames[i], poses.semi_axes)
        alone = [
            rt.Ellipsoids(
                *(getattr(target, f)[p : p + 1] for f in ("centres", "frames", "semi_axes"))
            )
            for p in (0, 1)
        ]
        both, free, before = (
            fresnel_scattering(
                t, ANTENNA[None], ANTENNA[None], np.array([14e9]), variant=backend.kind
            )[0]
            for t in (target, *alone)
        )
        exact.append((both - before) / free)
    # What the cubics between keyframes leave out.
    np.testing.assert_allclose(share[::20], exact, atol=0.01)
    # Within 3 cm, 2.2 Fresnel radii, exp(-j u^2) bends by 1e-3 a chirp; corners of straight pieces
    # 1.25 ms long, by 5e-3.
    assert np.abs(np.diff(share[80:321], 2)).max() < 3e-3


def test_a_part_inside_another_is_hidden(backend: Backend) -> None:
    target = rt.Ellipsoids(
        np.zeros((2, 3)), np.tile(np.eye(3), (2, 1, 1)), [[0.05, 0.05, 0.1], [0.1, 0.1, 0.2]]
    )
    alone = rt.Ellipsoids(np.zeros((1, 3)), np.eye(3)[None], [[0.1, 0.1, 0.2]])
    ends, frequency = ANTENNA[None], np.array([14e9])
    whole, outer = (
        fresnel_scattering(t, ends, ends, frequency, variant=backend.kind) for t in (target, alone)
    )
    np.testing.assert_array_equal(whole, outer)


@pytest.mark.parametrize(
    "axes",
    [
        (0.003, 0.003, 0.3),
        (0.3, 0.3, 0.0003),
        (0.3, 0.0003, 0.0003),
        (1e-4, 1e-4, 1e-4),
        (1.0, 1.0, 1.0),
    ],
)
@pytest.mark.parametrize("frequency", [1e9, 300e9])
def test_extremes_stay_numbers(axes: tuple[float, float, float], frequency: float) -> None:
    rng = np.random.default_rng(1)
    sight = np.concatenate([np.eye(3), -np.eye(3), rng.normal(size=(20, 3))])
    sight /= np.linalg.norm(sight, axis=1, keepdims=True)
    for reach in (0.1, 1e4):
        tx = sight * (max(axes) + reach)
        # One just before it, half over the line of sight.
        other = sight[7] * (max(axes) + reach / 2)
        target = rt.Ellipsoids(
            [np.zeros(3), other], np.tile(np.eye(3), (2, 1, 1)), [axes, np.full(3, reach / 5)]
        )
        field = fresnel_scattering(
            target, tx, tx + 0.01 * reach * sight[::-1], np.full(len(tx), frequency)
        )
        assert np.isfinite(field).all()


def test_a_wide_sweep_takes_three_nodes_and_a_narrow_one_its_middle() -> None:
    wide, narrow = (zone_nodes(Radar.preset(name)) for name in ("paper-12ghz", "paper-77ghz"))
    np.testing.assert_allclose(
        wide, [14e9 - np.sqrt(3) * 1e9, 14e9, 14e9 + np.sqrt(3) * 1e9], rtol=1e-12
    )
    np.testing.assert_allclose(narrow, [79e9], rtol=1e-12)


@pytest.mark.parametrize("shadow_rays", [0, 7, 5000, 64.0, True, "many"])
def test_bad_counts_of_rays_are_told_in_one_line(shadow_rays: object) -> None:
    with pytest.raises(InputError, match=r"shadow_rays = .*whole number from 8 to 4096") as caught:
        Fresnel(small_radar(), Curtain(), shadow_rays=shadow_rays)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)


@pytest.mark.filterwarnings("ignore:.*radius of curvature:rtradar.errors.ValidityWarning")
def test_no_share_passes_what_one_open_zone_leaves(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Thin parts among others at 3 GHz, where optics is past its end: shares of up to 2.8 came out.
    axes = [
        [47, 207, 112],
        [4, 31, 76],
        [14, 104, 164],
        [5, 21, 89],
        [43, 140, 11],
        [3, 131, 21],
        [305, 3, 24],
    ]
    random = np.random.default_rng(1)
    found = []

    def told(*given: Any) -> NDArray[np.complex128]:
        found.append(np.abs(zone_fractions(*given)).max())
        return zone_fractions(*given)

    monkeypatch.setattr(fresnel, "zone_fractions", told)
    for seed in range(40):
        frames = Rotation.random(len(axes), random_state=seed).as_matrix()
        target = rt.Ellipsoids(random.normal(0, 0.1, (len(axes), 3)), frames, np.array(axes) / 1000)
        rt.scattering_length(
            target, [1.4, 0.2, -0.2], [2.3, 0.4, -1.3], 3e9, "fresnel", variant=backend.kind
        )
    assert 2 - 1e-12 < max(found) <= 2 + 1e-12
