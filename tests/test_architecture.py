"""ARCHITECTURE.md: its picture is drawn from the code."""

from __future__ import annotations

import runpy
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
pytest.importorskip(
    "grimp", reason="the picture of the imports needs grimp: pip install --editable '.[dev]'"
)
DRAWN = runpy.run_path(str(ROOT / "docs" / "draw_architecture.py"))
FLOWS = cache(DRAWN["flows"])  # grimp reads all modules for it
DRAWN["drawing"].__globals__["flows"] = FLOWS


@pytest.mark.slow
def test_the_picture_is_that_of_the_code() -> None:
    there = (ROOT / "docs" / "architecture.svg").read_text(encoding="utf-8")
    assert there == DRAWN["drawing"](), "draw it anew: python docs/draw_architecture.py"


def test_data_flow_down_the_picture() -> None:
    """Every flow, drawn or not, goes from an earlier row to a later one."""
    rows = DRAWN["order"]()
    assert [edge for edge in FLOWS().edges if rows.index(edge[0]) >= rows.index(edge[1])] == []
    assert {"Motion", "Body", "Echoes"} <= set().union(*DRAWN["classes_handed_on"]().values())


def test_the_page_names_every_package() -> None:
    page = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    assert [name for name in DRAWN["order"]() if f"`{name}" not in page] == []
