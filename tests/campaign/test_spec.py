"""What a data set file may say, and one line that names the key about everything else."""

from __future__ import annotations

import copy
import pickle
import time
import tracemalloc
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from rtradar.campaign.intervals import Intervals, strike_times
from rtradar.campaign.spec_file import _spec, matching_files, read_spec
from rtradar.errors import InputError, InputErrors
from rtradar.motion import ACTIVITIES, synthetic_motion

SMALL = """
[windows]
duration_s = 2.0
[[synthetic]]
label = "walk"
count = 3
"""
RECORDING = """
[[recordings]]
file = "walk.bvh"
label = "walk"
subject = "her"
licence = "CC0"
"""


def write(folder: Path, text: str) -> Path:
    path = folder / "set.toml"
    path.write_text(text)
    return path


def test_what_is_left_out_has_a_value(tmp_path: Path) -> None:
    spec = read_spec(write(tmp_path, SMALL))
    assert (spec.run.seed, spec.run.pfa, spec.run.clutter_removal) == (0, 1e-6, "none")
    (setting,) = spec.combinations
    assert (setting.radar.name, setting.scene.name, setting.fidelity) == (
        "paper-12ghz",
        "free-space",
        "specular",
    )
    assert spec.drawn["snr_db"] == (20.0, 20.0)
    assert tuple(spec.actors[0].seeds) == (0, 1, 2)
    assert tuple(spec.actors[0].subjects) == tuple(range(10))


def small(old: str, new: str) -> str:
    """`SMALL` with another text in the place of one of its own."""
    assert old in SMALL
    return SMALL.replace(old, new)


def placed(how: str) -> str:
    return small("duration_s = 2.0", f"duration_s = 1.0\n{how}")


def recording(old: str, new: str) -> str:
    assert old in RECORDING
    return RECORDING.replace(old, new)


LISTS = {
    "heading_deg": [number / 10 for number in range(1000)],
    "snr_db": [number / 100 for number in range(10_000)],
    "person_position_m": [[number / 1000, 0] for number in range(10_000)],
}
"""1e11 combinations: to compare all values with each other takes minutes, to make them hours."""


MANY = small("count = 3", "count = 1000000")
WINDOWS = "[windows]\nduration_s = 1\nhop_s = 1e-3\nend_s = 1e5"
SIZES: dict[str, tuple[str, int]] = {
    "a thousand": (SMALL + f"[each]\nheading_deg = {LISTS['heading_deg']}\n", 0),
    "combinations": (
        SMALL + "[each]\n" + "".join(f"{key} = {values}\n" for key, values in LISTS.items()),
        3 * 10**11,
    ),
    "a million takes": (MANY, 0),
    "two million takes": (MANY + '[each]\nfidelity = ["specular", "analytic"]', 2 * 10**6),
    "windows of takes": (small("[windows]\nduration_s = 2.0", WINDOWS), 3 * 99_999_001),
    "windows of a recording": (WINDOWS + RECORDING, 99_999_001),
}
"""Texts, and the number of samples of those that are refused."""


@pytest.mark.parametrize(("text", "count"), SIZES.values(), ids=SIZES)
def test_samples_are_counted_before_they_are_made(tmp_path: Path, text: str, count: int) -> None:
    (tmp_path / "walk.bvh").write_text("")
    path = write(tmp_path, text)
    tracemalloc.start()
    began = time.perf_counter()
    try:
        says = rf"these are {count} samples, .* 1000000 are allowed: split the file"
        with pytest.raises(InputError, match=says) if count else nullcontext():
            read_spec(path)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 200e6
    # Some seconds with the memory watched; hours without the count.
    assert time.perf_counter() - began < 30


def test_every_combination_is_a_setting(tmp_path: Path) -> None:
    each = """
[each]
radar = ["paper-12ghz", "paper-77ghz"]
fidelity = ["analytic", "specular"]
snr_db = [10.0, 20, 30]
person_position_m = [[0, 0], [0.5, 0.5]]
radar_position_m = [[-4, 1, 1]]
"""
    settings = read_spec(write(tmp_path, SMALL + each)).combinations
    assert len(settings) == 2 * 2 * 3 * 2
    assert {setting.scene.person_position_m for setting in settings} == {(0.0, 0.0), (0.5, 0.5)}
    assert {setting.scene.radar_position_m for setting in settings} == {(-4.0, 1.0, 1.0)}


def test_files_are_sought_beside_the_data_set_file(tmp_path: Path) -> None:
    (tmp_path / "walk.bvh").write_text("")
    (tmp_path / "mine.toml").write_text("samples_per_chirp = 128")
    spec = read_spec(write(tmp_path, RECORDING + '[each]\nradar = ["mine.toml"]'))
    assert spec.recordings[0].path == tmp_path / "walk.bvh"
    assert spec.recordings[0].intervals == Intervals()
    assert spec.combinations[0].radar.samples_per_chirp == 128


def test_a_recording_has_windows_of_its_own_where_it_says_so(tmp_path: Path) -> None:
    (tmp_path / "walk.bvh").write_text("")
    text = "[windows]\nduration_s = 2.0\nhop_s = 1.0" + RECORDING + "start_s = 0.5\nend_s = 4.0"
    spec = read_spec(write(tmp_path, text))
    assert spec.recordings[0].intervals == Intervals(0.5, 2.0, 1.0, 4.0)


NONSENSE = [
    ("", "neither [[synthetic]] nor [[recordings]]"),
    ("colour = 1" + SMALL, "unknown key 'colour' (did you mean clouds?); allowed: seed, pfa"),
    ("seed = 1.5" + SMALL, "seed = 1.5; it must be a whole number"),
    ("pfa = 2" + SMALL, "pfa = 2; it must be a number"),
    ('clutter_removal = "magic"' + SMALL, "clutter_removal = 'magic'; allowed: none, mean"),
    ("detector = 'eye'" + SMALL, "detector 'eye' is unknown; allowed: os-cfar"),
    ("range_window = 'square'" + SMALL, "range window 'square' is unknown; allowed: "),
    ("doppler_window = [1, 2]" + SMALL, "doppler_window = [1, 2]; it must be a name"),
    ("windows = 3", "windows = 3; it must be a table"),
    (SMALL + "colour = 1", "[[synthetic]] number 1 unknown key 'colour'"),
    (SMALL + "seeds = [1]", "give count or seeds, one of them"),
    (small("count = 3", ""), "give count or seeds, one of them"),
    (small("count = 3", "count = 0"), "count = 0; it must be a whole number from 1 to"),
    (small("count = 3", "seeds = [1, 1]"), "seeds = [1, 1]; it must be a list of different whole"),
    (small("walk", "dance"), f"label = 'dance'; allowed: {', '.join(ACTIVITIES)}"),
    (SMALL + SMALL[SMALL.index("[[") :], "label = 'walk' is given twice"),
    (small("duration_s = 2.0", ""), "duration_s is missing; synthetic actors have no end"),
    (small("duration_s = 2.0", "duration_s = -1"), "duration_s = -1; it must be a number"),
    (small("duration_s = 2.0", "hop_s = 1"), "hop_s needs duration_s"),
    (placed("end_s = 0.5"), "end_s = 0.5 leaves no room"),
    (placed("length = 1"), "[windows] unknown key 'length'"),
    (placed('place = "middle"'), "place = 'middle'; allowed: regular, random, strike"),
    (placed('place = "random"\ncount = 0'), "count = 0; it must be a whole number from 1 to 10000"),
    (placed('place = "random"\nhop_s = 1.0'), "hop_s has no use where place is 'random'"),
    (placed("count = 2"), "count has no use where place is 'regular'"),
    (SMALL + "[each]\ncolour = [1]", "[each] unknown key 'colour'"),
    (SMALL + "[each]\nradar = 'paper-12ghz'", "[each] radar = 'paper-12ghz'; it must be a list"),
    (SMALL + "[each]\nradar = []", "[each] radar = []; it must be a list, not empty"),
    (SMALL + "[each]\nradar = ['paper-13ghz']", "[each] radar: radar 'paper-13ghz' is unknown"),
    (SMALL + "[each]\nradar = ['none.toml']", "No such file"),
    (SMALL + "[each]\nradar = [1]", "[each] radar = 1; it must be a string"),
    (SMALL + "[each]\nscene = ['moon']", "[each] scene: scene 'moon' is unknown"),
    (SMALL + "[each]\nfidelity = ['perfect']", "[each] fidelity 'perfect' is unknown; allowed: an"),
    (SMALL + "[each]\nsnr_db = [1, 1]", "a value is given twice"),
    (SMALL + "[each]\nsnr_db = [10, 10.0]", "a value is given twice"),
    (SMALL + "[each]\nsnr_db = [1]\n[drawn]\nsnr_db = [1, 2]", "is under [each] and under [drawn]"),
    (SMALL + "[drawn]\ncolour = [1, 2]", "[drawn] unknown key 'colour'"),
    (SMALL + "[drawn]\ntempo = 1", "[drawn] tempo = 1; it must be a range [least, most]"),
    (RECORDING, "[[recordings]] number 1 file = 'walk.bvh': there is no such file"),
    (
        recording("licence", "license"),
        "(did you mean licence?); allowed: file, label, subject, lic",
    ),
    (recording('file = "walk.bvh"', ""), "file is missing; needed: file"),
    (recording('label = "walk"', ""), "label is missing; give it, or have {label} in"),
    (recording("walk.bvh", "*.bvh"), "file = '*.bvh' matches no file in"),
    (recording("walk.bvh", "../*.bvh"), "file = '../*.bvh' leaves the folder"),
    (recording("walk.bvh", "*" * 11), "10 wildcards are allowed"),
    ('folder = "none"' + SMALL, "folder = 'none': there is no such folder"),
    ('folder = "${RTRADAR_NOWHERE}"' + SMALL, "the environment has no such variable"),
    ("[", "is not TOML"),
]


@pytest.mark.parametrize(("text", "says"), NONSENSE)
def test_nonsense_is_refused_in_one_line_that_names_the_key(
    tmp_path: Path, text: str, says: str
) -> None:
    with pytest.raises(InputError) as caught:
        read_spec(write(tmp_path, text))
    lines = getattr(caught.value, "lines", (str(caught.value),))
    assert any(says in line for line in lines)
    assert all(line.startswith("data set file '") for line in lines)
    assert not any("\n" in line for line in lines)


def test_everything_that_is_wrong_is_told_at_once(tmp_path: Path) -> None:
    text = """
pfa = 2
colour = 1
keep = ["sound"]
range_window = 7
[windows]
duration_s = -1
[each]
radar = ["moon", "none.toml"]
snr_db = [10, "loud"]
[drawn]
snr_db = [1, 2]
tempo = [3, 1]
[[synthetic]]
label = "dance"
count = 0
[[synthetic]]
label = "walk"
[[recordings]]
file = "no/*.bvh"
subject = 7
"""
    with pytest.raises(InputErrors) as caught:
        read_spec(write(tmp_path, text))
    says = [
        "unknown key 'colour'", "snr_db is under [each] and under [drawn]", "duration_s = -1",
        "label = 'dance'", "count = 0", "number 2 : give count or seeds", "subject = 7",
        "label is missing", "matches no file", "radar 'moon' is unknown", "none.toml",
        "snr_db = 'loud'", "tempo = [3, 1]", "keep = ['sound']", "range_window = 7", "pfa = 2",
    ]  # fmt: skip
    assert [one for one in says if not any(one in line for line in caught.value.lines)] == []
    assert len(caught.value.lines) == len(says)
    assert pickle.loads(pickle.dumps(caught.value)).lines == caught.value.lines


def test_patterns_find_recordings_subjects_and_activities(tmp_path: Path) -> None:
    for name in ("walk/anna_1.bvh", "walk/anna_2.bvh", "kick/ben_1.bvh", "kick/ben_1.txt"):
        (tmp_path / "all" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "all" / name).touch()
    (tmp_path / "anna.asf").touch()
    (tmp_path / "ben.asf").touch()
    text = '[[recordings]]\nfile = "all/{label}/{subject}_*.bvh"\nskeleton = "{subject}.asf"\n'
    found = read_spec(write(tmp_path, text)).recordings
    assert [(one.name, one.label, one.subject, one.licence) for one in found] == [
        ("all/kick/ben_1.bvh", "kick", "ben", "unknown"),
        ("all/walk/anna_1.bvh", "walk", "anna", "unknown"),
        ("all/walk/anna_2.bvh", "walk", "anna", "unknown"),
    ]
    assert [one.skeleton for one in found] == [
        tmp_path / f"{name}.asf" for name in ("ben", "anna", "anna")
    ]
    text = '[[recordings]]\nfile = "**/*_?.bvh"\nlabel = "moves"\nlicence = "CC0"\n'
    found = read_spec(write(tmp_path, text)).recordings
    assert {(one.label, one.subject, one.licence) for one in found} == {("moves", "unknown", "CC0")}
    assert len(found) == 3


@pytest.mark.parametrize(
    ("pattern", "name", "fields"),
    [
        ("{subject}_{label}_*.bvh", "a_b_c_d.bvh", {"subject": "a", "label": "b"}),
        ("{subject}/{subject}_x.bvh", "a/a_x.bvh", {"subject": "a"}),
        ("{subject}/{subject}_x.bvh", "a/b_x.bvh", None),
        ("**/{label}.bvh", "walk.bvh", {"label": "walk"}),
        ("**/{label}.bvh", "a/b/walk.bvh", {"label": "walk"}),
        ("a[1]*.bvh", "a[1]b.bvh", {}),
        ("a[1]*.bvh", "a1b.bvh", None),
        ("r/**", "r/walk.bvh", {}),
        ("r/**", "r/deep/walk.bvh", None),
    ],
)
def test_a_field_ends_where_the_text_behind_it_begins(
    tmp_path: Path, pattern: str, name: str, fields: dict[str, str] | None
) -> None:
    (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
    (tmp_path / name).touch()
    if fields is None:
        with pytest.raises(InputError, match="matches no file"):
            matching_files("", pattern, tmp_path)
    else:
        assert matching_files("", pattern, tmp_path) == [(name, fields)]


WHOLE: dict[str, Any] = {
    "seed": 1,
    "pfa": 1e-5,
    "clutter_removal": "mean",
    "detector": "ca-cfar",
    "range_window": ["chebwin", 80.0],
    "order": 1,
    "keep_all": False,
    "folder": ".",
    "windows": {"start_s": 0.0, "duration_s": 1.0, "hop_s": 1.0, "end_s": 3.0},
    "each": {
        "radar": ["paper-12ghz"],
        "scene": ["free-space"],
        "fidelity": ["analytic"],
        "heading_deg": [0.0],
        "person_position_m": [[0.0, 0.0]],
        "radar_position_m": [[-4.0, 1.0, 1.0]],
    },
    "drawn": {"snr_db": [10.0, 20.0], "tempo": [0.9, 1.1]},
    "synthetic": [
        {"label": "walk", "count": 2, "subjects": 2},
        {"label": "kick", "seeds": [1], "subjects": [5]},
    ],
    "recordings": [
        {"file": "walk.bvh", "label": "walk", "subject": "her", "licence": "CC0", "start_s": 0.5}
    ],
}
junk = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(max_size=5)
    | st.sampled_from(["walk", "${HOME}", "../x.toml"]),
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=2)
    ),
    max_leaves=4,
)


def places(value: object, here: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """The way to every value inside."""
    items = (
        value.items()
        if isinstance(value, dict)
        else enumerate(value)
        if isinstance(value, list)
        else ()
    )
    return [way for key, inner in items for way in [(*here, key), *places(inner, (*here, key))]]


def test_the_whole_is_understood(tmp_path: Path) -> None:
    (tmp_path / "walk.bvh").write_text("")
    assert len(_spec(WHOLE, tmp_path).actors) == 2


@settings(max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(way=st.sampled_from(places(WHOLE)), value=junk)
def test_whatever_stands_where_a_value_should_gets_one_line_or_is_one(
    tmp_path: Path, way: tuple[Any, ...], value: object
) -> None:
    (tmp_path / "walk.bvh").write_text("")
    table = copy.deepcopy(WHOLE)
    inside: Any = table
    for key in way[:-1]:
        inside = inside[key]
    inside[way[-1]] = value
    lines: tuple[str, ...] = ()
    try:
        _spec(table, tmp_path)
    except InputErrors as errors:
        lines = errors.lines
    except InputError as error:
        lines = (str(error),)
    assert not any("\n" in line for line in lines)


@pytest.mark.parametrize(
    ("windows", "length_s", "expected"),
    [
        (Intervals(), 3.0, [(0.0, 3.0)]),
        (Intervals(start_s=1.0), 3.0, [(1.0, 2.0)]),
        (Intervals(duration_s=2.0), 3.0, [(0.0, 2.0)]),
        (Intervals(0.5, 1.0, 1.0), 3.5, [(0.5, 1.0), (1.5, 1.0), (2.5, 1.0)]),
        (Intervals(0.5, 1.0, 1.0), 3.4, [(0.5, 1.0), (1.5, 1.0)]),
        # 0.6 - 0.3 is less than 3 x 0.1.
        (Intervals(0.0, 0.3, 0.1), 0.6, [(0.0, 0.3), (0.1, 0.3), (0.2, 0.3), (0.3, 0.3)]),
        (Intervals(0.0, 1.0, 0.5, 2.0), 9.0, [(0.0, 1.0), (0.5, 1.0), (1.0, 1.0)]),
    ],
)
def test_intervals_fill_the_recording(
    windows: Intervals, length_s: float, expected: list[tuple[float, float]]
) -> None:
    assert windows.of("walk", length_s) == expected


def test_intervals_lie_round_strikes_or_anywhere_and_never_overlap() -> None:
    actor = synthetic_motion("punch", seed=3, duration_s=8.0)
    strikes = strike_times(actor)
    assert 4 <= len(strikes) <= 16  # about one strike, and one recoil of it, a second
    for place in ("strike", "random"):
        windows = Intervals(0.5, 1.2, end_s=8.0, place=place, count=4)
        several = [windows.of("punch", 8.0, seed, lambda: actor) for seed in range(20)]
        assert several[0] == windows.of("punch", 8.0, 0, lambda: actor) != several[1]
        for found in several:
            starts = np.array([start for start, _ in found])
            assert 1 <= len(starts) <= 4
            assert np.all(np.diff(starts) >= 1.2)
            assert starts[0] >= 0.5
            assert starts[-1] + 1.2 <= 8.0
            if place == "strike":
                into = (strikes[:, None] - starts) / 1.2
                inside = ((into > 0.249) & (into < 0.751)).any(axis=0)
                assert np.all(inside | (starts == 0.5) | (starts == 6.8))  # or at an end


@pytest.mark.parametrize(
    "windows",
    [
        Intervals(duration_s=3.0),
        Intervals(start_s=2.5),
        Intervals(end_s=2.5),
        Intervals(2.0, 1.0, 0.5),
    ],
)
def test_a_recording_that_is_too_short_is_named(windows: Intervals) -> None:
    with pytest.raises(InputError, match=r"recording 'walk' has 2 s, too short"):
        windows.of("walk", 2.0)
