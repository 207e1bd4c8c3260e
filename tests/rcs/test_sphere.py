"""The sphere: Mie against another implementation, and the optics against Mie and each other."""

import miepython
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.rcs import sphere

NODES, WEIGHTS = np.polynomial.legendre.leggauss(200)


def frequency_of(ka: float, radius: float = 0.1) -> float:
    return ka / radius * SPEED_OF_LIGHT_MPS / (2 * np.pi)


@pytest.mark.parametrize("ka", [0.05, 0.7, 1.0, 3.3, 10.0, 12.6, 17.1, 60.0, 147.3, 300.0])
def test_mie_agrees_with_miepython(ka: float) -> None:
    ours = abs(sphere(0.1, frequency_of(ka))) ** 2 / (np.pi * 0.1**2)
    back = miepython.efficiencies_mx(1 - 1e6j, ka)[2]
    # Its metal has the index 1e6, not infinity: that leaves 2e-6, and more where the backscatter
    # nearly vanishes.
    np.testing.assert_allclose(ours, back, rtol=1e-5, atol=1e-5)


def test_a_small_sphere_scatters_as_rayleigh_has_it() -> None:
    ka = 1e-3
    # sigma = 9 pi a^2 (ka)^4 for a conductor: electric and magnetic dipole add up in the backward
    # direction.
    np.testing.assert_allclose(
        abs(sphere(0.1, frequency_of(ka))) ** 2, 9 * np.pi * 0.1**2 * ka**4, rtol=1e-5
    )


@given(st.floats(0.5, 200.0))
def test_physical_optics_is_its_integral(ka: float) -> None:
    # Over slices of equal depth z the lit half gives j k / sqrt(pi) * 2 pi a * Int_0^a (z/a)
    # exp(2jkz) dz.
    radius, k = 0.1, ka / 0.1
    z = radius * (NODES + 1) / 2
    integral = (
        1j * k / np.sqrt(np.pi) * 2 * np.pi * np.sum(WEIGHTS * radius / 2 * z * np.exp(2j * k * z))
    )
    np.testing.assert_allclose(sphere(radius, frequency_of(ka), "po"), integral, rtol=1e-9)


@given(st.floats(1e-4, 10.0), st.floats(1e6, 1e12))
def test_geometric_optics_has_the_phase_of_the_nearest_point(
    radius: float, frequency: float
) -> None:
    turned = sphere(radius, frequency, "go") * np.exp(
        -4j * np.pi * frequency / SPEED_OF_LIGHT_MPS * radius
    )
    # exp(2jka) with ka up to 1e5 keeps 1e-11.
    np.testing.assert_allclose(turned, np.sqrt(np.pi) * radius, rtol=1e-10)


@pytest.mark.parametrize("method", ["go", "po", "mie"])
def test_it_depends_on_ka_alone(method: str) -> None:
    small, large = sphere(0.1, 10e9, method), sphere(0.7, 10e9 / 7, method)  # type: ignore[call-overload]
    np.testing.assert_allclose(large, 7 * small, rtol=1e-10)


def test_it_broadcasts() -> None:
    assert sphere(np.ones((3, 1)), np.full(2, 1e9)).shape == (3, 2)


def test_huge_spheres_stay_finite() -> None:
    # Bessel functions of the second kind of high order leave the range of float64 long before their
    # terms matter.
    assert np.isfinite(sphere(10.0, np.array([1e6, 1e9, 16e9]))).all()


@pytest.mark.parametrize(
    ("radius", "frequency", "method"),
    [(0.0, 1e9, "mie"), (-1.0, 1e9, "go"), (1.0, 0.0, "po"), (1.0, 1e9, "x")],
)
def test_what_means_nothing_is_refused(radius: float, frequency: float, method: str) -> None:
    with pytest.raises(ValueError, match=r"positive|unknown"):
        sphere(radius, frequency, method)  # type: ignore[call-overload]
