"""Write the tables of docs/performance.md from measurements of this machine.

    rtradar bench --only models --json bench.json
    sh validation/wheel.sh python3.11
    python docs/write_performance.py bench.json out/installed.json

What is between the markers of the page is replaced, of the files that are named.
"""

from __future__ import annotations

import json
import sys
import textwrap
from pathlib import Path
from typing import Any

from code_tables import pipe_table

PAGE = Path(__file__).with_name("performance.md")
SLOW, FAST = "paper-12ghz", "paper-77ghz"
HEAD = (
    "level",
    "12 GHz: to the cloud",
    "whole run",
    "first use",
    "peak memory",
    "NumPy",
    "its echoes",
    "77 GHz: to the cloud",
    "peak memory",
)
STAGES = ("doppler", "range", "signal", "noise", "cfar", "cloud", "scatter", "elsewhere")
"""Stages of `analytic` up to the cloud that take more than 0.05 s."""


def models(bench: dict[str, Any]) -> str:
    """Return the table of whole runs, a row for each level."""
    at = {(row["radar"], row["fidelity"]): row for row in bench["models"]}
    rows = []
    for fidelity in bench["settings"]["fidelities"]:
        here, there = at[SLOW, fidelity], at[FAST, fidelity]
        rows.append(
            [
                f"`{fidelity}`",
                f"{here['to_cloud_s']['median']:.1f} s",
                f"{here['whole_s']['median']:.1f} s",
                f"+ {here['first_use']['adds_s']:.0f} s",
                f"{here['peak_memory_mb']:.0f} MB",
                f"{here['paper_over']['to_cloud']:.2g}",
                f"{here['paper_over']['if']:.0f}",
                f"{there['to_cloud_s']['median']:.1f} s",
                f"{there['peak_memory_mb']:.0f} MB",
            ]
        )
    growth = {row["fidelity"]: row["to_cloud"] for row in bench["growth"]["chirps"]}
    most, least = max(growth, key=growth.__getitem__), min(growth, key=growth.__getitem__)
    frame_s = bench["paper"]["radars"][SLOW]["total"]["median"]
    text = (
        f"A frame at 12 GHz takes NumPy {frame_s:.1f} s. 77 GHz has five times the chirps, and "
        f"takes {growth[least]:.1f} (`{least}`) to {growth[most]:.1f} (`{most}`) times as long "
        "to the cloud."
    )
    return f"{pipe_table(HEAD, rows)}\n\n{textwrap.fill(text, 100)}"


def stages(bench: dict[str, Any]) -> str:
    """Return the table of the stages of `analytic` at 12 GHz."""
    row = next(
        row for row in bench["models"] if (row["radar"], row["fidelity"]) == (SLOW, "analytic")
    )
    lines = [[name, f"{row['stages'][name]['median']:.2f}"] for name in STAGES]
    lines.append(["all to the cloud", f"{row['to_cloud_s']['median']:.2f}"])
    return pipe_table(["stage of `analytic`", "it takes [s]"], lines)


def installed(found: dict[str, Any]) -> str:
    """Return the table of what is installed, a row for each package of more than 5 MB."""
    large = [row for row in found["installed"] if row["mb"] > 5]
    small = [row["mb"] for row in found["installed"] if row["mb"] <= 5]
    rows = [[f"{row['package']}", f"{row['mb']:.0f}", row["first"] or "-"] for row in large]
    rows.append([f"{len(small)} others", f"{sum(small):.0f}", ""])
    rows.append(["all", f"{sum(row['mb'] for row in found['installed']):.0f}", ""])
    return pipe_table(["package", "MB", "first imported by"], rows)


def replaced(text: str, name: str, content: str) -> str:
    """Return the text with other content between the markers of that name."""
    begin, end = f"<!-- {name}: begin -->", f"<!-- {name}: end -->"
    before, rest = text.split(begin)
    return f"{before}{begin}\n\n{content}\n\n{end}{rest.split(end)[1]}"


def main() -> int:
    text = PAGE.read_text(encoding="utf-8")
    for name in sys.argv[1:]:
        found = json.loads(Path(name).read_text(encoding="utf-8"))
        for table in (installed,) if "installed" in found else (models, stages):
            text = replaced(text, table.__name__, table(found))
    PAGE.write_text(text, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
