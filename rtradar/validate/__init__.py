"""``rtradar validate``: run the validation scripts, and report which figures keep their limits.

A script has a function ``measure`` and imports ``main`` from `rtradar.validate.rows`. The keys of
its rows are the texts given as ``key=`` in it, or its own name if there are none. They are read
from its source, so that the choice of one claim does not run the others.
"""

from __future__ import annotations

import json
import math
import os
import platform
import re
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tqdm import tqdm

from rtradar.errors import InputError
from rtradar.system.files import (
    atomic_file,
    check_place,
    read_bytes,
    shipped_folder,
    temporary_folder,
    write_json,
)
from rtradar.system.templates import templates
from rtradar.validate.rows import Row, worst

_MEASURE = re.compile(r"^def measure\(", re.MULTILINE)
_MAIN = re.compile(
    r"^from rtradar\.validate\.rows import (?:\([^)]*|[^\n(]*)\bmain\b", re.MULTILINE
)
_FRAMES = 40  # the most lines that tell where a script hung
_KEY = re.compile(r'\bkey="([^"{}]+)"')


@dataclass(frozen=True)
class Claim:
    """A validation script, and the keys that its rows may have."""

    script: Path
    keys: tuple[str, ...]

    @property
    def name(self) -> str:
        """Name of the script, without its ending."""
        return self.script.stem

    @property
    def alone(self) -> bool:
        """Whether it measures times, which other scripts beside it would spoil."""
        return self.script.parent.name == "cost"


@dataclass(frozen=True)
class Outcome:
    """Result of a script: rows with the chosen key, elapsed time and CPU time of all cores [s].

    ``trouble`` is the reason why it did not finish, in one line, or empty; ``left_out`` says what
    it could not measure here, and why.
    """

    claim: Claim
    rows: list[Row]
    seconds: float
    cpu_seconds: float
    trouble: str
    left_out: tuple[str, ...] = ()

    @property
    def judged(self) -> int:
        """Number of rows that have a limit."""
        return sum(row.tolerance is not None for row in self.rows)

    @property
    def failed(self) -> list[Row]:
        """Rows outside their limits."""
        return [row for row in self.rows if not row.passed]

    @property
    def keys(self) -> list[str]:
        """Keys of the rows, in their order."""
        return list(dict.fromkeys(row.key for row in self.rows))


def validation_folder() -> Path:
    """Find the scripts of claims."""
    return shipped_folder("validation")


def claims(folder: Path) -> list[Claim]:
    """All scripts of a folder that measure a claim, sorted by name."""
    found = []
    for script in sorted(folder.rglob("*.py"), key=lambda path: path.stem):
        text = script.read_text(encoding="utf-8")
        if _MEASURE.search(text) and _MAIN.search(text):
            keys = tuple(dict.fromkeys(_KEY.findall(text)))
            found.append(Claim(script, keys or (script.stem,)))
    return found


def choose(found: Sequence[Claim], only: str | None) -> list[tuple[Claim, str | None]]:
    """Scripts to run, each with the key to which its rows are limited, if any."""
    if not found:
        raise InputError(
            f"there are no validation scripts in '{validation_folder()}'; "
            "install rtradar again, or use a checkout"
        )
    if only is None:
        return [(claim, None) for claim in found]
    # The name of a script stands for all of its claims, a key for one of them.
    by_name = [claim for claim in found if claim.name == only.removesuffix(".py")]
    by_key = [claim for claim in found if only in claim.keys and claim not in by_name]
    if not by_name and not by_key:
        keys = sorted({key for claim in found for key in claim.keys})
        names = sorted({claim.name for claim in found} - set(keys))
        raise InputError(
            f"--only {only}: no such claim; allowed keys: {', '.join(keys)}; "
            f"or a script: {', '.join(names)}"
        )
    return [*((claim, None) for claim in by_name), *((claim, only) for claim in by_key)]


def run_claim(
    claim: Claim, *, key: str | None = None, quick: bool = False, figures: Path | None = None
) -> Outcome:
    """Run one script in a process of its own, and read its rows."""
    began = time.perf_counter()
    with temporary_folder("rtradar-validate-") as folder:
        written = folder / "rows.json"
        command = [sys.executable, str(claim.script), "--json", str(written)]
        command += ["--quick"] if quick else []
        command += ["--figure", str(figures)] if figures else []
        # Files, because a process that outlives the script would keep pipes open.
        errors = folder / "stderr"
        with errors.open("wb") as stderr:
            done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=stderr, check=False)
        text = errors.read_text(encoding="utf-8", errors="replace")
        # The last line of an error says what went wrong; for a script that hung it is the
        # traceback.
        said = text.strip().splitlines() or ["nothing on stderr"]
        hung = [place for place, line in enumerate(said) if line.startswith("Timeout (")]
        last = " ".join(said[hung[0] :][:_FRAMES]) if hung else said[-1]
        # A script that left its rows has done its work. Its status then only tells whether all of
        # them are within their limits.
        rows, trouble = [], f"ended with status {done.returncode} and left no rows: {last}"
        cpu_seconds, left_out = 0.0, tuple[str, ...]()
        with suppress(OSError, ValueError, KeyError, TypeError):
            content = json.loads(written.read_text(encoding="utf-8"))
            rows = [Row(**row) for row in content["rows"]]
            cpu_seconds = float(content["cpu_seconds"])
            left_out = tuple(content["left_out"])
            trouble = "" if rows or left_out else "gave no rows"
    if rows and done.returncode not in (0, int(not all(row.passed for row in rows))):
        trouble = f"ended with status {done.returncode}: {last}"
    kept = [row for row in rows if key is None or row.key == key]
    seconds = time.perf_counter() - began
    return Outcome(claim, kept, seconds, cpu_seconds, " ".join(trouble.split()), left_out)


__all__ = ["claims", "validate", "validation_folder"]

BEGIN, END = "<!-- validation: begin -->", "<!-- validation: end -->"
"""Markers before and after the table in the page."""

_MOST_BYTES = 10_000_000

KEYS = (
    *("sphere", "ellipsoid", "plate", "path", "point", "doppler", "edge", "body", "cfar"),
    *("if-sum", "backends"),
)
"""Keys of the main claims, in the order of the table; others come after them."""

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
    # Places that cannot be written are refused before anything runs.
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
    # Each script gets its line as soon as it ends.
    outcomes = []
    tqdm.write(_HEAD)
    with tqdm(total=len(chosen), unit="script", disable=None) as bar:
        for outcome in _run(chosen, quick=quick, figures=figures):
            outcomes.append(outcome)
            bar.set_description(outcome.claim.name)
            bar.update()
            tqdm.write(_text("outcome.txt", outcome=outcome, worst=worst))
            sys.stdout.flush()
    # The exit status is that of all rows together.
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


# -- the table of a page, and its place between markers -------------------------------------------


def markdown(outcomes: Sequence[Outcome]) -> str:
    """Table for docs/validation.md: a line for each claim, with the worst of its judged rows."""
    # Rows with the same words and the same limit share a line, which shows the worst of them.
    groups: dict[tuple[str, str, str, str, str], list[Row]] = {}
    for outcome in outcomes:
        for row in outcome.rows:
            if row.tolerance is not None:
                script, says = outcome.claim.script.name, row.says or row.quantity
                same = (row.key, script, says, row.unit, str(row.tolerance))
                groups.setdefault(same, []).append(row)
    # Sorting is stable, so the scripts and their rows keep their order.
    places = {key: place for place, key in enumerate(KEYS)}
    ordered = sorted(groups, key=lambda line: (places.get(line[0], len(KEYS)), line[0]))
    lines = []
    for same in ordered:
        (key, script, says, unit, _), rows = same, groups[same]
        row = worst(rows) or rows[0]
        if not row.says and len(rows) == 1:
            says = f"{row.claim}: {row.quantity}"
        unit = f" {unit}" if unit not in ("", "1") else ""
        line = {"key": key, "script": script, "says": says, "passed": row.passed}
        line |= {"error": f"{_figure(row.error)}{unit}", "limit": f"{row.tolerance:.3g}{unit}"}
        lines.append(line | {"cases": sum(row.cases for row in rows)})
    judged = [row for rows in groups.values() for row in rows]
    others = sum(len(outcome.rows) for outcome in outcomes) - len(judged)
    return _text("table.md", lines=lines, judged=judged, others=others, outcomes=outcomes).rstrip()


def _figure(value: float) -> str:
    """Two digits, or three where a figure may be close to its limit."""
    if 100 <= abs(value) < 1e5:
        return f"{value:.0f}"
    return format(value, ".3g" if abs(value) >= 0.1 else ".2g")


def write_readme(path: Path, text: str) -> None:
    """Put a table between the markers `BEGIN` and `END` of a file."""
    before, after = around_table(path)
    with atomic_file(path) as file:
        file.write(f"{before}{BEGIN}\n\n{text}\n\n{END}{after}".encode())


def around_table(path: Path) -> tuple[str, str]:
    """Text before and after the markers, of which the file must have each once, in that order."""
    try:
        content = read_bytes(path, _MOST_BYTES).decode("utf-8")
    except (OSError, ValueError) as error:
        raise InputError(
            f"--readme {path}: {getattr(error, 'strerror', 'no text')}; name a markdown file"
        ) from None
    before, _, rest = content.partition(BEGIN)
    _, _, after = rest.partition(END)
    if content.count(BEGIN) != 1 or content.count(END) != 1 or END not in rest:
        raise InputError(
            f"--readme {path}: it must hold '{BEGIN}' once and '{END}' once after it; "
            "put them where the table goes"
        )
    return before, after
