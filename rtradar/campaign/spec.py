"""What a data set shall hold, and how a TOML file says so.

::

    seed = 0                          # of all that is drawn
    pfa = 1e-6                        # of OS-CFAR
    clutter_removal = "none"
    folder = "."                      # of the recordings, from the folder of this file; ${NAME} is what the environment says

    [windows]                         # which intervals of each recording
    start_s = 0.0
    duration_s = 2.0                  # to the end where it is left out
    hop_s = 1.0                       # one interval where it is left out, else one every hop up to end_s
    end_s = 9.0                       # the end of the recording where it is left out

    [each]                            # every combination of these is a sample
    radar = ["paper-12ghz"]           # presets or TOML files
    scene = ["free-space"]            # names or TOML files
    fidelity = ["specular"]
    heading_deg = [0.0]
    snr_db = [20.0]
    person_position_m = [[0.0, 0.0]]  # where the scene says, where it is left out
    radar_position_m = [[-4.0, 1.0, 1.0]]

    [drawn]                           # every recording's interval draws one value from each range, whatever its label
    heading_deg = [-30.0, 30.0]       # not beside [each] heading_deg; snr_db likewise
    snr_db = [15.0, 25.0]
    offset_x_m = [-0.3, 0.3]          # added to the place of the person
    offset_y_m = [-0.3, 0.3]
    tempo = [0.8, 1.25]               # this and the following: of synthetic actors
    amplitude = [0.8, 1.1]
    build = [0.8, 1.25]
    height_m = [1.55, 1.95]

    [[synthetic]]
    label = "walk"                    # kick, punch, jumping_jack
    count = 100                       # of takes, or seeds = [0, 1, 2]
    subjects = 20                     # take k is of subject k modulo 20, who is one and the same person in all activities

    [[recordings]]
    file = "07_05.amc"
    skeleton = "07.asf"
    label = "walk"
    subject = "CMU_07"
    licence = "CMU mocap terms"
    start_s = 0.5                     # these four, where given, in place of those of [windows]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from rtradar.campaign.windows import Windows
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scene import Scene

DRAWN: Mapping[str, tuple[tuple[float, float], float, float]] = {
    "heading_deg": ((0.0, 0.0), -360.0, 360.0),
    "snr_db": ((20.0, 20.0), -100.0, 200.0),
    "offset_x_m": ((0.0, 0.0), -100.0, 100.0),
    "offset_y_m": ((0.0, 0.0), -100.0, 100.0),
    "tempo": ((0.8, 1.25), 0.4, 2.0),
    "amplitude": ((0.8, 1.1), 0.3, 1.25),
    "build": ((0.8, 1.25), 0.4, 2.5),
    "height_m": ((1.55, 1.95), 0.8, 2.5),
}
"""What is drawn: the range where the file gives none, and the least and the most that it may give."""


MOST_SAMPLES = 1_000_000
"""Of one data set. The plan of as many takes 2 GB of memory and half an hour, and each sample is a file of one folder."""


def check_samples(intervals: int, settings: int) -> None:
    """Refuse a data set of more samples than `MOST_SAMPLES`, before any of them takes memory.

    Parameters
    ----------
    intervals : int
        Intervals of recordings and of synthetic takes.
    settings : int
        Combinations of what stands under ``[each]``; every interval meets each.

    Raises
    ------
    InputError
        The message tells both numbers, and how to go on.
    """
    if intervals * settings > MOST_SAMPLES:
        raise InputError(
            f"these are {intervals * settings} samples, {intervals} intervals under {settings} combinations of [each]; "
            f"{MOST_SAMPLES} are allowed: split the file, each part into a folder of its own, as rtradar train takes several"
        )


@dataclass(frozen=True)
class Actor:
    """Takes of synthetic actors: ``seeds`` of the takes, ``subjects`` by their numbers."""

    label: str
    seeds: tuple[int, ...]
    subjects: tuple[int, ...]


@dataclass(frozen=True)
class Recorded:
    """One recording: ``name`` as the file says it, ``path`` and ``skeleton`` where they are."""

    name: str
    path: Path
    skeleton: Path | None
    label: str
    subject: str
    licence: str
    windows: Windows


@dataclass(frozen=True)
class Setting:
    """One combination of what stands under ``[each]``; None: drawn, or as the scene says."""

    radar: Radar
    scene: Scene
    fidelity: str
    heading_deg: float | None
    snr_db: float | None


@dataclass(frozen=True)
class Spec:
    """A data set as a file describes it; the head of this module says what each is."""

    seed: int
    pfa: float
    clutter_removal: str
    windows: Windows
    settings: tuple[Setting, ...]
    drawn: Mapping[str, tuple[float, float]]
    actors: tuple[Actor, ...]
    recordings: tuple[Recorded, ...]
