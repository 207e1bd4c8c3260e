"""Two people far apart are the sum of each alone, at every level of fidelity."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body.people import body_of_people
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.scatter import build_model
from rtradar.scatter.common.interpolation import interpolation_weights
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
