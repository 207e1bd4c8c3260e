"""Specification of a data set, and its reader from TOML; errors are one line that names the key.

The page on data sets, ``docs/data-sets.md``, lists the keys and has an example.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from rtradar.campaign.kept import KEPT, sizes
from rtradar.campaign.patterns import FIELD, file_in, matching_files
from rtradar.clouds.sample_files import UNKNOWN
from rtradar.errors import InputError, InputErrors
from rtradar.motion import ACTIVITIES
from rtradar.process import CLUTTER_REMOVALS, DETECTORS, WindowFunctions, measured_angles
from rtradar.radar import Radar
from rtradar.scatter import MODELS
from rtradar.scatter.common.polarization import BODY_MATERIALS
from rtradar.scene import Scene
from rtradar.settings import RunSettings
from rtradar.system.checks import (
    Complaints,
    Table,
    brief,
    check_number,
    check_text,
    check_vector,
    inside,
    read_toml,
    table_at,
    tables_at,
    wrong_keys,
)
from rtradar.system.seeds import check_seed

DRAWN: Mapping[str, tuple[tuple[float, float], float, float]] = {
    "heading_deg": ((0.0, 0.0), -360.0, 360.0),
    "snr_db": ((20.0, 20.0), -100.0, 200.0),
    "offset_x_m": ((0.0, 0.0), -100.0, 100.0),
    "offset_y_m": ((0.0, 0.0), -100.0, 100.0),
    "tempo": ((0.8, 1.25), 0.4, 2.0),
    "amplitude": ((0.8, 1.1), 0.3, 1.25),
    "build": ((0.8, 1.25), 0.4, 2.5),
    "height_m": ((1.55, 1.95), 0.8, 2.5),
}
"""Quantities drawn at random: default range, smallest and largest allowed value."""

MOST_SAMPLES = 1_000_000
"""Largest number of samples of a data set; the plan of each takes some 2 kB of memory."""

INTERVAL_KEYS = ("start_s", "duration_s", "hop_s", "end_s")
"""Keys of the intervals in files."""

_NAMED = {
    "clutter_removal": CLUTTER_REMOVALS,
    "detector": DETECTORS,
    "body_material": BODY_MATERIALS,
}
_WINDOWS = ("range_window", "doppler_window")
_SWITCHES = ("keep_all", "spreading")
RUN_KEYS = ("pfa", *_NAMED, *_WINDOWS, "order", *_SWITCHES)
"""Settings of a run that a file may give for all samples."""

RUN_LIMITS: Mapping[str, tuple[float, float]] = {"pfa": (1e-15, 0.5), "order": (0, 3)}
"""Limits of those that are numbers."""

_TOP = ("seed", *RUN_KEYS, "keep", "folder", "windows", "each", "drawn", "synthetic", "recordings")
EACH: Mapping[str, list[Any]] = {
    "radar": ["paper-12ghz"],
    "scene": ["free-space"],
    "fidelity": ["specular"],
    "heading_deg": [None],
    "snr_db": [None],
    "person_position_m": [None],
    "radar_position_m": [None],
}
"""Keys of ``[each]`` with their defaults; None means drawn at random or given by the scene."""

_SYNTHETIC = ("label",), ("count", "seeds", "subjects")
_RECORDING = ("file",), ("label", "subject", "licence", "skeleton", *INTERVAL_KEYS)
_MOST = 1_000_000
_VARIABLE = re.compile(r"\$\{(\w+)\}(?=/|$)")
_SLACK_S = 1e-6  # by which rounding may shorten a recording


@dataclass(frozen=True)
class Intervals:
    """Intervals of ``duration_s`` from ``start_s`` on, one every ``hop_s``, all before ``end_s``.

    Without ``duration_s`` there is one interval to the end, without ``hop_s`` a single one, and
    without ``end_s`` the recording ends them.
    """

    start_s: float = 0.0
    duration_s: float | None = None
    hop_s: float | None = None
    end_s: float | None = None

    @classmethod
    def read(cls, where: str, table: Mapping[str, Any]) -> Intervals:
        """Read the intervals from a table whose keys are known; InputError for invalid values."""
        least = {"start_s": 0.0, "duration_s": 1e-3, "hop_s": 1e-3, "end_s": 1e-3}
        given = {
            key: check_number(where, key, table[key], least[key], 1e5)
            for key in INTERVAL_KEYS
            if key in table
        }
        found = cls(**given)
        if found.hop_s is not None and found.duration_s is None:
            raise InputError(f"{where}: hop_s needs duration_s; give both")
        needed = found.start_s + (found.duration_s or 1e-3) - _SLACK_S
        if found.end_s is not None and found.end_s < needed:
            raise InputError(
                f"{where}: end_s = {found.end_s:g} leaves no room for one interval "
                f"from {found.start_s:g} s on"
            )
        return found

    @property
    def needed_s(self) -> float | None:
        """Length of a recording that all intervals need [s]; None if not known in advance."""
        if self.end_s is not None:
            return self.end_s
        return None if self.duration_s is None else self.start_s + self.duration_s

    def count(self, length_s: float | None = None) -> int:
        """Count the intervals of a recording of this length [s]; a lower bound for None."""
        end = length_s if self.end_s is None else self.end_s
        if self.hop_s is None or self.duration_s is None or end is None:
            return 1
        return 1 + math.floor((end - self.start_s - self.duration_s + _SLACK_S) / self.hop_s)

    def of(self, name: str, length_s: float) -> list[tuple[float, float]]:
        """Return start and duration [s] of each interval of a recording of this length [s].

        InputError if the recording is too short for one.
        """
        end = length_s if self.end_s is None else self.end_s
        needed = self.start_s + (self.duration_s or 1e-3)
        if max(end, needed) > length_s + _SLACK_S:
            raise InputError(
                f"recording '{name}' has {length_s:.6g} s, "
                f"too short for an interval from {self.start_s:g} to "
                f"{max(end, needed):.6g} s; shorten it (start_s, duration_s, end_s)"
            )
        if self.duration_s is None:
            return [(self.start_s, round(end - self.start_s, 6))]
        hop_s, count = self.hop_s or 0.0, self.count(length_s)
        return [(round(self.start_s + k * hop_s, 6), self.duration_s) for k in range(count)]


class Actor(NamedTuple):
    """Takes of synthetic actors, by the seeds of the takes and the numbers of the subjects."""

    label: str
    seeds: tuple[int, ...]
    subjects: tuple[int, ...]


class Recorded(NamedTuple):
    """One recording: ``name`` as in the file, ``path`` and ``skeleton`` as absolute paths."""

    name: str
    path: Path
    skeleton: Path | None
    label: str
    subject: str
    licence: str
    intervals: Intervals


class Combination(NamedTuple):
    """One combination of the values under ``[each]``; None means drawn at random."""

    radar: Radar
    scene: Scene
    fidelity: str
    heading_deg: float | None
    snr_db: float | None


class Spec(NamedTuple):
    """Specification of a data set; ``run`` has the seed and what the file gives of `RUN_KEYS`.

    ``keep`` are the kinds of arrays that samples hold beside clouds, in the order of `KEPT`.
    """

    run: RunSettings
    intervals: Intervals
    combinations: tuple[Combination, ...]
    drawn: Mapping[str, tuple[float, float]]
    actors: tuple[Actor, ...]
    recordings: tuple[Recorded, ...]
    keep: tuple[str, ...] = ()


def check_samples(intervals: int, combinations: int) -> None:
    """Refuse a data set of more samples than `MOST_SAMPLES` before it takes memory."""
    if intervals * combinations > MOST_SAMPLES:
        raise InputError(
            f"these are {intervals * combinations} samples, "
            f"{intervals} intervals under {combinations} combinations of [each]; "
            f"{MOST_SAMPLES} are allowed: split the file, each part into a folder of its own, "
            "as rtradar train takes several"
        )


def read_spec(path: Path) -> Spec:
    """Read the specification of a data set from a TOML file.

    InputError, in one line with the file and the key, if the file cannot be read, a key is unknown,
    a value is invalid, or a file that it names is missing; InputErrors, a line for each, if several
    things are wrong.
    """
    table = read_toml(path, "data set", "give a TOML file")
    try:
        # The path is absolute, because other processes read the meshes of scenes.
        return _spec(table, path.resolve().parent)
    except InputErrors as errors:
        raise InputErrors([f"data set file '{path}': {line}" for line in errors.lines]) from None
    except InputError as error:
        raise InputError(f"data set file '{path}': {error}") from None


def _spec(table: Table, folder: Path) -> Spec:
    wrong = Complaints()
    wrong.lines += wrong_keys("", table, (), _TOP)
    drawn_table, each, windows = (
        wrong.of(table_at, key, table) or {} for key in ("drawn", "each", "windows")
    )
    wrong.lines += wrong_keys("[drawn] ", drawn_table, (), tuple(DRAWN))
    wrong.lines += wrong_keys("[each] ", each, (), tuple(EACH))
    wrong.lines += wrong_keys("[windows] ", windows, (), INTERVAL_KEYS)
    wrong.lines += [
        f"{key} is under [each] and under [drawn]; give it once"
        for key in drawn_table
        if key in each
    ]
    intervals = wrong.of(Intervals.read, "[windows]", windows)
    actors = _actors(table, wrong)
    recordings = _recordings(table, windows if intervals else {}, folder, wrong)
    if not table.get("synthetic") and not table.get("recordings"):
        wrong.lines.append("there is neither [[synthetic]] nor [[recordings]]; give one of them")
    if table.get("synthetic") and intervals and intervals.needed_s is None:
        wrong.lines.append(
            "[windows] duration_s is missing; synthetic actors have no end of their own"
        )
    lists = _lists(each, folder, wrong)
    drawn = {
        key: wrong.of(_range, key, drawn_table.get(key, usual), least, most) or (0.0, 0.0)
        for key, (usual, least, most) in DRAWN.items()
    }
    keep = wrong.of(_keep, table) or ()
    run = wrong.of(_run_settings, table)
    wrong.check()
    assert intervals is not None  # for else there are complaints
    assert run is not None
    takes = sum(len(actor.seeds) for actor in actors)
    count = takes * intervals.count(intervals.needed_s)
    count += sum(recorded.intervals.count() for recorded in recordings)
    check_samples(count, math.prod(map(len, lists.values())))  # before combinations are made
    combinations = _combinations(lists)
    if keep:
        lengths = {recorded.intervals.duration_s for recorded in recordings}
        lengths |= {intervals.duration_s} if actors else set()
        check_equal_sizes(keep, lengths, combinations)
    return Spec(run, intervals, combinations, drawn, actors, recordings, keep)


def _keep(table: Table) -> tuple[str, ...]:
    """Return the kinds of arrays to keep, in the order of `KEPT`."""
    kinds = table.get("keep", [])
    known = isinstance(kinds, list) and all(
        isinstance(kind, str) and kind in KEPT for kind in kinds
    )
    if not known:
        raise InputError(f"keep = {brief(kinds)}; it must be a list of: {', '.join(KEPT)}")
    return tuple(kind for kind in KEPT if kind in kinds)


def check_equal_sizes(
    keep: tuple[str, ...], lengths_s: set[float | None], combinations: tuple[Combination, ...]
) -> None:
    """Refuse maps of several sizes, which could not be batched, and angles not measured."""
    if len(lengths_s) > 1 or None in lengths_s:
        raise InputError(
            f"keep = {list(keep)}: intervals differ in length; give all the same duration_s, "
            "so that their maps have one size"
        )
    radars = list({each.radar.name: each.radar for each in combinations}.values())
    if len(set(map(sizes, radars))) > 1:
        raise InputError(
            f"keep = {list(keep)}: maps of radars {', '.join(radar.name for radar in radars)} "
            "have several sizes; make a data set for each of them"
        )
    for radar in radars if "range_azimuth" in keep else ():
        if "azimuth" not in measured_angles(radar):
            raise InputError(
                f"keep = {list(keep)}: radar '{radar.name}' measures no azimuth; "
                "leave range_azimuth out"
            )


def _run_settings(table: Table) -> RunSettings:
    wrong, given = Complaints(), {key: table[key] for key in RUN_KEYS if key in table}
    for key, allowed in _NAMED.items():
        value = given.get(key)
        if key in given and not (isinstance(value, str) and value in allowed):
            wrong.lines.append(f"{key} = {brief(value)}; allowed: {', '.join(allowed)}")
    for key in _SWITCHES:
        if not isinstance(given.get(key, True), bool):
            wrong.lines.append(f"{key} = {brief(given[key])}; allowed: true, false")
    for key in _WINDOWS:
        value = given.get(key, "")
        if not isinstance(value[0] if isinstance(value, list) and value else value, str):
            wrong.lines.append(
                f"{key} = {brief(value)}; it must be a name, or a list of a name and a number"
            )
            del given[key]
    if "pfa" in given:
        given["pfa"] = wrong.of(check_number, "data set", "pfa", given["pfa"], *RUN_LIMITS["pfa"])
    if "order" in given:
        wrong.of(_whole, "", "order", given["order"], int(RUN_LIMITS["order"][1]))
    seed = wrong.of(check_seed, "", table.get("seed", 0))
    named = {
        axis: given[f"{axis}_window"] for axis in ("range", "doppler") if f"{axis}_window" in given
    }
    windows = wrong.of(lambda: WindowFunctions(**named))
    wrong.check()
    assert windows is not None  # for else there are complaints
    assert seed is not None
    run = RunSettings(seed=seed, **given)
    return dataclasses.replace(run, range_window=windows.range, doppler_window=windows.doppler)


def _folder(table: Table, beside: Path) -> Path:
    """Folder of the recordings, below the file's own or below that of an environment variable."""
    named = check_text("data set", "folder", table.get("folder", "."))
    allowed, below = beside, named
    if variable := _VARIABLE.match(named):
        if not os.environ.get(variable[1]):
            raise InputError(
                f"folder = {brief(named)}: the environment has no such variable; "
                "set it to the folder of recordings"
            )
        allowed, below = beside / os.environ[variable[1]], named[variable.end() :].lstrip("/")
    there = inside(allowed, below)
    if there is None:
        raise InputError(
            f"folder = {brief(named)} leaves the folder of the file; "
            "put recordings below it, or name a variable of the "
            'environment that holds their folder: "${RECORDINGS}"'
        )
    if not there.is_dir():
        raise InputError(f"folder = {brief(named)}: there is no such folder")
    return there


def _lists(each: Table, folder: Path, wrong: Complaints) -> dict[str, list[Any]]:
    """Return the values under ``[each]``, checked; radars and scenes are loaded."""

    def number(key: str) -> Callable[[object], float]:
        return lambda value: check_number("[each]", key, value, *DRAWN[key][1:])

    def place(key: str, size: int) -> Callable[[object], tuple[float, ...]]:
        return lambda value: check_vector("[each]", key, value, size, 100.0)

    readers: dict[str, Callable[[Any], Any]] = {
        "radar": lambda value: _loaded("radar", value, folder, Radar.load),
        "scene": lambda value: _loaded("scene", value, folder, Scene.load),
        "fidelity": _fidelity,
        "heading_deg": number("heading_deg"),
        "snr_db": number("snr_db"),
        "person_position_m": place("person_position_m", 2),
        "radar_position_m": place("radar_position_m", 3),
    }
    lists = {key: wrong.of(_several, each, key, usual) or [] for key, usual in EACH.items()}
    # A default of None stays: it is no value of the file.
    return {
        key: [
            None if key not in each and value is None else wrong.of(readers[key], value)
            for value in values
        ]
        for key, values in lists.items()
    }


def _fidelity(value: object) -> str:
    model = check_text("[each]", "fidelity", value)
    if model not in MODELS:
        raise InputError(
            f"[each] fidelity = {brief(model)} is unknown; allowed: {', '.join(MODELS)}"
        )
    return model


def _combinations(lists: Mapping[str, list[Any]]) -> tuple[Combination, ...]:
    places = [
        [{} if value is None else {key: value} for value in lists[key]]
        for key in ("person_position_m", "radar_position_m")
    ]
    placed = [
        dataclasses.replace(scene, **person, **radar)
        for scene, person, radar in itertools.product(lists["scene"], *places)
    ]
    values = itertools.product(
        lists["radar"], placed, lists["fidelity"], lists["heading_deg"], lists["snr_db"]
    )
    return tuple(itertools.starmap(Combination, values))


def _several(each: Table, key: str, usual: list[Any]) -> list[Any]:
    values = each.get(key, usual)
    if not isinstance(values, list) or not values:
        raise InputError(f"[each] {key} = {brief(values)}; it must be a list, not empty")
    different = {
        tuple(map(_comparable, value)) if isinstance(value, list) else _comparable(value)
        for value in values
    }
    if len(different) < len(values):
        raise InputError(f"[each] {key} = {brief(values)}; a value is given twice")
    return values


def _comparable(value: object) -> object:
    """Return numbers and texts unchanged; tables and lists, refused later, become their repr."""
    return value if isinstance(value, int | float | str | None) else repr(value)


def _loaded(key: str, value: object, folder: Path, load: Any) -> Any:
    source = check_text("[each]", key, value)
    if source.endswith(".toml") and inside(folder, source) is None:
        raise InputError(
            f"[each] {key} = {brief(source)} leaves the folder of the file; "
            "put it beside it or below"
        )
    try:
        return load(folder / source if source.endswith(".toml") else source)
    except InputError as error:
        raise InputError(f"[each] {key}: {error}") from None


def _actors(table: Table, wrong: Complaints) -> tuple[Actor, ...]:
    found: dict[str, Actor] = {}
    for where, one in wrong.of(tables_at, "synthetic", table) or ():
        wrong.lines += wrong_keys(where, one, *_SYNTHETIC)
        actor = wrong.of(_actor, where, one) if "label" in one else None
        if actor and actor.label in found:
            wrong.lines.append(
                f"[[synthetic]] label = '{actor.label}' is given twice; give its takes together"
            )
        elif actor:
            found[actor.label] = actor
    return tuple(found.values())


def _actor(where: str, table: Table) -> Actor:
    wrong = Complaints()
    label = wrong.of(check_text, where.strip(), "label", table["label"])
    if label is not None and label not in ACTIVITIES:
        wrong.lines.append(
            f"{where}label = {brief(label)} is unknown; allowed: {', '.join(ACTIVITIES)}"
        )
    seeds = None
    if ("count" in table) == ("seeds" in table):
        wrong.lines.append(f"{where}: give count or seeds, one of them")
    else:
        seeds = wrong.of(_numbers, where, "seeds" if "seeds" in table else "count", table)
    subjects = wrong.of(_numbers, where, "subjects", {"subjects": 10, **table})
    wrong.check()
    return Actor(label or "", seeds or (), subjects or ())


def _numbers(where: str, key: str, table: Table) -> tuple[int, ...]:
    """Return a list of whole numbers as it is, or for a count all numbers below it."""
    value = table[key]
    if isinstance(value, list) and value and len(set(map(str, value))) == len(value):
        return tuple(_whole(where, key, number) for number in value)
    if isinstance(value, list):
        raise InputError(
            f"{where}{key} = {brief(value)}; "
            "it must be a list of different whole numbers, not empty"
        )
    count = _whole(where, key, value)
    if count == 0:
        raise InputError(f"{where}{key} = 0; it must be at least 1")
    return tuple(range(count))


def _recordings(
    table: Table, windows: Table, folder: Path, wrong: Complaints
) -> tuple[Recorded, ...]:
    beside = wrong.of(_folder, table, folder)
    found: list[Recorded] = []
    for where, one in wrong.of(tables_at, "recordings", table) or ():
        wrong.lines += wrong_keys(where, one, *_RECORDING)
        if beside is not None and "file" in one:
            found += wrong.of(_recorded, where, one, windows, beside) or ()
    return tuple(found)


def _recorded(where: str, table: Table, windows: Table, folder: Path) -> list[Recorded]:
    """Return the recordings of one table: those of its pattern, or the one that it names."""
    wrong, place = Complaints(), where.strip()
    texts = {
        key: wrong.of(check_text, place, key, table[key]) or ""
        for key in ("file", "label", "subject", "licence", "skeleton")
        if key in table
    }
    own = {key: value for key, value in table.items() if key in INTERVAL_KEYS}
    intervals = wrong.of(Intervals.read, place, {**windows, **own})
    if "label" not in texts and "{label}" not in texts["file"]:
        wrong.lines.append(f"{where}label is missing; give it, or have {{label}} in file")
    matches = wrong.of(matching_files, where, texts["file"], folder) if texts["file"] else None
    wrong.check()
    assert intervals is not None  # for else there are complaints
    found = []
    for name, fields in matches or ():
        values = {"subject": UNKNOWN, "licence": UNKNOWN, **texts, **fields}
        skeleton = None
        if "skeleton" in texts:
            named = FIELD.sub(lambda field: values[field[1]], texts["skeleton"])  # noqa: B023
            skeleton = wrong.of(file_in, where, "skeleton", named, folder)
        about = {key: values[key] for key in ("label", "subject", "licence")}
        for key in fields:
            wrong.of(check_text, place, key, fields[key])
        found.append(Recorded(name, folder / name, skeleton, intervals=intervals, **about))
    wrong.check()
    return found


def _range(key: str, value: object, least: float, most: float) -> tuple[float, float]:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise InputError(f"[drawn] {key} = {brief(value)}; it must be a range: [least, most]")
    low, high = (check_number("[drawn]", key, end, least, most) for end in value)
    if low > high:
        raise InputError(f"[drawn] {key} = {brief(value)}; the least must come first")
    return low, high


def _whole(where: str, key: str, value: object, most: int = _MOST) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= most:
        raise InputError(
            f"{where}{key} = {brief(value)}; it must be a whole number from 0 to {most}"
        )
    return value
