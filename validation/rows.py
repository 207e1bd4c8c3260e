"""What the validation scripts share: rows of figures, their table, and the two options that all of them take."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True)
class Row:
    """One figure: what is claimed, what the reference says, what we say, how far apart they may be."""

    claim: str
    quantity: str
    unit: str
    reference: float | None
    ours: float
    error: float
    tolerance: float | None  # None: reported, not judged
    passed: bool


def judged(claim: str, quantity: str, unit: str, ours: float, tolerance: float, *, reference: float | None = None) -> Row:
    """A figure that must not exceed its tolerance: |ours - reference| where there is a reference, else ours."""
    error = float(abs(ours - reference) if reference is not None else ours)
    known = None if reference is None else float(reference)
    return Row(claim, quantity, unit, known, float(ours), error, tolerance, math.isfinite(error) and error <= tolerance)


def reported(claim: str, quantity: str, unit: str, ours: float, *, reference: float | None = None) -> Row:
    """A figure without a limit; it only has to be a number."""
    error = float(ours - reference if reference is not None else ours)
    known = None if reference is None else float(reference)
    return Row(claim, quantity, unit, known, float(ours), error, None, math.isfinite(error))


def table(rows: Sequence[Row]) -> str:
    """The rows, aligned."""
    head = ("claim", "quantity", "unit", "reference", "ours", "error", "tolerance", "passed")
    lines = [head]
    for row in rows:
        figures = ("-" if value is None else f"{value:.4g}" for value in (row.reference, row.ours, row.error, row.tolerance))
        verdict = "reported" if row.tolerance is None and row.passed else ("yes" if row.passed else "NO")
        lines.append((row.claim, row.quantity, row.unit, *figures, verdict))
    widths = [max(len(line[column]) for line in lines) for column in range(len(head))]
    return "\n".join("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines)


def main(description: str, measure: Callable[[bool], list[Row]]) -> int:
    """Read the options, measure, print the table; 1 where a row fails."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--json", type=Path, help="write the rows there as well")
    parser.add_argument("--quick", action="store_true", help="fewer cases, seconds instead of minutes")
    options = parser.parse_args()
    rows = measure(options.quick)
    print(table(rows))
    if options.json:
        options.json.write_text(json.dumps({"rows": [asdict(row) for row in rows]}, indent=1) + "\n")
    return 0 if all(row.passed for row in rows) else 1
