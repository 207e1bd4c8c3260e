"""Rows of figures that the validation scripts measure, their table, and the options of a script."""

from __future__ import annotations

import argparse
import faulthandler
import json
import math
import os
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, astuple, dataclass, field, fields, replace
from pathlib import Path
from typing import TypedDict, Unpack

from rtradar.system.figure_style import dress, new_figure, save_figure

QUICK_LIMIT_S = 900.0
"""A script that takes longer with ``--quick`` hangs: the slowest takes four minutes."""

_MOST_DRAWN = 40
_left_out: list[str] = []


def script_name() -> str:
    """Name of the script that runs, which is the key of rows that name no other."""
    return Path(sys.argv[0]).stem


def leave_out(what: str, needs: str) -> None:
    """Note figures that this script cannot measure here, and what they need: no failure."""
    _left_out.append(f"{what}: needs {needs}")


@dataclass(frozen=True, kw_only=True)
class Row:
    """One figure: its claim, the values of the reference and of rtradar, and their difference."""

    claim: str  # the case that is tested
    quantity: str  # what is measured there
    unit: str
    reference: float | None = None  # None: zero by definition
    ours: float
    error: float = math.nan
    tolerance: float | None = None  # None: the figure is reported, not judged
    passed: bool = False
    key: str = field(default_factory=script_name)  # for `rtradar validate --only`
    says: str = ""  # the claim in words; those with the same words are one line of the table
    cases: int = 1  # of which this is the worst

    @property
    def used(self) -> float:
        """Fraction of the tolerance that the error uses, see `used_up`; 0 without a tolerance."""
        return 0.0 if self.tolerance is None else used_up(self.error, self.tolerance)


class Details(TypedDict, total=False):
    """Fields of a `Row` that have a default."""

    reference: float | None
    key: str
    says: str
    cases: int


def used_up(error: float, tolerance: float) -> float:
    """Fraction of a limit that a figure uses; for a level below zero, the limit over the level."""
    if not math.isfinite(error):
        return math.inf
    # A level below 0 dB should be as low as possible: a floor of -119 dB uses 80/119 of a limit of
    # -80 dB.
    if tolerance > 0:
        return max(error, 0.0) / tolerance
    if tolerance < 0:
        return tolerance / error if error < 0 else math.inf
    return math.inf if error > 0 else 0.0


def worst(rows: Sequence[Row]) -> Row | None:
    """Judged row that is nearest to its limit, or farthest beyond it; None if none is judged."""
    judged_ones = (row for row in rows if row.tolerance is not None)
    return max(judged_ones, key=lambda row: (not row.passed, row.used), default=None)


def judged(
    claim: str, quantity: str, unit: str, ours: float, tolerance: float, **details: Unpack[Details]
) -> Row:
    """Make a row whose error, |ours - reference| or else ours, must not exceed its tolerance."""
    row = reported(claim, quantity, unit, ours, **details)
    # Without a reference, the figure itself is the error.
    error = row.error if row.reference is None else abs(row.error)
    limit = float(tolerance)
    return replace(row, error=error, tolerance=limit, passed=row.passed and error <= limit)


def reported(claim: str, quantity: str, unit: str, ours: float, **details: Unpack[Details]) -> Row:
    """Make a row without a tolerance; its value only has to be a finite number."""
    reference = details.get("reference")
    error = float(ours if reference is None else ours - reference)
    row = Row(claim=claim, quantity=quantity, unit=unit, ours=float(ours), **details)
    return replace(row, error=error, passed=math.isfinite(error))


def table(rows: Sequence[Row]) -> str:
    """Text table of rows, with aligned columns."""
    lines = [("key", *(column.name for column in fields(Row)[:8]))]
    for row in rows:
        figures = ("-" if value is None else f"{value:.4g}" for value in astuple(row)[3:7])
        verdict = "NO" if not row.passed else "reported" if row.tolerance is None else "yes"
        lines.append((row.key, row.claim, row.quantity, row.unit, *figures, verdict))
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )


def draw(rows: Sequence[Row], path: Path, title: str) -> None:
    """Draw the judged rows nearest to their limits, by the fractions of the limits they use."""
    of_judged = (row for row in rows if row.tolerance is not None)
    nearest = sorted(of_judged, key=lambda row: row.used, reverse=True)[:_MOST_DRAWN]
    figure = new_figure(1.5 + 0.19 * max(len(nearest), 4), width_in=9.0)
    axes = figure.subplots()
    # Infinite values and exact zeros are drawn at the ends of the axis.
    places = [min(max(row.used, 1e-6), 100.0) for row in nearest]
    colours = ["tab:green" if row.passed else "tab:red" for row in nearest]
    axes.scatter(places, range(len(nearest)), c=colours, s=18, zorder=2)
    axes.axvline(1.0, color="black", linewidth=1)
    names = [f"{row.claim}: {row.quantity}"[:90] for row in nearest]
    axes.set_yticks(range(len(nearest)), names)
    axes.set(xscale="log", xlabel="error / tolerance")
    axes.invert_yaxis()
    dress(axes, title=title)
    axes.tick_params(axis="y", labelsize=6)
    save_figure(figure, path)


def main(
    description: str,
    measure: Callable[[bool], list[Row]],
    figure: Callable[[list[Row], Path], None] | None = None,
) -> int:
    """Read the options of a script, measure, print the table, and return the exit status.

    ``measure`` gets True for ``--quick``, and may then take `QUICK_LIMIT_S`. ``figure`` draws rows
    into a PNG file, `draw` by default.
    """
    parser = argparse.ArgumentParser(description=description)
    add = parser.add_argument
    add("--json", type=Path, help="also write the rows to this file")
    add("--quick", action="store_true", help="measure fewer cases, in seconds instead of minutes")
    add("--figure", type=Path, metavar="DIR", help="draw the rows as a PNG file in this folder")
    options = parser.parse_args()
    if options.quick:
        # What hangs ends, and says where.
        faulthandler.dump_traceback_later(QUICK_LIMIT_S, exit=True)
    try:
        rows = measure(options.quick)
    finally:
        faulthandler.cancel_dump_traceback_later()
    print("\n".join([table(rows), *(f"not measured: {what}" for what in _left_out)]))
    if options.json:
        # What this process and its children used, whatever runs beside it.
        spent = sum(os.times()[:4])
        content = {
            "rows": [asdict(row) for row in rows],
            "left_out": _left_out,
            "cpu_seconds": spent,
        }
        options.json.write_text(json.dumps(content, indent=1, default=float) + "\n")
    if options.figure:
        options.figure.mkdir(parents=True, exist_ok=True)
        path = options.figure / f"{script_name()}.png"
        if figure is not None:
            figure(rows, path)
        else:
            draw(rows, path, description)
    return 0 if all(row.passed for row in rows) else 1
