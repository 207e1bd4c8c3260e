"""Nodes of a sweep, the polynomial through them, and sets of echoes put together."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import rtradar as rt
from rtradar import Radar
from rtradar.scatter.common.interpolation import interpolation_weights, sweep_nodes, together


@pytest.mark.parametrize("count", [1, 2, 5, 33])
def test_nodes_are_chebyshevs_and_the_polynomial_through_them_is_of_their_degree(
    count: int,
) -> None:
    radar = Radar.preset("paper-12ghz")
    nodes = sweep_nodes(radar, count)
    assert (np.diff(nodes) > 0).all()
    place = (nodes - radar.centre_frequency_hz) / (radar.bandwidth_hz / 2)
    np.testing.assert_allclose(np.cos(count * np.arccos(place)), 0, atol=1e-12)
    places = sweep_nodes(radar, 7)

    def polynomial(frequency: np.ndarray) -> np.ndarray:
        x = (frequency - radar.centre_frequency_hz) / radar.bandwidth_hz
        return np.asarray(sum((-1.3 * x) ** power for power in range(count)))

    np.testing.assert_allclose(
        interpolation_weights(nodes, places) @ polynomial(nodes), polynomial(places), rtol=1e-12
    )


RADAR = dataclasses.replace(rt.Radar.preset("paper-12ghz"), tx_y=2, tx_z=1, rx_y=2, rx_z=2)


def test_echoes_together_are_the_sum_of_each() -> None:
    rng = np.random.default_rng(0)
    several = []
    for nodes in (1, 3, 2):
        shape = (nodes, 4, 2, 5)
        several.append(
            rt.Echoes(
                length=np.broadcast_to(rng.uniform(2, 8, (2, 5)), shape[1:]),
                amplitude=rng.normal(size=shape) + 1j * rng.normal(size=shape),
                frequency=RADAR.start_frequency_hz + rng.uniform(0, 4e9, nodes),
                tx=RADAR.tx_of_chirp(np.arange(4)),
                part=np.arange(5),
                bounces=np.ones(5, dtype=np.int64),
            )
        )
    times = RADAR.chirp_times(4)
    found = rt.signal.synthesize(together(several), RADAR, times)
    expected = sum(rt.signal.synthesize(own, RADAR, times) for own in several)
    np.testing.assert_allclose(found, expected, atol=1e-7)
