"""What the validation scripts share: rows of figures, their table, and the options that all of them take."""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from rtradar.validate.outcome import used_up

_MOST_DRAWN = 40


def script_name() -> str:
    """Name of the script that runs, which is the key of rows that name no other."""
    return Path(sys.argv[0]).stem


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
    key: str = field(
        default_factory=script_name
    )  # of the claim, as `rtradar validate --only` takes it
    says: str = ""  # the claim in words; rows that say the same, with the same limit, are one line of docs/validation.md's table
    cases: int = 1  # of which this is the worst


def judged(
    claim: str,
    quantity: str,
    unit: str,
    ours: float,
    tolerance: float,
    *,
    reference: float | None = None,
    key: str = "",
    says: str = "",
    cases: int = 1,
) -> Row:
    """A figure that must not exceed its tolerance: |ours - reference| where there is a reference, else ours."""
    error = float(abs(ours - reference) if reference is not None else ours)
    known = None if reference is None else float(reference)
    passed = math.isfinite(error) and error <= float(tolerance)
    figures = (known, float(ours), error, float(tolerance))
    return Row(claim, quantity, unit, *figures, passed, key or script_name(), says, cases)


def reported(
    claim: str,
    quantity: str,
    unit: str,
    ours: float,
    *,
    reference: float | None = None,
    key: str = "",
) -> Row:
    """A figure without a limit; it only has to be a number."""
    error = float(ours - reference if reference is not None else ours)
    known = None if reference is None else float(reference)
    return Row(
        claim,
        quantity,
        unit,
        known,
        float(ours),
        error,
        None,
        math.isfinite(error),
        key or script_name(),
    )


def table(rows: Sequence[Row]) -> str:
    """The rows, aligned."""
    head = ("key", "claim", "quantity", "unit", "reference", "ours", "error", "tolerance", "passed")
    lines: list[tuple[str, ...]] = [head]
    for row in rows:
        figures = (
            "-" if value is None else f"{value:.4g}"
            for value in (row.reference, row.ours, row.error, row.tolerance)
        )
        verdict = (
            "reported" if row.tolerance is None and row.passed else ("yes" if row.passed else "NO")
        )
        lines.append((row.key, row.claim, row.quantity, row.unit, *figures, verdict))
    widths = [max(len(line[column]) for line in lines) for column in range(len(head))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    )


def draw(rows: Sequence[Row], path: Path, title: str) -> None:
    """Judged rows, the nearest to their limits, as a share of these limits."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    shares = [(used_up(row.error, row.tolerance), row) for row in rows if row.tolerance is not None]
    shares = sorted(shares, key=lambda pair: pair[0], reverse=True)[:_MOST_DRAWN]
    nearest = [row for _, row in shares]
    figure, axes = plt.subplots(
        figsize=(9.0, 1.5 + 0.19 * max(len(nearest), 4)), layout="constrained"
    )
    # A failure and an exact zero stand at the ends of the axis.
    places = [min(max(share, 1e-6), 100.0) for share, _ in shares]
    colours = ["tab:green" if row.passed else "tab:red" for row in nearest]
    axes.scatter(places, range(len(nearest)), c=colours, s=18, zorder=2)
    axes.axvline(1.0, color="black", linewidth=1)
    axes.set_xscale("log")
    axes.set_yticks(
        range(len(nearest)), [f"{row.claim}: {row.quantity}"[:90] for row in nearest], fontsize=6
    )
    axes.invert_yaxis()
    axes.set_xlabel("error / tolerance")
    axes.set_title(title, fontsize=9)
    axes.grid(axis="x", alpha=0.3)
    figure.savefig(path, dpi=130)
    plt.close(figure)


def main(
    description: str,
    measure: Callable[[bool], list[Row]],
    figure: Callable[[list[Row], Path], None] | None = None,
) -> int:
    """Read the options, measure, print the table; 1 where a row fails.

    ``figure`` draws into a PNG; without one, rows are drawn as shares of their limits.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--json", type=Path, help="write the rows there as well")
    parser.add_argument(
        "--quick", action="store_true", help="fewer cases, seconds instead of minutes"
    )
    parser.add_argument(
        "--figure",
        type=Path,
        metavar="DIR",
        help="draw the main rows there, as a PNG of this script's name",
    )
    options = parser.parse_args()
    rows = measure(options.quick)
    print(table(rows))
    if options.json:
        options.json.write_text(
            json.dumps({"rows": [asdict(row) for row in rows]}, indent=1) + "\n"
        )
    if options.figure:
        options.figure.mkdir(parents=True, exist_ok=True)
        path = options.figure / f"{script_name()}.png"
        if figure is not None:
            figure(rows, path)
        else:
            draw(rows, path, description)
    return 0 if all(row.passed for row in rows) else 1
