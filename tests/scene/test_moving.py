"""Poses of rigid objects by hand, and scene files that have them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

import rtradar as rt


def test_a_turning_object_is_a_quarter_turn_further_after_a_quarter_of_its_period() -> None:
    fan = rt.Object(
        "fan", "fan", "metal", position_m=(1, 2, 3), yaw_deg=90, motion=rt.Turning(rate_hz=0.5)
    )
    rotation, place = fan.pose([0.5])
    # A quarter turn about z, after a yaw of a quarter turn: x goes to -x.
    np.testing.assert_allclose(rotation[0] @ [1, 0, 0], [-1, 0, 0], atol=1e-12)
    np.testing.assert_array_equal(place[0], [1, 2, 3])


def test_the_axis_of_a_motion_turns_with_the_yaw() -> None:
    turning = rt.Turning(rate_hz=0.25, axis=(2, 0, 0))
    fan = rt.Object("fan", "fan", "metal", yaw_deg=90, motion=turning)
    rotation, _ = fan.pose([1.0])
    # In its own axes y goes to z about x; its x axis is the world's y.
    np.testing.assert_allclose(rotation[0] @ [0, 1, 0], [0, 0, 1], atol=1e-12)
    np.testing.assert_allclose(rotation[0] @ [1, 0, 0], [0, 1, 0], atol=1e-12)


def test_a_swing_is_at_its_amplitude_after_a_quarter_period_and_keeps_its_pivot() -> None:
    swinging = rt.Swinging(amplitude_deg=30, period_s=4)
    door = rt.Object("door", "door-leaf", "wood", pivot_m=(0, 0.9, 0), motion=swinging)
    rotation, place = door.pose([0.0, 1.0, 3.0])
    angles = np.degrees(np.arctan2(rotation[:, 1, 0], rotation[:, 0, 0]))
    np.testing.assert_allclose(angles, [0, 30, -30], atol=1e-9)
    far_edge = door.triangles(1.0).vertices
    hinged = np.linalg.norm(far_edge[:, :2], axis=1) < 0.03
    assert hinged.any()  # what was at y = 0.9 m is still at the pivot
    np.testing.assert_array_equal(place, 0)


def test_a_path_goes_through_its_way_points_and_rests_at_its_ends() -> None:
    points, times = ((0, 0, 0), (1, 0, 0), (1, 2, 0)), (1.0, 2.0, 4.0)
    path = rt.FollowingPath(points_m=points, times_s=times)
    cart = rt.Object("cart", "trihedral", "metal", position_m=(5, 0, 1), motion=path)
    _, place = cart.pose([0.0, 1.0, 2.0, 4.0, 9.0])
    expected = np.add([points[0], points[0], points[1], points[2], points[2]], [5, 0, 1])
    np.testing.assert_allclose(place, expected, atol=1e-12)
    steady = rt.FollowingPath(velocity_mps=(0, -2, 0))
    np.testing.assert_allclose(steady.pose(np.array([1.5]))[1], [[0, -3, 0]])


def test_a_mesh_in_memory_is_a_closed_body_or_a_sheet_by_itself() -> None:
    box = trimesh.creation.box((1, 2, 3))
    assert rt.Object("box", box, "wood").shape.closed
    sheet = trimesh.Trimesh([[0, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 1, 2]])
    assert not rt.Object("sheet", sheet, "metal").shape.closed
    with pytest.raises(rt.InputError, match="material 'wood' of a thin sheet"):
        rt.Object("sheet", sheet, "wood").triangles()


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (lambda: rt.Turning(axis=(0, 0, 0)), "it must have a direction"),
        (lambda: rt.Turning(axis=(1e-300, 0, 0)), "it must have a direction"),
        (lambda: rt.Object("a", 1, "metal"), "mesh = 1; .* or a trimesh.Trimesh"),
        (lambda: rt.Swinging(period_s=0), "period_s"),
        (lambda: rt.FollowingPath(), "give velocity_mps, or points_m"),
        (
            lambda: rt.FollowingPath(points_m=((0, 0, 0), (1, 0, 0)), times_s=(1, 1)),
            "they must ascend",
        ),
        (lambda: rt.Object("a", "fan", "metal", motion="turning"), "allowed: Turning"),
        (lambda: rt.Object("a", "fann", "metal"), "object 'a': mesh = 'fann' is unknown"),
        (lambda: rt.Object("a", None, "metal", metres_per_unit=1), "mesh = None; it must be"),
        (lambda: rt.Scene(furniture=(rt.Object("a", "fan", "metal"),)), "tuple of Furniture"),
    ],
)
def test_what_has_no_meaning_is_refused_in_one_line(made: object, message: str) -> None:
    with pytest.raises(rt.InputError, match=message):
        made()  # type: ignore[operator]


def test_a_scene_file_says_how_its_objects_move(tmp_path: Path) -> None:
    path = tmp_path / "hall.toml"
    path.write_text(
        '[[objects]]\nname = "fan"\nmesh = "fan"\nmaterial = "metal"\nposition_m = [1, 0, 1]\n'
        'motion = {kind = "turning", rate_hz = 3, axis = [1, 0, 0]}\n'
    )
    (fan,) = rt.Scene.load(path).objects
    assert fan.motion == rt.Turning(rate_hz=3, axis=(1, 0, 0))
    path.write_text(path.read_text().replace("turning", "spinning"))
    with pytest.raises(rt.InputError, match="kind = turning or swinging or path"):
        rt.Scene.load(path)
    path.write_text(path.read_text().replace("spinning", "turning").replace("= 3", "= true"))
    with pytest.raises(rt.InputError, match=r"\[\[objects\]\] number 1 motion Turning: rate_hz"):
        rt.Scene.load(path)
