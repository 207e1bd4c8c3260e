"""From a specification to samples: how many, what is drawn, and names that stay."""

from __future__ import annotations

import json
import shutil
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

import rtradar as rt
from rtradar.campaign.intervals import Augmented, mirrored, vary
from rtradar.campaign.samples import SamplePlan, counts, make_sample, plan_samples, scene_digest
from rtradar.campaign.spec_file import read_spec
from rtradar.clouds.collection import Collection
from rtradar.clouds.sample_files import write_index, write_sample
from rtradar.errors import InputError
from rtradar.motion import synthetic_motion
from rtradar.motion.skeleton import NODES
from rtradar.settings import RunSettings
from rtradar.validate import validation_folder

HEAD = """
[windows]
duration_s = 1.0
[drawn]
heading_deg = [-30, 30]
snr_db = [10, 30]
offset_x_m = [-0.5, 0.5]
"""
BVH = (
    """HIERARCHY
ROOT hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  End Site
  {
    OFFSET 0 100 0
  }
}
MOTION
Frames: 31
Frame Time: 0.1
"""
    + "0 90 0 0 0 0\n" * 31
)


def planned(folder: Path, text: str, seed: int = 0) -> list[SamplePlan]:
    path = folder / "set.toml"
    path.write_text(f"seed = {seed}\n{text}")
    return plan_samples(read_spec(path))


def actors(count: int, *labels: str) -> str:
    return "".join(
        f'[[synthetic]]\nlabel = "{label}"\ncount = {count}\nsubjects = 3\n' for label in labels
    )


def recording(folder: Path, *, moved: int = 0, **keys: object) -> str:
    (folder / "walk.bvh").write_text(BVH.replace("0 90 0 0 0 0\n", f"{moved} 90 0 0 0 0\n", 1))
    own = "".join(f"{key} = {value}\n" for key, value in keys.items())
    head = '[[recordings]]\nfile = "walk.bvh"\nlabel = "walk"\nsubject = "her"\nlicence = "CC0"\n'
    return head + own


def test_every_take_meets_every_setting(tmp_path: Path) -> None:
    each = '[each]\nradar = ["paper-12ghz", "paper-77ghz"]\nfidelity = ["analytic", "specular"]\n'
    text = HEAD + each + actors(5, "walk", "kick") + recording(tmp_path, hop_s=0.5)
    found = planned(tmp_path, text)
    assert len(found) == (5 + 5 + 5) * 4  # 3 s every 0.5 s: five intervals of 1 s
    told = counts(found)
    assert told["label"] == {"kick": 20, "walk": 40}
    assert told["source"] == {"recorded": 20, "synthetic": 40}
    assert told["radar"] == {"paper-12ghz": 30, "paper-77ghz": 30}
    assert told["fidelity"] == {"analytic": 30, "specular": 30}
    assert told["subject"] == {"her": 20, "synthetic-0": 16, "synthetic-1": 16, "synthetic-2": 8}


def test_a_motion_is_the_same_for_every_setting(tmp_path: Path) -> None:
    each = '[each]\nfidelity = ["analytic", "specular"]\n'
    found = planned(tmp_path, HEAD + each + actors(4, "walk"))
    by_take = defaultdict(list)
    for recipe in found:
        by_take[recipe.parameters["recording"]].append(recipe)
    assert len(by_take) == 4
    for one, other in by_take.values():
        differs = {key for key in one.parameters if one.parameters[key] != other.parameters[key]}
        assert differs == {"fidelity"}


def test_ids_do_not_depend_on_what_else_there_is_or_where(tmp_path: Path) -> None:
    other = tmp_path / "elsewhere"
    other.mkdir()
    small = planned(tmp_path, HEAD + actors(3, "walk") + recording(tmp_path))
    large = planned(other, HEAD + actors(9, "kick", "walk") + recording(other, hop_s=0.5))
    few, many = ({recipe.identity for recipe in found} for found in (small, large))
    assert len(few) == 4
    assert few < many


def test_an_id_is_of_all_that_a_sample_follows_from(tmp_path: Path) -> None:
    texts = [
        HEAD + actors(1, "walk"),
        HEAD + actors(1, "kick"),
        "pfa = 1e-5\n" + HEAD + actors(1, "walk"),
        HEAD.replace("30]", "31]") + actors(1, "walk"),
        HEAD.replace("1.0", "1.1") + actors(1, "walk"),
        HEAD + actors(1, "walk") + '[each]\nscene = ["living-room"]',
        HEAD + recording(tmp_path),
    ]
    found = [planned(tmp_path, text)[0].identity for text in texts]
    found += [planned(tmp_path, texts[0], seed=1)[0].identity]
    found += [planned(tmp_path, HEAD + recording(tmp_path, moved=1))[0].identity]
    assert len(set(found)) == len(found)


def test_an_id_is_the_same_tomorrow() -> None:
    recipe = SamplePlan("walk", {"b": [1, 2.5], "a": "x"}, None, None)  # type: ignore[arg-type]
    assert recipe.identity == "d0a8e28dc6775d9616b6"


def test_what_is_drawn_is_the_same_tomorrow(tmp_path: Path) -> None:
    (recipe,) = planned(tmp_path, HEAD + actors(1, "walk"))
    # The first eight digits that sha256sum gives for (0, 'walk', 0), and for ('subject', 0).
    assert recipe.parameters["seed"] == recipe.parameters["take"] == 0x94DE7F0B
    seeds = (0x94DE7F0B, 0xC9D761C3)
    take, subject = (np.random.default_rng([seed, 0]).random(8) for seed in seeds)
    drawn = {
        "heading_deg": -30 + 60 * take[0], "snr_db": 10 + 20 * take[1],
        "tempo": 0.8 + 0.45 * take[4], "amplitude": 0.8 + 0.3 * take[5],
        "build": 0.8 + 0.45 * subject[6], "height_m": 1.55 + 0.4 * subject[7],
    }  # fmt: skip
    told = {key: recipe.parameters[key] for key in drawn}
    assert told == {key: round(value, 4) for key, value in drawn.items()}


def test_what_is_drawn_is_added_to_the_place_and_what_each_gives_is_not_drawn(
    tmp_path: Path,
) -> None:
    drawn = "[drawn]\nheading_deg = [7, 7]\noffset_x_m = [0.25, 0.25]\noffset_y_m = [-0.5, -0.5]\n"
    each = "[each]\nsnr_db = [3]\nperson_position_m = [[1.0, 2.0]]\n"
    each += "radar_position_m = [[-3, 0, 1.5]]\n"
    text = "[windows]\nduration_s = 1.0\n" + drawn + each
    (recipe,) = planned(tmp_path, text + actors(1, "walk"))
    told = recipe.parameters
    assert (told["heading_deg"], told["snr_db"]) == (7, 3)
    assert told["person_position_m"] == list(recipe.scene.person_position_m) == [1.25, 1.5]
    assert told["radar_position_m"] == list(recipe.scene.radar_position_m or ()) == [-3, 0, 1.5]
    (other,) = planned(tmp_path, HEAD + actors(1, "walk"))
    assert other.parameters["radar_position_m"] == [-4, 1, 1]  # the radar's own


def test_nothing_but_the_motion_tells_the_label(tmp_path: Path) -> None:
    found = planned(tmp_path, HEAD + actors(60, "walk", "kick"))
    ranges = {
        "heading_deg": (-30, 30), "snr_db": (10, 30), "tempo": (0.8, 1.25),
        "amplitude": (0.8, 1.1), "build": (0.8, 1.25), "height_m": (1.55, 1.95),
    }  # fmt: skip
    for key, (low, high) in ranges.items():
        values = {
            label: np.array([r.parameters[key] for r in found if r.label == label])
            for label in ("walk", "kick")
        }
        for drawn in values.values():
            assert drawn.min() >= low
            assert drawn.max() <= high
        if key not in ("build", "height_m"):  # which are those of the same three people
            # Means of 60 uniform values each: five standard deviations of their difference.
            spread = (high - low) / np.sqrt(12) * np.sqrt(2 / 60)
            assert abs(values["walk"].mean() - values["kick"].mean()) < 5 * spread


def test_a_subject_has_one_body_in_all_activities(tmp_path: Path) -> None:
    bodies = defaultdict(set)
    for recipe in planned(tmp_path, HEAD + actors(6, "walk", "punch")):
        told = recipe.parameters
        bodies[told["subject"]].add((told["build"], told["height_m"]))
    assert len(bodies) == 3
    assert all(len(body) == 1 for body in bodies.values())
    assert len(set.union(*bodies.values())) == 3


def test_a_range_that_changes_moves_no_other(tmp_path: Path) -> None:
    (one,) = planned(tmp_path, HEAD + actors(1, "walk"))
    (other,) = planned(tmp_path, HEAD + "tempo = [1.0, 1.0]\n" + actors(1, "walk"))
    differs = {key for key in one.parameters if one.parameters[key] != other.parameters[key]}
    assert differs == {"tempo"}


def test_parameters_are_plain_json_and_tell_what_a_reader_needs(tmp_path: Path) -> None:
    for recipe in planned(tmp_path, HEAD + actors(1, "walk") + recording(tmp_path)):
        assert json.loads(json.dumps(dict(recipe.parameters))) == recipe.parameters
        needed = "recording subject source start_s duration_s radar scene fidelity "
        needed += "snr_db heading_deg seed licence version"
        assert set(needed.split()) <= set(recipe.parameters)


def test_what_is_sent_of_a_recording_is_what_its_interval_needs(tmp_path: Path) -> None:
    (recipe,) = planned(tmp_path, HEAD.replace("1.0", "0.2") + recording(tmp_path, start_s=1.0))
    packed = recipe.packed()
    assert packed.identity == recipe.identity
    assert packed.motion is not None
    assert packed.motion.duration_s == 0.2


def test_an_interval_to_the_end_may_be_rounded_up(tmp_path: Path) -> None:
    text = recording(tmp_path)
    # 29 / 15 s = 1.93333...
    third = BVH.replace("Frame Time: 0.1", f"Frame Time: {1 / 15}").replace("31", "30")
    (tmp_path / "walk.bvh").write_text(third.rstrip().rpartition("\n")[0] + "\n")
    (recipe,) = planned(tmp_path, text)
    packed = recipe.packed().motion
    assert packed is not None
    assert recipe.interval_s == 1.933333
    assert packed.duration_s == pytest.approx(29 / 15, abs=1e-6)
    text = text.replace("[[recordings]]", "[[recordings]]\nstart_s = 0.266666")
    (later,) = planned(tmp_path, text)
    assert later.interval_s == 1.666667
    assert later.packed().motion is not None


def test_settings_of_a_run_reach_the_sample_and_change_ids_where_they_are_not_the_usual_ones(
    tmp_path: Path,
) -> None:
    text = HEAD + actors(1, "walk")
    usual = RunSettings().range_window
    other = 'range_window = ["chebwin", 80]\ndetector = "ca-cfar"\nkeep_all = true\n'
    (plain,), (same,), (changed,) = (
        planned(tmp_path, more + text)
        for more in ("", f'range_window = "{usual}"\norder = 1\n', other)
    )
    assert plain.identity == same.identity != changed.identity
    settings = changed.run_settings()
    assert (settings.range_window, settings.doppler_window) == (("chebwin", 80.0), usual)
    assert (settings.detector, settings.keep_all, settings.variant) == ("ca-cfar", True, "cpu")
    assert settings.snr_db == changed.parameters["snr_db"]
    assert settings.seed == changed.parameters["seed"]


def test_one_interval_twice_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"'walk.bvh' from 0 s is given twice; leave one out"):
        planned(tmp_path, HEAD + recording(tmp_path) * 2)


def test_a_recording_of_too_many_intervals_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("rtradar.campaign.spec.MOST_SAMPLES", 20)
    text = "[windows]\nduration_s = 1.0\nhop_s = 0.1\n" + recording(tmp_path)
    with pytest.raises(InputError, match="these are 21 samples, 21 intervals under 1 combinations"):
        planned(tmp_path, text)
    monkeypatch.setattr("rtradar.campaign.spec.MOST_SAMPLES", 21)
    assert len(planned(tmp_path, text)) == 21


def test_a_recording_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    text = HEAD + recording(tmp_path)
    (tmp_path / "walk.bvh").write_text("nothing")
    with pytest.raises(InputError, match=r"walk\.bvh"):
        planned(tmp_path, text)


# -- several people ------------------------------------------------------------------------------

OTHERS = '[others]\ncount = 2\nlabels = ["stand"]\nx_m = [-1, 1]\ny_m = [-2, 2]\n'


def test_others_are_drawn_apart_from_everyone_and_the_same_again(tmp_path: Path) -> None:
    plans = planned(tmp_path, HEAD + OTHERS + actors(4, "kick"))
    assert plans == planned(tmp_path, HEAD + OTHERS + actors(4, "kick"))
    assert len({json.dumps(plan.parameters["others"]) for plan in plans}) == 4
    for plan in plans:
        others = plan.parameters["others"]
        assert [one["label"] for one in others] == ["stand"] * 2
        places = np.array([plan.scene.person_position_m, *(one["position_m"] for one in others)])
        gaps = np.linalg.norm(places[:, None] - places, axis=-1)[np.triu_indices(3, 1)]
        assert gaps.min() >= 1.0
        assert (np.abs(places[1:]) <= [1, 2]).all()
    alone = planned(tmp_path, HEAD + actors(4, "kick"))
    assert "others" not in alone[0].parameters
    assert not {plan.identity for plan in alone} & {plan.identity for plan in plans}


def test_people_of_a_scene_belong_to_its_digest() -> None:
    walk, other = (rt.synthetic_motion("walk", seed=seed, duration_s=0.5) for seed in (0, 1))
    people = rt.Person(walk), rt.Person(walk, (1, 0)), rt.Person(other)
    found = [scene_digest(rt.Scene(people=(person,))) for person in people]
    assert len({*found, scene_digest(rt.Scene())}) == 4
    assert scene_digest(rt.Scene(people=(rt.Person(walk),))) == found[0]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("count = 2", "count = 9"), "count = 9"),
        (("count = 2", "count = true"), "count = True"),
        (("count = 2\n", ""), "count"),
        (('["stand"]', '["fly"]'), "labels = "),
        (('["stand"]', '[["stand"]]'), "labels = "),
        (('["stand"]', "[]"), "labels = "),
        (("[-1, 1]", "[1, -1]"), r"\[others\] x_m"),
        (("[-2, 2]", "[0, 0.1]"), "hold no place 1 m from"),
    ],
)
def test_others_without_meaning_are_refused(
    tmp_path: Path, change: tuple[str, str], message: str
) -> None:
    text = OTHERS.replace(*change)
    if "0.1" in change[1]:
        text = text.replace("[-1, 1]", "[0, 0.1]")
    with pytest.raises(InputError, match=message):
        planned(tmp_path, HEAD + text + actors(1, "kick"))


def test_every_recording_that_is_too_short_is_named_or_left_out(tmp_path: Path) -> None:
    both = recording(tmp_path, duration_s=2.0)
    for name, frames in (("short", 11), ("shorter", 6)):
        text = BVH.replace("Frames: 31", f"Frames: {frames}").partition("0 90 0")[0]
        (tmp_path / f"{name}.bvh").write_text(text + "0 90 0 0 0 0\n" * frames)
        both += recording(tmp_path, duration_s=2.0).replace("walk.bvh", f"{name}.bvh")
    with pytest.raises(InputError) as caught:
        planned(tmp_path, HEAD + both)
    lines = str(caught.value).splitlines()
    assert [line.partition(", too")[0] for line in lines] == [
        f"recording '{name}' has {length} s"
        for name, length in (("short.bvh", 1), ("shorter.bvh", 0.5))
    ]
    assert all("skip_short = true" in line for line in lines)
    with pytest.warns(rt.ValidityWarning) as said:
        found = planned(tmp_path, "skip_short = true\n" + HEAD + both)
    assert [plan.parameters["recording"] for plan in found] == ["walk.bvh"]
    assert sum("left out" in str(one.message) for one in said) == 2


def test_random_rooms_are_one_for_each_interval(tmp_path: Path) -> None:
    text = 'random_rooms = true\n[windows]\nduration_s = 0.5\n[each]\nfidelity = ["analytic"]\n'
    text += '[[synthetic]]\nlabel = "walk"\ncount = 3\n'
    file = tmp_path / "set.toml"
    file.write_text(text)
    planned = plan_samples(read_spec(file))
    assert len({plan.parameters["scene_digest"] for plan in planned}) == 3
    assert {plan.kind[1] for plan in planned} == {"random"}
    assert all(plan.scene.walls for plan in planned)
    again = plan_samples(read_spec(file))
    assert [plan.identity for plan in again] == [plan.identity for plan in planned]
    file.write_text(text.replace("[each]", '[each]\nscene = ["living-room"]'))
    with pytest.raises(InputError, match="leave scene and radar_position_m under"):
        read_spec(file)


PLAIN = {"mirror": False, "tempo": 1.0, "height": 1.0, "build": 1.0} | {
    "drift_mps": 0.0,
    "drift_deg": 0.0,
}


def test_a_mirrored_person_moves_the_other_side_alike() -> None:
    kicker = synthetic_motion("kick", seed=1, duration_s=2.0)
    other = mirrored(kicker)
    times = np.linspace(0, 2, 50)
    here, there = kicker.at(times)[0], other.at(times)[0]
    for node in NODES:
        twin = {"l": "r", "r": "l"}.get(node[0], "") + node[1:] if node[1] == "_" else node
        place, opposite = (NODES.index(name) for name in (node, twin))
        assert there[:, opposite] == pytest.approx(here[:, place] * [1, -1, 1], abs=1e-9)
    assert mirrored(other).positions == pytest.approx(kicker.positions, abs=1e-12)


def test_tempo_height_build_and_drift_are_those_that_are_said() -> None:
    walker = synthetic_motion("walk", seed=1, duration_s=2.0)
    how = PLAIN | {"tempo": 1.25, "height": 1.1, "build": 0.9, "drift_mps": 0.4, "drift_deg": 90.0}
    other = vary(walker, how)
    assert other.duration_s == pytest.approx(1.6)
    assert other.girth == pytest.approx(walker.girth * 1.1 * 0.9)
    times = np.linspace(0, 1.6, 40)
    expected = 1.1 * walker.at(1.25 * times)[0] + 0.4 * times[:, None, None] * [0, 1, 0]
    # PCHIP of a sum is not the sum of both, to some micrometres.
    assert other.at(times)[0] == pytest.approx(expected, abs=2e-5)
    assert vary(walker, PLAIN).positions == pytest.approx(walker.positions)


def test_copies_never_reach_beyond_the_recording() -> None:
    augmented = Augmented(1)
    for seed in range(200):
        drawn = augmented.draw(seed, 0.4, 1.6, 2.05)
        assert drawn["start_s"] >= 0
        assert drawn["start_s"] + 1.6 * drawn["varied"]["tempo"] <= 2.05 + 1e-9
    assert len({augmented.draw(seed, 0.4, 1.6, 9.0)["start_s"] for seed in range(9)}) == 9


def test_a_data_set_has_the_copies_beside_the_recording(
    tmp_path: Path, small_file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    walker = synthetic_motion("walk", seed=2, duration_s=1.5)
    monkeypatch.setattr("rtradar.campaign.samples.load_motion", lambda path, skeleton: walker)
    (tmp_path / "walk.bvh").touch()
    shutil.copy(small_file, tmp_path)
    text = (
        "[windows]\nduration_s = 0.5\nstart_s = 0.5\n[augmented]\ncopies = 3\n[each]\n"
        'fidelity = ["analytic"]\nradar = ["small.toml"]\n'
        '[[recordings]]\nfile = "walk.bvh"\nlabel = "walk"\n'
    )
    (tmp_path / "set.toml").write_text(text)
    plans = plan_samples(read_spec(tmp_path / "set.toml"))
    assert len({plan.identity for plan in plans}) == 4
    assert sum("varied" in plan.parameters for plan in plans) == 3
    copy = next(plan for plan in plans if "varied" in plan.parameters)
    assert len(make_sample(copy.packed()).sample.points)
    (tmp_path / "set.toml").write_text(text.replace("copies = 3", "copies = 3\nmirror = true"))
    with pytest.raises(InputError, match=r"\[augmented\] .*mirror"):
        read_spec(tmp_path / "set.toml")


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
        "recording tempo amplitude build height_m heading_deg snr_db person_position_m take seed"
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
        differs = {
            key for key in drawn.split() if free[name].parameters[key] != room[name].parameters[key]
        }
        assert differs <= {"person_position_m"}  # which is where the room says, and the same offset


@pytest.mark.slow  # reads all of them
def test_real_recordings_are_of_all_activities(
    mocap: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RTRADAR_MOCAP", str(mocap))
    told = counts(plan_samples(read_spec(validation_folder() / "real_recordings.toml")))
    assert tuple(told["label"]) == FOUR
    assert told["source"] == {"recorded": 92}


MOUNT = """
[each]
radar = ["iwr1443"]
fidelity = ["analytic"]
snr_db = ["physical"]
[drawn]
radar_up_m = [0.1, 0.3]
radar_pitch_deg = [-20.0, -10.0]
noise_db = [5.0, 10.0]
"""


def test_where_a_radar_is_put_up_and_its_noise_are_drawn(tmp_path: Path) -> None:
    found = planned(tmp_path, "[windows]\nduration_s = 0.1\n" + MOUNT + actors(4, "stand"))
    board = rt.Radar.preset("iwr1443")
    usual = rt.Scene.load("free-space").radar_place(board)
    radars = [plan.radar for plan in found]
    for radar, plan in zip(radars, found, strict=True):
        assert radar.position_m[:2] == usual[:2]
        assert 0.1 <= radar.position_m[2] - usual[2] <= 0.3001
        assert -20 <= radar.pitch_deg <= -10
        assert 5 <= (radar.noise_figure_db or 0) - (board.noise_figure_db or 0) <= 10
        assert plan.parameters["radar_position_m"] == list(radar.position_m)
        assert plan.parameters["snr_db"] == "physical"
    assert len({radar.pitch_deg for radar in radars}) == 4


def test_antennas_that_are_not_turned_leave_the_names_of_samples_as_they_were(
    tmp_path: Path,
) -> None:
    text = HEAD + '[each]\nradar = ["iwr1443"]\nfidelity = ["analytic"]\n' + actors(1, "walk")
    (plan,) = planned(tmp_path, text)
    antenna = plan.parameters["radar_parameters"]["tx_antenna"]
    assert "angles_deg" not in antenna
    assert plan.radar.tx_antenna == rt.Antenna(**antenna)


def test_actors_may_have_a_style_and_ranges_of_their_own(tmp_path: Path) -> None:
    own = 'style = "hop"\ndrawn = { offset_x_m = [2.0, 3.0] }\n'
    found = planned(tmp_path, HEAD + actors(2, "jump") + actors(2, "jump") + own)
    hops = [plan for plan in found if plan.parameters.get("style") == "hop"]
    others = [plan for plan in found if "style" not in plan.parameters]
    assert (len(hops), len(others)) == (2, 2)
    assert all(2 <= plan.parameters["person_position_m"][0] <= 3 for plan in hops)
    assert all(abs(plan.parameters["person_position_m"][0]) <= 0.5 for plan in others)
    # What was planned before there were styles keeps its identity.
    before = planned(tmp_path, HEAD + actors(2, "jump"))
    assert [plan.identity for plan in before] == [plan.identity for plan in others]
    for text, words in (
        ('style = "crawl"\n', "style = 'crawl'; allowed for jump: high, hop"),
        ("drawn = { tempi = [1, 2] }\n", "drawn: unknown key 'tempi'"),
    ):
        with pytest.raises(InputError, match=words):
            planned(tmp_path, HEAD + actors(2, "jump") + text)


def test_whole_clouds_have_the_time_and_the_velocity_of_each_point(tmp_path: Path) -> None:
    text = "whole_clouds = true\n" + HEAD + '[each]\nfidelity = ["analytic"]\n' + actors(1, "kick")
    (plan,) = planned(tmp_path, text)
    made = make_sample(plan.packed())
    write_sample(tmp_path, plan.identity, made.sample, made.spatial, made.maps)
    write_index(tmp_path, [plan.identity])
    found = Collection(tmp_path).whole_cloud(0)
    assert found.shape == (made.sample.provenance["xyz_points_found"], 5)
    assert (np.diff(found[:, 0]) >= 0).all()
    np.testing.assert_array_equal(found[:, 1:4], made.spatial)
    assert np.abs(found[:, 4]).max() > 2  # a foot
    with pytest.raises(InputError, match="whole_clouds = true needs spatial clouds"):
        planned(tmp_path, "angles = false\n" + text)
    (plain,) = planned(tmp_path, text.replace("whole_clouds = true\n", ""))
    made = make_sample(plain.packed())
    write_sample(tmp_path, plain.identity, made.sample, made.spatial, made.maps)
    write_index(tmp_path, [plain.identity])
    with pytest.raises(InputError, match="has no whole clouds"):
        Collection(tmp_path).whole_cloud(0)
