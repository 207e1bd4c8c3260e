"""Tests of the nodes of a sweep and of the polynomial through them."""

from __future__ import annotations

import numpy as np
import pytest

from rtradar import Radar
from rtradar.scatter.common.interpolation import interpolation_weights, sweep_nodes


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
