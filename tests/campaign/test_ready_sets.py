"""The data sets that come along can be planned."""

from __future__ import annotations

from pathlib import Path

import pytest

from rtradar.campaign.samples import counts, plan_samples
from rtradar.campaign.spec_file import read_spec
from rtradar.validate import validation_folder

FOUR = ("jumping_jack", "kick", "punch", "walk")


@pytest.mark.parametrize(
    ("name", "each", "settings"),
    [
        ("paper_400", 100, 1),
        ("transfer_free_space", 50, 4),
        ("transfer_room", 50, 2),
        ("noise_100", 25, 1),
    ],
)
def test_every_activity_has_as_many(name: str, each: int, settings: int) -> None:
    found = plan_samples(read_spec(validation_folder() / f"{name}.toml"))
    assert counts(found)["label"] == dict.fromkeys(FOUR, each * settings)
    assert len(counts(found)["subject"]) == 20


def test_both_sets_of_the_transfer_have_the_same_motions() -> None:
    drawn = (
        "recording",
        "tempo",
        "amplitude",
        "build",
        "height_m",
        "heading_deg",
        "snr_db",
        "person_position_m",
        "take",
        "seed",
    )
    free, room = (
        {
            recipe.parameters["recording"]: recipe
            for recipe in plan_samples(read_spec(validation_folder() / f"transfer_{name}.toml"))
        }
        for name in ("free_space", "room")
    )
    assert free.keys() == room.keys()
    for name in free:
        differs = {key for key in drawn if free[name].parameters[key] != room[name].parameters[key]}
        assert differs <= {"person_position_m"}  # which is where the room says, and the same offset


@pytest.mark.slow  # reads all of them
def test_real_recordings_are_of_all_activities(
    mocap: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RTRADAR_MOCAP", str(mocap))
    told = counts(plan_samples(read_spec(validation_folder() / "real_recordings.toml")))
    assert tuple(told["label"]) == FOUR
    assert told["source"] == {"recorded": 92}
