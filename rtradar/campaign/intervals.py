"""Intervals of recordings and takes, and copies that other people might have made.

Intervals lie at equal steps, at random, or round the strikes. A copy is the same motion mirrored,
faster, taller or drifting, at another moment.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.motion import Motion
from rtradar.motion.skeleton import NODES, to_nodes
from rtradar.system.fields import Limits, check_fields, keys_of, within
from rtradar.system.seeds import stream

_SLACK_S = 1e-6  # by which rounding may shorten a recording
_PLACES_STREAM = 4  # differs from the random streams of what else a seed draws
_STEP_S, _SMOOTHING_S = 1 / 60, 0.04  # of the speeds in which strikes are sought
_LEAST_STRIKE = 0.5  # of the fastest one
_MIDDLE = (0.25, 0.75)  # part of an interval in which its strike lies


@dataclass(frozen=True)
class Intervals:
    """Intervals of ``duration_s`` from ``start_s`` on, one every ``hop_s``, all before ``end_s``.

    Without ``duration_s`` there is one interval to the end, without ``hop_s`` a single one, and
    without ``end_s`` the recording ends them. Where ``place`` is ``random`` or ``strike``, there
    are at most ``count`` intervals, which do not overlap: anywhere, or with an instant at which a
    hand or a foot is fastest somewhere in their middle half. Then the time at which a movement
    begins does not give its kind away.
    """

    start_s: Annotated[float, Limits(0.0, 1e5)] = 0.0
    duration_s: Annotated[float | None, Limits(1e-3, 1e5)] = None
    hop_s: Annotated[float | None, Limits(1e-3, 1e5)] = None
    end_s: Annotated[float | None, Limits(1e-3, 1e5)] = None
    place: Annotated[str, Limits(allowed=("regular", "random", "strike"))] = "regular"
    count: Annotated[int, Limits(1, 10_000)] = 1

    def __post_init__(self) -> None:
        check_fields(self)
        # Keys that have no effect together are refused.
        regular = self.place == "regular"
        if self.count > 1 if regular else self.hop_s is not None:
            key = "count" if regular else "hop_s"
            raise InputError(f"{key} has no use where place is '{self.place}'")
        if self.duration_s is None and (self.hop_s is not None or not regular):
            key = "hop_s" if regular else f"place = '{self.place}'"
            raise InputError(f"{key} needs duration_s; give both")
        needed = self.start_s + (self.duration_s or 1e-3) - _SLACK_S
        if self.end_s is not None and self.end_s < needed:
            raise InputError(
                f"end_s = {self.end_s:g} leaves no room for one interval from {self.start_s:g} s on"
            )

    @property
    def needed_s(self) -> float | None:
        """Length of a recording that all intervals need [s]; None if not known in advance."""
        if self.end_s is not None:
            return self.end_s
        return None if self.duration_s is None else self.start_s + self.duration_s

    def most(self, length_s: float | None = None) -> int:
        """Return the largest number of intervals of a recording of this length [s].

        Without a length it is a lower bound.
        """
        if self.place != "regular":
            return self.count
        end = length_s if self.end_s is None else self.end_s
        if self.hop_s is None or self.duration_s is None or end is None:
            return 1
        return 1 + math.floor((end - self.start_s - self.duration_s + _SLACK_S) / self.hop_s)

    def lacks(self, name: str, length_s: float) -> str | None:
        """Say that a recording of this length [s] is too short for one interval; else None."""
        end = length_s if self.end_s is None else self.end_s
        needed = self.start_s + (self.duration_s or 1e-3)
        if max(end, needed) <= length_s + _SLACK_S:
            return None
        return (
            f"recording '{name}' has {length_s:.6g} s, "
            f"too short for an interval from {self.start_s:g} to "
            f"{max(end, needed):.6g} s; shorten it (start_s, duration_s, end_s)"
        )

    def of(
        self, name: str, length_s: float, seed: int = 0, motion: Callable[[], Motion] | None = None
    ) -> list[tuple[float, float]]:
        """Return start and duration [s] of each interval of a recording of this length [s].

        ``seed`` is that of their places, and ``motion`` makes what strikes are sought in. An
        InputError is raised if the recording is too short for one interval.
        """
        if (text := self.lacks(name, length_s)) is not None:
            raise InputError(text)
        # One interval to the end, intervals at equal steps, or intervals drawn at random.
        end = length_s if self.end_s is None else self.end_s
        if self.duration_s is None:
            return [(self.start_s, round(end - self.start_s, 6))]
        if self.place == "regular":
            hop_s, count = self.hop_s or 0.0, self.most(length_s)
            starts = [self.start_s + k * hop_s for k in range(count)]
        else:
            random = np.random.default_rng(stream(seed, _PLACES_STREAM))
            strikes = strike_times(motion()) if self.place == "strike" and motion else None
            starts = self._drawn(end, random, strikes)
        return [(round(start, 6), self.duration_s) for start in starts]

    def _drawn(
        self, end: float, random: np.random.Generator, strikes: NDArray[np.float64] | None
    ) -> list[float]:
        """Draw starts of intervals that do not overlap, ascending."""
        assert self.duration_s is not None  # as was checked
        last = max(end - self.duration_s, self.start_s)
        if strikes is None:
            # As many equal parts as there are intervals, one anywhere in each of them.
            count = max(1, min(self.count, int((end - self.start_s) / self.duration_s)))
            free = (last + self.duration_s - self.start_s) / count - self.duration_s
            slots = self.start_s + np.arange(count) * (free + self.duration_s)
            return sorted(np.minimum(slots + max(free, 0.0) * random.random(count), last).tolist())
        # Each strike, in random order, at a random place in the middle half of an interval, as long
        # as intervals do not overlap. Without any strike, anywhere.
        inside = strikes[(strikes >= self.start_s) & (strikes <= end)]
        wanted = random.permutation(inside) - self.duration_s * random.uniform(
            *_MIDDLE, size=len(inside)
        )
        starts: list[float] = []
        for start in np.clip(wanted, self.start_s, last).tolist():
            if all(abs(start - other) >= self.duration_s for other in starts):
                starts.append(start)
        return sorted(starts[: self.count]) or self._drawn(end, random, None)


INTERVAL_KEYS = keys_of(Intervals)[1]
"""Keys of the intervals in files."""


def strike_times(motion: Motion) -> NDArray[np.float64]:
    """Return the times [s] at which a hand or a foot is fastest relative to the hips, (strike,).

    They are the maxima of the largest of the four speeds that reach at least half of the greatest.
    """
    from scipy.ndimage import gaussian_filter1d
    from scipy.signal import find_peaks

    # Speeds of wrists and ankles relative to the root, smoothed; the largest of the four at each
    # time.
    nodes = to_nodes(motion)
    times = np.arange(0.0, nodes.duration_s, _STEP_S)
    positions = nodes.at(times)[0]
    limbs = [NODES.index(f"{side}_{end}") for side in "lr" for end in ("wrist", "ankle")]
    relative = positions[:, limbs] - positions[:, :1]
    speeds = np.linalg.norm(np.gradient(relative, _STEP_S, axis=0), axis=2).max(axis=1)
    speed = gaussian_filter1d(speeds, _SMOOTHING_S / _STEP_S)
    return np.asarray(times[find_peaks(speed, height=_LEAST_STRIKE * speed.max())[0]])


_STREAM = 5  # differs from the random streams of what else a seed draws
_MIRRORED = np.array(
    [NODES.index({"l": "r", "r": "l"}[name[0]] + name[1:] if name[1] == "_" else name)
     for name in NODES]
)  # fmt: skip


@dataclass(frozen=True)
class Augmented:
    """``copies`` of each interval of a recording, half of them mirrored, drawn from ranges.

    Tempo, height and build are factors, a drift has any direction, and the start is moved.
    """

    copies: Annotated[int, Limits(1, 1000)]
    tempo: Annotated[tuple[float, float], within(0.4, 2.5)] = (0.8, 1.25)
    height: Annotated[tuple[float, float], within(0.5, 2.0)] = (0.9, 1.1)
    build: Annotated[tuple[float, float], within(0.4, 2.5)] = (0.8, 1.25)
    drift_mps: Annotated[tuple[float, float], within(0.0, 3.0)] = (0.0, 0.3)
    start_s: Annotated[tuple[float, float], within(-10.0, 10.0)] = (-0.3, 0.3)

    def __post_init__(self) -> None:
        check_fields(self)

    def draw(self, seed: int, start_s: float, duration_s: float, length_s: float) -> dict[str, Any]:
        """Draw a copy of an interval of a recording of this length [s], as plain JSON values.

        The recording has no end before the copy does: a tempo or start that needs more is changed.
        """
        random = np.random.default_rng(stream(seed, _STREAM))
        ranges = {key: value for key, value in vars(self).items() if key != "copies"}
        # A number for each range, in a fixed order.
        drawn = {
            key: round(low + (high - low) * float(random.random()), 4)
            for key, (low, high) in ranges.items()
        }
        # A copy at a higher tempo needs more of the recording; rounded down, it never needs more
        # than there is.
        most = math.floor(1e4 * length_s / duration_s) / 1e4
        tempo = min(drawn["tempo"], max(most, 1.0))
        last = max(0.0, length_s - duration_s * tempo)
        return {
            "start_s": math.floor(1e4 * min(max(start_s + drawn["start_s"], 0.0), last)) / 1e4,
            "varied": {
                "mirror": bool(random.integers(2)),
                "tempo": tempo,
                "height": drawn["height"],
                "build": drawn["build"],
                "drift_mps": drawn["drift_mps"],
                "drift_deg": round(float(random.uniform(-180.0, 180.0)), 2),
            },
        }


def vary(motion: Motion, how: Mapping[str, Any]) -> Motion:
    """Return the motion as a copy of `Augmented.draw` has it."""
    # Mirror, size, drift over the floor, and tempo, which is another rate of frames.
    nodes = to_nodes(motion)
    if how["mirror"]:
        nodes = mirrored(nodes)
    nodes = nodes.scaled(how["height"])
    angle = math.radians(how["drift_deg"])
    way = how["drift_mps"] * np.array([math.cos(angle), math.sin(angle), 0.0])
    tempo = how["tempo"]
    times = nodes.frame_times / tempo
    return dataclasses.replace(
        nodes,
        root_positions=nodes.root_positions + times[:, None] * way,
        rate_hz=nodes.rate_hz * tempo,
        first_frame_s=nodes.first_frame_s / tempo,
        length_s=nodes.duration_s / tempo,
        girth=nodes.girth * how["build"],
    )


def mirrored(nodes: Motion) -> Motion:
    """Mirror a motion of the 22 nodes at the plane y = 0: left becomes right."""

    def flipped(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        return vectors * [1.0, -1.0, 1.0]

    return dataclasses.replace(
        nodes,
        offsets=flipped(nodes.offsets[_MIRRORED]),
        root_positions=flipped(nodes.root_positions),
        # The axis of a rotation is a pseudovector: its other two components change sign.
        rotations=nodes.rotations[:, _MIRRORED] * [-1.0, 1.0, -1.0, 1.0],
    )
