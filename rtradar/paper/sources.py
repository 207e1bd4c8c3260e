"""What the parts of the page work with: its folder, and who moves in each of its activities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from rtradar.errors import InputError
from rtradar.motion import Motion, load_motion, synthetic_motion
from rtradar.paper.items import contents


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
