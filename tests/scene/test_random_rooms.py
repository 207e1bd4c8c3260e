"""Rooms that are drawn at random: what always holds, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import rtradar as rt
from rtradar.errors import InputError


@given(st.integers(0, 2**31))
def test_furniture_is_in_the_room_and_apart_and_the_radar_is_free(seed: int) -> None:
    room = rt.Scene.random(seed)
    for preset in ("paper-12ghz", "iwr6843"):
        placed = room.place(rt.Radar.preset(preset))
        assert not room.is_outside(placed.position_m)
    assert not room.is_outside((1.8, 0.0, 1.0))
    boxes = []
    for piece in room.furniture:
        vertices = piece.triangles().vertices
        low, high = vertices.min(axis=0) + 1e-9, vertices.max(axis=0)
        assert not room.is_outside(low)
        assert not room.is_outside(high)
        boxes.append((low[:2], high[:2]))
        # Where people walk.
        assert low[0] > 1.9 or high[0] < -1.9 or low[1] > 0.8 or high[1] < -0.8
    for number, (low, high) in enumerate(boxes):
        for other_low, other_high in boxes[:number]:
            assert (low > other_high).any() or (other_low > high).any()


def test_a_seed_names_a_room_everywhere(tmp_path: Path) -> None:
    room = rt.Scene.random(7)
    assert room == rt.Scene.load("random:7") == rt.Scene.random(7)
    assert room != rt.Scene.random(8)
    file = tmp_path / "seven.toml"
    file.write_text("[random]\nseed = 7\n\n[person]\nheading_deg = 30\n")
    own = rt.Scene.load(file)
    assert (own.walls, own.furniture, own.heading_deg) == (room.walls, room.furniture, 30.0)
    scene = {"base": "random:7", "room": {"far": {"material": "metal"}}}
    walls = rt.Experiment({"scene": scene}).parts.scene.walls
    assert {wall.name: wall.material.name for wall in walls}["far"] == "metal"


def test_ranges_are_kept_to() -> None:
    for seed in range(20):
        room = rt.Scene.random(
            seed, furniture=(1, 2), length_m=(9, 9.5), width_m=(4, 4), height_m=(2.5, 2.6)
        )
        assert 1 <= len(room.furniture) <= 2
        floor = next(wall for wall in room.walls if wall.name == "floor")
        size = np.sort(np.ptp(floor.corners, axis=0))
        assert size[1] == pytest.approx(4)
        assert 9 <= size[2] <= 9.5


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"seed": -1}, "[random] seed = -1"),
        ({"seed": 1, "furniture": (3, 2)}, "[random] furniture = (3, 2); it must be a range"),
        ({"seed": 1, "furniture": (0.5, 2)}, "of whole numbers"),
        ({"seed": 1, "length_m": (1, 2)}, "from 5.5 to 30"),
    ],
)
def test_what_has_no_meaning_is_refused(words: dict[str, object], message: str) -> None:
    with pytest.raises(InputError) as caught:
        rt.Scene.random(**words)  # type: ignore[arg-type]
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_name_needs_a_seed_and_a_table_known_keys() -> None:
    with pytest.raises(InputError, match="did you mean length_m"):
        rt.Scene.of_table({"random": {"seed": 1, "lenght_m": [6, 7]}})
    with pytest.raises(InputError, match="give a seed, as in random:7"):
        rt.Scene.load("random:seven")


@pytest.mark.filterwarnings("ignore:clutter power is from behind")
def test_a_walk_in_one_is_simulated_and_repeated(small: rt.Radar, tmp_path: Path) -> None:
    walk = rt.synthetic_motion("walk", duration_s=0.2)
    first = rt.run(walk, small, "random:3", out=tmp_path / "first")
    text = (tmp_path / "first" / "run.toml").read_text()
    # The room itself, whatever other versions draw.
    assert "[scene.room.near]" in text
    assert "[scene.random]" not in text
    again = rt.Experiment.load(tmp_path / "first" / "run.toml").run()
    np.testing.assert_array_equal(first.maps.range_doppler, again.maps.range_doppler)
