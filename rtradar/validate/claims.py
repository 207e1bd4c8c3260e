"""Validation scripts: which exist, which a choice selects, and the run of one in its own process.

A script has a function ``measure`` and imports ``main`` from `rtradar.validate.rows`. The keys of
its rows are the texts given as ``key=`` in it, or its own name if there are none. They are read
from its source, so that the choice of one claim does not run the others.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from rtradar.errors import InputError
from rtradar.system.files import shipped_folder, temporary_folder
from rtradar.validate.rows import Row

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
        # Files, for a process that outlives the script would keep pipes open.
        errors = folder / "stderr"
        with errors.open("wb") as stderr:
            done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=stderr, check=False)
        text = errors.read_text(encoding="utf-8", errors="replace")
        said = text.strip().splitlines() or ["nothing on stderr"]
        hung = [place for place, line in enumerate(said) if line.startswith("Timeout (")]
        last = " ".join(said[hung[0] :][:_FRAMES]) if hung else said[-1]
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
