"""Tables as text with commas, which spreadsheets open."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterable, Sequence

_FORMULA = re.compile(r"[=@\t\r]|[+-](?![\d.]+$)")
"""Beginning of a formula, and of no number."""


def csv_text(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table as text, with what a spreadsheet would run as a formula quoted."""
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(map(_inert, (head, *rows)))
    return text.getvalue()


def _inert(row: Sequence[object]) -> list[object]:
    return [f"'{cell}" if isinstance(cell, str) and _FORMULA.match(cell) else cell for cell in row]
