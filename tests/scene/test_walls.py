"""Walls and rooms: where they are, which way they look, what they refuse."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from rtradar.errors import InputError
from rtradar.scene.materials import material
from rtradar.scene.objects import ROOM_SIDES, Surface, Wall, room_walls

CONCRETE = material("concrete")


def wall(**changes: Any) -> Wall:
    return Wall(
        **{
            "name": "north",
            "corner_m": (1.0, 2.0, 0.0),
            "edge_u_m": (0.0, 3.0, 0.0),
            "edge_v_m": (0.0, 0.0, 2.5),
            "material": CONCRETE,
            "thickness_m": 0.2,
            **changes,
        }
    )


def test_a_wall() -> None:
    made = wall()
    np.testing.assert_array_equal(made.normal, [1, 0, 0])
    np.testing.assert_array_equal(made.corners, [[1, 2, 0], [1, 5, 0], [1, 5, 2.5], [1, 2, 2.5]])
    assert made.area_m2 == 7.5
    assert wall() == made
    assert hash(wall()) == hash(made)


def test_the_slab_is_behind_its_front() -> None:
    points = np.array([[0.9, 3, 1], [1.1, 3, 1], [0.79, 3, 1], [0.9, 1.9, 1], [0.9, 3, 2.6]])
    np.testing.assert_array_equal(wall().holds(points), [True, False, False, False, False])


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("name", ""),
        ("corner_m", (1, 2)),
        ("corner_m", (1, 2, 1e9)),
        ("edge_u_m", (0, 0, 0)),
        ("edge_u_m", (0, 3.0, 0.1)),
        ("edge_v_m", (0, 0, 0.001)),
        ("material", "concrete"),
        ("thickness_m", 0),
        ("roughness_m", -1e-6),
    ],
)
def test_a_wall_without_meaning(key: str, value: Any) -> None:
    with pytest.raises(InputError) as caught:
        wall(**{key: value})
    message = str(caught.value)
    assert "\n" not in message
    assert key in message
    assert key == "name" or "wall 'north'" in message


def surfaces() -> dict[str, Surface]:
    return {
        side: Surface(material=CONCRETE, thickness_m=0.1 + 0.01 * k)
        for k, side in enumerate(ROOM_SIDES)
    }


sizes = st.tuples(*[st.floats(0.1, 100)] * 3)
places = st.tuples(*[st.floats(-100, 100)] * 2)


@given(size=sizes, corner=places)
def test_a_room_is_closed_and_looks_inward(
    size: tuple[float, float, float], corner: tuple[float, float]
) -> None:
    walls = room_walls(size, corner, surfaces())
    low = np.array([*corner, 0.0])
    middle = low + np.array(size) / 2
    for side, made in zip(ROOM_SIDES, walls, strict=True):
        assert made.name == side
        # Rounding of places up to 200 m.
        distance = (middle - made.corners[0]) @ made.normal
        axis = int(np.argmax(np.abs(made.normal)))
        assert distance == pytest.approx(size[axis] / 2, abs=1e-12)
        assert np.all(made.corners >= low - 1e-12)
        assert np.all(made.corners <= low + np.array(size) + 1e-12)
    # A closed surface: its directed areas cancel, and by Gauss it holds the room's volume.
    np.testing.assert_allclose(sum(made.area_m2 * made.normal for made in walls), 0, atol=1e-9)
    volume = (
        sum(made.area_m2 * float((middle - made.corners[0]) @ made.normal) for made in walls) / 3
    )
    assert volume == pytest.approx(np.prod(size), rel=1e-9)


def test_sides_of_a_room_are_where_their_names_say() -> None:
    walls = {made.name: made for made in room_walls((4, 3, 2.5), (-1, -2), surfaces())}
    expected = {
        "near": (0, -1),
        "far": (0, 3),
        "right": (1, -2),
        "left": (1, 1),
        "floor": (2, 0),
        "ceiling": (2, 2.5),
    }
    for name, (axis, place) in expected.items():
        assert np.all(walls[name].corners[:, axis] == place)
    assert walls["floor"].thickness_m == pytest.approx(0.14)


@pytest.mark.parametrize("size", [(0, 1, 1), (1, 1, 1000), "abc"])
def test_rooms_without_meaning(size: Any) -> None:
    with pytest.raises(InputError, match="size_m"):
        room_walls(size, (0, 0), surfaces())


def test_openings_lie_in_their_wall_and_nowhere_in_each_other() -> None:
    own = {
        "name": "front",
        "corner_m": (0, 0, 0),
        "edge_u_m": (0, 4, 0),
        "edge_v_m": (0, 0, 2.5),
        "material": material("brick"),
        "thickness_m": 0.1,
    }
    door = Wall(**own, openings=[[1, 0, 0.9, 2], [2.5, 1, 1, 1]])
    assert door.openings == ((1.0, 0.0, 0.9, 2.0), (2.5, 1.0, 1.0, 1.0))
    points = np.array([[-0.05, 1.5, 1], [-0.05, 0.5, 1], [-0.05, 3, 1.5], [-0.05, 3, 0.5]])
    np.testing.assert_array_equal(door.holds(points), [False, True, False, True])
    for openings, told in (
        (((3.5, 0, 0.9, 2),), "it must lie in the wall of 4 by 2.5 m"),
        (((1, 0, 0.9, 2), (1.5, 1, 1, 1)), "overlap"),
        (((1, 0, 0.9),), "it must be a list"),
        ("door", "it must be a list"),
    ):
        with pytest.raises(InputError, match=told):
            Wall(**own, openings=openings)
