"""The surface of the body: a conductor by vectors, skin by Fresnel's formulas."""

from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.errors import InputError
from rtradar.front_end import Antenna
from rtradar.motion.placement import place
from rtradar.radar import Radar
from rtradar.scatter import build_model
from rtradar.scatter.common.polarization import (
    Polarization,
    antenna_field,
    bisector,
    body_material,
    body_reflection,
    over_copolar,
    sent_field,
)
from rtradar.scene import material

Array = NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)
SKIN = material("skin")
ETA = SKIN.eta(np.array([14e9]))
CONDUCTOR = material("perfect-conductor").eta(np.array([14e9]))


def unit(vector: Array) -> Array:
    return vector / np.linalg.norm(vector, axis=-1, keepdims=True)


def material_factor(
    to_tx: Array, to_rx: Array, eta: NDArray[np.complex128], polarization: Polarization
) -> NDArray[np.complex128]:
    """Co-polar echo over that of a perfect conductor of the same shape, (node, ...)."""
    tx, rx = unit(to_tx), unit(to_rx)
    sent, received = antenna_field(-tx, polarization), antenna_field(-rx, polarization)
    field = np.broadcast_to(sent.astype(np.complex128), (len(eta), *sent.shape))
    back = -np.sum(received * body_reflection(field, -tx, bisector(tx, rx), eta), axis=-1)
    return over_copolar(back, tx, rx, polarization)


def incidence(angle: float) -> tuple[Array, Array, Array, Array]:
    """Direction, normal, and unit fields across and in the plane of incidence, at random."""
    turn = Rotation.from_euler("xyz", [0.4, 1.1, -0.7])
    way, normal = np.array([np.sin(angle), 0.0, -np.cos(angle)]), np.array([0.0, 0.0, 1.0])
    across = np.array([0.0, 1.0, 0.0])
    return tuple(turn.apply(v) for v in (way, normal, across, np.cross(across, way)))  # type: ignore[return-value]


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.3, 1.0, 1.5])
def test_skin_has_fresnels_coefficients(angle: float) -> None:
    way, normal, across, within = incidence(angle)
    cosine, root = np.cos(angle), np.sqrt(ETA[0] - np.sin(angle) ** 2)
    te = (cosine - root) / (cosine + root)
    tm = (ETA[0] * cosine - root) / (ETA[0] * cosine + root)
    leaving = way + 2 * cosine * normal
    for field, expected in ((across, te * across), (within, tm * np.cross(across, leaving))):
        # Rounding: near the normal the plane of incidence is only as sure as sine^2 does not
        # matter.
        np.testing.assert_allclose(
            body_reflection(field[None], way, normal, ETA)[0], expected, atol=1e-9
        )


@given(seeds)
def test_a_conductor_leaves_no_field_along_itself(seed: int) -> None:
    rng = np.random.default_rng(seed)
    normal, way = unit(rng.normal(size=3)), unit(rng.normal(size=3))
    way *= -np.sign(way @ normal)
    field = np.cross(way, rng.normal(size=3)) + 1j * np.cross(way, rng.normal(size=3))
    total = field + body_reflection(field[None], way, normal, CONDUCTOR)[0]
    np.testing.assert_allclose(np.cross(normal, total), 0, atol=1e-14)
    leaving = way - 2 * (way @ normal) * normal
    # It lies across the wave that leaves, as strong as it came.
    np.testing.assert_allclose((total - field) @ leaving, 0, atol=1e-14)
    assert np.linalg.norm(total - field) == pytest.approx(np.linalg.norm(field), rel=1e-12)


@given(seeds)
def test_skin_takes_some_and_gives_nothing(seed: int) -> None:
    rng = np.random.default_rng(seed)
    normal, way = unit(rng.normal(size=3)), unit(rng.normal(size=3))
    way *= -np.sign(way @ normal)
    field = np.cross(way, rng.normal(size=3))[None]
    back = body_reflection(field.astype(complex), way, normal, ETA)
    assert np.linalg.norm(back) < np.linalg.norm(field)
    leaving = way - 2 * (way @ normal) * normal
    np.testing.assert_allclose(back[0] @ leaving, 0, atol=1e-12)


@pytest.mark.parametrize("polarization", ["v", "h"])
@pytest.mark.parametrize("frequency", [14e9, 79e9])
def test_straight_on_skin_gives_back_its_coefficient(
    frequency: float, polarization: Literal["v", "h"]
) -> None:
    eta = SKIN.eta(np.array([frequency]))
    way = np.array([-4.0, 1.0, 0.3])
    expected = (np.sqrt(eta[0]) - 1) / (np.sqrt(eta[0]) + 1)
    found = material_factor(way, 2 * way, eta, Polarization(polarization))
    assert found[0] == pytest.approx(expected, rel=1e-9)


def test_at_10_ghz_skin_is_as_published() -> None:
    # Gabriel et al., Phys. Med. Biol. 41 (1996) 2271, dry skin: permittivity 31.29, conductivity
    # 8.01 S/m.
    published = np.sqrt(31.29 - 8.01j / (2 * np.pi * 10e9 * 8.854e-12))
    way = np.array([-4.0, 1.0, 0.3])
    found = material_factor(way, way, SKIN.eta(np.array([10e9])), Polarization("v"))
    # Four digits are published.
    assert found[0] == pytest.approx((published - 1) / (published + 1), rel=1e-3)


@pytest.mark.parametrize("polarization", ["v", "h"])
def test_a_conductor_is_what_others_are_told_by(polarization: Literal["v", "h"]) -> None:
    rng = np.random.default_rng(0)
    tx = rng.normal(size=(50, 3))
    rx = tx + 0.3 * rng.normal(size=(50, 3))
    found = material_factor(tx, rx, CONDUCTOR, Polarization(polarization))
    np.testing.assert_allclose(found, 1, rtol=1e-9)


def test_antennas_send_across_their_way() -> None:
    ways = unit(np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, -1.0]]))
    v, h = Polarization("v"), Polarization("h")
    np.testing.assert_allclose(antenna_field(ways, v)[:2], [[0, 0, 1], [0, 0, 1]])
    np.testing.assert_allclose(antenna_field(ways, v)[2], np.array([1, 0, 1]) / np.sqrt(2))
    np.testing.assert_allclose(np.abs(antenna_field(ways, h)[0]), [0, 1, 0])
    # Straight up there is no v, or that of the boresight.
    up = np.array([[0.0, 0.0, 1.0]])
    np.testing.assert_array_equal(antenna_field(up, v), 0)
    np.testing.assert_array_equal(antenna_field(up, v, x_for_steep=True), [[1, 0, 0]])


@pytest.mark.parametrize("kind", ["v", "h"])
def test_a_turned_antenna_sends_its_field_turned(kind: Literal["v", "h"]) -> None:
    turns = Rotation.random(3, random_state=0).as_matrix()
    ways = unit(np.random.default_rng(0).normal(size=(3, 4, 5, 3)))
    ways[:, 0, 0] = [0, 0, 1]
    turned = np.einsum("tij,tabj->tabi", turns, ways)
    # One antenna for each of the first index, as of a radar that moves, or one for all.
    for one, own, there in ((turns, ways, turned), (turns[0], ways[0], turned[0])):
        antenna = Antenna(pattern="dipole")
        upright = sent_field(antenna, own, Polarization(kind), x_for_steep=True)
        found = sent_field(antenna, there, Polarization(kind, one), x_for_steep=True)
        back = Polarization(kind, one).seen(found)
        np.testing.assert_allclose(back, upright, atol=1e-7)


def test_unknown_materials_and_frequencies_are_refused() -> None:
    with pytest.raises(InputError, match="allowed: perfect-conductor, skin"):
        body_material("concrete", np.array([14e9]))
    for frequency in (0.5e9, 120e9):
        with pytest.raises(InputError):
            body_material("skin", np.array([frequency]))
    assert body_material("perfect-conductor", np.array([120e9])).conducts


@pytest.mark.parametrize("fidelity", ["analytic", "specular"])
def test_a_model_of_skin_is_the_conductor_times_its_factor(fidelity: str) -> None:
    body = rt.Body.from_motion(place(rt.synthetic_motion("walk", seed=0), duration_s=0.1))
    radar, chirps = Radar.preset("paper-12ghz"), np.arange(36)
    traced = {"variant": "scalar"} if fidelity == "specular" else {}
    metal, named, skin = (
        build_model(fidelity, radar, body, **traced, **option).echoes(chirps)  # type: ignore[arg-type]
        for option in ({}, {"materials": ["perfect-conductor"] * 21}, {"materials": ["skin"] * 21})
    )
    np.testing.assert_array_equal(named.amplitude, metal.amplitude)
    np.testing.assert_array_equal(skin.length, metal.length)
    seen = np.abs(metal.amplitude) > 0
    ratio = skin.amplitude[seen] / metal.amplitude[seen]
    straight = np.conj((np.sqrt(ETA[0]) - 1) / (np.sqrt(ETA[0]) + 1))
    # Half of the angle between Tx and Rx is at most 3 degrees: TE and TM differ by its square.
    np.testing.assert_allclose(ratio, straight, rtol=3e-3)
