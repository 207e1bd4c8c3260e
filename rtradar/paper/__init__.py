"""The paper beside what this package gives: its items one by one, and its own choices of a run."""

from __future__ import annotations

from rtradar.paper.items import AS_PAPER, Item, paper_warnings
from rtradar.paper.make import make_paper

__all__ = ["AS_PAPER", "Item", "make_paper", "paper_warnings"]
