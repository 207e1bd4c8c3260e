"""Specification of a data set: which intervals, under which combinations, by which settings."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from rtradar.campaign.intervals import Augmented, Intervals
from rtradar.campaign.kept import sizes
from rtradar.conventions import PERSON_LIMITS
from rtradar.errors import InputError, prefixed
from rtradar.process import measured_angles
from rtradar.radar import Radar
from rtradar.scatter import MODELS
from rtradar.scene import Scene
from rtradar.settings import RunSettings
from rtradar.system.checks import Complaints, Table, brief, inside
from rtradar.system.fields import Limits, check_fields, read_value, within
from rtradar.system.registries import ACTIVITY_NAMES

DRAWN: Mapping[str, tuple[tuple[float, float], float, float]] = {
    "heading_deg": ((0.0, 0.0), -360.0, 360.0),
    "snr_db": ((20.0, 20.0), -100.0, 200.0),
    "offset_x_m": ((0.0, 0.0), -100.0, 100.0),
    "offset_y_m": ((0.0, 0.0), -100.0, 100.0),
    "tempo": ((0.8, 1.25), 0.4, 2.0),
    "amplitude": ((0.8, 1.1), 0.3, 1.25),
    "build": ((0.8, 1.25), 0.4, 2.5),
    "height_m": ((1.55, 1.95), 0.8, 2.5),
    "radar_up_m": ((0.0, 0.0), -10.0, 10.0),
    "radar_pitch_deg": ((0.0, 0.0), -90.0, 90.0),
    "noise_db": ((0.0, 0.0), -20.0, 60.0),
}
"""Quantities drawn at random: default range, smallest and largest allowed value.

The last three are added to the height, the pitch and the noise figure of the radar. New ones come
last, so that the values of the others stay as they are."""

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

_NUMBERS: Mapping[str, Any] = {
    "heading_deg": Annotated[float, Limits(*DRAWN["heading_deg"][1:])],
    "snr_db": Annotated[
        float | Literal["physical"],
        Limits(*DRAWN["snr_db"][1:], 'it must be a number from -100 to 200, or "physical"'),
    ],
    "person_position_m": Annotated[tuple[float, float], Limits(-100, 100)],
    "radar_position_m": Annotated[tuple[float, float, float], Limits(-100, 100)],
}

MOST_SAMPLES = 1_000_000
"""Largest number of samples of a data set; the plans of all of them are held in memory."""

RUN_KEYS = (
    "pfa", "clutter_removal", "detector", "body_material", "range_window", "doppler_window",
    "spectrogram_window_s", "spectrogram_overlap", "order", "keep_all", "spreading",
)  # fmt: skip
"""Settings of a run that a file may give for all samples."""


class Actor(NamedTuple):
    """Takes of synthetic actors, by the seeds of the takes and the numbers of the subjects.

    Without a style every subject has one of its own. ``drawn`` has their own ranges of what is
    drawn, beside those of the data set.
    """

    label: str
    seeds: Sequence[int]
    subjects: Sequence[int]
    style: str = ""
    drawn: Mapping[str, tuple[float, float]] = {}


class Recorded(NamedTuple):
    """One recording: ``name`` as in the file, ``path`` and ``skeleton`` as absolute paths.

    ``said`` is what the specification says of unit, axis and rate.
    """

    name: str
    path: Path
    skeleton: Path | None
    label: str
    subject: str
    licence: str
    intervals: Intervals
    said: Mapping[str, Any]


class Combination(NamedTuple):
    """One combination of the values under ``[each]``; None means drawn at random."""

    radar: Radar
    scene: Scene
    fidelity: str
    heading_deg: float | None
    snr_db: float | str | None


_MOST_OTHERS, APART_M = 8, 1.0
"""Most people beside the one of the label, and the least distance of their places [m]."""

_Place = Annotated[tuple[float, float], within(*PERSON_LIMITS["position_m"])]


@dataclass(frozen=True)
class Others:
    """People beside the one of the label: how many, what they do, and where, from least to most.

    Synthetic actors whose mean places are at least `APART_M` from each other and from that one.
    """

    count: Annotated[int, Limits(1, _MOST_OTHERS)]
    labels: Annotated[
        tuple[str, ...],
        Limits(
            allowed=ACTIVITY_NAMES,
            wanted=f"it must be a list of: {', '.join(ACTIVITY_NAMES)}",
            counts=(1, 2**31),
        ),
    ] = ("walk", "stand")
    x_m: _Place = (-1.0, 1.0)
    y_m: _Place = (-1.5, 1.5)

    def __post_init__(self) -> None:
        check_fields(self)


class Spec(NamedTuple):
    """Specification of a data set; ``run`` has the seed and what the file gives of `RUN_KEYS`.

    ``keep`` are the kinds of arrays that samples hold beside clouds, in the order of `KEPT`.
    Without ``angles`` spatial clouds are empty, without ``clouds`` all clouds; with
    ``whole_clouds`` they are whole, with the time and the velocity of each point. With
    ``skip_short`` recordings that are too short for an interval are left out. With
    ``random_rooms`` every interval has a room of its own, which is drawn. Of ``shard``, (number,
    count), only every count-th sample is made.
    """

    run: RunSettings
    intervals: Intervals
    combinations: tuple[Combination, ...]
    drawn: Mapping[str, tuple[float, float]]
    actors: tuple[Actor, ...]
    recordings: tuple[Recorded, ...]
    keep: tuple[str, ...] = ()
    others: Others | None = None
    augmented: Augmented | None = None
    angles: bool = True
    skip_short: bool = False
    random_rooms: bool = False
    clouds: bool = True
    whole_clouds: bool = False
    shard: tuple[int, int] = (1, 1)


def check_samples(intervals: int, combinations: int) -> None:
    """Refuse a data set of more samples than `MOST_SAMPLES` before it takes memory."""
    if intervals * combinations > MOST_SAMPLES:
        raise InputError(
            f"these are {intervals * combinations} samples, "
            f"{intervals} intervals under {combinations} combinations of [each]; "
            f"{MOST_SAMPLES} are allowed: split the file, each part into a folder of its own, "
            "as rtradar train takes several"
        )


def check_equal_sizes(
    keep: tuple[str, ...],
    lengths_s: set[float | None],
    combinations: tuple[Combination, ...],
    window_s: float | None,
) -> None:
    """Refuse maps of several sizes, which could not be batched, and angles not measured."""
    if len(lengths_s) > 1 or None in lengths_s:
        raise InputError(
            f"keep = {list(keep)}: intervals differ in length; give all the same duration_s, "
            "so that their maps have one size"
        )
    # Radars with the same axes may be mixed.
    radars = list({each.radar.name: each.radar for each in combinations}.values())
    if len({sizes(radar, window_s) for radar in radars}) > 1:
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


def lists_of(each: Table, folder: Path, wrong: Complaints) -> dict[str, list[Any]]:
    """Return the values under ``[each]``, checked; radars and scenes are loaded."""
    readers: dict[str, Callable[[Any], Any]] = {
        "radar": lambda value: _loaded("radar", value, folder, Radar.load),
        "scene": lambda value: _loaded("scene", value, folder, Scene.load),
        "fidelity": _fidelity,
        **{key: partial(read_value, hint, "[each] ", key) for key, hint in _NUMBERS.items()},
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
    model: str = read_value(str, "[each] ", "fidelity", value)
    with prefixed("[each] "):
        MODELS.check(model)
    return model


def combinations_of(lists: Mapping[str, list[Any]]) -> tuple[Combination, ...]:
    """Return every combination of the values under ``[each]``."""
    # A place that is None leaves that of the scene.
    places = [
        [{} if value is None else {key: value} for value in lists[key]]
        for key in ("person_position_m", "radar_position_m")
    ]
    # Scenes with every combination of places, and then everything else.
    placed = [
        dataclasses.replace(scene, **person, **radar)
        for scene, person, radar in itertools.product(lists["scene"], *places)
    ]
    radars = lists["radar"]
    if lists["radar_position_m"] != [None]:
        # What the data set says goes before what the radar does.
        usual = Radar().position_m
        radars = [dataclasses.replace(radar, position_m=usual) for radar in radars]
    values = itertools.product(
        radars, placed, lists["fidelity"], lists["heading_deg"], lists["snr_db"]
    )
    return tuple(itertools.starmap(Combination, values))


def _several(each: Table, key: str, usual: list[Any]) -> list[Any]:
    values = each.get(key, usual)
    if not isinstance(values, list) or not values:
        raise InputError(f"[each] {key} = {brief(values)}; it must be a list, not empty")
    # 10 and 10.0 are one value.
    if any(value in values[:place] for place, value in enumerate(values)):
        raise InputError(f"[each] {key} = {brief(values)}; a value is given twice")
    return values


def _loaded(key: str, value: object, folder: Path, load: Any) -> Any:
    # A radar may be a table with a base; only files below the folder of the specification may be
    # named.
    table = value if key == "radar" and isinstance(value, Mapping) else {"base": value}
    if "name" in table and not table.keys() & {"base", "board"}:
        with prefixed(f"[each] {key}: "):
            return load(table)  # a radar that is whole
    source = read_value(str, "[each] ", key, table.get("base", table.get("board")))
    if source.endswith((".toml", ".cfg")):
        if inside(folder, source) is None:
            raise InputError(
                f"[each] {key} = {brief(source)} leaves the folder of the file; "
                "put it beside it or below"
            )
        source = str(folder / source)
    with prefixed(f"[each] {key}: "):
        return load({**table, "base": source} if table is value else source)
