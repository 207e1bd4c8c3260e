"""The pictures of one run, drawn from its maps."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from rtradar.pipeline.cloud_maker import Clouds
from rtradar.radar import Radar
from rtradar.report import (
    draw_range_angle,
    draw_range_doppler,
    draw_range_time,
    draw_rdt_cloud,
    draw_spatial_cloud,
    draw_spectrogram,
)

_COLUMNS = 600
"""Steps of time in a picture, those of 3 s; longer captures are averaged to as many, so that memory does not grow."""

_SPATIAL_DOTS = 20_000


def draw_pictures(
    folder: Path, radar: Radar, clouds: Clouds, title: str, *, spreading: bool = True
) -> dict[str, Path]:
    """Draw what ``maps.h5`` in this folder holds, and the clouds, into the same folder.

    Parameters
    ----------
    folder : path
    radar : Radar
    clouds : Clouds
    title : str
        Of the run.
    spreading : bool
        Whether amplitudes hold the loss over distance.

    Returns
    -------
    dict of title to path
        PNG files, in the order in which they are best looked at.
    """
    drawn: dict[str, Path] = {}

    def to(name: str, file: str) -> Path:
        drawn[name] = folder / file
        return drawn[name]

    with h5py.File(folder / "maps.h5") as maps:
        power, times = thinned(maps, "range_time", "slow_time")
        what = title + removed(maps["range_time"])
        draw_range_time(
            to("Range over time", "range_time.png"), power, times, radar, what, spreading=spreading
        )
        if len(maps["spectrogram_time"]):
            power, times = thinned(maps, "spectrogram", "spectrogram_time")
            velocity, what = maps["spectrogram_velocity"][:], title + removed(maps["spectrogram"])
            file = to("Spectrogram", "spectrogram.png")
            draw_spectrogram(file, power, times, velocity, radar, what, spreading=spreading)
        window = busiest_window(maps)
        cleaned = removed(maps["range_doppler"])
        moment = f"{title}, window at {float(maps['time'][window]):.2f} s{cleaned}"
        power, mask = maps["range_doppler"][window], maps["detections"][window].astype(bool)
        file = to("Range-Doppler map and detections", "range_doppler.png")
        draw_range_doppler(file, power, mask, radar, moment, spreading=spreading)
        angles = {
            angle: (maps[f"range_{angle}"][window], maps[angle][:])
            for angle in ("azimuth", "elevation")
            if angle in maps
        }
    if angles:
        panels = " and ".join(f"range-{angle}" for angle in angles).capitalize()
        draw_range_angle(to(panels, "range_angle.png"), angles, radar, moment, spreading=spreading)
    draw_rdt_cloud(
        to("Range-Doppler-time cloud", "cloud_rdt.png"), clouds.rdt.points, title + cleaned
    )
    if angles:
        shown = clouds.spatial.strongest()
        every = math.ceil(max(len(shown.points), 1) / _SPATIAL_DOTS)
        points, velocity = shown.points[::every], shown.velocity[::every]
        draw_spatial_cloud(
            to("Spatial cloud", "cloud_xyz.png"), points, velocity, radar, title + cleaned
        )
    return drawn


def removed(data: Any) -> str:
    """A further line of a title: how static clutter was removed from an open dataset of maps; empty where it was not."""
    how = data.attrs["clutter_removal"]
    return "" if how == "none" else f"\nstatic clutter removed: {how}"


def busiest_window(maps: Any) -> int:
    """Index of the window with the most detections, of an open file of maps."""
    counts = [int(np.count_nonzero(mask)) for mask in maps["detections"]]
    return int(np.argmax(counts))


def thinned(maps: Any, name: str, axis: str) -> tuple[NDArray[np.floating], NDArray[np.float64]]:
    """A map (time, ...) and its times [s], averaged to a few hundred steps."""
    every = math.ceil(len(maps[axis]) / _COLUMNS)
    starts = range(0, len(maps[axis]), every)
    times = np.array([maps[axis][first : first + every].mean() for first in starts])
    return np.stack([maps[name][first : first + every].mean(axis=0) for first in starts]), times
