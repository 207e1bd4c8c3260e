"""Augmentation of recordings: copies that other people might have made, at another moment."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.motion import Motion
from rtradar.motion.skeleton import NODES, to_nodes
from rtradar.system.seeds import stream

VARIED: Mapping[str, tuple[tuple[float, float], float, float]] = {
    "tempo": ((0.8, 1.25), 0.4, 2.5),
    "height": ((0.9, 1.1), 0.5, 2.0),
    "build": ((0.8, 1.25), 0.4, 2.5),
    "drift_mps": ((0.0, 0.3), 0.0, 3.0),
    "start_s": ((-0.3, 0.3), -10.0, 10.0),
}
"""What a copy varies: default range, smallest and largest allowed value. Tempo, height and build
are factors, a drift has any direction, and the start is moved."""

_STREAM = 5  # differs from the random streams of what else a seed draws
_MIRRORED = np.array(
    [NODES.index({"l": "r", "r": "l"}[name[0]] + name[1:] if name[1] == "_" else name)
     for name in NODES]
)  # fmt: skip


class Augmented(NamedTuple):
    """``copies`` of each interval of a recording, half of them mirrored, drawn from ``ranges``."""

    copies: int
    ranges: Mapping[str, tuple[float, float]]

    def draw(self, seed: int, start_s: float, duration_s: float, length_s: float) -> dict[str, Any]:
        """Draw a copy of an interval of a recording of this length [s], as plain JSON values.

        The recording has no end before the copy does: a tempo or start that needs more is changed.
        """
        random = np.random.default_rng(stream(seed, _STREAM))
        drawn = {
            key: round(low + (high - low) * float(random.random()), 4)
            for key, (low, high) in self.ranges.items()
        }
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
