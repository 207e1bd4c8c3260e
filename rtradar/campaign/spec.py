"""What a data set shall hold, from a TOML file.

::

    seed = 0                          # of all that is drawn
    pfa = 1e-6                        # of OS-CFAR
    clutter_removal = "none"
    folder = "."                      # of the recordings, from the folder of this file; ${NAME} is what the environment says

    [windows]                         # which intervals of each recording
    start_s = 0.0
    duration_s = 2.0                  # to the end where it is left out
    hop_s = 1.0                       # one interval where it is left out, else one every hop up to end_s
    end_s = 9.0                       # the end of the recording where it is left out

    [each]                            # every combination of these is a sample
    radar = ["paper-12ghz"]           # presets or TOML files
    scene = ["free-space"]            # names or TOML files
    fidelity = ["specular"]
    heading_deg = [0.0]
    snr_db = [20.0]
    person_position_m = [[0.0, 0.0]]  # where the scene says, where it is left out
    radar_position_m = [[-4.0, 1.0, 1.0]]

    [drawn]                           # every recording's interval draws one value from each range, whatever its label
    heading_deg = [-30.0, 30.0]       # not beside [each] heading_deg; snr_db likewise
    snr_db = [15.0, 25.0]
    offset_x_m = [-0.3, 0.3]          # added to the place of the person
    offset_y_m = [-0.3, 0.3]
    tempo = [0.8, 1.25]               # this and the following: of synthetic actors
    amplitude = [0.8, 1.1]
    build = [0.8, 1.25]
    height_m = [1.55, 1.95]

    [[synthetic]]
    label = "walk"                    # kick, punch, jumping_jack
    count = 100                       # of takes, or seeds = [0, 1, 2]
    subjects = 20                     # take k is of subject k modulo 20, who is one and the same person in all activities

    [[recordings]]
    file = "07_05.amc"
    skeleton = "07.asf"
    label = "walk"
    subject = "CMU_07"
    licence = "CMU mocap terms"
    start_s = 0.5                     # these four, where given, in place of those of [windows]
"""

from __future__ import annotations

import dataclasses
import itertools
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rtradar.campaign.windows import WINDOW_KEYS, Windows
from rtradar.errors import InputError
from rtradar.motion import ACTIVITIES
from rtradar.radar import Radar
from rtradar.scatter import RUNGS
from rtradar.scene import Scene
from rtradar.scene.checks import check_number, check_text, check_vector, shown
from rtradar.scene.toml_tables import Table, check_keys, read_toml, table_at, tables_at

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
"""What is drawn: the range where the file gives none, and the least and the most that it may give."""

_TOP = ("seed", "pfa", "clutter_removal", "folder", "windows", "each", "drawn", "synthetic", "recordings")
_EACH = ("radar", "scene", "fidelity", "heading_deg", "snr_db", "person_position_m", "radar_position_m")
_SYNTHETIC = ("label",), ("count", "seeds", "subjects")
_RECORDING = ("file", "label", "subject", "licence"), ("skeleton", *WINDOW_KEYS)
_MOST = 1_000_000


@dataclass(frozen=True)
class Actor:
    """Takes of synthetic actors: ``seeds`` of the takes, ``subjects`` by their numbers."""

    label: str
    seeds: tuple[int, ...]
    subjects: tuple[int, ...]


@dataclass(frozen=True)
class Recorded:
    """One recording: ``name`` as the file says it, ``path`` and ``skeleton`` where they are."""

    name: str
    path: Path
    skeleton: Path | None
    label: str
    subject: str
    licence: str
    windows: Windows


@dataclass(frozen=True)
class Setting:
    """One combination of what stands under ``[each]``; None: drawn, or as the scene says."""

    radar: Radar
    scene: Scene
    fidelity: str
    heading_deg: float | None
    snr_db: float | None


@dataclass(frozen=True)
class Spec:
    """A data set as a file describes it; the head of this module says what each is."""

    seed: int
    pfa: float
    clutter_removal: str
    windows: Windows
    settings: tuple[Setting, ...]
    drawn: Mapping[str, tuple[float, float]]
    actors: tuple[Actor, ...]
    recordings: tuple[Recorded, ...]


def read_spec(path: Path) -> Spec:
    """The data set that a TOML file describes.

    Raises
    ------
    InputError
        One line that names the file and the key: where it cannot be read, or a key is unknown, or a value has no meaning, or a
        file that it names is missing.
    """
    table = read_toml(path, "data set", "give a TOML file")
    try:
        return _spec(table, path.parent)
    except InputError as error:
        raise InputError(f"data set file '{path}': {error}") from None


def _spec(table: Table, folder: Path) -> Spec:
    check_keys("", table, (), _TOP)
    drawn_table, each = table_at("drawn", table), table_at("each", table)
    check_keys("[drawn] ", drawn_table, (), tuple(DRAWN))
    check_keys("[each] ", each, (), _EACH)
    for key in drawn_table:
        if key in each:
            raise InputError(f"{key} stands under [each] and under [drawn]; give it once")
    windows_table = table_at("windows", table)
    check_keys("[windows] ", windows_table, (), WINDOW_KEYS)
    windows = Windows.read("[windows]", windows_table)
    actors = tuple(_actor(where, piece) for where, piece in tables_at("synthetic", table))
    beside = _folder(table, folder)
    recordings = tuple(_recorded(where, piece, windows_table, beside) for where, piece in tables_at("recordings", table))
    if not actors and not recordings:
        raise InputError("there is neither [[synthetic]] nor [[recordings]]; give one of them")
    labels = [actor.label for actor in actors]
    if len(set(labels)) < len(labels):
        twice = next(label for label in labels if labels.count(label) > 1)
        raise InputError(f"[[synthetic]] label = '{twice}' stands there twice; give its takes together")
    if actors and windows.needed_s is None:
        raise InputError("[windows] duration_s is missing; synthetic actors have no end of their own")
    removal = table.get("clutter_removal", "none")
    if removal not in ("none", "mean", "exponential", "mti"):
        raise InputError(f"clutter_removal = {shown(removal)}; allowed: none, mean, exponential, mti")
    return Spec(
        seed=_whole("", "seed", table.get("seed", 0)),
        pfa=check_number("data set", "pfa", table.get("pfa", 1e-6), 1e-15, 0.5),
        clutter_removal=removal,
        windows=windows,
        settings=_settings(each, folder),
        drawn={key: _range(key, drawn_table.get(key, usual), least, most) for key, (usual, least, most) in DRAWN.items()},
        actors=actors,
        recordings=recordings,
    )


def _folder(table: Table, beside: Path) -> Path:
    named = check_text("data set", "folder", table.get("folder", "."))
    there = os.path.expandvars(named)
    if "$" in there:
        raise InputError(f"folder = {shown(named)}: the environment has no such variable; set it to the folder of recordings")
    if not (beside / there).is_dir():
        raise InputError(f"folder = {shown(named)}: there is no such folder")
    return beside / there


def _settings(each: Table, folder: Path) -> tuple[Setting, ...]:
    radars = [_loaded("radar", value, folder, Radar.load) for value in _several(each, "radar", ["paper-12ghz"])]
    scenes = [_loaded("scene", value, folder, Scene.load) for value in _several(each, "scene", ["free-space"])]
    rungs = [check_text("[each]", "fidelity", value) for value in _several(each, "fidelity", ["specular"])]
    for rung in rungs:
        if rung not in RUNGS:
            raise InputError(f"[each] fidelity = {shown(rung)} is unknown; allowed: {', '.join(RUNGS)}")
    numbers: dict[str, list[float | None]] = {}
    for key in ("heading_deg", "snr_db"):
        _, least, most = DRAWN[key]
        given = _several(each, key, [None])
        numbers[key] = [None if value is None else check_number("[each]", key, value, least, most) for value in given]
    people, radar_places = (
        [None if value is None else check_vector("[each]", key, value, size, 100.0) for value in _several(each, key, [None])]
        for key, size in (("person_position_m", 2), ("radar_position_m", 3))
    )
    placed = [
        dataclasses.replace(
            scene,
            **({} if person is None else {"person_position_m": person}),
            **({} if place is None else {"radar_position_m": place}),
        )
        for scene, person, place in itertools.product(scenes, people, radar_places)
    ]
    combinations = itertools.product(radars, placed, rungs, numbers["heading_deg"], numbers["snr_db"])
    return tuple(Setting(*combination) for combination in combinations)


def _several(each: Table, key: str, usual: list[Any]) -> list[Any]:
    values = each.get(key, usual)
    if not isinstance(values, list) or not values:
        raise InputError(f"[each] {key} = {shown(values)}; it must be a list, not empty")
    if any(value in values[:number] for number, value in enumerate(values)):
        raise InputError(f"[each] {key} = {shown(values)}; a value stands there twice")
    return values


def _loaded(key: str, value: object, folder: Path, load: Any) -> Any:
    source = check_text("[each]", key, value)
    try:
        return load(folder / source if source.endswith(".toml") else source)
    except InputError as error:
        raise InputError(f"[each] {key}: {error}") from None


def _actor(where: str, table: Table) -> Actor:
    check_keys(where, table, *_SYNTHETIC)
    label = table["label"]
    if label not in ACTIVITIES:
        raise InputError(f"{where}label = {shown(label)} is unknown; allowed: {', '.join(ACTIVITIES)}")
    if ("count" in table) == ("seeds" in table):
        raise InputError(f"{where}: give count or seeds, one of them")
    seeds = _numbers(where, "seeds" if "seeds" in table else "count", table)
    return Actor(label, seeds, _numbers(where, "subjects", {"subjects": 10, **table}))


def _numbers(where: str, key: str, table: Table) -> tuple[int, ...]:
    """A list of whole numbers as it is, and a number as those below it."""
    value = table[key]
    if isinstance(value, list) and value and len(set(map(str, value))) == len(value):
        return tuple(_whole(where, key, number) for number in value)
    if isinstance(value, list):
        raise InputError(f"{where}{key} = {shown(value)}; it must be a list of different whole numbers, not empty")
    count = _whole(where, key, value)
    if count == 0:
        raise InputError(f"{where}{key} = 0; it must be at least 1")
    return tuple(range(count))


def _recorded(where: str, table: Table, windows: Table, folder: Path) -> Recorded:
    check_keys(where, table, *_RECORDING)
    texts = {key: check_text(where.strip(), key, table[key]) for key in ("file", "label", "subject", "licence")}
    skeleton = check_text(where.strip(), "skeleton", table["skeleton"]) if "skeleton" in table else None
    for key, name in (("file", texts["file"]), ("skeleton", skeleton)):
        if name is not None and not (folder / name).is_file():
            raise InputError(f"{where}{key} = {shown(name)}: there is no such file in '{folder}'")
    own = {key: value for key, value in table.items() if key in WINDOW_KEYS}
    return Recorded(
        name=texts["file"],
        path=folder / texts["file"],
        skeleton=None if skeleton is None else folder / skeleton,
        label=texts["label"],
        subject=texts["subject"],
        licence=texts["licence"],
        windows=Windows.read(where.strip(), {**windows, **own}),
    )


def _range(key: str, value: object, least: float, most: float) -> tuple[float, float]:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise InputError(f"[drawn] {key} = {shown(value)}; it must be a range: [least, most]")
    low, high = (check_number("[drawn]", key, end, least, most) for end in value)
    if low > high:
        raise InputError(f"[drawn] {key} = {shown(value)}; the least must come first")
    return low, high


def _whole(where: str, key: str, value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= _MOST:
        raise InputError(f"{where}{key} = {shown(value)}; it must be a whole number from 0 to {_MOST}")
    return value
