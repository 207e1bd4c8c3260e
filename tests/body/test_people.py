from __future__ import annotations

import numpy as np
import pytest

import rtradar as rt
from rtradar.body import PART_NAMES, Bodies
from rtradar.body.people import body_of_people, distinct_names
from rtradar.errors import InputError
from rtradar.settings import RunSettings

WALK = rt.synthetic_motion("walk", duration_s=0.6)
KICK = rt.synthetic_motion("kick", duration_s=0.3)


def test_of_several_people_parts_poses_and_owners_are_those_of_each() -> None:
    people = rt.Person(WALK, (1.0, -0.5), 30.0, 0.1), rt.Person(KICK, (-0.5, 1.0), material="skin")
    together = body_of_people(people, RunSettings(duration_s=0.25))
    alone = [body_of_people([one], RunSettings(duration_s=0.25)) for one in people]
    times = [0.0, 0.1, 0.25]
    poses = together.at(times)
    for number, body in enumerate(alone):
        own = together.owner == number
        for got, expected in zip(poses[:2], body.at(times)[:2], strict=True):
            np.testing.assert_array_equal(got[:, own], expected)
        np.testing.assert_array_equal(poses.semi_axes[own], body.semi_axes)
        assert set(np.array(together.materials)[own]) == {body.material}
    assert together.part_names[0] == f"synthetic:walk: {PART_NAMES[0]}"
    assert together.part_names[-1] == f"synthetic:kick: {PART_NAMES[-1]}"
    assert together.duration_s == 0.25


def test_one_person_has_the_parts_and_the_place_that_they_say() -> None:
    body = body_of_people([rt.Person(WALK, (1.0, -0.5))], RunSettings())
    assert body.part_names == PART_NAMES
    assert not body.owner.any()
    roots = body.motion.at(np.linspace(0, body.duration_s, 300))[0][:, 0]
    np.testing.assert_allclose(roots[:, :2].mean(axis=0), [1.0, -0.5], atol=0.01)


def test_the_shortest_ends_the_capture_and_who_ends_early_rests() -> None:
    people = [rt.Person(WALK), rt.Person(KICK, start_s=0.1)]
    assert body_of_people(people, RunSettings()).duration_s == pytest.approx(0.2)
    longer = body_of_people(people, RunSettings(duration_s=0.5))
    assert isinstance(longer, Bodies)
    assert longer.duration_s == 0.5
    centres = longer.at([0.2, 0.5]).centres
    rests = longer.owner == 1
    np.testing.assert_array_equal(centres[0, rests], centres[1, rests])
    assert (centres[0, ~rests] != centres[1, ~rests]).any()
    with pytest.raises(InputError, match="duration_s = "):
        body_of_people(people, RunSettings(duration_s=0.7))
    with pytest.raises(InputError, match=r"synthetic:kick, 0.3 s long: start_s = 0.4"):
        body_of_people(people, RunSettings(start_s=0.3))


def test_each_person_breathes_in_their_own_way_and_goes_on_while_they_rest() -> None:
    own, usual = rt.Breathing(3.0, 0.5), rt.Breathing(2.0, 0.25, phase_deg=90.0)
    people = [rt.Person(WALK), rt.Person(KICK, breathing=own)]
    options = {"duration_s": 0.5}
    breathing = body_of_people(people, RunSettings(**options, breathing=usual))
    still = body_of_people([rt.Person(WALK), rt.Person(KICK)], RunSettings(**options))
    times = np.array([0.2, 0.3, 0.5])
    moved = np.linalg.norm(breathing.at(times).centres - still.at(times).centres, axis=2)
    chest = [name.endswith("upper torso") for name in breathing.part_names]
    expected = [
        2e-3 * np.sin(2 * np.pi * 0.25 * times + np.pi / 2),
        3e-3 * np.sin(2 * np.pi * 0.5 * times),
    ]
    np.testing.assert_allclose(moved[:, chest].T, np.abs(expected), rtol=1e-9)


def test_names_that_come_twice_are_numbered() -> None:
    assert distinct_names(["a", "b", "a"]) == ("a 1", "b", "a 2")
    assert len(set(distinct_names(["a", "a", "a 1"]))) == 3


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"position_m": (0, 0, 0)}, "position_m = .*2 numbers"),
        ({"position_m": (0, float("nan"))}, "position_m"),
        ({"heading_deg": 400}, "heading_deg = 400"),
        ({"start_s": 1}, "start_s = 1; it must be a number from 0 to 0.6"),
        ({"body": "bones"}, "body = 'bones'; allowed: ellipsoids, mesh"),
        ({"material": 3}, "material = 3"),
        ({"breathing": (3, 0.25)}, r"walk': breathing = \(3, 0.25\); .* of Breathing"),
    ],
)
def test_a_person_without_meaning_is_refused(options: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        rt.Person(WALK, **options)


@pytest.mark.parametrize("people", [[], None, [WALK]])
def test_bodies_are_of_bodies(people: object) -> None:
    with pytest.raises(InputError, match="a list of one Body or more"):
        Bodies(people)  # type: ignore[arg-type]


def test_what_is_no_motion_is_refused() -> None:
    with pytest.raises(InputError, match="Person: motion is a str"):
        rt.Person("walk")  # type: ignore[arg-type]
