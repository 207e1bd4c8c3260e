"""Full-wave scattering by bodies of revolution: spheres, laws, and what is refused."""

from __future__ import annotations

import miepython
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError, ValidityWarning
from rtradar.full_wave import BodiesOfRevolution, Spheroid
from rtradar.scene import material

FREQUENCY_HZ = 12e9
WAVE_NUMBER = 2 * np.pi * FREQUENCY_HZ / SPEED_OF_LIGHT_MPS
ALONG_X = Rotation.from_euler("y", 90, degrees=True)


def bodies(*places: float, axes: object = (0.01, 0.01, 0.02), turn: Rotation) -> rt.Ellipsoids:
    """Equal ellipsoids at some places on the direction of the third axis."""
    frame = turn.as_matrix()
    n = len(places)
    return rt.Ellipsoids(
        [place * frame[:, 2] for place in places], [frame] * n, np.broadcast_to(axes, (n, 3))
    )


def full_wave(target: rt.Ellipsoids, tx: object, rx: object, polarization: str = "v") -> complex:
    return rt.scattering_length(
        target, tx, rx, FREQUENCY_HZ, "full-wave", polarization=polarization
    )[0]


@pytest.mark.parametrize("ka", [0.5, 2.7437, 4.4934, 6.0])
@pytest.mark.parametrize("polarization", ["v", "h"])
def test_a_conducting_sphere_has_the_field_of_mie_at_resonances_of_its_inside_too(
    ka: float, polarization: str
) -> None:
    radius = ka / WAVE_NUMBER
    sphere = bodies(0.0, axes=(radius,) * 3, turn=Rotation.identity())
    far = 1e7 * np.array([0.6, 0.48, 0.64])
    # Far away is 1e7 m, 2.5e9 rad, of which float64 keeps 5e-7.
    mie = rt.rcs.sphere(radius, FREQUENCY_HZ)
    assert full_wave(sphere, far, far, polarization) == pytest.approx(mie, rel=1e-5)


@pytest.mark.parametrize("permittivity", [4 - 0.5j, 29.3 - 15.5j])
def test_a_penetrable_sphere_scatters_as_the_series_of_mie_says(permittivity: complex) -> None:
    ka, angle = 2.0, np.radians([0.0, 50.0, 120.0, 180.0])
    sphere = BodiesOfRevolution(
        (Spheroid(ka / WAVE_NUMBER, ka / WAVE_NUMBER),), FREQUENCY_HZ, permittivity=permittivity
    )
    tx = np.array([1e7, 0.0, 0.0])
    rx = -1e7 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    # Its mean square over polarisations and directions is the scattering efficiency over 4 pi.
    series = miepython.S1_S2(complex(np.sqrt(permittivity)), ka, np.cos(angle), norm="qsca")
    for polarization, amplitude in zip(("v", "h"), series, strict=True):
        length = sphere.scattering_length(np.tile(tx, (4, 1)), rx, polarization)
        expected = 2 * np.pi * ka / WAVE_NUMBER * np.abs(amplitude)
        np.testing.assert_allclose(np.abs(length), expected, rtol=1e-5)


def test_tx_and_rx_may_be_swapped_for_a_pair_of_bodies_nearby() -> None:
    pair = bodies(-0.03, 0.03, turn=Rotation.from_euler("xyz", [20, 50, 10], degrees=True))
    tx, rx = [0.4, 0.1, 0.2], [-0.1, 0.5, -0.3]
    there, back = full_wave(pair, tx, rx), full_wave(pair, rx, tx)
    assert there == pytest.approx(back, rel=1e-6)


def test_axes_in_any_order_are_the_same_body() -> None:
    long = full_wave(bodies(0.0, turn=ALONG_X), [3.0, 1.0, 0.5], [2.0, 2.0, 1.0])
    same = rt.Ellipsoids([np.zeros(3)], [np.eye(3)], [(0.02, 0.01, 0.01)])
    assert full_wave(same, [3.0, 1.0, 0.5], [2.0, 2.0, 1.0]) == pytest.approx(long, rel=1e-9)


@pytest.mark.parametrize(
    ("target", "says"),
    [
        (
            rt.Ellipsoids([np.zeros(3)], [np.eye(3)], [(0.01, 0.02, 0.03)]),
            r"full-wave.* of revolution: make two of them equal",
        ),
        (bodies(0.0, 0.03, turn=ALONG_X), r"overlap by 0\.01 m"),
        (
            rt.Ellipsoids([np.zeros(3), [0.1, 0, 0]], [np.eye(3)] * 2, [(0.01, 0.01, 0.02)] * 2),
            r"ellipsoid 0 is not on the axis",
        ),
        (
            rt.Ellipsoids([np.zeros(3)], [np.eye(3)], [(1.0, 1.0, 2.0)]),
            r"bodies of 4 m at 12 GHz take .* unknowns",
        ),
    ],
)
def test_targets_that_it_does_not_take_are_refused(target: rt.Ellipsoids, says: str) -> None:
    with pytest.raises(InputError, match=says):
        full_wave(target, [9.0, 0.0, 0.0], [9.0, 0.0, 0.0])


def test_an_antenna_too_near_is_warned_of() -> None:
    sphere = bodies(0.0, axes=(0.02,) * 3, turn=Rotation.identity())
    with pytest.warns(ValidityWarning, match=r"leaves .*% of the incident field"):
        full_wave(sphere, [0.022, 0.0, 0.0], [1.0, 0.0, 0.0])


def test_each_pair_of_antennas_may_have_its_own_frequency() -> None:
    sphere, at = bodies(0.0, turn=ALONG_X), np.array([[1.0, 0.0, 0.2]] * 2)
    several = rt.scattering_length(sphere, at, at, np.array([8e9, 12e9]), "full-wave")
    assert several[1] == pytest.approx(full_wave(sphere, at[0], at[0]), rel=1e-12)
    assert abs(several[0] / several[1] - 1) > 0.1


def test_a_body_of_skin_is_one_of_its_permittivity() -> None:
    sphere = bodies(0.0, axes=(0.008,) * 3, turn=Rotation.identity())
    at = [1.0, 0.2, 0.1]
    length = rt.scattering_length(sphere, at, at, FREQUENCY_HZ, "full-wave", material="skin")
    eta = complex(material("skin").eta(FREQUENCY_HZ))
    same = BodiesOfRevolution((Spheroid(0.008, 0.008),), FREQUENCY_HZ, permittivity=eta)
    assert length == pytest.approx(same.scattering_length(at, at), rel=1e-12)


def test_options_it_does_not_have_are_refused() -> None:
    sphere = bodies(0.0, turn=ALONG_X)
    with pytest.raises(InputError, match="no option 'facets'; it has: material"):
        rt.scattering_length(sphere, [1.0, 0, 0], [1.0, 0, 0], 1e9, "full-wave", facets=3)
