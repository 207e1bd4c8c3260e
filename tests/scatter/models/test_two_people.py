"""Two people far apart are the sum of each alone, at every level of fidelity."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body.people import body_of_people
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.scatter import build_model
from rtradar.scatter.common.interpolation import interpolation_weights
from rtradar.scatter.specular_points import solve_specular_points
from rtradar.settings import RunSettings
from rtradar.system.registries import MODELS

RADAR = replace(rt.Radar.preset("paper-12ghz"), tx_y=2, tx_z=1, rx_y=2, rx_z=2)
# One near, who is strong, and one far behind and beside, who bends more than what is strong.
PEOPLE = (
    rt.Person(rt.synthetic_motion("walk", duration_s=0.1), (-1.5, -1.2)),
    rt.Person(rt.synthetic_motion("kick", duration_s=0.1), (8.0, 6.0), 30.0),
)
OPTIONS = {
    "physical-optics": {"tolerance": 0.01, "unevenness": 0.002},
    "auto": {"tolerance_complex": 0.05},
    "rays": {"rays_per_wavelength": 2.5},
}


def received(echoes: Echoes, parts: NDArray[np.bool_]) -> NDArray[np.complex128]:
    """Field (frequency, chirp, rx) of some echoes at both ends and in the middle of the sweep."""
    sweep = RADAR.start_frequency_hz + RADAR.bandwidth_hz * np.array([0.0, 0.5, 1.0])
    weights = interpolation_weights(echoes.frequency, sweep)
    amplitude = np.tensordot(weights, echoes.amplitude[..., parts], axes=1)
    turns = sweep[:, None, None, None] / SPEED_OF_LIGHT_MPS * echoes.length[..., parts]
    return np.asarray((amplitude * np.exp(2j * np.pi * turns)).sum(axis=3))


@pytest.mark.parametrize("fidelity", MODELS.built_in)
def test_two_people_far_apart_are_the_sum_of_each_alone(fidelity: str) -> None:
    settings = RunSettings(duration_s=0.06)
    both = body_of_people(PEOPLE, settings)
    # Between keyframes, where what a level thinks worth its while matters.
    chirps = np.array([163, 403, 723]) if fidelity != "rays" else np.array([403])
    options = OPTIONS.get(fidelity, {})
    together = build_model(fidelity, RADAR, both, **options).echoes(chirps)
    for number, person in enumerate(PEOPLE):
        body = body_of_people([person], settings)
        echoes = build_model(fidelity, RADAR, body, **options).echoes(chirps)
        alone = received(echoes, np.ones(len(echoes.part), dtype=bool))
        own = received(together, both.owner[together.part] == number)
        assert np.abs(own - alone).max() < 1e-6 * np.sqrt((np.abs(alone) ** 2).mean())


def in_the_way(starts: NDArray[np.float64], ends: NDArray[np.float64], body: rt.Ellipsoids) -> bool:
    """Whether an ellipsoid is between two points, by the quadratic of a line and a unit sphere."""
    for centre, frame, axes in zip(body.centres, body.frames, body.semi_axes, strict=True):
        start, way = (frame.T @ (starts - centre) / axes, frame.T @ (ends - starts) / axes)
        square, half, rest = way @ way, start @ way, start @ start - 1
        if half**2 > square * rest:
            roots = (-half + np.sqrt(half**2 - square * rest) * np.array([-1, 1])) / square
            if ((roots > 0) & (roots < 1)).any():
                return True
    return False


def test_one_behind_another_loses_what_is_in_the_way() -> None:
    stands = rt.synthetic_motion("walk", duration_s=0.1)
    # On one line with the radar at (-4, 1); the one in front is wide of nothing.
    line = rt.Person(stands, (-2.0, 0.6)), rt.Person(stands, (0.5, 0.1))
    settings = RunSettings(duration_s=0.06)
    both, front, back = (body_of_people(people, settings) for people in (line, line[:1], line[1:]))
    chirps = np.array([0])
    echoes = build_model("specular", RADAR, both).echoes(chirps)
    alone = build_model("specular", RADAR, back).echoes(chirps)
    own = echoes.amplitude[0, 0][:, both.owner[echoes.part] == 1]
    time = RADAR.centres_of(chirps)[0]
    poses, wall = back.at([time]), front.ellipsoids(time)
    antennas = RADAR.tx[0], RADAR.rx[RADAR.rx_of_tx[0]]
    at = Geometry(antennas[0][None], antennas[1][None], *poses)
    points = solve_specular_points(at, points=True)[2][0]
    lost = 0
    for rx, part in np.ndindex(own.shape):
        point = points[rx, part]
        ends = (antennas[0], antennas[1][rx])
        hidden = any(in_the_way(end, point, wall) for end in ends)
        lost += hidden
        expected = 0.0 if hidden else alone.amplitude[0, 0, rx, part]
        assert own[rx, part] == pytest.approx(expected, rel=1e-12, abs=1e-15)
    assert 0.2 < lost / own.size < 1
    # And nobody behind takes anything from who is in front.
    before = build_model("specular", RADAR, front).echoes(chirps).amplitude[0, 0]
    np.testing.assert_array_equal(echoes.amplitude[0, 0][:, both.owner[echoes.part] == 0], before)
