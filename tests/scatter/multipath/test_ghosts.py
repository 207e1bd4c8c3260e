"""Where ghosts show: their direction in the axes of a board that is turned."""

import dataclasses
from typing import Any

import numpy as np
import pytest

from rtradar.radar import Radar
from rtradar.scatter import build_model
from rtradar.scatter.multipath.path_summary import ghosts
from rtradar.scatter.multipath.room_model import RoomModel
from rtradar.scene import Scene, Wall, material


@pytest.mark.parametrize("name", ["iwr1843", "paper-12ghz"])
def test_the_azimuth_of_a_ghost_is_that_of_its_last_leg(name: str, make: Any) -> None:
    wall = Wall(
        name="left",
        corner_m=(-6.0, 3.0, -3.0),
        edge_u_m=(12.0, 0.0, 0.0),
        edge_v_m=(0.0, 0.0, 6.0),
        material=material("metal"),
        thickness_m=0.01,
    )
    radar = dataclasses.replace(Radar.preset(name), position_m=(-4.0, 1.0, 1.0), yaw_deg=20.0)
    body = make.one((0.1, 0.1, 0.1), (0.0, 0.0, 1.0))
    model = build_model("specular", radar, body, scene=Scene(walls=(wall,)), variant="scalar")
    assert isinstance(model, RoomModel)
    found = {ghost.path: np.degrees(ghost.azimuth_rad) for ghost in ghosts(model, radar, 0.0)}
    direct, image = (np.degrees(np.arctan2(y - 1.0, 4.0)) - 20.0 for y in (0.0, 6.0))
    assert found["left > body"] == pytest.approx(direct, abs=1.0)
    assert found["body > left"] == pytest.approx(image, abs=1.0)
