"""What the parts of the page work with: its folder, and who moves in each of its activities."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rtradar.errors import InputError
from rtradar.motion import Motion, load_motion, synthetic_motion

ACTIVITIES = {"jumping_jack": 3.0, "kick": 3.0, "punch": 2.5, "walk": 3.0}
"""Activities in the order of the paper's pictures, and how much of each it shows [s]."""

TITLES = dict(zip(ACTIVITIES, ("Jumping jack", "Kick", "Punch", "Walk"), strict=True))
"""Titles of the activities."""

_RECORDINGS = {
    "jumping_jack": ("jumpingJack3Reps_001", "jumpingJack"),
    "kick": ("kickLSide2Reps_001", "kick"),
    "punch": ("punchLSide2Reps_001", "punch"),
    "walk": ("walkLeft3Steps_001", "walk"),
}


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
            return synthetic_motion(activity, seed=0, duration_s=ACTIVITIES[activity])
        return load_motion(path, skeleton=_skeleton(path))

    @property
    def named(self) -> str:
        """Who does each activity, in words."""
        actors = dict.fromkeys(ACTIVITIES, "a synthetic actor")
        actors |= {name: f"HDM05 file {path.name}" for name, path in self.recordings.items()}
        return "; ".join(f"{TITLES[name].lower()}: {actor}" for name, actor in actors.items())


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
    for activity, patterns in _RECORDINGS.items():
        for pattern in patterns:
            fitting = [path for path in there if f"_{pattern}" in path.name]
            if fitting and activity not in found:
                found[activity] = fitting[0]
    if not found:
        raise InputError(
            f"--mocap {folder}: it holds no HDM_*.amc of a jumping jack, kick, punch or walk; "
            "give a folder of HDM05, or leave it out for synthetic actors"
        )
    return found


def _skeleton(path: Path) -> Path:
    """Return the skeleton of a recording, which begins with the same ``HDM_`` and subject."""
    return path.with_name("_".join(path.name.split("_")[:2]) + ".asf")
