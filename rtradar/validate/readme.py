"""Table of all figures for a markdown page, docs/validation.md, and its place between markers."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rtradar.errors import InputError
from rtradar.system.files import atomic_file, read_bytes
from rtradar.system.templates import templates
from rtradar.validate.claims import Outcome
from rtradar.validate.rows import Row, worst

BEGIN, END = "<!-- validation: begin -->", "<!-- validation: end -->"
"""Markers before and after the table in the page."""

_MOST_BYTES = 10_000_000

KEYS = (
    *("sphere", "ellipsoid", "plate", "path", "point", "doppler", "edge", "body", "cfar"),
    *("if-sum", "backends"),
)
"""Keys of the main claims, in the order of the table; others come after them."""


def markdown(outcomes: Sequence[Outcome]) -> str:
    """Table for docs/validation.md: a line for each claim, with the worst of its judged rows."""
    groups: dict[tuple[str, str, str, str, str], list[Row]] = {}
    for outcome in outcomes:
        for row in outcome.rows:
            if row.tolerance is not None:
                script, says = outcome.claim.script.name, row.says or row.quantity
                same = (row.key, script, says, row.unit, str(row.tolerance))
                groups.setdefault(same, []).append(row)
    # Sorting is stable, so the scripts and their rows keep their order.
    places = {key: place for place, key in enumerate(KEYS)}
    ordered = sorted(groups, key=lambda line: (places.get(line[0], len(KEYS)), line[0]))
    lines = []
    for same in ordered:
        (key, script, says, unit, _), rows = same, groups[same]
        row = worst(rows) or rows[0]
        if not row.says and len(rows) == 1:
            says = f"{row.claim}: {row.quantity}"
        unit = f" {unit}" if unit not in ("", "1") else ""
        line = {"key": key, "script": script, "says": says, "passed": row.passed}
        line |= {"error": f"{_figure(row.error)}{unit}", "limit": f"{row.tolerance:.3g}{unit}"}
        lines.append(line | {"cases": sum(row.cases for row in rows)})
    judged = [row for rows in groups.values() for row in rows]
    others = sum(len(outcome.rows) for outcome in outcomes) - len(judged)
    template = templates(Path(__file__).parent, escaped=False).get_template("table.md")
    return template.render(lines=lines, judged=judged, others=others, outcomes=outcomes).rstrip()


def _figure(value: float) -> str:
    """Two digits, or three where a figure may be close to its limit."""
    if 100 <= abs(value) < 1e5:
        return f"{value:.0f}"
    return format(value, ".3g" if abs(value) >= 0.1 else ".2g")


def write_readme(path: Path, text: str) -> None:
    """Put a table between the markers `BEGIN` and `END` of a file."""
    before, after = around_table(path)
    with atomic_file(path) as file:
        file.write(f"{before}{BEGIN}\n\n{text}\n\n{END}{after}".encode())


def around_table(path: Path) -> tuple[str, str]:
    """Text before and after the markers, of which the file must have each once, in that order."""
    try:
        content = read_bytes(path, _MOST_BYTES).decode("utf-8")
    except (OSError, ValueError) as error:
        raise InputError(
            f"--readme {path}: {getattr(error, 'strerror', 'no text')}; name a markdown file"
        ) from None
    before, _, rest = content.partition(BEGIN)
    _, _, after = rest.partition(END)
    if content.count(BEGIN) != 1 or content.count(END) != 1 or END not in rest:
        raise InputError(
            f"--readme {path}: it must hold '{BEGIN}' once and '{END}' once after it; "
            "put them where the table goes"
        )
    return before, after
