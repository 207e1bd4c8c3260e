"""``rtradar validate``: run the validation scripts, a claim each, and say which of their figures keep their limits.

A script is one that has a function ``measure`` and takes ``main`` from ``rows``. It runs in a process of its own with
``--json`` and, where asked for, ``--quick``. The keys of its rows are the texts given as ``key=`` in it, and its own name
where there are none; they are read from its source, for a choice of one claim must not run the others.
"""

from __future__ import annotations

import ast
import json
import math
import os
import platform
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib import resources
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tqdm import tqdm

from rtradar.errors import InputError
from rtradar.files import atomic_file, temporary_folder, write_json

BEGIN, END = "<!-- validation: begin -->", "<!-- validation: end -->"
"""What stands before and after the table in a README."""

KEYS = ("sphere", "ellipsoid", "plate", "path", "point", "doppler", "edge", "body", "cfar", "if-sum", "backends")
"""The main claims, in the order of the table; others come after them."""

Row = dict[str, Any]
"""A figure as a script writes it: key, claim, quantity, unit, reference, ours, error, tolerance, passed; and the claim in
words, ``says``, with the number of ``cases`` of which it is the worst."""


@dataclass(frozen=True)
class Claim:
    """One script.

    Parameters
    ----------
    script : path
    keys : tuple of str
        Those that its rows may have.
    """

    script: Path
    keys: tuple[str, ...]

    @property
    def name(self) -> str:
        """Of the script, without its ending."""
        return self.script.stem


@dataclass(frozen=True)
class Outcome:
    """What a script gave.

    Parameters
    ----------
    claim : Claim
    rows : list of Row
        Those asked for; empty where it did not finish.
    seconds, cpu_seconds : float
        By the clock, and of all cores.
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


def validation_folder() -> Path:
    """Folder of the scripts that come with rtradar: inside the installed package, or at the top of a checkout."""
    installed = Path(str(resources.files("rtradar"))) / "validation"
    return installed if installed.is_dir() else Path(__file__).resolve().parents[1] / "validation"


def claims(folder: Path) -> list[Claim]:
    """All scripts of a folder that measure a claim, by name."""
    found = []
    for script in sorted(folder.glob("*.py")):
        tree = ast.parse(script.read_text(encoding="utf-8"), str(script))
        measures = any(isinstance(node, ast.FunctionDef) and node.name == "measure" for node in tree.body)
        asks = any(
            isinstance(node, ast.ImportFrom) and node.module == "rows" and any(alias.name == "main" for alias in node.names)
            for node in tree.body
        )
        if measures and asks:
            found.append(Claim(script, _keys(tree) or (script.stem,)))
    return found


def _keys(tree: ast.Module) -> tuple[str, ...]:
    named = [
        keyword.value.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        for keyword in node.keywords
        if keyword.arg == "key" and isinstance(keyword.value, ast.Constant)
    ]
    return tuple(dict.fromkeys(name for name in named if isinstance(name, str) and name))


def choose(found: Sequence[Claim], only: str | None) -> list[tuple[Claim, str | None]]:
    """Scripts to run, each with the key that its rows are limited to, if any.

    Raises
    ------
    InputError
        Where no script is there, or none has that name or key.
    """
    if not found:
        raise InputError(f"there are no validation scripts in '{validation_folder()}'; install rtradar again, or use a checkout")
    if only is None:
        return [(claim, None) for claim in found]
    by_name = [(claim, None) for claim in found if claim.name == only.removesuffix(".py")]
    named = {claim.name for claim, _ in by_name}
    chosen: list[tuple[Claim, str | None]] = [
        *by_name,
        *((claim, only) for claim in found if only in claim.keys and claim.name not in named),
    ]
    if not chosen:
        keys = sorted({key for claim in found for key in claim.keys})
        names = sorted({claim.name for claim in found} - set(keys))
        raise InputError(f"--only {only}: no such claim; allowed keys: {', '.join(keys)}; or a script: {', '.join(names)}")
    return chosen


def run_claim(claim: Claim, *, key: str | None = None, quick: bool = False, figures: Path | None = None) -> Outcome:
    """Run one script and read its rows."""
    began, spent = time.perf_counter(), _children_s()
    with temporary_folder("rtradar-validate-") as folder:
        written = folder / "rows.json"
        command = [sys.executable, str(claim.script), "--json", str(written)]
        command += ["--quick"] if quick else []
        command += ["--figure", str(figures)] if figures else []
        done = subprocess.run(command, capture_output=True, text=True, errors="replace", check=False)
        rows: list[Row] = []
        trouble = ""
        try:
            rows = json.loads(written.read_text(encoding="utf-8"))["rows"]
            if not rows:
                trouble = "gave no rows"
            elif done.returncode not in (0, 1) or (done.returncode == 1 and all(row["passed"] for row in rows)):
                trouble = f"ended with status {done.returncode}: {_last_line(done.stderr)}"
        except (OSError, ValueError, KeyError, TypeError):
            trouble = f"ended with status {done.returncode} and left no rows: {_last_line(done.stderr)}"
    kept = [row for row in rows if key is None or row["key"] == key]
    return Outcome(claim, kept, time.perf_counter() - began, _children_s() - spent, " ".join(trouble.split()))


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
    return max(of_judged, key=lambda row: (not row["passed"], used_up(row["error"], row["tolerance"])), default=None)


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


def markdown(outcomes: Sequence[Outcome]) -> str:
    """A table for a README: a line for each thing that is claimed, with the worst of its judged rows."""
    groups: dict[tuple[str, ...], list[Row]] = {}
    rows = [row | {"script": outcome.claim.script.name} for outcome in outcomes for row in outcome.rows]
    of_judged = [row for row in rows if row["tolerance"] is not None]
    for row in of_judged:
        group = (row["key"], row["script"], row.get("says") or row["quantity"], row["unit"], str(row["tolerance"]))
        groups.setdefault(group, []).append(row)
    # Sorting keeps the order of the scripts and of their rows.
    places = {key: place for place, key in enumerate(KEYS)}
    ordered = sorted(groups.values(), key=lambda own: (places.get(own[0]["key"], len(KEYS)), own[0]["key"]))
    lines = ["| key | claim | worst | limit | cases | script |", "|---|---|---|---|---|---|"]
    for own in ordered:
        row = max(own, key=lambda row: (not row["passed"], used_up(row["error"], row["tolerance"])))
        says = row.get("says") or (row["quantity"] if len(own) > 1 else f"{row['claim']}: {row['quantity']}")
        unit = f" {row['unit']}" if row["unit"] not in ("", "1") else ""
        error = f"{_figure(row['error'])}{unit}"
        error = error if row["passed"] else f"**{error}: FAILED**"
        cases = sum(row.get("cases", 1) for row in own)
        lines.append(f"| `{row['key']}` | {_cell(says)} | {error} | {row['tolerance']:.3g}{unit} | {cases} | `{row['script']}` |")
    kept = sum(row["passed"] for row in of_judged)
    lines += [
        "",
        f"{kept} of {len(of_judged)} judged figures are within their limits; {len(rows) - len(of_judged)} more are reported.",
    ]
    lines += [f"`{outcome.claim.script.name}` {_cell(outcome.trouble)}." for outcome in outcomes if outcome.trouble]
    return "\n".join(lines)


def _figure(value: float) -> str:
    """Two digits; three where a figure may be close to its limit."""
    return f"{value:.0f}" if 100 <= abs(value) < 1e5 else format(value, ".3g" if abs(value) >= 0.1 else ".2g")


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
    content = _between(path)
    with atomic_file(path) as file:
        file.write(f"{content[0]}{BEGIN}\n\n{text}\n\n{END}{content[1]}".encode())


def _between(path: Path) -> tuple[str, str]:
    """What stands before the first and behind the second marker."""
    try:
        content = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"--readme {path}: {getattr(error, 'strerror', 'no text')}; name a markdown file") from None
    if content.count(BEGIN) != 1 or content.count(END) != 1 or content.index(BEGIN) > content.index(END):
        raise InputError(f"--readme {path}: it must hold '{BEGIN}' once and '{END}' once after it; put them where the table goes")
    return content[: content.index(BEGIN)], content[content.index(END) + len(END) :]


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
    if json_path is not None and not json_path.resolve().parent.is_dir():
        raise InputError(f"--json {json_path}: there is no folder '{json_path.resolve().parent}'; make it first")
    if readme is not None:
        if quick or only is not None:
            raise InputError("--readme: the table is of all claims and cases; leave out --quick and --only")
        _between(readme)
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
        "versions": {"python": platform.python_version()} | {name: version(name) for name in ("rtradar", "mitsuba", "numpy")},
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
            | {name: None if isinstance(value, float) and not math.isfinite(value) else value for name, value in row.items()}
            for outcome in outcomes
            for row in outcome.rows
        ],
    }
    write_json(path, content)
