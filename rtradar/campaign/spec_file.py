"""Reader of specification files (TOML); every error is reported in one line."""

from __future__ import annotations

import dataclasses
import itertools
import math
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rtradar.campaign.spec import (
    DRAWN,
    WINDOW_KEYS,
    Actor,
    Recorded,
    Setting,
    Spec,
    Windows,
    check_samples,
)
from rtradar.errors import InputError
from rtradar.motion import ACTIVITIES
from rtradar.process import CLUTTER_REMOVALS
from rtradar.radar import Radar
from rtradar.scatter import MODELS
from rtradar.scene import Scene
from rtradar.system.checks import check_number, check_text, check_vector, inside, shown
from rtradar.system.seeds import check_seed
from rtradar.system.toml_tables import Table, check_keys, read_toml, table_at, tables_at

_TOP = (
    "seed",
    "pfa",
    "clutter_removal",
    "folder",
    "windows",
    "each",
    "drawn",
    "synthetic",
    "recordings",
)
_EACH: Mapping[str, list[Any]] = {
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
_RECORDING = ("file", "label", "subject", "licence"), ("skeleton", *WINDOW_KEYS)
_MOST = 1_000_000
_VARIABLE = re.compile(r"\$\{(\w+)\}(?=/|$)")


def read_spec(path: Path) -> Spec:
    """Read the specification of a data set from a TOML file.

    Raises
    ------
    InputError
        If the file cannot be read, a key is unknown, a value is invalid, or a file that it names is
        missing. The message is one line with the file and the key.
    """
    table = read_toml(path, "data set", "give a TOML file")
    try:
        # The path is absolute, because other processes read the meshes of scenes.
        return _spec(table, path.resolve().parent)
    except InputError as error:
        raise InputError(f"data set file '{path}': {error}") from None


def _spec(table: Table, folder: Path) -> Spec:
    check_keys("", table, (), _TOP)
    drawn_table, each = table_at("drawn", table), table_at("each", table)
    check_keys("[drawn] ", drawn_table, (), tuple(DRAWN))
    check_keys("[each] ", each, (), tuple(_EACH))
    for key in drawn_table:
        if key in each:
            raise InputError(f"{key} stands under [each] and under [drawn]; give it once")
    windows_table = table_at("windows", table)
    check_keys("[windows] ", windows_table, (), WINDOW_KEYS)
    windows = Windows.read("[windows]", windows_table)
    actors = _actors(table)
    beside = _folder(table, folder)
    recordings = tuple(
        _recorded(where, piece, windows_table, beside)
        for where, piece in tables_at("recordings", table)
    )
    if not actors and not recordings:
        raise InputError("there is neither [[synthetic]] nor [[recordings]]; give one of them")
    if actors and windows.needed_s is None:
        raise InputError(
            "[windows] duration_s is missing; synthetic actors have no end of their own"
        )
    lists = {key: _several(each, key, usual) for key, usual in _EACH.items()}
    takes = sum(len(actor.seeds) for actor in actors)
    intervals = takes * windows.count(windows.needed_s) + sum(
        recorded.windows.count() for recorded in recordings
    )
    check_samples(intervals, math.prod(map(len, lists.values())))  # before combinations are made
    removal = table.get("clutter_removal", "none")
    if removal not in CLUTTER_REMOVALS:
        raise InputError(
            f"clutter_removal = {shown(removal)}; allowed: {', '.join(CLUTTER_REMOVALS)}"
        )
    return Spec(
        seed=check_seed("", table.get("seed", 0)),
        pfa=check_number("data set", "pfa", table.get("pfa", 1e-6), 1e-15, 0.5),
        clutter_removal=removal,
        windows=windows,
        settings=_settings(lists, folder),
        drawn={
            key: _range(key, drawn_table.get(key, usual), least, most)
            for key, (usual, least, most) in DRAWN.items()
        },
        actors=actors,
        recordings=recordings,
    )


def _folder(table: Table, beside: Path) -> Path:
    """Folder of the recordings, below the file's own or below that of an environment variable."""
    named = check_text("data set", "folder", table.get("folder", "."))
    allowed, below = beside, named
    if variable := _VARIABLE.match(named):
        if not os.environ.get(variable[1]):
            raise InputError(
                f"folder = {shown(named)}: the environment has no such variable; "
                "set it to the folder of recordings"
            )
        allowed, below = beside / os.environ[variable[1]], named[variable.end() :].lstrip("/")
    there = inside(allowed, below)
    if there is None:
        raise InputError(
            f"folder = {shown(named)} leaves the folder of the file; "
            "put recordings below it, or name a variable of the "
            'environment that holds their folder: "${RECORDINGS}"'
        )
    if not there.is_dir():
        raise InputError(f"folder = {shown(named)}: there is no such folder")
    return there


def _settings(each: Mapping[str, list[Any]], folder: Path) -> tuple[Setting, ...]:
    radars = [_loaded("radar", value, folder, Radar.load) for value in each["radar"]]
    scenes = [_loaded("scene", value, folder, Scene.load) for value in each["scene"]]
    models = [check_text("[each]", "fidelity", value) for value in each["fidelity"]]
    for model in models:
        if model not in MODELS:
            raise InputError(
                f"[each] fidelity = {shown(model)} is unknown; allowed: {', '.join(MODELS)}"
            )
    numbers: dict[str, list[float | None]] = {}
    for key in ("heading_deg", "snr_db"):
        _, least, most = DRAWN[key]
        numbers[key] = [
            None if value is None else check_number("[each]", key, value, least, most)
            for value in each[key]
        ]
    people, radar_places = (
        [
            None if value is None else check_vector("[each]", key, value, size, 100.0)
            for value in each[key]
        ]
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
    combinations = itertools.product(
        radars, placed, models, numbers["heading_deg"], numbers["snr_db"]
    )
    return tuple(Setting(*combination) for combination in combinations)


def _several(each: Table, key: str, usual: list[Any]) -> list[Any]:
    values = each.get(key, usual)
    if not isinstance(values, list) or not values:
        raise InputError(f"[each] {key} = {shown(values)}; it must be a list, not empty")
    different = {
        tuple(map(_comparable, value)) if isinstance(value, list) else _comparable(value)
        for value in values
    }
    if len(different) < len(values):
        raise InputError(f"[each] {key} = {shown(values)}; a value stands there twice")
    return values


def _comparable(value: object) -> object:
    """Return numbers and texts unchanged; tables and lists, refused later, become their repr."""
    return value if isinstance(value, int | float | str | None) else repr(value)


def _loaded(key: str, value: object, folder: Path, load: Any) -> Any:
    source = check_text("[each]", key, value)
    if source.endswith(".toml") and inside(folder, source) is None:
        raise InputError(
            f"[each] {key} = {shown(source)} leaves the folder of the file; "
            "put it beside it or below"
        )
    try:
        return load(folder / source if source.endswith(".toml") else source)
    except InputError as error:
        raise InputError(f"[each] {key}: {error}") from None


def _actors(table: Table) -> tuple[Actor, ...]:
    found: dict[str, Actor] = {}
    for where, piece in tables_at("synthetic", table):
        actor = _actor(where, piece)
        if actor.label in found:
            raise InputError(
                f"[[synthetic]] label = '{actor.label}' stands there twice; give its takes together"
            )
        found[actor.label] = actor
    return tuple(found.values())


def _actor(where: str, table: Table) -> Actor:
    check_keys(where, table, *_SYNTHETIC)
    label = check_text(where.strip(), "label", table["label"])
    if label not in ACTIVITIES:
        raise InputError(
            f"{where}label = {shown(label)} is unknown; allowed: {', '.join(ACTIVITIES)}"
        )
    if ("count" in table) == ("seeds" in table):
        raise InputError(f"{where}: give count or seeds, one of them")
    seeds = _numbers(where, "seeds" if "seeds" in table else "count", table)
    return Actor(label, seeds, _numbers(where, "subjects", {"subjects": 10, **table}))


def _numbers(where: str, key: str, table: Table) -> tuple[int, ...]:
    """Return a list of whole numbers as it is, or for a count all numbers below it."""
    value = table[key]
    if isinstance(value, list) and value and len(set(map(str, value))) == len(value):
        return tuple(_whole(where, key, number) for number in value)
    if isinstance(value, list):
        raise InputError(
            f"{where}{key} = {shown(value)}; "
            "it must be a list of different whole numbers, not empty"
        )
    count = _whole(where, key, value)
    if count == 0:
        raise InputError(f"{where}{key} = 0; it must be at least 1")
    return tuple(range(count))


def _recorded(where: str, table: Table, windows: Table, folder: Path) -> Recorded:
    check_keys(where, table, *_RECORDING)
    texts = {
        key: check_text(where.strip(), key, table[key])
        for key in ("file", "label", "subject", "licence")
    }
    skeleton = (
        check_text(where.strip(), "skeleton", table["skeleton"]) if "skeleton" in table else None
    )
    for key, name in (("file", texts["file"]), ("skeleton", skeleton)):
        if name is not None and inside(folder, name) is None:
            raise InputError(
                f"{where}{key} = {shown(name)} leaves the folder of recordings; "
                "name files in it or below"
            )
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
        raise InputError(
            f"{where}{key} = {shown(value)}; it must be a whole number from 0 to {_MOST}"
        )
    return value
