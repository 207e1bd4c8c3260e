"""Reader of the specification of a data set from TOML; errors are lines that name the key.

The page on data sets, ``docs/data-sets.md``, lists the keys and has an example. Patterns, such as
``{label}/{subject}_*.bvh``, name several recordings: ``*`` and ``?`` stand for letters of one name,
``**`` for any folders. ``{label}`` and ``{subject}`` stand for letters of one name, too, which
become the activity and the subject; each ends where the text behind it begins.
"""

from __future__ import annotations

import dataclasses
import math
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

from rtradar.campaign.intervals import INTERVAL_KEYS, Augmented, Intervals
from rtradar.campaign.kept import KEPT
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
from rtradar.motion.synthetic import STYLES
from rtradar.process import WindowFunctions
from rtradar.recordings import SAID, said_of
from rtradar.settings import RunSettings
from rtradar.system.checks import (
    Complaints,
    Table,
    brief,
    inside,
    is_whole,
    read_toml,
    table_at,
    tables_at,
    wrong_keys,
)
from rtradar.system.fields import Limits, annotations_of, read_range, read_table, read_value
from rtradar.system.files import digest_of
from rtradar.system.registries import ACTIVITY_NAMES

_Thing = TypeVar("_Thing")

RUN_LIMITS: Mapping[str, tuple[float, float]] = {"pfa": (1e-15, 0.5)}
"""Limits of settings of a run, narrower than those of the settings themselves."""

_SWITCHES = ("angles", "skip_short", "random_rooms", "clouds", "whole_clouds")
_RUN = annotations_of(RunSettings)
_TOP: dict[str, Any] = {
    **{key: _RUN[key] for key in ("seed", *RUN_KEYS)},
    "pfa": Annotated[float, Limits(*RUN_LIMITS["pfa"])],
    "keep": Annotated[
        tuple[str, ...], Limits(allowed=KEPT, wanted=f"it must be a list of: {', '.join(KEPT)}")
    ],
    **dict.fromkeys(_SWITCHES, bool),
    "folder": str,
    **dict.fromkeys(("windows", "each", "drawn", "others", "augmented"), Any),
    **dict.fromkeys(("synthetic", "recordings"), Any),
}
"""Keys of a file, and what may stand there; tables are read one by one."""

_MANY = Annotated[int, Limits(1, 1_000_000)]
_DIFFERENT = "it must be a list of different whole numbers, not empty"
_SEVERAL = Annotated[tuple[int, ...], Limits(0, 1_000_000, _DIFFERENT, (1, 2**31))]
_SYNTHETIC: dict[str, Any] = {
    "label": Annotated[str, Limits(allowed=ACTIVITY_NAMES)],
    "count": _MANY,
    "seeds": _SEVERAL,
    "subjects": _MANY | _SEVERAL,
    "style": str,
    "drawn": Any,
}
_RECORDING: dict[str, Any] = {
    **dict.fromkeys(("file", "label", "subject", "licence", "skeleton"), str),
    **dict.fromkeys((*SAID, *INTERVAL_KEYS), Any),
}
_UNKNOWN = dict.fromkeys(("label", "subject", "licence"), UNKNOWN)
_FIELD = re.compile(r"\{(label|subject)\}")
"""Part of a pattern that gives a value."""

_PIECE = re.compile(r"\*|\?|\{label\}|\{subject\}")
_MOST_WILD = 10  # wildcards of a pattern, so that matching stays quick
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
    # A file that a data set was made from also lists the digests of all files that it names.
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
    # Paths start from the new place of the file, and every file gets its digest.
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
    # Scenes name meshes and recordings of their people.
    for scene in {id(one.scene): one.scene for one in spec.combinations}.values():
        pieces = (*scene.furniture, *scene.objects)
        named |= {piece.path for piece in pieces if piece.metres_per_unit is not None}
        sources = (person.motion.source for person in scene.people)
        named |= {Path(path) for source in sources if source for path in source.files}
    return {path.resolve() for path in named}


def _spec(table: Table, folder: Path) -> Spec:
    # Everything is read before an error is raised, so that the user sees all of them at once.
    wrong = Complaints()
    top = _values(_TOP, "", table, wrong)
    drawn_table, each = (wrong.of(table_at, key, table) or {} for key in ("drawn", "each"))
    wrong.lines += wrong_keys("[each] ", each, (), tuple(EACH))
    wrong.lines += [
        f"{key} is under [each] and under [drawn]; give it once"
        for key in drawn_table
        if key in each
    ]
    intervals = wrong.of(_of_table, Intervals, "windows", {"windows": {}, **table})
    others = wrong.of(_of_table, Others, "others", table)
    augmented = wrong.of(_of_table, Augmented, "augmented", table)
    actors = _actors(table, wrong)
    windows = table.get("windows", {}) if intervals else {}
    beside = wrong.of(_folder, top.get("folder", "."), folder)
    recordings = _recordings(table, windows, beside, wrong)
    # What does not go together, although each value is allowed.
    if not table.get("synthetic") and not table.get("recordings"):
        wrong.lines.append("there is neither [[synthetic]] nor [[recordings]]; give one of them")
    if table.get("synthetic") and intervals and intervals.needed_s is None:
        wrong.lines.append(
            "[windows] duration_s is missing; synthetic actors have no end of their own"
        )
    lists = lists_of(each, folder, wrong)
    usual: dict[str, Any] = {key: bounds for key, (bounds, _, _) in DRAWN.items()}
    drawn = _ranges("[drawn] ", {**usual, **drawn_table}, wrong)
    keep = tuple(kind for kind in KEPT if kind in top.get("keep", ()))
    if table.get("clouds") is False and not table.get("keep"):
        wrong.lines.append("clouds = false, and keep is empty; nothing would be left")
    if table.get("angles") is False and "range_azimuth" in keep:
        wrong.lines.append("angles = false, and keep has range_azimuth; leave one of them out")
    if table.get("whole_clouds") and not (table.get("angles", True) and table.get("clouds", True)):
        wrong.lines.append("whole_clouds = true needs spatial clouds; leave angles and clouds out")
    if table.get("random_rooms") and each.keys() & {"scene", "radar_position_m"}:
        wrong.lines.append(
            "random_rooms = true draws rooms and where the radar stands; leave scene and "
            "radar_position_m under [each] out"
        )
    run = wrong.of(_run_settings, top)
    wrong.check()
    assert intervals is not None  # for else there are complaints
    assert run is not None
    # How many samples it will be at least, and maps that can be batched.
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
    switches = {key: top[key] for key in _SWITCHES if key in top}
    return Spec(
        run, intervals, combinations, drawn, actors, recordings, keep, others, augmented, **switches
    )


def _ranges(where: str, table: Table, wrong: Complaints) -> dict[str, tuple[float, float]]:
    """Return the ranges of a table of what is drawn at random; complain about all else."""
    wrong.lines += wrong_keys(where, table, (), tuple(DRAWN))
    return {
        key: wrong.of(read_range, where, key, table[key], least, most) or (0.0, 0.0)
        for key, (_, least, most) in DRAWN.items()
        if key in table
    }


def _values(
    hints: Mapping[str, Any],
    where: str,
    table: Table,
    wrong: Complaints,
    needed: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Return those values of a table that are allowed; complain about the others and about keys."""
    wrong.lines += wrong_keys(
        where, table, needed, tuple(key for key in hints if key not in needed)
    )
    found = {
        key: wrong.of(read_value, hint, where, key, table[key])
        for key, hint in hints.items()
        if key in table
    }
    return {key: value for key, value in found.items() if value is not None}


def _of_table(kind: type[_Thing], key: str, table: Table) -> _Thing | None:
    """Make an object of a table of the file; None if it is not there."""
    given = table_at(key, table)
    with prefixed(f"[{key}] "):
        return read_table(kind, "", given) if key in table else None


def _run_settings(top: Mapping[str, Any]) -> RunSettings:
    run = RunSettings(**{key: top[key] for key in ("seed", *RUN_KEYS) if key in top})
    windows = WindowFunctions(run.range_window, run.doppler_window)
    return dataclasses.replace(run, range_window=windows.range, doppler_window=windows.doppler)


def _folder(named: str, beside: Path) -> Path:
    """Folder of the recordings, below the file's own or below that of an environment variable."""
    # A specification may come from a stranger, so recordings must lie below its own folder, or
    # below one that the user has named in the environment.
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
    found: dict[tuple[str, str], Actor] = {}
    for where, one in wrong.of(tables_at, "synthetic", table) or ():
        usual: dict[str, Any] = {"label": "", "subjects": 10, "style": ""}
        given = usual | _values(_SYNTHETIC, where, one, wrong, ("label",))
        if ("count" in one) == ("seeds" in one):
            wrong.lines.append(f"{where}: give count or seeds, one of them")
        for key, value in given.items():
            if isinstance(value, tuple) and len(set(value)) < len(value):
                wrong.lines.append(f"{where}{key} = {brief(list(value))}; {_DIFFERENT}")
        # A number stands for that many, counted from 0.
        seeds, subjects = (
            range(own) if isinstance(own, int) else own
            for own in (given.get("seeds", given.get("count", 0)), given["subjects"])
        )
        own = _ranges(f"{where}drawn: ", wrong.of(table_at, "drawn", one, where) or {}, wrong)
        actor = Actor(given["label"], seeds, subjects, given["style"], own)
        if actor.label and (actor.label, actor.style) in found:
            wrong.lines.append(
                f"[[synthetic]] label = '{actor.label}' is given twice; give its takes together"
            )
        if actor.label and actor.style and actor.style not in STYLES.get(actor.label, ()):
            wrong.lines.append(
                f"{where}style = {brief(actor.style)}; allowed for {actor.label}: "
                f"{', '.join(STYLES.get(actor.label, ())) or 'none'}"
            )
        found[actor.label, actor.style] = actor
    return tuple(found.values())


def _recordings(
    table: Table, windows: Table, folder: Path | None, wrong: Complaints
) -> tuple[Recorded, ...]:
    """Return the recordings of all tables, each those of a pattern or the one that it names."""
    found: list[Recorded] = []
    for where, one in wrong.of(tables_at, "recordings", table) or ():
        texts = _values(_RECORDING, where, one, wrong, ("file",))
        own = {key: texts[key] for key in INTERVAL_KEYS if key in texts}
        said = wrong.of(said_of, where.strip(), one) or {}
        intervals = wrong.of(_intervals, where, {**windows, **own}) or Intervals()
        if "label" not in one and "{label}" not in texts.get("file", ""):
            wrong.lines.append(f"{where}label is missing; give it, or have {{label}} in file")
        if folder is None or "file" not in texts:
            continue
        # What the pattern finds in a name takes precedence over what the table says.
        for name, fields in wrong.of(matching_files, where, texts["file"], folder) or ():
            values = {**_UNKNOWN, **texts, **fields}
            about = {
                key: wrong.of(read_value, str, where, key, values[key]) or "" for key in _UNKNOWN
            }
            skeleton = None
            if "skeleton" in texts:
                named = _FIELD.sub(lambda field: values[field[1]], texts["skeleton"])  # noqa: B023
                skeleton = wrong.of(file_in, where, "skeleton", named, folder)
            path = folder / name
            found.append(Recorded(name, path, skeleton, intervals=intervals, said=said, **about))
    return tuple(found)


def _intervals(where: str, table: Table) -> Intervals:
    with prefixed(where):
        return Intervals(**table)


# -- patterns of files -----------------------------------------------------------------------------


def matching_files(where: str, pattern: str, folder: Path) -> list[tuple[str, dict[str, str]]]:
    """Return the files of a pattern in a folder by relative name, each with the values of fields.

    InputError if there is none, or the pattern leaves the folder.
    """
    if not _PIECE.search(pattern) or _is_file(folder, pattern):
        file_in(where, "file", pattern, folder)
        return [(pattern, {})]
    if inside(folder, pattern) is None:
        raise _leaves(where, "file", pattern)
    if len(_PIECE.findall(pattern)) > _MOST_WILD or pattern.count("**/") > 1:
        raise InputError(
            f"{where}file = {brief(pattern)}: {_MOST_WILD} wildcards are allowed, "
            "one of them **; give fewer"
        )
    # The pattern finds candidates once its fields have become stars; a regular expression then
    # reads the fields from their names.
    *folders, last = pattern.split("/")
    parts = [part if part == "**" else _single(part) for part in folders] + [_single(last)]
    expression, found = _expression(parts), []
    for path in sorted(folder.glob(_FIELD.sub("*", "/".join(parts)).replace("[", "[[]"))):
        name = path.relative_to(folder).as_posix()
        if (match := expression.fullmatch(name)) and path.is_file():
            if inside(folder, name) is None:
                raise _leaves(where, "file", name)
            found.append((name, match.groupdict()))
    if not found:
        raise InputError(
            f"{where}file = {brief(pattern)} matches no file in '{folder}'; "
            "mend the pattern, or leave it out"
        )
    return found


def _expression(parts: list[str]) -> re.Pattern[str]:
    """Return the regular expression of a pattern of these names."""
    seen: set[str] = set()

    def wild(piece: str) -> str:
        if piece in ("*", "?"):
            return "[^/]*?" if piece == "*" else "[^/]"
        # A field that occurs twice must be the same text both times.
        name, again = piece.strip("{}"), piece in seen
        seen.add(piece)
        return f"(?P={name})" if again else f"(?P<{name}>[^/]+?)"

    def one(part: str) -> str:
        fixed = [re.escape(text) for text in _PIECE.split(part)]
        pieces = [wild(piece) for piece in _PIECE.findall(part)]
        if not pieces:
            return fixed[0]
        # Each but the last ends where the text behind it begins, and is not tried again: the time
        # stays in proportion to the length of the name.
        held = [f"(?>{piece}{text})" for piece, text in zip(pieces[:-1], fixed[1:-1], strict=True)]
        return "".join([fixed[0], *held, pieces[-1], fixed[-1]])

    folders = ["(?:[^/]+/)*" if part == "**" else f"{one(part)}/" for part in parts[:-1]]
    return re.compile("".join(folders) + one(parts[-1]))


def _single(part: str) -> str:
    """Return a name with one star where there are several, which mean the same."""
    return re.sub(r"\*+", "*", part)


def _is_file(folder: Path, name: str) -> bool:
    try:
        return inside(folder, name) is not None and (folder / name).is_file()
    except (OSError, ValueError):
        return False


def file_in(where: str, key: str, name: str, folder: Path) -> Path:
    """Return the path of an existing file in a folder or below; InputError if it is not there."""
    if inside(folder, name) is None:
        raise _leaves(where, key, name)
    if not _is_file(folder, name):
        raise InputError(f"{where}{key} = {brief(name)}: there is no such file in '{folder}'")
    return folder / name


def _leaves(where: str, key: str, name: str) -> InputError:
    return InputError(
        f"{where}{key} = {brief(name)} leaves the folder of recordings; name files in it or below"
    )
