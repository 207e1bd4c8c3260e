from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import rtradar as rt
from rtradar.errors import InputError
from rtradar.motion.formats import save_motion

PERSON = """
[[people]]
motion = "synthetic:walk"
position_m = [0.5, -1.0]
heading_deg = 30
start_s = 0.2
duration_s = 0.5
seed = 3
material = "skin"
breathing = {amplitude_mm = 3, rate_hz = 0.25}
"""


def load(folder: Path, text: str) -> rt.Scene:
    (folder / "duo.toml").write_text(text, encoding="utf-8")
    return rt.Scene.load(folder / "duo.toml")


def test_people_of_a_scene_file(tmp_path: Path) -> None:
    walker, kicker = load(tmp_path, PERSON + '[[people]]\nmotion = "synthetic:kick"').people
    expected = rt.synthetic_motion("walk", seed=3, duration_s=0.5)
    assert (walker.motion.rotations == expected.rotations).all()
    assert walker.position_m == (0.5, -1.0)
    assert (walker.heading_deg, walker.start_s, walker.material) == (30.0, 0.2, "skin")
    assert walker.breathing == rt.Breathing(3, 0.25)
    assert kicker.motion.name == "synthetic:kick"
    assert "people       2: synthetic:walk at (0.5, -1) m, turned by 30°" in repr(
        rt.Scene.load(tmp_path / "duo.toml")
    )


def test_recordings_lie_beside_the_scene(tmp_path: Path, mocap: Path) -> None:
    for name in ("HDM_bd.asf", "HDM_bd_kickLFront1Reps_001_120.amc"):
        shutil.copy(mocap / "hdm05" / name, tmp_path / name)
    text = '[[people]]\nmotion = "{}"\nskeleton = "HDM_bd.asf"'
    recording = "HDM_bd_kickLFront1Reps_001_120.amc"
    assert load(tmp_path, text.format(recording)).people[0].motion.duration_s > 1
    with pytest.raises(InputError, match="leaves the folder"):
        load(tmp_path, text.format("../" + recording))


def test_of_a_recording_a_part_may_be_taken(tmp_path: Path) -> None:
    save_motion(tmp_path / "a.motion", rt.synthetic_motion("walk", duration_s=2.0))
    text = '[[people]]\nmotion = "a.motion"\nstart_s = 0.5\nduration_s = {}'
    (person,) = load(tmp_path, text.format(0.25)).people
    assert (person.start_s, person.motion.duration_s) == (0.5, 0.75)
    assert person.motion.source is not None
    assert person.motion.source.keys["duration_s"] == 0.25
    with pytest.raises(InputError, match=r"duration_s = 1.6; it must be a number from 0 to 1.5"):
        load(tmp_path, text.format(1.6))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("seed = 3", 'seed = "x"'), "number 1 seed = 'x'"),
        (("duration_s = 0.5", "duration_s = true"), "duration_s = True"),
        (("start_s = 0.2", "start_s = 9"), "start_s = 9"),
        (('"synthetic:walk"', "3"), "motion = 3"),
        (("amplitude_mm", "amplitude"), "breathing: .*amplitude"),
        (("seed = 3", 'skeleton = "a.asf"'), "leave skeleton out"),
        (("seed = 3", "size = 3"), "size"),
        (('"synthetic:walk"', '"walk.bvh"'), "only a synthetic actor has it"),
    ],
)
def test_what_has_no_meaning_is_refused(
    tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    with pytest.raises(InputError, match=message):
        load(tmp_path, PERSON.replace(*change))


def test_people_of_a_scene_are_people() -> None:
    walk = rt.synthetic_motion("walk", duration_s=0.5)
    for people in ((walk,), rt.Person(walk), None):
        with pytest.raises(InputError, match="must be a tuple of Person"):
            rt.Scene(people=people)  # type: ignore[arg-type]
