"""What the fidelity levels say of themselves, as tables and names of the pages.

The texts are those of the classes' docstrings: the summary, what follows it, and a paragraph that
begins with "Occlusion:". ``python docs/level_tables.py`` writes the same words into the table of
README.md, whose last column it leaves as it is.
"""

from __future__ import annotations

import dataclasses
import inspect
import re
from pathlib import Path
from typing import Any, NamedTuple

from code_tables import described, pipe_table
from docutils import nodes
from docutils.parsers.rst.states import Inliner

from rtradar.front_end import Receiver
from rtradar.scatter import MODELS
from rtradar.scatter.echo_models import models_that

README = Path(__file__).parents[1] / "README.md"
GIVEN = {"radar", "body", "variant", "spreading"}
"""Parameters that are no options of a level."""


class Said(NamedTuple):
    """What a level computes, details of that, what occludes it in a word, and how that is found."""

    computes: str
    details: str
    occlusion: str
    asked: str


def said(level: str) -> Said:
    """Read the docstring of a level; one without a paragraph on occlusion has none."""
    text, found, occlusion = (inspect.getdoc(MODELS[level]) or "").partition("\n\nOcclusion: ")
    computes, _, details = text.partition("\n\nParameters\n")[0].partition("\n\n")
    short, _, asked = " ".join(occlusion.partition("\n\n")[0].split()).partition(". ")
    computes, details = computes.removeprefix(f"`{level}`: ").rstrip("."), " ".join(details.split())
    if not found:
        return Said(computes, details, "none", "Every part is visible.")
    return Said(computes, details, short, asked)


def levels() -> str:
    """What each level computes."""
    rows = []
    for level in MODELS.built_in:
        own = said(level)
        rows.append([f"`{level}`", f"{own.computes}. {own.details}".strip()])
    return pipe_table(["level", "path length and return"], rows)


def occlusion() -> str:
    """What occludes the echoes of each level, and how that is found."""
    tracing = models_that("traces")
    rows = [
        [f"`{level}`", own.occlusion, own.asked, "Mitsuba" if level in tracing else ""]
        for level, own in zip(MODELS.built_in, map(said, MODELS.built_in), strict=True)
    ]
    return pipe_table(["level", "occlusion", "how it is found", "by"], rows)


def abilities() -> str:
    """What each level does in rooms, and which targets it takes."""
    fast, meshes = models_that("fast_over_walls"), models_that("accepts_meshes")
    alone = models_that("scattering")
    rows = [
        [
            f"`{level}`",
            "all at once" if level in fast else "each by a model of its own",
            "any `--order`" if level in fast else "`--order 0`",
            "ellipsoids, meshes" if level in meshes else "ellipsoids",
            "yes" if level in alone else "no",
        ]
        for level in MODELS.built_in
    ]
    head = ["level", "paths over walls", "those before a radar that moves", "bodies"]
    return pipe_table([*head, "`rt.scattering_length`"], rows)


def options() -> str:
    """Options of each level, from its docstring and the defaults of its class."""
    rows = []
    for level in MODELS.built_in:
        parameters = inspect.signature(MODELS[level]).parameters
        for names, _, meaning in described(inspect.getdoc(MODELS[level]) or ""):
            for name in names:
                if name not in GIVEN:
                    default = parameters[name].default
                    default = "none" if default is None else default
                    shown = default if isinstance(default, str) else f"{default:g}"
                    rows.append([f"`{level}`", f"`{name}`", meaning, shown])
    return pipe_table(["level", "option", "meaning and what is allowed", "default"], rows)


TABLES = {
    "levels": levels,
    "level-occlusion": occlusion,
    "level-abilities": abilities,
    "level-options": options,
}


def names(of: str) -> list[str]:
    """Names that a sentence lists.

    They are the keys of a receiver (``receiver``), or the levels that have an ability or do not
    have it (``levels: traces``, ``levels: not traces``).
    """
    if of == "receiver":
        return [field.name for field in dataclasses.fields(Receiver)]
    ability = of.removeprefix("levels: ")
    able = models_that(ability.removeprefix("not "))
    if ability == of or not able:
        raise ValueError(f"{of}: there are no such names")
    return [level for level in MODELS.built_in if (level in able) != ability.startswith("not ")]


def names_role(
    role: str, raw: str, text: str, line: int, inliner: Inliner, *_: Any, **__: Any
) -> tuple[list[nodes.Node], list[Any]]:
    """List names in a sentence of a page: ``a``, ``b`` and ``c``."""
    found: list[nodes.Node] = []
    listed = names(text)
    for left, name in zip(range(len(listed) - 1, -1, -1), listed, strict=True):
        found += [nodes.literal(text=name)]
        found += [nodes.Text(" and " if left == 1 else ", ")] if left else []
    return found, []


def readme(text: str) -> str:
    """Return the text of the README with the levels' own words in its table."""
    table = re.search(r"^\| level \| what it computes .*\n\|.*\n((?:\|.*\n)+)", text, re.M)
    assert table, "README.md has no table of levels"
    when = {}
    for row in table[1].splitlines():
        level, _, *others = row.split(" | ")
        when[level.strip("| `")] = others
    lines = []
    for level in MODELS.built_in:
        others = when.get(level, ["|"])
        lines.append(" | ".join([f"| `{level}`", said(level).computes, *others]) + "\n")
    return text[: table.start(1)] + "".join(lines) + text[table.end(1) :]


if __name__ == "__main__":
    README.write_text(readme(README.read_text(encoding="utf-8")), encoding="utf-8")
