"""Who and what is in a scene: those who are given, and those whom the scene has."""

from __future__ import annotations

import rtradar as rt
from rtradar.pipeline.prepare import people_in

WALK = rt.synthetic_motion("walk", duration_s=0.3)
FAN = rt.Object("fan", "fan", "metal", position_m=(1, 1, 1), motion=rt.Turning(rate_hz=5))


def test_people_and_objects_that_are_given_come_before_those_of_the_scene() -> None:
    own, person = rt.Person(WALK, (2.0, 0.0)), rt.Person(WALK, (0.0, 1.0))
    scene = rt.Scene(people=(own,), objects=(FAN,), person_position_m=(1.0, 0.5))
    other = rt.Object("other fan", "fan", "metal", position_m=(2, 1, 1))
    found, everyone = people_in(scene, [person, other, WALK])
    assert [one.name for one in found.objects] == ["other fan", "fan"]
    assert [one.position_m for one in everyone] == [(0.0, 1.0), (1.0, 0.5), (2.0, 0.0)]


def test_an_object_alone_is_nobody() -> None:
    assert people_in(rt.Scene(), [FAN])[1] == ()
