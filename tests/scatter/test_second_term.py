"""The second term of geometric optics: against full wave, of spheres, and of a walker."""

from __future__ import annotations

import dataclasses
from typing import Any, Literal

import numpy as np
import pytest

import rtradar as rt
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.scatter import build_model
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.models.specular import Specular
from rtradar.scatter.specular_points import solve_specular_points, with_second_term
from rtradar.scatter.target import target_geometry

TORSO = rt.Ellipsoids([np.zeros(3)], [np.eye(3)], [(0.1, 0.1, 0.0758)])
RADAR = dataclasses.replace(rt.Radar.preset("paper-12ghz"), tx_y=1, tx_z=0, rx_y=2, rx_z=0)


def fields(
    target: rt.Ellipsoids, tx: Any, rx: Any, frequency: float = 12e9, **options: Any
) -> list[Any]:
    """Scattering lengths by one term and by two."""
    return [
        rt.scattering_length(target, tx, rx, frequency, "specular", terms=n, **options)
        for n in (1, 2)
    ]


@pytest.mark.slow  # solves Maxwell's equations at 12 GHz
@pytest.mark.parametrize("polarization", ["v", "h"])
def test_half_of_the_error_of_a_torso_goes(polarization: Literal["v", "h"]) -> None:
    angle = np.radians([10.0, 30.0, 50.0, 70.0, 90.0])
    at = 4 * np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    truth = rt.scattering_length(TORSO, at, at, 12e9, "full-wave", polarization=polarization)
    one, two = fields(TORSO, at, at, polarization=polarization)
    assert np.linalg.norm(two - truth) < 0.5 * np.linalg.norm(one - truth)


def test_near_a_sphere_it_is_that_of_the_exact_series() -> None:
    """The backscatter of a conducting sphere is that of geometric optics times 1 + j / 2ka."""
    radius, k = 0.1, 2 * np.pi * 12e9 / SPEED_OF_LIGHT_MPS
    sphere = rt.Ellipsoids([np.zeros(3)], [np.eye(3)], [(radius,) * 3])
    at = np.array([[4.0, 0.0, 0.0], [1.0, 2.0, -1.0]])
    place = target_geometry(sphere, at, at)
    points = solve_specular_points(place, points=True)[2]
    for polarization in ("v", "h"):
        found = with_second_term(place, points, Polarization(polarization), np.array(k))
        np.testing.assert_allclose(found, 1 + 0.5j / (k * radius), rtol=0, atol=1e-9)


def test_a_model_has_what_the_scattering_length_has() -> None:
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=0.3))
    chirps = np.array([0, 5])
    one, two = (build_model("specular", RADAR, body, terms=n).echoes(chirps) for n in (1, 2))
    centres, frames, axes = body.at(RADAR.centres_of(chirps[:1]))
    for part in (body.part_names.index("head"), body.part_names.index("right thigh")):
        target = rt.Ellipsoids([centres[0, part]], [frames[0, part]], [axes[part]])
        single, both = fields(target, RADAR.tx[:1], RADAR.rx[:1], RADAR.centre_frequency_hz)
        ratio = two.amplitude[0, 0, 0, part] / one.amplitude[0, 0, 0, part]
        np.testing.assert_allclose(ratio.conj(), both[0] / single[0], rtol=0, atol=1e-6)


def test_over_walls_each_path_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Specular, "fast_over_walls", False)  # which has another order of paths
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=0.3))
    scene, chirps = rt.Scene.load("doorway"), np.array([0])
    one, two = (
        build_model("specular", RADAR, body, scene=scene, terms=n).echoes(chirps) for n in (1, 2)
    )
    np.testing.assert_array_equal(one.part, two.part)
    # After the echoes of the direct path come those over walls.
    before, after = (e.amplitude[0, 0, 0, len(body.part_names) :] for e in (one, two))
    change = np.abs(after[before != 0] / before[before != 0] - 1)
    assert len(change) > 10
    assert np.mean((change > 1e-3) & (change < 0.3)) > 0.5


@pytest.mark.parametrize("terms", [0, 3, 1.5])
def test_other_numbers_of_terms_are_refused(terms: Any) -> None:
    with pytest.raises(InputError, match=r"specular: terms = .* must be 1"):
        rt.scattering_length(TORSO, [4, 0, 0], [4, 0, 0], 12e9, "specular", terms=terms)


def test_far_apart_antennas_have_the_first_term_alone() -> None:
    def change(rx: Any) -> float:
        one, two = fields(TORSO, [4, 0, 0], rx)
        return float(abs(two[0] / one[0] - 1))

    assert change([-3, 4, 0]) < 1e-6 < change([-1, 4, 0]) < change([1, 4, 0])


@pytest.mark.parametrize(("polarization", "sign"), [("v", -1), ("h", 1)])
@pytest.mark.parametrize("half_deg", [0.0, 32.0])
def test_of_a_sphere_it_is_that_of_the_exact_series(
    half_deg: float, polarization: Literal["v", "h"], sign: int
) -> None:
    """(1 -+ tan^2 i) / cos i, with i half the angle between Tx and Rx, which stand level."""
    radius, k, half = 0.1, 2 * np.pi * 12e9 / SPEED_OF_LIGHT_MPS, np.radians(half_deg)
    sphere = rt.Ellipsoids([np.zeros(3)], [np.eye(3)], [(radius,) * 3])
    tx, rx = (1e6 * np.array([[np.cos(half), way * np.sin(half), 0.0]]) for way in (-1, 1))
    place = target_geometry(sphere, tx, rx)
    points = solve_specular_points(place, points=True)[2]
    found = with_second_term(place, points, Polarization(polarization), np.array(k))
    coefficient = (1 + sign * np.tan(half) ** 2) / np.cos(half)
    np.testing.assert_allclose(found, 1 + 0.5j * coefficient / (k * radius), rtol=0, atol=1e-5)


def test_without_a_specular_point_there_is_nothing() -> None:
    """Straight through the centre the two antennas have no point that both see."""
    assert fields(TORSO, [4, 0, 0], [-4, 0, 0])[1] == 0
