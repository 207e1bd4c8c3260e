from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

import rtradar as rt
from rtradar.body.people import body_of_people
from rtradar.pipeline.output.truth import truth_of
from rtradar.pipeline.output.writer import open_maps
from rtradar.settings import RunSettings

RADAR = replace(rt.Radar.preset("paper-12ghz"), tx_y=1, tx_z=0, rx_y=2, rx_z=0)
WALK = rt.synthetic_motion("walk", duration_s=0.5)
KICK = rt.synthetic_motion("kick", duration_s=0.2)


def test_truth_is_that_of_each_motion() -> None:
    people = rt.Person(WALK, (1, 0.5)), rt.Person(KICK, (-1, -0.5))
    body = body_of_people(people, RunSettings(duration_s=0.4))
    times = np.array([0.1, 0.3])
    truth = truth_of(body, times)
    alone = [
        body_of_people([rt.Person(WALK, (1, 0.5))], RunSettings(duration_s=0.4)),
        body_of_people([rt.Person(KICK, (-1, -0.5))], RunSettings()),
    ]
    for number, (one, own) in enumerate(zip(alone, (times, [0.1, 0.2]), strict=True)):
        joints = one.motion.at(own)[0]
        np.testing.assert_array_equal(truth["joints"][:, number], joints)
        np.testing.assert_array_equal(truth["person_position"][:, number], joints[:, 0])
    before, after = (alone[0].motion.at(times + step)[0][:, 0] for step in (-1e-4, 1e-4))
    speed = np.linalg.norm(after - before, axis=1) / 2e-4
    np.testing.assert_allclose(truth["person_speed"][:, 0], speed, rtol=1e-2)
    assert truth["person_speed"][1, 1] == 0.0


def test_maps_of_a_run_hold_the_truth(tmp_path: Path) -> None:
    result = rt.run(
        [rt.Person(WALK, (1, 0.5)), rt.Person(WALK, (-1, -0.5))],
        RADAR,
        duration_s=0.15,
        fidelity="analytic",
        out=tmp_path,
        pictures=False,
    )
    with open_maps(tmp_path / "maps.h5") as maps:
        assert maps["joints"].dims == ("time", "person", "joint", "coordinate")
        assert list(maps["person"].values) == ["synthetic:walk 1", "synthetic:walk 2"]
        place = maps["person_position"].sel(person="synthetic:walk 2", coordinate="x")
        np.testing.assert_allclose(place, -1, atol=0.2)
        assert maps["person_speed"].attrs["units"] == "m/s"
    assert [person["name"] for person in result.summary["people"]] == list(maps["person"].values)
