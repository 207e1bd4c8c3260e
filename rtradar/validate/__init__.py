"""``rtradar validate``: run the validation scripts, a claim each, and say which of their figures keep their limits."""

from __future__ import annotations

import math
import os
import platform
import sys
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path

from tqdm import tqdm

from rtradar.errors import InputError
from rtradar.system.files import check_place, write_json
from rtradar.validate.claims import Claim, choose, claims, validation_folder
from rtradar.validate.outcome import Outcome, Row, by_key, run_claim, used_up, worst
from rtradar.validate.readme import BEGIN, END, KEYS, around_table, markdown, write_readme

__all__ = [
    "BEGIN",
    "END",
    "KEYS",
    "Claim",
    "Outcome",
    "Row",
    "claims",
    "markdown",
    "used_up",
    "validate",
    "validation_folder",
]

_HEAD = f"{'key':<14} {'script':<18} {'rows':>5} {'judged':>6} {'failed':>6} {'error/limit':>11} {'seconds':>8}"


def _lines(outcome: Outcome) -> Iterator[str]:
    """The outcome of one script: a line a key, and each figure outside its limit."""
    seconds = f"{outcome.seconds:8.1f}"
    for key, rows in by_key(outcome.rows).items():
        of_judged = [row for row in rows if row["tolerance"] is not None]
        nearest = worst(rows)
        share = "-" if nearest is None else f"{used_up(nearest['error'], nearest['tolerance']):.3g}"
        failed = sum(not row["passed"] for row in rows)
        yield f"{key:<14} {outcome.claim.name:<18} {len(rows):5d} {len(of_judged):6d} {failed:6d} {share:>11} {seconds}"
        seconds = ""
    for row in outcome.failed:
        limit = "must be a number" if row["tolerance"] is None else f"limit {row['tolerance']:.4g}"
        yield f"  FAILED  {row['claim']}: {row['quantity']}: {row['error']:.4g} {row['unit']}, {limit}"
    if outcome.trouble:
        yield f"  FAILED  {outcome.claim.name} {outcome.trouble}"


def validate(
    *,
    quick: bool = False,
    only: str | None = None,
    json_path: Path | None = None,
    figures: Path | None = None,
    readme: Path | None = None,
) -> int:
    """Run the validation scripts, print a line a script and key, and return the exit status.

    Parameters
    ----------
    quick : bool
        Fewer cases of each.
    only : str, optional
        Key of a claim, or name of a script.
    json_path : path, optional
        All rows are written there.
    figures : path, optional
        Folder for one picture a script.
    readme : path, optional
        File whose table of figures, between the markers `BEGIN` and `END`, is replaced.

    Returns
    -------
    int
        0, or 1 where a row fails or a script does not finish.

    Raises
    ------
    InputError
        Where ``only`` names nothing, or a file cannot be written; nothing has run then.
    """
    check_place(json_path)
    if readme is not None:
        if quick or only is not None:
            raise InputError(
                "--readme: the table is of all claims and cases; leave out --quick and --only"
            )
        around_table(readme)
    chosen = choose(claims(validation_folder()), only)
    if figures is not None:
        try:
            figures.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"--figure {figures}: {error.strerror}; name a folder") from None
        figures = figures.resolve()
    outcomes = []
    tqdm.write(_HEAD)
    with tqdm(chosen, unit="script", disable=None) as bar:
        for claim, key in bar:
            bar.set_description(claim.name)
            outcome = run_claim(claim, key=key, quick=quick, figures=figures)
            outcomes.append(outcome)
            for line in _lines(outcome):
                tqdm.write(line)
            sys.stdout.flush()
    rows = [row for outcome in outcomes for row in outcome.rows]
    of_judged = [row for row in rows if row["tolerance"] is not None]
    passed = all(row["passed"] for row in rows) and not any(outcome.trouble for outcome in outcomes)
    kept = sum(row["passed"] for row in of_judged)
    print(
        f"{'passed' if passed else 'FAILED'}: {kept} of {len(of_judged)} judged figures within their limits, "
        f"{len(rows) - len(of_judged)} reported; {len(outcomes)} scripts, {sum(outcome.seconds for outcome in outcomes):.0f} s"
    )
    if json_path is not None:
        _write_json(json_path, outcomes, passed, quick)
    if readme is not None:
        write_readme(readme, markdown(outcomes))
    return 0 if passed else 1


def _write_json(path: Path, outcomes: Sequence[Outcome], passed: bool, quick: bool) -> None:
    content = {
        "passed": passed,
        "quick": quick,
        "versions": {"python": platform.python_version()}
        | {name: version(name) for name in ("rtradar", "mitsuba", "numpy")},
        "cores": os.cpu_count(),
        "scripts": [
            {
                "script": outcome.claim.script.name,
                "keys": list(by_key(outcome.rows)),
                "seconds": round(outcome.seconds, 2),
                "cpu_seconds": round(outcome.cpu_seconds, 2),
                "failed": len(outcome.failed),
                "trouble": outcome.trouble,
            }
            for outcome in outcomes
        ],
        # JSON has no NaN and no infinity.
        "rows": [
            {"script": outcome.claim.script.name}
            | {
                name: None if isinstance(value, float) and not math.isfinite(value) else value
                for name, value in row.items()
            }
            for outcome in outcomes
            for row in outcome.rows
        ],
    }
    write_json(path, content)
