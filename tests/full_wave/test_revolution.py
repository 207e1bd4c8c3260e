"""Full-wave scattering by bodies of revolution: spheres, laws, and what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError

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


def test_options_it_does_not_have_are_refused() -> None:
    sphere = bodies(0.0, turn=ALONG_X)
    with pytest.raises(InputError, match="no option 'facets'; it has: material"):
        rt.scattering_length(sphere, [1.0, 0, 0], [1.0, 0, 0], 1e9, "full-wave", facets=3)
