"""The items of the paper in its order, and its own choices of a run with a warning for each fault.

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

from rtradar.settings import RunOptions

TEXTS = ("paper", "ours", "difference", "reason")
"""Texts of an item, in the order of the page."""


PAPER_OS_SCALE = 5.0003
"""OS-CFAR multiplier of the paper's program, where its search ends for any number of cells."""

AS_PAPER: RunOptions = {
    "fidelity": "analytic-paper",
    "spreading": False,
    "snr_db": 20.0,
    "detector": "os-cfar",
    "detector_options": {"guard": 2, "train": 4, "quantile": 0.75, "scale": PAPER_OS_SCALE},
    "range_window": "hann",
    "doppler_window": "hann",
}
"""Options of `rtradar.run` that the paper chose; `paper_warnings` says which are faults."""

SIZES = ("500", "1000", "2000", "3000")
"""Points of a cloud, the columns of table 4."""

CURVES = ("train_loss", "train_accuracy", "test_loss", "test_accuracy")
"""What is kept of each epoch of a training."""


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


def paper_warnings() -> tuple[str, ...]:
    """Say what is wrong with the choices of `AS_PAPER`, and which faults are not repeated.

    Returns
    -------
    tuple of str
        One sentence for each.

    Examples
    --------
    >>> from rtradar.paper import paper_warnings
    >>> len(paper_warnings())
    5
    """
    return tuple(text.format(scale=PAPER_OS_SCALE) for text in contents()["warnings"])
