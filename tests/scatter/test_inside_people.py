from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import rtradar as rt
from rtradar.body.people import body_of_people
from rtradar.errors import InputError
from rtradar.scatter import build_model
from rtradar.scatter.inside_people import InsidePeople
from rtradar.scatter.link_budget import LinkBudget, link_budget
from rtradar.settings import RunSettings

RADAR = replace(rt.Radar.preset("paper-12ghz"), tx_y=2, tx_z=0, rx_y=2, rx_z=0)
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
    inside = InsidePeople(body)
    inside.look(np.array([0.1]), poses, power)
    [(name, inside_power, message)] = inside.found()
    assert name == "inside_person"
    assert inside_power == 2.0  # of both, for the centre of the torso is in the hand, too
    assert "the synthetic:punch 2: left hand in 'synthetic:punch 1' from 0.10 s" in message


def test_who_is_never_in_range_is_named() -> None:
    with pytest.raises(InputError, match="person 'synthetic:punch 2' is never within the range"):
        budget((0, 1), (40, 0))
