"""The table of all figures, and where it stands in a markdown page: docs/validation.md."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rtradar.errors import InputError
from rtradar.system.files import atomic_file, read_bytes
from rtradar.validate.outcome import Outcome, Row, used_up

BEGIN, END = "<!-- validation: begin -->", "<!-- validation: end -->"
"""What stands before and after the table in the page."""

_MOST_BYTES = 10_000_000

KEYS = (
    "sphere",
    "ellipsoid",
    "plate",
    "path",
    "point",
    "doppler",
    "edge",
    "body",
    "cfar",
    "if-sum",
    "backends",
)
"""The main claims, in the order of the table; others come after them."""


def markdown(outcomes: Sequence[Outcome]) -> str:
    """The table for docs/validation.md: a line for each thing that is claimed, with the worst of its judged rows."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    rows = [
        row | {"script": outcome.claim.script.name} for outcome in outcomes for row in outcome.rows
    ]
    of_judged = [row for row in rows if row["tolerance"] is not None]
    for row in of_judged:
        group = (
            row["key"],
            row["script"],
            row.get("says") or row["quantity"],
            row["unit"],
            str(row["tolerance"]),
        )
        groups.setdefault(group, []).append(row)
    # Sorting keeps the order of the scripts and of their rows.
    places = {key: place for place, key in enumerate(KEYS)}
    ordered = sorted(
        groups.values(), key=lambda own: (places.get(own[0]["key"], len(KEYS)), own[0]["key"])
    )
    lines = ["| key | claim | worst | limit | cases | script |", "|---|---|---|---|---|---|"]
    for own in ordered:
        row = max(own, key=lambda row: (not row["passed"], used_up(row["error"], row["tolerance"])))
        says = row.get("says") or (
            row["quantity"] if len(own) > 1 else f"{row['claim']}: {row['quantity']}"
        )
        unit = f" {row['unit']}" if row["unit"] not in ("", "1") else ""
        error = f"{_figure(row['error'])}{unit}"
        error = error if row["passed"] else f"**{error}: FAILED**"
        cases = sum(row.get("cases", 1) for row in own)
        lines.append(
            f"| `{row['key']}` | {_cell(says)} | {error} | {row['tolerance']:.3g}{unit} | {cases} | `{row['script']}` |"
        )
    kept = sum(row["passed"] for row in of_judged)
    lines += [
        "",
        f"{kept} of {len(of_judged)} judged figures are within their limits; {len(rows) - len(of_judged)} more are reported.",
    ]
    lines += [
        f"`{outcome.claim.script.name}` {_cell(outcome.trouble)}."
        for outcome in outcomes
        if outcome.trouble
    ]
    return "\n".join(lines)


def _figure(value: float) -> str:
    """Two digits; three where a figure may be close to its limit."""
    return (
        f"{value:.0f}"
        if 100 <= abs(value) < 1e5
        else format(value, ".3g" if abs(value) >= 0.1 else ".2g")
    )


def _cell(text: str) -> str:
    """Text that a table does not take for more than one cell."""
    return text.replace("|", "\\|")


def write_readme(path: Path, text: str) -> None:
    """Put a table between the markers `BEGIN` and `END` of a file.

    Raises
    ------
    InputError
        Where the file cannot be read or written, or does not have each marker once, in that order.
    """
    content = around_table(path)
    with atomic_file(path) as file:
        file.write(f"{content[0]}{BEGIN}\n\n{text}\n\n{END}{content[1]}".encode())


def around_table(path: Path) -> tuple[str, str]:
    """What stands before the first and behind the second marker."""
    try:
        content = read_bytes(path, _MOST_BYTES).decode("utf-8")
    except (OSError, ValueError) as error:
        raise InputError(
            f"--readme {path}: {getattr(error, 'strerror', 'no text')}; name a markdown file"
        ) from None
    if (
        content.count(BEGIN) != 1
        or content.count(END) != 1
        or content.index(BEGIN) > content.index(END)
    ):
        raise InputError(
            f"--readme {path}: it must hold '{BEGIN}' once and '{END}' once after it; put them where the table goes"
        )
    return content[: content.index(BEGIN)], content[content.index(END) + len(END) :]
