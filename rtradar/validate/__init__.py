"""``rtradar validate``: run the validation scripts, and report which figures keep their limits."""

from __future__ import annotations

import math
import os
import platform
import sys
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path

from tqdm import tqdm

from rtradar.errors import InputError
from rtradar.system.files import check_place, write_json
from rtradar.validate.claims import Outcome, choose, claims, run_claim, validation_folder
from rtradar.validate.readme import around_table, markdown, write_readme
from rtradar.validate.rows import worst

__all__ = ["claims", "validate", "validation_folder"]

_LINE = "{:<14} {:<18} {:>5} {:>6} {:>6} {:>11} {:>8}"
_HEAD = _LINE.format("key", "script", "rows", "judged", "failed", "error/limit", "seconds")


def _lines(outcome: Outcome) -> Iterator[str]:
    """Lines of a script: one for each key, and one for each figure outside its limit."""
    name, seconds = outcome.claim.name, f"{outcome.seconds:.1f}"
    for key in outcome.keys:
        rows = [row for row in outcome.rows if row.key == key]
        judged = sum(row.tolerance is not None for row in rows)
        failed = sum(not row.passed for row in rows)
        nearest = worst(rows)
        used = "-" if nearest is None else f"{nearest.used:.3g}"
        yield _LINE.format(key, name, len(rows), judged, failed, used, seconds)
        seconds = ""
    for row in outcome.failed:
        limit = "must be a number" if row.tolerance is None else f"limit {row.tolerance:.4g}"
        yield f"  FAILED  {row.claim}: {row.quantity}: {row.error:.4g} {row.unit}, {limit}"
    if outcome.trouble:
        yield f"  FAILED  {name} {outcome.trouble}"


def validate(
    *,
    quick: bool = False,
    only: str | None = None,
    json_path: Path | None = None,
    figures: Path | None = None,
    readme: Path | None = None,
) -> int:
    """Run the validation scripts, and print a line for each script and key.

    Parameters
    ----------
    quick : bool
        True to measure fewer cases.
    only : str, optional
        Key of a claim, or name of a script.
    json_path : path, optional
        File for all rows.
    figures : path, optional
        Folder for a picture of each script.
    readme : path, optional
        File whose table of figures, between the markers `BEGIN` and `END`, is replaced.

    Returns
    -------
    int
        Exit status: 0, or 1 where a row fails or a script does not finish.

    Raises
    ------
    InputError
        If ``only`` names nothing, or a file cannot be written; nothing has run then.
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
            outcomes.append(run_claim(claim, key=key, quick=quick, figures=figures))
            for line in _lines(outcomes[-1]):
                tqdm.write(line)
            sys.stdout.flush()
    rows = [row for outcome in outcomes for row in outcome.rows]
    judged = [row for row in rows if row.tolerance is not None]
    passed = all(row.passed for row in rows) and not any(outcome.trouble for outcome in outcomes)
    print(
        f"{'passed' if passed else 'FAILED'}: {sum(row.passed for row in judged)} of {len(judged)} "
        f"judged figures within their limits, {len(rows) - len(judged)} reported; "
        f"{len(outcomes)} scripts, {sum(outcome.seconds for outcome in outcomes):.0f} s"
    )
    if json_path is not None:
        _write_json(json_path, outcomes, passed, quick)
    if readme is not None:
        write_readme(readme, markdown(outcomes))
    return 0 if passed else 1


def _write_json(path: Path, outcomes: Sequence[Outcome], passed: bool, quick: bool) -> None:
    def number(value: object) -> object:  # JSON has neither NaN nor infinity
        return None if isinstance(value, float) and not math.isfinite(value) else value

    content = {
        "passed": passed,
        "quick": quick,
        "versions": {"python": platform.python_version()}
        | {name: version(name) for name in ("rtradar", "mitsuba", "numpy")},
        "cores": os.cpu_count(),
        "scripts": [
            {
                "script": outcome.claim.script.name,
                "keys": outcome.keys,
                "seconds": round(outcome.seconds, 2),
                "cpu_seconds": round(outcome.cpu_seconds, 2),
                "failed": len(outcome.failed),
                "trouble": outcome.trouble,
            }
            for outcome in outcomes
        ],
        "rows": [
            {"script": outcome.claim.script.name}
            | {name: number(value) for name, value in asdict(row).items()}
            for outcome in outcomes
            for row in outcome.rows
        ],
    }
    write_json(path, content)
