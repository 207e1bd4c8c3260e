"""The items of the paper in its order, and its own choices of a run with a warning for each fault.

The texts are in ``items.toml``. Figures in braces, such as ``{v_max:.2f}``, are filled in with what
the parts of `rtradar.paper` have measured, so that no figure of ours is typed. Who moves in each of
the paper's activities is there, too.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any, NamedTuple

from rtradar.errors import InputError
from rtradar.motion import Motion, load_motion, synthetic_motion
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


class Activity(NamedTuple):
    """One of the paper's activities, as ``items.toml`` has it."""

    title: str
    shown_s: float
    class_s: float
    recordings: list[str]


ACTIVITIES = {name: Activity(**one) for name, one in contents()["activities"].items()}
"""Activities in the order of the paper's pictures."""


@dataclass(frozen=True)
class Sources:
    """What the parts of the page work with.

    Parameters
    ----------
    out : path
        Folder of the page and its pictures.
    quick : bool
        Whether long measurements take fewer cases.
    full : bool
        Whether what takes hours is measured anew.
    recordings : mapping
        Files of HDM05 by activity; a synthetic actor does what has none.
    """

    out: Path
    quick: bool
    full: bool
    recordings: Mapping[str, Path]

    def motion(self, activity: str) -> Motion:
        """Load the recording of an activity, or let a synthetic actor do it.

        Parameters
        ----------
        activity : str
            Key of `ACTIVITIES`.

        Returns
        -------
        Motion

        Raises
        ------
        InputError
            If the recording cannot be read.
        """
        if (path := self.recordings.get(activity)) is None:
            return synthetic_motion(activity, seed=0, duration_s=ACTIVITIES[activity].shown_s)
        # The skeleton of a recording begins with the same ``HDM_`` and subject.
        skeleton = path.with_name("_".join(path.name.split("_")[:2]) + ".asf")
        return load_motion(path, skeleton=skeleton)

    @property
    def named(self) -> str:
        """Who does each activity, in words."""
        actors = dict.fromkeys(ACTIVITIES, "a synthetic actor")
        actors |= {name: f"HDM05 file {path.name}" for name, path in self.recordings.items()}
        named = ((ACTIVITIES[name].title.lower(), actor) for name, actor in actors.items())
        return "; ".join(f"{title}: {actor}" for title, actor in named)


def find_recordings(folder: Path | None) -> dict[str, Path]:
    """Find a recording of each activity in a folder of HDM05, the paper's own where it is there.

    Parameters
    ----------
    folder : path, optional
        Folder of ``.amc`` files with the ``.asf`` file of each subject.

    Returns
    -------
    dict
        File by activity; only those that are there.

    Raises
    ------
    InputError
        If the folder holds none.
    """
    if folder is None:
        return {}
    there = sorted(folder.rglob("HDM_*.amc"))
    found = {}
    # Later patterns overwrite earlier ones, so the preferred recording comes last.
    for name, activity in ACTIVITIES.items():
        for pattern in reversed(activity.recordings):
            if fitting := [path for path in there if f"_{pattern}" in path.name]:
                found[name] = fitting[0]
    if not found:
        raise InputError(
            f"--mocap {folder}: it holds no HDM_*.amc of a jumping jack, kick, punch or walk; "
            "give a folder of HDM05, or leave it out for synthetic actors"
        )
    return found
