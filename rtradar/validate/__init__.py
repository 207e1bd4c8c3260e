"""``rtradar validate``: run the validation scripts, and report which figures keep their limits."""

from __future__ import annotations

import math
import os
import platform
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tqdm import tqdm

from rtradar.errors import InputError
from rtradar.system.files import check_place, write_json
from rtradar.system.templates import templates
from rtradar.validate.claims import (
    Claim,
    Outcome,
    choose,
    claims,
    run_claim,
    validation_folder,
)
from rtradar.validate.readme import around_table, markdown, write_readme
from rtradar.validate.rows import worst

__all__ = ["claims", "validate", "validation_folder"]

_HEAD = "key            script              rows judged failed error/limit  seconds"


def _text(template: str, **values: Any) -> str:
    found = templates(Path(__file__).parent, escaped=False)
    return found.get_template(template).render(values).rstrip("\n")


def _run(
    chosen: Sequence[tuple[Claim, str | None]], *, quick: bool, figures: Path | None
) -> Iterator[Outcome]:
    """Run scripts as they are chosen, as many side by side as there are cores.

    Those that measure costs run after all others, one at a time.
    """

    def run(claim: Claim, key: str | None) -> Outcome:
        return run_claim(claim, key=key, quick=quick, figures=figures)

    pool = ThreadPoolExecutor(os.cpu_count())
    try:
        running = [pool.submit(run, *one) for one in chosen if not one[0].alone]
        for future in as_completed(running):
            yield future.result()
    finally:
        # An interrupted command begins no other script.
        pool.shutdown(cancel_futures=True)
    for one in chosen:
        if one[0].alone:
            yield run(*one)


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
    with tqdm(total=len(chosen), unit="script", disable=None) as bar:
        for outcome in _run(chosen, quick=quick, figures=figures):
            outcomes.append(outcome)
            bar.set_description(outcome.claim.name)
            bar.update()
            tqdm.write(_text("outcome.txt", outcome=outcome, worst=worst))
            sys.stdout.flush()
    outcomes.sort(key=lambda outcome: outcome.claim.name)
    rows = [row for outcome in outcomes for row in outcome.rows]
    judged = [row for row in rows if row.tolerance is not None]
    passed = all(row.passed for row in rows) and not any(outcome.trouble for outcome in outcomes)
    print(_text("verdict.txt", passed=passed, judged=judged, rows=rows, outcomes=outcomes))
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
                "judged": outcome.judged,
                "failed": len(outcome.failed),
                "left_out": outcome.left_out,
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
