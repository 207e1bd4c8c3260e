"""Fresnel coefficients: laws of half-spaces and slabs."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.scene.materials import MATERIALS, material
from rtradar.scene.slab import Polarization, reflection, slab

BOTH = pytest.mark.parametrize("polarization", ["te", "tm"])
WAVELENGTH_M = SPEED_OF_LIGHT_MPS / 12e9
cosines = st.floats(0.01, 1.0)
# Nearly air divides two small differences; its laws hold, but not to the digits asked for.
permittivities = st.floats(1.05, 80.0)
losses = st.floats(0.0, 60.0)
thicknesses = st.floats(1e-4, 0.3)
polarizations = st.sampled_from(["te", "tm"])


def chain(
    eta: complex, thickness_m: float, frequency_hz: float, cosine: float, polarization: Polarization
) -> tuple[complex, complex]:
    """Reflection and transmission of tangential fields by the ABCD matrix of a line."""
    k0 = 2 * np.pi * frequency_hz / SPEED_OF_LIGHT_MPS
    inner = np.sqrt(complex(eta - 1 + cosine**2))
    inner = -inner if inner.imag > 0 else inner
    outer_z, inner_z = (1 / cosine, 1 / inner) if polarization == "te" else (cosine, inner / eta)
    phase = k0 * thickness_m * inner
    a, b, c = np.cos(phase), 1j * inner_z * np.sin(phase), 1j * np.sin(phase) / inner_z
    total = 2 * a + b / outer_z + c * outer_z
    tangential = (b / outer_z - c * outer_z) / total
    # The tangential TM field of a reflected wave is that along the wave's own unit vector, turned
    # round.
    return complex(tangential if polarization == "te" else -tangential), complex(2 / total)


@given(
    eps=permittivities,
    loss=losses,
    cosine=cosines,
    thickness=st.floats(1e-4, 0.02),
    polarization=polarizations,
)
def test_slab_against_chain_matrix(
    eps: float, loss: float, cosine: float, thickness: float, polarization: Polarization
) -> None:
    ours = slab(eps - 1j * loss, thickness, 12e9, cosine, polarization)
    theirs = chain(eps - 1j * loss, thickness, 12e9, cosine, polarization)
    # Cosine and sine of a complex phase grow to 1e17 here, and a near-resonance divides by 1e-3.
    assert abs(ours[0] - theirs[0]) < 1e-9
    assert abs(ours[1] - theirs[1]) < 1e-9


@given(eps=permittivities, cosine=cosines, thickness=thicknesses, polarization=polarizations)
def test_a_slab_without_loss_keeps_the_energy(
    eps: float, cosine: float, thickness: float, polarization: Polarization
) -> None:
    reflected, transmitted = slab(eps, thickness, 77e9, cosine, polarization)
    assert abs(reflected) ** 2 + abs(transmitted) ** 2 == pytest.approx(1.0, abs=1e-9)


@given(
    eps=permittivities,
    loss=losses,
    cosine=cosines,
    thickness=thicknesses,
    polarization=polarizations,
)
def test_no_slab_gives_energy(
    eps: float, loss: float, cosine: float, thickness: float, polarization: Polarization
) -> None:
    reflected, transmitted = slab(eps - 1j * loss, thickness, 77e9, cosine, polarization)
    assert abs(reflected) ** 2 + abs(transmitted) ** 2 <= 1 + 1e-9
    assert abs(reflection(eps - 1j * loss, cosine, polarization)) <= 1 + 1e-12


@BOTH
@pytest.mark.parametrize(
    "name",
    [name for name in MATERIALS if MATERIALS[name].holds(77e9) and not MATERIALS[name].conducts],
)
def test_a_thin_enough_slab_is_not_there(name: str, polarization: Polarization) -> None:
    reflected, transmitted = slab(material(name).eta(77e9), 1e-12, 77e9, [1.0, 0.5], polarization)
    # k (eta - 1) d is 1e-8 at most.
    assert np.abs(reflected).max() < 1e-7
    assert np.abs(transmitted - 1).max() < 1e-7


@BOTH
def test_a_thick_slab_with_losses_is_a_half_space(polarization: Polarization) -> None:
    eta, cosine = material("concrete").eta(77e9), np.linspace(0.05, 1.0, 20)
    reflected, transmitted = slab(eta, 2.0, 77e9, cosine, polarization)
    # 2 m of concrete at 77 GHz leave e^-220 of the field.
    np.testing.assert_allclose(reflected, reflection(eta, cosine, polarization), rtol=1e-14)
    assert np.abs(transmitted).max() < 1e-80


def test_brewster_angle() -> None:
    eta = 4.0
    cosine = np.cos(np.arctan(np.sqrt(eta)))
    assert abs(reflection(eta, cosine, "tm")) < 1e-15
    assert abs(reflection(eta, cosine, "te")) == pytest.approx(0.6)  # (eta - 1) / (eta + 1)
    assert abs(slab(eta, 0.0123, 12e9, cosine, "tm")[0]) < 1e-15


@BOTH
@pytest.mark.parametrize("half_waves", [1, 2, 7])
def test_whole_half_waves_are_a_window(half_waves: int, polarization: Polarization) -> None:
    eta, cosine = 6.31, 0.8
    inner = np.sqrt(eta - 1 + cosine**2)
    thickness = half_waves * WAVELENGTH_M / (2 * inner)
    reflected, transmitted = slab(eta, thickness, 12e9, cosine, polarization)
    assert abs(reflected) < 1e-13
    assert transmitted == pytest.approx((-1) ** half_waves, abs=1e-13)


@BOTH
def test_a_slab_of_air_is_air(polarization: Polarization) -> None:
    cosine = np.array([0.0, 0.3, 1.0])
    reflected, transmitted = slab(1.0, 0.5, 12e9, cosine, polarization)
    phase = 2 * np.pi * 0.5 / WAVELENGTH_M * cosine
    assert np.abs(reflected).max() < 1e-15
    # In its place on a straight path it changes nothing.
    np.testing.assert_allclose(transmitted * np.exp(1j * phase), 1.0, rtol=1e-12)


@BOTH
def test_normal_incidence_turns_both_round(polarization: Polarization) -> None:
    # The unit vectors of TM before and after are opposite, so its sign is the other one.
    sign = -1 if polarization == "te" else 1
    assert reflection(4.0, 1.0, polarization) == pytest.approx(sign / 3)
    assert reflection(complex(0, -np.inf), 1.0, polarization) == sign


@BOTH
def test_perfect_conductor(polarization: Polarization) -> None:
    eta, cosine = material("perfect-conductor").eta(12e9), np.linspace(0, 1, 5)
    reflected, transmitted = slab(eta, 1e-3, 12e9, cosine, polarization)
    assert np.all(reflected == (-1 if polarization == "te" else 1))
    assert np.all(reflected == reflection(eta, cosine, polarization))
    assert np.all(transmitted == 0)


@BOTH
def test_metal_is_nearly_a_perfect_conductor(polarization: Polarization) -> None:
    reflected, transmitted = slab(material("metal").eta(77e9), 1e-3, 77e9, [1.0, 0.5], polarization)
    # sqrt(eta) is 1500 - j 1500: 2 cos / sqrt(eta) or, for TM, its double at 60 degrees is missing.
    assert np.abs(reflected - reflection(complex(0, -np.inf), 1.0, polarization)).max() < 3e-3
    assert np.abs(transmitted).max() < 1e-300


@BOTH
def test_grazing_incidence_reflects_all(polarization: Polarization) -> None:
    eta = material("glass").eta(12e9)
    assert reflection(eta, 0.0, polarization) == pytest.approx(-1)
    reflected, transmitted = slab(eta, 0.006, 12e9, 0.0, polarization)
    assert reflected == pytest.approx(-1)
    assert transmitted == pytest.approx(0, abs=1e-15)


def test_total_reflection_inside_a_thinner_medium_decays() -> None:
    # A plasma-like permittivity below 1: beyond the critical angle a thick layer passes nothing, a
    # thin one tunnels.
    for thickness, least, most in ((1.0, 0.0, 1e-50), (0.001, 0.5, 1.0)):
        _, transmitted = slab(0.2, thickness, 12e9, 0.1, "te")
        assert least <= abs(transmitted) <= most


@BOTH
def test_broadcasting(polarization: Polarization) -> None:
    frequency: NDArray[np.float64] = np.array([12e9, 14e9, 16e9])
    eta = material("plasterboard").eta(frequency)
    thickness = np.array([[0.0125], [0.025]])
    reflected, transmitted = slab(eta, thickness, frequency, 0.7, polarization)
    assert reflected.shape == transmitted.shape == (2, 3)
    alone = slab(eta[1], 0.025, 14e9, 0.7, polarization)
    assert (reflected[1, 1], transmitted[1, 1]) == (
        pytest.approx(alone[0]),
        pytest.approx(alone[1]),
    )


@pytest.mark.parametrize(
    ("eta", "thickness", "frequency", "cosine", "polarization"),
    [
        (4.0, 0.1, 12e9, 1.1, "te"),
        (4.0, 0.1, 12e9, -0.1, "te"),
        (4.0, 0.1, 12e9, np.nan, "te"),
        (4 + 1j, 0.1, 12e9, 1.0, "te"),
        (0.0, 0.1, 12e9, 1.0, "te"),
        (np.nan, 0.1, 12e9, 1.0, "te"),
        (4.0, 0.0, 12e9, 1.0, "te"),
        (4.0, np.inf, 12e9, 1.0, "te"),
        (4.0, 0.1, -1.0, 1.0, "te"),
        (4.0, 0.1, 12e9, 1.0, "v"),
    ],
)
def test_values_without_meaning(
    eta: complex, thickness: float, frequency: float, cosine: float, polarization: str
) -> None:
    with pytest.raises(InputError) as caught:
        slab(eta, thickness, frequency, cosine, polarization)  # type: ignore[arg-type]
    assert "\n" not in str(caught.value)
