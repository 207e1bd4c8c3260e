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
from rtradar.scatter.specular_point.second_term import with_second_term
from rtradar.scatter.specular_point.solver import solve_specular_points
from rtradar.scatter.target import target_geometry

LEVELS = ("specular", "fresnel")
TORSO = rt.Ellipsoids([np.zeros(3)], [np.eye(3)], [(0.1, 0.1, 0.0758)])
RADAR = dataclasses.replace(rt.Radar.preset("paper-12ghz"), tx_y=1, tx_z=0, rx_y=2, rx_z=0)


def fields(target: rt.Ellipsoids, at: Any, level: str, **options: Any) -> list[Any]:
    """Scattering lengths by one term and by two."""
    return [rt.scattering_length(target, at, at, 12e9, level, terms=n, **options) for n in (1, 2)]


@pytest.mark.parametrize("polarization", ["v", "h"])
@pytest.mark.parametrize("level", LEVELS)
def test_half_of_the_error_of_a_torso_goes(level: str, polarization: Literal["v", "h"]) -> None:
    angle = np.radians([10.0, 30.0, 50.0, 70.0, 90.0])
    at = 4 * np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    truth = rt.scattering_length(TORSO, at, at, 12e9, "full-wave", polarization=polarization)
    one, two = fields(TORSO, at, level, polarization=polarization)
    assert np.linalg.norm(two - truth) < 0.5 * np.linalg.norm(one - truth)


def test_of_a_sphere_it_is_that_of_the_exact_series() -> None:
    """The backscatter of a conducting sphere is that of geometric optics times 1 + j / 2ka."""
    radius, k = 0.1, 2 * np.pi * 12e9 / SPEED_OF_LIGHT_MPS
    sphere = rt.Ellipsoids([np.zeros(3)], [np.eye(3)], [(radius,) * 3])
    at = np.array([[4.0, 0.0, 0.0], [1.0, 2.0, -1.0]])
    place = target_geometry(sphere, at, at)
    points = solve_specular_points(place, points=True)[2]
    for polarization in ("v", "h"):
        found = with_second_term(place, points, polarization, np.array(k))
        np.testing.assert_allclose(found, 1 + 0.5j / (k * radius), rtol=0, atol=1e-9)


@pytest.mark.parametrize("level", LEVELS)
def test_a_model_has_what_the_scattering_length_has(level: str) -> None:
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=0.3))
    chirps = np.array([0, 5])
    one, two = (build_model(level, RADAR, body, terms=n).echoes(chirps) for n in (1, 2))
    centres, frames, axes = body.at(RADAR.centres_of(chirps[:1]))
    for part in (body.part_names.index("head"), body.part_names.index("right thigh")):
        target = rt.Ellipsoids([centres[0, part]], [frames[0, part]], [axes[part]])
        tx, rx = RADAR.tx[:1], RADAR.rx[:1]
        for node, frequency in enumerate(np.atleast_1d(two.frequency)):
            single, both = (
                rt.scattering_length(target, tx, rx, frequency, level, terms=n) for n in (1, 2)
            )
            ratio = two.amplitude[node, 0, 0, part] / one.amplitude[node, 0, 0, part]
            np.testing.assert_allclose(ratio.conj(), both[0] / single[0], rtol=0, atol=1e-6)


def test_over_walls_each_path_has_it() -> None:
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=0.3))
    scene, chirps = rt.Scene.load("doorway"), np.array([0])
    own = rt.Radar.preset("paper-12ghz")
    direct = build_model("specular", own, body, terms=2).echoes(chirps)
    room = build_model("specular", own, body, scene=scene, terms=2).echoes(chirps)
    assert room.amplitude.shape[-1] > direct.amplitude.shape[-1]
    phases = np.angle(room.amplitude[0, 0, 0])
    assert np.any((np.abs(phases) > 1e-3) & (np.abs(phases) < 0.3))


@pytest.mark.parametrize("level", LEVELS)
@pytest.mark.parametrize("terms", [0, 3, 1.5])
def test_other_numbers_of_terms_are_refused(level: str, terms: Any) -> None:
    with pytest.raises(InputError, match=f"{level}: terms = .* must be 1"):
        rt.scattering_length(TORSO, [4, 0, 0], [4, 0, 0], 12e9, level, terms=terms)


def test_far_apart_antennas_have_the_first_term_alone() -> None:
    def change(rx: Any) -> float:
        one, two = (
            rt.scattering_length(TORSO, [4, 0, 0], rx, 12e9, "specular", terms=n) for n in (1, 2)
        )
        return float(abs(two[0] / one[0] - 1))

    assert change([0, 4, 0]) < 1e-6 < change([1, 4, 0]) < change([4, 2, 0])
