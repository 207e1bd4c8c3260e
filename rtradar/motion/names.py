"""Names of joints in the files of many programs, and the positions of the 22 nodes by them.

The table is ``names.toml`` beside this module. Of one's own names a file of the same kind is made,
and named by the environment variable ``RTRADAR_NAMES``.
"""

from __future__ import annotations

import os
import re
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError, prefixed
from rtradar.system.checks import brief, check_keys, read_toml, tables_at

Array = NDArray[np.float64]

OWN_NAMES = "RTRADAR_NAMES"
"""Environment variable that names a table of one's own."""

_Kind = Literal["skeletons", "joints", "markers"]
_KEYS = ("sides", "middle", "sided", "like", "complete", "low_pass_hz", "head_is_top", "up")


@dataclass(frozen=True)
class Convention:
    """Joint names of one kind of file, as `plain` gives them.

    ``joints`` has the alternatives for each node, of which the first one that is there counts. The
    others are described in ``names.toml``; ``open_ended`` is not ``complete``.
    """

    name: str
    joints: Mapping[str, tuple[str, ...]]
    open_ended: bool = True
    low_pass_hz: float | None = None
    head_is_top: bool = False
    up: str = ""

    def found(self, there: Container[str]) -> dict[str, str]:
        """First alternative for each node whose joints are all there."""
        known = {}
        for node, choices in self.joints.items():
            whole = [choice for choice in choices if all(one in there for one in _names(choice))]
            if whole:
                known[node] = whole[0]
        return known

    def missing(self, there: Container[str]) -> list[str]:
        """Names of the joints that are not there, where no alternative is."""
        known = self.found(there)
        last = [choices[-1] for node, choices in self.joints.items() if node not in known]
        return list(dict.fromkeys(one for each in last for one in _names(each) if one not in there))


def plain(name: str) -> str:
    """A joint's name without namespace (``mixamorig:``, ``Bip01``), case, spaces, underscores."""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"^(.*:|mixamorig\d*|[Bb]ip\d+)", "", name).lower())


def conventions(kind: _Kind) -> tuple[Convention, ...]:
    """Every kind of skeleton, joints or markers that is understood; one's own come first."""
    own, known = os.environ.get(OWN_NAMES, ""), _read(Path(__file__).with_suffix(".toml"), kind)
    return (*(_read(Path(own), kind) if own else ()), *known)


@lru_cache(maxsize=4)
def _read(path: Path, kind: str) -> tuple[Convention, ...]:
    named = dict[str, Mapping[str, Any]]()
    content = read_toml(path, "names of joints", "check the path")
    with prefixed(f"{path}: "):
        tables = list(tables_at(kind, content))
    for where, table in tables:
        check_keys(f"{path}: {where}", table, ("name",), _KEYS)
        named[table["name"]] = {**named.get(table.get("like", ""), {}), **table}
    return tuple(_convention(path, table) for table in named.values())


def _convention(path: Path, table: Mapping[str, Any]) -> Convention:
    try:
        left, right = table["sides"]
        texts = dict(table["middle"])
        for side, name in (("l", left), ("r", right)):
            for node, text in table["sided"].items():
                texts[f"{side}_{node}"] = text.replace("@", name)
        joints = {node: tuple(re.split(r",\s*", text)) for node, text in texts.items()}
        for choices in joints.values():
            for choice in choices:
                _fraction(choice)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"{path}: {table['name']}: sides, middle and sided are needed, as in names.toml of "
            f"rtradar ({brief(str(error))[1:-1]})"
        ) from None
    return Convention(
        table["name"],
        joints,
        not table.get("complete", False),
        table.get("low_pass_hz"),
        table.get("head_is_top", False),
        table.get("up", ""),
    )


def _names(choice: str) -> list[str]:
    """Names of the joints in a text such as ``a+b>c 0.4``."""
    return re.split("[+>]", choice.partition(" ")[0])


def _fraction(choice: str) -> float:
    return float(choice.partition(" ")[2] or 0)


def recognise(where: str, names: Sequence[str]) -> Convention:
    """Return the convention of joints by their names; an `InputError` names what is missing."""
    there = {plain(name) for name in names}
    tried = [(known, known.missing(there)) for known in conventions("joints")]
    best, lacking = min(tried, key=lambda one: len(one[1]))
    if lacking:
        raise unknown(where, names, tried)
    return best


def unknown(
    where: str, names: Sequence[str], tried: Sequence[tuple[Convention, Sequence[str]]]
) -> InputError:
    """Return the error for names of joints that fit no convention, of which these are lacking."""
    nearest, lacking = min(tried, key=lambda one: len(one[1]))
    if len(lacking) > len(nearest.joints) / 2:
        return InputError(
            f"{where}: its joints ({', '.join(names[:4])}, ...) are named as in no set that is "
            f"known: {'; '.join(one.name for one, _ in tried)}; rename them after one of these, or "
            f"name them in a table of your own ({OWN_NAMES})"
        )
    return InputError(
        f"{where}: joints {', '.join(lacking)} of {nearest.name} are missing; rename or add them"
    )


def node_positions(
    convention: Convention, names: Sequence[str], positions: Array, nodes: Sequence[str]
) -> Array:
    """Positions (frame, node, 3) of the nodes from those of joints (frame, joint, 3)."""
    column = {plain(name): k for k, name in reversed(list(enumerate(names)))}
    found, choices = np.empty((len(positions), len(nodes), 3)), convention.found(column)
    for k, node in enumerate(nodes):
        ends = [
            np.mean([positions[:, column[name]] for name in end.split("+")], axis=0)
            for end in choices[node].partition(" ")[0].split(">")
        ]
        found[:, k] = ends[0] + _fraction(choices[node]) * (ends[-1] - ends[0])
    return found
