"""Pages repeat figures of each other and of the code; they must be the same everywhere."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from rtradar.cli.captures import _FLAGS
from rtradar.settings import RunSettings

ROOT = Path(__file__).parents[1]


def rows(page: str, heading: str) -> list[list[str]]:
    """Cells of the table that has this heading; empty cells at its end are left out."""
    lines = iter((ROOT / page).read_text(encoding="utf-8").splitlines())
    found = []
    for line in lines:
        if line.startswith(heading):
            next(lines)
            for row in lines:
                if not row.startswith("|"):
                    break
                found.append([cell.strip() for cell in row.strip().strip("|").split(" | ")])
    assert found, f"{page} has no table {heading}"
    return found


CLAIMS = rows("README.md", "| claim | worst")
LEVELS = rows("README.md", "| level | what it computes")


@pytest.mark.parametrize("claim", CLAIMS, ids=lambda claim: claim[0])
def test_claims_of_the_readme_are_those_of_the_validation(claim: list[str]) -> None:
    figures = [row[2:4] + row[5:] for row in rows("docs/validation.md", "| key | claim")]
    assert claim[1:] in figures


@pytest.mark.parametrize("level", LEVELS, ids=lambda level: level[0])
def test_costs_and_errors_of_the_readme_are_those_of_the_page_of_levels(level: list[str]) -> None:
    error, _, cost = next(
        row[1:4]
        for row in rows("docs/choosing-a-level.md", "| level | 12 GHz: complex error")
        if row[0] == level[0]
    )
    assert (level[4] if error != "-" else "-", level[3]) == (error, cost)


def test_defaults_of_the_page_for_beginners_are_those_of_the_settings() -> None:
    compared = 0
    for options, _, shown in rows("docs/start.md", "| option | meaning | default"):
        for name, (flag, _) in _FLAGS.items():
            default, text = getattr(RunSettings(), name), shown.strip("`")
            if not re.search(rf"`{flag}[ `]", options) or name in ("start_s", "duration_s"):
                continue
            compared += 1
            if isinstance(default, bool):
                assert text == ("on" if default else "off"), flag
            elif default is None:
                assert not text, flag
            else:
                assert type(default)(text) == default, flag
    assert compared > 10
