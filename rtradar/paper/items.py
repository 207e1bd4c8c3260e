"""The items of the paper in its order: what it shows, what we show, the difference and why.

The texts are in ``items.toml``. Figures in braces, such as ``{v_max:.2f}``, are filled in with what
the parts of `rtradar.paper` have measured, so that no figure of ours is typed.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

TEXTS = ("paper", "ours", "difference", "reason")
"""Texts of an item, in the order of the page."""


@dataclass(frozen=True)
class Item:
    """A figure, table, equation or stated number of the paper, beside ours.

    Parameters
    ----------
    id : str
        Identifier, such as ``figure-9``, ``table-1``, ``equation-3`` or ``number-hop``.
    title : str
        Name and subject.
    paper, ours, difference, reason : str
        What the paper shows, what we show, how far both are apart, and why.
    picture : str, optional
        Name of the picture, a PNG file beside the page.
    """

    id: str
    title: str
    paper: str
    ours: str
    difference: str
    reason: str
    picture: str | None = None

    def filled(self, figures: Mapping[str, Any]) -> Item | None:
        """Fill measured figures into the texts.

        Parameters
        ----------
        figures : mapping
            Measured values by their names.

        Returns
        -------
        Item or None
            Copy with the values in place of the braces; None where one is not measured yet.
        """
        try:
            texts = {name: getattr(self, name).format_map(figures) for name in TEXTS}
        except KeyError:
            return None
        return Item(self.id, self.title, **texts, picture=self.picture)


@cache
def contents() -> dict[str, Any]:
    """Read the tables of ``items.toml``.

    Returns
    -------
    dict
        ``items``, ``activities`` and ``warnings``.
    """
    text = files("rtradar.paper").joinpath("items.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def load_items() -> tuple[Item, ...]:
    """Read all items, with braces where figures belong.

    Returns
    -------
    tuple of Item
        Items in the order of the paper.
    """
    return tuple(Item(**entry) for entry in contents()["items"])
