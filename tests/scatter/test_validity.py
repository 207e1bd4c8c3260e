"""Where optics ends, and persons who stand in walls, furniture or one another."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import rtradar as rt
from rtradar.body import Body
from rtradar.body.people import body_of_people
from rtradar.errors import InputError, ValidityWarning
from rtradar.motion import place
from rtradar.scatter import build_model
from rtradar.scatter.link_budget import LinkBudget, link_budget
from rtradar.scatter.validity import Inside, objects_inside, warn_of_small_radii
from rtradar.scene import Furniture, Scene, Wall, material
from rtradar.settings import RunSettings
from rtradar.system.registries import scene_files

WAVENUMBER = np.array([100.0])


def two(radius: float) -> rt.Ellipsoids:
    return rt.Ellipsoids([[0, 0, 0], [0, 1, 0]], [np.eye(3)] * 2, [[1.0, 1.0, 1.0], [radius] * 3])


def test_a_small_sphere_that_counts_is_told() -> None:
    antenna = np.array([[4.0, 0.0, 0.0]])
    with pytest.warns(ValidityWarning, match=r"50% .* below 5, down to 4\.9"):
        warn_of_small_radii(two(0.049), antenna, antenna, WAVENUMBER, np.array([[1.0, -1.0]]))


def test_what_is_large_or_does_not_count_is_not() -> None:
    antenna = np.array([[4.0, 0.0, 0.0]])
    warn_of_small_radii(two(0.051), antenna, antenna, WAVENUMBER, np.array([[1.0, 1.0]]))
    warn_of_small_radii(
        two(0.049), antenna, antenna, WAVENUMBER, np.array([[1.0, 0.2]])
    )  # 4 % of the power
    warn_of_small_radii(two(0.049), antenna, antenna, WAVENUMBER, np.array([[0.0, 0.0]]))


def test_opposite_antennas_have_no_normal() -> None:
    needle = rt.Ellipsoids([[0, 0, 0]], [np.eye(3)], [[0.01, 0.01, 1.0]])
    sight = np.array([[4.0, 0.0, 0.0]])
    warn_of_small_radii(needle, sight, -sight, WAVENUMBER, np.zeros((1, 1)))


def test_the_tip_of_a_needle_counts_by_its_own_radius() -> None:
    needle = rt.Ellipsoids(
        [[0, 0, 0]], [np.eye(3)], [[0.1, 0.1, 1.0]]
    )  # radii 0.01 at the tip, 0.1 and 10 on the side
    tip, side = np.array([[0.0, 0.0, 4.0]]), np.array([[4.0, 0.0, 0.0]])
    with pytest.warns(ValidityWarning, match="down to 1,"):
        warn_of_small_radii(needle, tip, tip, WAVENUMBER, np.ones((1, 1)))
    warn_of_small_radii(needle, side, side, WAVENUMBER, np.ones((1, 1)))


RADAR = rt.Radar(
    name="small",
    tx_y=2,
    tx_z=0,
    rx_y=4,
    rx_z=0,
    chirp_duration_s=250e-6,
    samples_per_chirp=256,
    frame_duration_s=0.05,
)
MOTION = rt.synthetic_motion("punch", seed=9, duration_s=1.0)
BODY = Body.from_motion(place(MOTION))
TIMES = np.arange(0, 1.0, 0.01)


def wall(x: float, thickness: float, name: str = "across") -> Wall:
    """Across the way from the radar to the person, its front toward the radar at this x [m]."""
    brick = material("brick")
    corner, u, v = (x, 3.0, 0.0), (0.0, -6.0, 0.0), (0.0, 0.0, 3.0)
    made = Wall(
        name=name, corner_m=corner, edge_u_m=u, edge_v_m=v, material=brick, thickness_m=thickness
    )
    assert made.normal[0] == -1
    return made


def inside(*walls: Wall) -> list[tuple[str, float, str]]:
    """By even echo powers, in blocks of 7 instants."""
    solid = Inside(Scene(walls=walls), BODY)
    power = np.full((len(TIMES), len(BODY.part_names)), 1e-3)
    for first in range(0, len(TIMES), 7):
        some = slice(first, first + 7)
        solid.look(TIMES[some], BODY.at(TIMES[some]), power[some])
    return solid.found(power.sum(axis=0))


@pytest.mark.parametrize(
    ("x", "thickness"), [(-0.25, 0.5), (-0.3, 0.36), (-0.01, 0.02), (0.0, 0.002)]
)
def test_who_stands_in_a_wall_is_refused(tmp_path: Path, x: float, thickness: float) -> None:
    scene = Scene(name="cell", walls=(wall(x, thickness),))
    said = (
        r"scene 'cell': at 0.\d\d s the (left hip|right hip|lower torso) of the person is inside "
        "wall 'across'; move the person"
    )
    with pytest.raises(InputError, match=said) as caught:
        rt.run(MOTION, RADAR, scene, out=tmp_path / "out", fidelity="analytic", duration_s=0.2)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_at_any_time_of_the_interval() -> None:
    # A walk of 3 s comes about a metre nearer; at its middle it is at the origin.
    walk = rt.synthetic_motion("walk", seed=0, duration_s=3.0)
    body = Body.from_motion(place(walk))
    centres = body.at([0.0, 3.0]).centres[:, :, 0]
    ahead = wall(float(centres[1].mean()), 0.3)
    model = build_model("analytic", RADAR, body)
    n_chirps = int(3.0 / RADAR.chirp_interval_s)
    with pytest.raises(InputError, match=r"at [12].\d\d s the .* is inside wall 'across'"):
        link_budget(model, RADAR, body, n_chirps, scene=Scene(walls=(ahead,)))
    behind = wall(float(centres[0].max()) + 0.5, 0.3)
    told = link_budget(model, RADAR, body, n_chirps, scene=Scene(walls=(behind,)))
    assert not [limit for limit in told.limits if limit.name.startswith("inside")]


def test_a_part_that_matters_is_refused_and_one_that_does_not_is_told() -> None:
    hand = BODY.part_names.index(
        "left hand"
        if BODY.at(TIMES).centres[:, BODY.part_names.index("left hand"), 0].min() < -0.5
        else "right hand"
    )
    reach = BODY.at(TIMES).centres[..., 0]
    # Thick enough that the fist comes in from behind, by the back face, and stays there; nothing
    # else reaches so far.
    others = np.delete(reach, hand, axis=1).min()
    assert reach[:, hand].min() < others - 0.1
    back = (reach[:, hand].min() + others) / 2
    ahead = wall(back - 0.3, 0.3)
    told = inside(ahead)
    ((name, power, message),) = told
    first = TIMES[np.argmax(reach[:, hand] <= back)]
    assert name == "inside_wall"
    assert power == pytest.approx(1e-3 * np.count_nonzero(reach[:, hand] <= back))
    assert f"the {BODY.part_names[hand]} in 'across' from {first:.2f} s" in message
    # The same with all power from that hand.
    solid = Inside(Scene(walls=(ahead,)), BODY)
    power_of_hand = np.zeros((len(TIMES), len(BODY.part_names)))
    power_of_hand[:, hand] = 1.0
    solid.look(TIMES, BODY.at(TIMES), power_of_hand)
    with pytest.raises(
        InputError,
        match=rf"at {first:.2f} s the {BODY.part_names[hand]} of the person is inside wall "
        "'across'",
    ):
        solid.found(power_of_hand.sum(axis=0))


def test_the_summary_tells(tmp_path: Path) -> None:
    box = Furniture(
        name="crate",
        mesh=tmp_path / "crate.ply",
        material=material("wood"),
        position_m=(0, 0, 0),
        metres_per_unit=1,
    )
    trimesh = pytest.importorskip("trimesh")
    trimesh.creation.box((1.0, 1.0, 1.0)).export(tmp_path / "crate.ply")
    motion = rt.synthetic_motion("stand", seed=0, duration_s=0.2)
    with pytest.warns(rt.ValidityWarning, match="parts inside furniture"):
        rt.run(
            motion,
            RADAR,
            Scene(name="store", furniture=(box,)),
            out=tmp_path / "out",
            fidelity="analytic",
        )
    limits = {
        limit["name"]: limit
        for limit in json.loads((tmp_path / "out" / "summary.json").read_text())["limits"]
    }
    told = limits["inside_furniture"]
    assert 0.05 < told["share"] <= 1
    # The crate reaches up to 0.5 m: shanks and feet.
    assert "the left foot in 'crate' from 0.00 s" in told["message"]
    assert "head" not in told["message"]


@pytest.mark.parametrize("activity", ["walk", "kick", "punch", "jumping_jack"])
def test_nobody_stands_in_anything_in_the_scenes_that_come_along(activity: str) -> None:
    motion = rt.synthetic_motion(activity, seed=0, duration_s=2.0)
    for scene in map(Scene.load, scene_files()):
        placed = place(motion, heading_deg=scene.heading_deg)
        body = Body.from_motion(placed.shifted([*scene.person_position_m, 0.0]))
        times = np.arange(0, body.duration_s, 0.02)
        solid = Inside(scene, body)
        solid.look(times, body.at(times), np.ones((len(times), len(body.part_names))))
        assert solid.found(np.ones(len(body.part_names))) == [], scene.name


def box(name: str, x: float, motion: rt.FollowingPath | None = None) -> rt.Object:
    trimesh = pytest.importorskip("trimesh")
    mesh = trimesh.creation.box((0.4, 0.4, 0.4))
    return rt.Object(name, mesh, "wood", position_m=(x, 0.0, 1.0), motion=motion)


def test_parts_in_an_object_that_moves_are_told_while_they_are_in_it() -> None:
    # It comes to where the person is half-way, and goes on.
    path = rt.FollowingPath(velocity_mps=(4, 0, 0))
    solid = Inside(Scene(objects=(box("cart", -2.0, path),)), BODY)
    power = np.full((len(TIMES), len(BODY.part_names)), 1e-3)
    solid.look(TIMES, BODY.at(TIMES), power)
    ((name, within, message),) = solid.found(power.sum(axis=0))
    assert name == "inside_object"
    assert "the middle torso in 'cart' from 0.50 s" in message
    assert 0 < within < 0.3 * power.sum()


def test_objects_in_one_another_are_told_and_what_touches_is_not() -> None:
    path = rt.FollowingPath(velocity_mps=(1, 0, 0))
    both = box("cart", -0.4, path), box("crate", 0.0)
    (limit,) = objects_inside(Scene(objects=both), 1.0)
    assert limit.name == "objects_overlap"
    # At 7 of 10 instants: it touches at the first, and has gone through at the last two.
    assert limit.share == pytest.approx(0.7)
    assert "'cart' in 'crate' from 0.11 s" in limit.message
    assert objects_inside(Scene(objects=(box("cart", -0.4), box("crate", 0.0))), 1.0) == []


STAND = rt.synthetic_motion("punch", duration_s=0.3)


def budget(*places: tuple[float, float]) -> LinkBudget:
    people = [rt.Person(STAND, place, 90.0 * number) for number, place in enumerate(places)]
    body = body_of_people(people, RunSettings())
    return link_budget(build_model("analytic", RADAR, body), RADAR, body, 1000)


def test_power_is_that_of_each_person() -> None:
    together, one, other = budget((0, 1), (1, -1)), budget((0, 1)), budget((-1, 2), (1, -1))
    expected = [one.power, other.person_power[1]]
    np.testing.assert_allclose(together.person_power, expected, rtol=1e-12)
    assert together.power == pytest.approx(sum(together.person_power), rel=1e-12)
    assert one.person_power == (pytest.approx(one.power, rel=1e-12),)


def test_people_inside_one_another_are_refused() -> None:
    with pytest.raises(InputError, match=r"at 0\.\d\d s the synthetic:punch 2: .* is inside"):
        budget((0, 1), (0.05, 1))


def test_a_hand_in_someone_is_a_limit() -> None:
    """The left hand of the second is put into the middle torso of the first."""
    people = [rt.Person(STAND), rt.Person(STAND, (1, 0))]
    body = body_of_people(people, RunSettings())
    poses, power = body.at([0.1]), np.ones((1, 42))
    hand, torso = (
        body.part_names.index(f"synthetic:punch {who}")
        for who in ("2: left hand", "1: middle torso")
    )
    poses.centres[0, hand] = poses.centres[0, torso]
    others = Inside(Scene(), body)
    others.look(np.array([0.1]), poses, power)
    [(name, inside_power, message)] = others.found(power[0])
    assert name == "inside_person"
    assert inside_power == 2.0  # of both, for the centre of the torso is in the hand, too
    assert "the synthetic:punch 2: left hand in 'synthetic:punch 1' from 0.10 s" in message


def test_a_hand_in_two_others_at_once_counts_once() -> None:
    people = [rt.Person(STAND, (x, 0)) for x in (0, 1, 2)]
    body = body_of_people(people, RunSettings())
    poses, power = body.at([0.1]), np.ones((1, 63))
    hands = [index for index, name in enumerate(body.part_names) if name.endswith("left hand")]
    poses.centres[0, hands] = poses.centres[0, hands[0]]
    others = Inside(Scene(), body)
    others.look(np.array([0.1]), poses, power)
    [(_, inside_power, _)] = others.found(power[0])
    assert inside_power == 3.0


def test_who_is_never_in_range_is_named() -> None:
    with pytest.raises(InputError, match="person 'synthetic:punch 2' is never within the range"):
        budget((0, 1), (40, 0))
