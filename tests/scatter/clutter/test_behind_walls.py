"""Static clutter that is partly behind a wall: the rest is as it would be without the wall."""

from __future__ import annotations

import numpy as np
import pytest

from rtradar.radar import Radar
from rtradar.scatter.clutter.returns import (
    FREQUENCY_ERROR,
    FURNITURE_NODES,
    RoomEchoes,
    behind_walls,
)
from rtradar.scatter.common.interpolation import sweep_nodes
from rtradar.scene import Scene, Wall, material

RADAR = Radar(tx_y=2, tx_z=1, rx_y=2, rx_z=2, position_m=(0.0, 0.0, 1.0))
POINTS = np.array([[3.0, -1.0, 1.0], [3.0, 1.0, 1.0]])


def pane(name: str, thickness_m: float) -> Scene:
    """A pane before the second point alone."""
    place = {"corner_m": (2.0, 0.2, 0.0), "edge_u_m": (0.0, 2.0, 0.0), "edge_v_m": (0.0, 0.0, 2.0)}
    return Scene(
        name="half",
        walls=(Wall(name="pane", material=material(name), thickness_m=thickness_m, **place),),
    )  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("name", "thickness_m"), [("plasterboard", 1e-4), ("metal", 0.01), ("glass", 0.006)]
)
def test_what_has_no_wall_before_it_keeps_its_frequency_response(
    name: str, thickness_m: float
) -> None:
    nodes = sweep_nodes(RADAR, FURNITURE_NODES)
    place = (nodes - RADAR.centre_frequency_hz) / RADAR.bandwidth_hz
    response = 1 + 0.8 * place - 1.5 * place**2 + 2 * place**4
    shape = RADAR.n_tx, RADAR.n_rx, 2
    returns = RoomEchoes(
        name="two facets",
        kind="furniture",
        length=np.full(shape, 6.3),
        # The echo behind the wall changes with frequency as the wall has it alone.
        amplitude=np.stack([response, np.ones_like(response)], axis=-1)[:, None, None]
        * np.ones((1, *shape), dtype=complex),
        frequency=nodes,
        bounces=np.ones(2, dtype=np.int64),
        points=POINTS[None, None, :, None],
    )
    found = behind_walls(returns, RADAR, pane(name, thickness_m))
    own = np.isclose(found.points[0, 0, :, 0, 1], -1.0)
    assert own.sum() == 1
    kept = found.take(own).at_nodes(nodes)
    np.testing.assert_allclose(
        kept, returns.amplitude[..., :1], atol=FREQUENCY_ERROR * np.abs(response).max()
    )
