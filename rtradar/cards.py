"""Cards of radars, motions, scenes and results: HTML for a notebook, short texts for a terminal."""

from __future__ import annotations

import base64
import math
from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from pathlib import Path

from rtradar.system.checks import printable

MOST_LINES, MOST_COLUMNS = 10, 100
"""Largest size of a text; what is beyond it is cut."""

_PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M", 9: "G"}


@cache
def _style() -> str:
    return Path(__file__).with_suffix(".css").read_text(encoding="utf-8")


def html_card(
    kind: str,
    name: str,
    tables: Mapping[str, Mapping[str, str]],
    *,
    picture: bytes | None = None,
    note: str = "",
) -> str:
    """Make the HTML of a card, which has no script and makes no request.

    Parameters
    ----------
    kind, name : str
        What the card is about, such as ``Radar``, and its name.
    tables : mapping of str to mapping of str to str
        Rows of each table, a value for each label, by the table's heading, which may be empty.
    picture : bytes, optional
        Content of a PNG file that the card shows beside its tables.
    note : str
        Sentence below the tables.

    Returns
    -------
    str
        One element ``div``; all given texts are escaped.
    """
    # Each heading gets a table, and the picture follows. The texts may come from anybody, so all of
    # them are escaped.
    parts = []
    for heading, rows in tables.items():
        caption = f"<caption>{escape(printable(heading))}</caption>" if heading else ""
        body = "".join(
            f'<tr><th scope="row">{escape(printable(label))}</th>'
            f"<td>{escape(printable(value))}</td></tr>"
            for label, value in rows.items()
        )
        parts.append(f"<table>{caption}<tbody>{body}</tbody></table>")
    if picture is not None:
        data = base64.b64encode(picture).decode()
        about = escape(f"{kind} {printable(name)}")
        parts.append(f'<img alt="{about}" src="data:image/png;base64,{data}"/>')
    title = f'<span class="faint">{escape(kind)}</span> <b>{escape(printable(name))}</b>'
    below = f'<p class="faint">{escape(printable(note))}</p>' if note else ""
    return (
        f'<div class="rtradar-card"><style>{_style()}</style><p class="title">{title}</p>'
        f'<div class="parts">{"".join(parts)}</div>{below}</div>'
    )


def text_card(kind: str, name: str, rows: Mapping[str, str]) -> str:
    """Make the text of a card, for ``repr``: a title, and a line for each row.

    Parameters
    ----------
    kind, name : str
        What the card is about, such as ``Radar``, and its name.
    rows : mapping of str to str
        Value for each label. Of more than nine rows the last are left out.

    Returns
    -------
    str
        At most `MOST_LINES` lines of at most `MOST_COLUMNS` characters.
    """
    width = max(map(len, rows), default=0)
    lines = [f"{kind} {printable(name)}"]
    lines += [f"  {label:{width}}  {printable(value)}" for label, value in rows.items()]
    if len(lines) > MOST_LINES:
        lines[MOST_LINES - 1 :] = ["  ..."]
    return "\n".join(cut(line, MOST_COLUMNS) for line in lines)


def cut(text: str, most: int) -> str:
    """Cut a text that is longer than ``most`` characters, and end it with three dots."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """Format a quantity with the prefix of its unit, such as ``62.5 µs`` or ``4 GHz``.

    Parameters
    ----------
    value : float
        Value in the unit without prefix.
    unit : str
        Symbol of a unit that takes prefixes, such as ``Hz``, ``s`` or ``m``.
    digits : int
        Significant digits.

    Returns
    -------
    str
        The digits, and the unit.
    """
    value = float(f"{value:.{digits}g}")  # 999.99 µs are 1 ms
    # The prefix is that of the largest power of a thousand below the value, as far as there are
    # prefixes.
    power = 3 * math.floor(math.log10(abs(value)) / 3) if value and math.isfinite(value) else 0
    power = min(max(power, min(_PREFIXES)), max(_PREFIXES))
    return f"{value / 10.0**power:.{digits}g} {_PREFIXES[power]}{unit}"


def text_table(rows: Sequence[Sequence[str]]) -> str:
    """Return rows of cells as aligned text: the first column to the left, the others right."""
    first, *others = (max(map(len, column)) for column in zip(*rows, strict=True))
    return "\n".join(
        "  ".join([row[0].ljust(first), *map(str.rjust, row[1:], others)]).rstrip() for row in rows
    )
