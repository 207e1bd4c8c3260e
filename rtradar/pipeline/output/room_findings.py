"""Ghosts of a room with their places, and what the removal of clutter gained."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.pipeline.capture import Capture
from rtradar.scatter.multipath.ghosts import ghosts

_REST_BINS = 2
"""Doppler bins on either side of zero that hold what does not move: the lobe of a Hann window."""


def room_findings(capture: Capture, maps: Any) -> dict[str, Any]:
    """Return what the maps of a room add to ``summary["room"]``; nothing without a room.

    ``maps`` are those of the run, open. The keys are ``ghosts``, with ``time_s`` and ``paths``, a
    list of path, range [m], velocity [m/s], azimuth [deg] and power [m^2]; and ``clutter``, to
    which ``after_removal_db`` is added, the signal to clutter ratio after removal, at least, and of
    a room in which nobody and nothing moves ``false_alarm_rate``, that of a cell.
    """
    if capture.room is None:
        return {}
    times = np.asarray(maps["time"])
    if "range_doppler_received" in maps:
        time_s = float(maps["range_doppler_received"].attrs["time_s"])
        frame = int(np.abs(times - time_s).argmin())
    else:
        frame = int(np.asarray(maps["detections"]).sum(axis=(1, 2)).argmax())
        time_s = float(times[frame])
    paths = [
        {
            "path": ghost.path,
            "range_m": ghost.range_m,
            "velocity_mps": ghost.velocity_mps,
            "azimuth_deg": math.degrees(ghost.azimuth_rad),
            "power_m2": ghost.power_m2,
        }
        for ghost in ghosts(capture.room.model, capture.radar, time_s)
    ]
    clutter = dict(capture.room.summary["clutter"])
    if not (capture.people or capture.scene.objects):
        clutter["false_alarm_rate"] = float(np.asarray(maps["detections"]).mean())
    before_db = clutter["signal_to_clutter_db"]
    if "range_doppler_received" in maps and before_db is not None:
        velocity = np.asarray(maps["velocity"])
        received, left = (
            at_rest(np.asarray(power), velocity)
            for power in (maps["range_doppler_received"], maps["range_doppler"][frame])
        )
        if received > 0 and left > 0:
            clutter["after_removal_db"] = before_db + 10 * math.log10(received / left)
    return {"ghosts": {"time_s": time_s, "paths": paths}, "clutter": clutter}


def at_rest(power: NDArray[np.floating], velocity: NDArray[np.float64]) -> float:
    """Sum the power of a map (range, velocity) [m^2] within two Doppler bins of rest."""
    bins = velocity / (velocity[1] - velocity[0]) if len(velocity) > 1 else velocity
    return float(power[:, np.abs(bins) < _REST_BINS + 0.5].sum(dtype=np.float64))
