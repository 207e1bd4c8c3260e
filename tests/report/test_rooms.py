"""The plan of a room."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib import collections

from rtradar.radar import Radar
from rtradar.report.rooms import ShownRoom, draw_room_plan
from rtradar.scene import Furniture, Scene, material

pytestmark = pytest.mark.drawn


def test_a_plan_draws_no_more_faces_than_cover_the_furniture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    drawn: list[np.ndarray] = []
    collection = collections.PolyCollection

    def counted(corners: list[np.ndarray], **words: object) -> object:
        drawn.append(np.array(corners))
        return collection(corners, **words)

    monkeypatch.setattr(collections, "PolyCollection", counted)
    place = {"position_m": (2.0, 0.0, 0.0), "yaw_deg": 30.0}
    chair = Furniture(name="chair", mesh="chair", material=material("wood"), **place)
    scene, tracks = Scene(furniture=(chair,)), {"person": np.zeros((3, 2))}
    given = {"tracks": tracks, "paths": {}, "key": {}, "before_after": [], "azimuth": []}
    draw_room_plan(tmp_path / "plan.png", ShownRoom(scene=scene, radar=Radar(), **given), "title")
    every = chair.triangles().corners[..., :2]
    (corners,) = drawn
    # Each face takes as long; all of them took most of a run's time in a hall of chairs.
    assert len(corners) < len(every) / 3

    def area(triangles: np.ndarray) -> float:
        sides = triangles[:, 1:] - triangles[:, :1]
        return float(np.abs(np.linalg.det(sides)).sum() / 2)

    # What looks up covers as much as what looks down.
    assert area(corners) == pytest.approx(area(every) / 2)
