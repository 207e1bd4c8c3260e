"""One script run in a process of its own, with ``--json`` and ``--quick`` where asked for; how near its figures are to limits."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rtradar.system.files import temporary_folder
from rtradar.validate.claims import Claim

Row = dict[str, Any]
"""A figure as a script writes it: key, claim, quantity, unit, reference, ours, error, tolerance, passed; and the claim in
words, ``says``, with the number of ``cases`` of which it is the worst."""


@dataclass(frozen=True)
class Outcome:
    """What a script gave.

    Parameters
    ----------
    claim : Claim
    rows : list of Row
        Those asked for; empty where it did not finish.
    seconds, cpu_seconds : float
        Elapsed time, and CPU time of all cores [s].
    trouble : str
        Why it did not finish, in one line; empty where it did.
    """

    claim: Claim
    rows: list[Row]
    seconds: float
    cpu_seconds: float
    trouble: str

    @property
    def failed(self) -> list[Row]:
        """Rows outside their limits."""
        return [row for row in self.rows if not row["passed"]]


def run_claim(
    claim: Claim, *, key: str | None = None, quick: bool = False, figures: Path | None = None
) -> Outcome:
    """Run one script and read its rows."""
    began, spent = time.perf_counter(), _children_s()
    with temporary_folder("rtradar-validate-") as folder:
        written = folder / "rows.json"
        command = [sys.executable, str(claim.script), "--json", str(written)]
        command += ["--quick"] if quick else []
        command += ["--figure", str(figures)] if figures else []
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", check=False
        )
        rows: list[Row] = []
        trouble = ""
        try:
            rows = json.loads(written.read_text(encoding="utf-8"))["rows"]
            if not rows:
                trouble = "gave no rows"
            elif done.returncode not in (0, 1) or (
                done.returncode == 1 and all(row["passed"] for row in rows)
            ):
                trouble = f"ended with status {done.returncode}: {_last_line(done.stderr)}"
        except (OSError, ValueError, KeyError, TypeError):
            trouble = (
                f"ended with status {done.returncode} and left no rows: {_last_line(done.stderr)}"
            )
    kept = [row for row in rows if key is None or row["key"] == key]
    return Outcome(
        claim, kept, time.perf_counter() - began, _children_s() - spent, " ".join(trouble.split())
    )


def _children_s() -> float:
    """CPU time of all processes that were started and have ended [s]."""
    times = os.times()
    return times.children_user + times.children_system


def _last_line(text: str) -> str:
    lines = [line for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else "nothing on stderr"


def used_up(error: float, tolerance: float) -> float:
    """How much of its limit a figure uses: 1 where it is just met; of a level below zero, how near it comes to it."""
    if not math.isfinite(error):
        return math.inf
    if tolerance > 0:
        return max(error, 0.0) / tolerance
    if tolerance < 0:
        return tolerance / error if error < 0 else math.inf
    return math.inf if error > 0 else 0.0


def by_key(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Rows of each key, in the order in which they come."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row["key"], []).append(row)
    return found


def worst(rows: Sequence[Row]) -> Row | None:
    """The judged row that is nearest to its limit, or farthest beyond it; None where none is judged."""
    of_judged = [row for row in rows if row["tolerance"] is not None]
    return max(
        of_judged,
        key=lambda row: (not row["passed"], used_up(row["error"], row["tolerance"])),
        default=None,
    )
