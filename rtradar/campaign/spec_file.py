"""Reader of the specification of a data set from TOML; errors are lines that name the key.

The page on data sets, ``docs/data-sets.md``, lists the keys and has an example.
"""

from __future__ import annotations

import dataclasses
import math
import os
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from rtradar.campaign.intervals import INTERVAL_KEYS, VARIED, Augmented, Intervals
from rtradar.campaign.kept import KEPT
from rtradar.campaign.patterns import FIELD, file_in, matching_files
from rtradar.campaign.spec import (
    DRAWN,
    EACH,
    RUN_KEYS,
    Actor,
    Others,
    Recorded,
    Spec,
    check_equal_sizes,
    check_samples,
    combinations_of,
    lists_of,
)
from rtradar.clouds.sample_files import MADE_FROM, UNKNOWN, write_durably
from rtradar.description import MOST_FILES, check_files, path_from, versions
from rtradar.errors import InputError, prefixed
from rtradar.motion import ACTIVITIES
from rtradar.process import DETECTORS, WindowFunctions
from rtradar.recordings import SAID, said_of
from rtradar.settings import RunSettings
from rtradar.system.checks import (
    Complaints,
    Table,
    brief,
    check_keys,
    inside,
    is_whole,
    read_toml,
    table_at,
    tables_at,
    wrong_keys,
)
from rtradar.system.fields import Limits, annotations_of, read_range, read_table, read_value
from rtradar.system.files import digest_of

RUN_LIMITS: Mapping[str, tuple[float, float]] = {"pfa": (1e-15, 0.5)}
"""Limits of settings of a run, narrower than those of the settings themselves."""

_YES_OR_NO = {"angles": True, "skip_short": False, "random_rooms": False, "clouds": True}
_TOP = (
    "seed",
    *RUN_KEYS,
    "keep",
    *_YES_OR_NO,
    "folder",
    "windows",
    "each",
    "drawn",
    "others",
    "augmented",
    "synthetic",
    "recordings",
)
_COUNT, _MANY = Annotated[int, Limits(0, 1_000_000)], Annotated[int, Limits(1, 1_000_000)]
_PFA = Annotated[float, Limits(*RUN_LIMITS["pfa"])]
_KEPT = Annotated[
    tuple[str, ...], Limits(allowed=tuple(KEPT), wanted=f"it must be a list of: {', '.join(KEPT)}")
]
_SYNTHETIC = ("label",), ("count", "seeds", "subjects")
_RECORDING = (
    ("file",),
    ("label", "subject", "licence", "skeleton", *SAID, *INTERVAL_KEYS),
)
_VARIABLE = re.compile(r"\$\{(\w+)\}(?=/|$)")


_MADE_KEYS = ("root", "shard", "files", "versions")
_HEAD = """\
# What this data set was made from: `rtradar dataset build %s --out DIR` makes it again.
# The paths of recordings, radars and scenes start from root; files that have changed are refused.

"""


def read_spec(path: Path, *, changed: bool = False) -> Spec:
    """Read the specification of a data set from a TOML file.

    InputError, in one line with the file and the key, if the file cannot be read, a key is unknown,
    a value is invalid, or a file that it names is missing; InputErrors, a line for each, if several
    things are wrong. Files that a `MADE_FROM` lists are compared with their digests, unless they
    may have ``changed``.
    """
    given = read_toml(path, "data set", "give a TOML file")
    table = {key: value for key, value in given.items() if key not in _MADE_KEYS}
    listed = check_files(f"data set file '{path}'", path.resolve().parent, given, changed=changed)
    with prefixed(f"data set file '{path}': "):
        # The path is absolute, because other processes read the meshes of scenes.
        beside = path.resolve().parent
        root = read_value(str, "data set: ", "root", given.get("root", "."))
        folder = (beside / root).resolve()
        spec = _spec(table, folder)
        if "root" in given:
            # Only files of which the digest was known may be anywhere.
            for file in sorted(_files(spec, table, folder) - listed):
                raise InputError(f"'{file}' is not among its files; build from the original file")
        return spec._replace(shard=check_shard(given.get("shard", [1, 1])))


def check_shard(value: object) -> tuple[int, int]:
    """Return the number of a shard and their count; InputError where it is none."""
    given = value if isinstance(value, list | tuple) else ()
    if len(given) == 2 and all(map(is_whole, given)) and 1 <= given[0] <= given[1]:
        return int(given[0]), int(given[1])
    raise InputError(f"shard = {brief(value)}; it must be a number and a count, such as 2 of 8")


def write_made(spec_path: Path, spec: Spec, out: Path) -> None:
    """Write into the folder of a data set what it is made from; see `MADE_FROM`.

    A file of that name that rtradar did not write is refused.
    """
    path, head = out / MADE_FROM, _HEAD % MADE_FROM
    ours = path.is_file() and path.read_bytes().startswith(head[:20].encode())
    if os.path.lexists(path) and not ours:
        raise InputError(
            f"'{path}' is there, and not of rtradar; move it away, or give another folder (--out)"
        )
    import tomli_w  # only who writes needs it

    given = read_toml(spec_path, "data set", "give a TOML file")
    table = {key: value for key, value in given.items() if key not in _MADE_KEYS}
    folder = (spec_path.resolve().parent / given.get("root", ".")).resolve()
    files = sorted(_files(spec, table, folder))
    listed = [
        {"path": path_from(out.resolve(), str(file)), "sha256": digest_of(file)} for file in files
    ]
    table |= {"shard": list(spec.shard)} if spec.shard[1] > 1 else {}
    table |= {
        "root": path_from(out.resolve(), str(folder)),
        "files": listed[:MOST_FILES],
        "versions": versions(),
    }
    write_durably(path, (head + tomli_w.dumps(table)).encode())


def _files(spec: Spec, table: Table, folder: Path) -> set[Path]:
    """Files that a specification names: recordings, radars and scenes."""
    named = {path for own in spec.recordings for path in (own.path, own.skeleton) if path}
    each = table.get("each", {})
    for value in (*each.get("radar", ()), *each.get("scene", ())):
        base = value.get("base") if isinstance(value, Mapping) else value
        if isinstance(base, str) and base.endswith((".toml", ".cfg")):
            named.add(folder / base)
    for scene in {id(one.scene): one.scene for one in spec.combinations}.values():
        pieces = (*scene.furniture, *scene.objects)
        named |= {piece.path for piece in pieces if piece.metres_per_unit is not None}
        sources = (person.motion.source for person in scene.people)
        named |= {Path(path) for source in sources if source for path in source.files}
    return {path.resolve() for path in named}


def _spec(table: Table, folder: Path) -> Spec:
    wrong = Complaints()
    drawn_table, each, windows = (
        wrong.of(table_at, key, table) or {} for key in ("drawn", "each", "windows")
    )
    for where, own, keys in (
        ("", table, _TOP),
        ("[drawn] ", drawn_table, tuple(DRAWN)),
        ("[each] ", each, tuple(EACH)),
        ("[windows] ", windows, INTERVAL_KEYS),
    ):
        wrong.lines += wrong_keys(where, own, (), keys)
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
    lists = lists_of(each, folder, wrong)
    drawn = {
        key: wrong.of(read_range, "[drawn] ", key, drawn_table.get(key, usual), least, most)
        or (0.0, 0.0)
        for key, (usual, least, most) in DRAWN.items()
    }
    switches: dict[str, Any] = {
        key: bool(wrong.of(read_value, bool, "", key, table.get(key, usual)))
        for key, usual in _YES_OR_NO.items()
    }
    kinds = wrong.of(read_value, _KEPT, "", "keep", table.get("keep", [])) or ()
    keep = tuple(kind for kind in KEPT if kind in kinds)
    if table.get("clouds") is False and not table.get("keep"):
        wrong.lines.append("clouds = false, and keep is empty; nothing would be left")
    if table.get("angles") is False and "range_azimuth" in keep:
        wrong.lines.append("angles = false, and keep has range_azimuth; leave one of them out")
    if table.get("random_rooms") and each.keys() & {"scene", "radar_position_m"}:
        wrong.lines.append(
            "random_rooms = true draws rooms and where the radar stands; leave scene and "
            "radar_position_m under [each] out"
        )
    run = wrong.of(_run_settings, table)
    others = wrong.of(_others, table)
    augmented = wrong.of(_augmented, table)
    wrong.check()
    assert intervals is not None  # for else there are complaints
    assert run is not None
    takes = sum(len(actor.seeds) for actor in actors)
    count = takes * intervals.most(intervals.needed_s)
    copies = 1 + (augmented.copies if augmented else 0)
    count += copies * sum(recorded.intervals.most() for recorded in recordings)
    check_samples(count, math.prod(map(len, lists.values())))  # before combinations are made
    combinations = combinations_of(lists)
    if keep:
        lengths = {recorded.intervals.duration_s for recorded in recordings}
        lengths |= {intervals.duration_s} if actors else set()
        check_equal_sizes(keep, lengths, combinations, run.spectrogram_window_s)
    return Spec(
        run,
        intervals,
        combinations,
        drawn,
        actors,
        recordings,
        keep,
        others,
        augmented,
        **switches,
    )


def _others(table: Table) -> Others | None:
    """Return who is there beside the person of the label, if there is a table ``[others]``."""
    if "others" not in table:
        return None
    return read_table(Others, "[others] ", table_at("others", table))


def _augmented(table: Table) -> Augmented | None:
    """Return how recordings are augmented, if there is a table ``[augmented]``."""
    if "augmented" not in table:
        return None
    given = table_at("augmented", table)
    check_keys("[augmented] ", given, ("copies",), tuple(VARIED))
    copies = read_value(Annotated[int, Limits(1, 1000)], "[augmented] ", "copies", given["copies"])
    ranges = {
        key: read_range("[augmented] ", key, given.get(key, usual), least, most)
        for key, (usual, least, most) in VARIED.items()
    }
    return Augmented(copies, ranges)


def _run_settings(table: Table) -> RunSettings:
    wrong, hints = Complaints(), annotations_of(RunSettings)
    given: dict[str, Any] = {}
    for key in ("seed", *RUN_KEYS):
        if key in table:
            hint = _PFA if key == "pfa" else hints[key]
            given[key] = wrong.of(read_value, hint, "", key, table[key])
    if isinstance(detector := given.get("detector"), str):
        wrong.of(DETECTORS.check, detector)
    named = {axis: given.get(f"{axis}_window") for axis in ("range", "doppler")}
    windows = wrong.of(
        lambda: WindowFunctions(**{axis: own for axis, own in named.items() if own is not None})
    )
    wrong.check()
    assert windows is not None  # for else there are complaints
    run = RunSettings(**given)
    return dataclasses.replace(run, range_window=windows.range, doppler_window=windows.doppler)


def _folder(table: Table, beside: Path) -> Path:
    """Folder of the recordings, below the file's own or below that of an environment variable."""
    named = read_value(str, "data set: ", "folder", table.get("folder", "."))
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
    label = wrong.of(read_value, str, where, "label", table["label"])
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


def _numbers(where: str, key: str, table: Table) -> Sequence[int]:
    """Return a list of whole numbers as it is, or for a count all numbers below it."""
    value = table[key]
    if not isinstance(value, list):
        return range(read_value(_MANY, where, key, value))
    if not value or len(set(map(str, value))) < len(value):
        raise InputError(
            f"{where}{key} = {brief(value)}; "
            "it must be a list of different whole numbers, not empty"
        )
    return tuple(read_value(_COUNT, where, key, number) for number in value)


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
        key: wrong.of(read_value, str, where, key, table[key]) or ""
        for key in ("file", "label", "subject", "licence", "skeleton")
        if key in table
    }
    own = {key: value for key, value in table.items() if key in INTERVAL_KEYS}
    said = wrong.of(said_of, place, table)
    intervals = wrong.of(Intervals.read, place, {**windows, **own})
    if "label" not in texts and "{label}" not in texts["file"]:
        wrong.lines.append(f"{where}label is missing; give it, or have {{label}} in file")
    matches = wrong.of(matching_files, where, texts["file"], folder) if texts["file"] else None
    wrong.check()
    assert intervals is not None  # for else there are complaints
    assert said is not None
    found = []
    for name, fields in matches or ():
        values = {"subject": UNKNOWN, "licence": UNKNOWN, **texts, **fields}
        skeleton = None
        if "skeleton" in texts:
            named = FIELD.sub(lambda field: values[field[1]], texts["skeleton"])  # noqa: B023
            skeleton = wrong.of(file_in, where, "skeleton", named, folder)
        about = {key: values[key] for key in ("label", "subject", "licence")}
        for key in fields:
            wrong.of(read_value, str, where, key, fields[key])
        path = folder / name
        found.append(Recorded(name, path, skeleton, intervals=intervals, said=said, **about))
    wrong.check()
    return found
