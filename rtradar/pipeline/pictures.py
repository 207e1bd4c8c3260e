"""Pictures of a run, drawn from its maps and clouds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from rtradar.pipeline.capture import Capture
from rtradar.pipeline.indoors import Indoors
from rtradar.pipeline.processing import Clouds
from rtradar.report.figures import maps as figures
from rtradar.report.figures import rooms
from rtradar.scatter.multipath.ghosts import ghosts

_COLUMNS = 600
"""Time steps in a picture, those of 3 s; longer maps are averaged, so that memory does not grow."""

_SPATIAL_DOTS = 20_000
_TRACK_POINTS = 400


def draw_pictures(folder: Path, capture: Capture, clouds: Clouds) -> dict[str, Path]:
    """Draw ``maps.h5`` of this folder, the clouds, and the room if there is one.

    Returns the PNG files by their titles, in the order in which they are best looked at.
    """
    drawn: dict[str, Path] = {}
    radar, title, spreading = capture.radar, capture.title, capture.settings.spreading
    options: Any = {"spreading": spreading, "window_functions": capture.processing.window_functions}

    def to(name: str, file: str) -> Path:
        drawn[name] = folder / file
        return drawn[name]

    with h5py.File(folder / "maps.h5") as maps:
        power, times = thinned(maps, "range_time", "slow_time")
        heading = title + removed(maps["range_time"])
        file = to("Range over time", "range_time.png")
        figures.draw_range_time(file, power, times, radar, heading, spreading=spreading)
        if len(maps["spectrogram_time"]):
            power, times = thinned(maps, "spectrogram", "spectrogram_time")
            velocity = maps["spectrogram_velocity"][:]
            heading = title + removed(maps["spectrogram"])
            file = to("Spectrogram", "spectrogram.png")
            figures.draw_spectrogram(file, power, times, velocity, radar, heading, **options)
        frame = busiest_frame(maps)
        cleaned = removed(maps["range_doppler"])
        heading = f"{title}, window at {float(maps['time'][frame]):.2f} s{cleaned}"
        power, mask = maps["range_doppler"][frame], maps["detections"][frame].astype(bool)
        file = to("Range-Doppler map and detections", "range_doppler.png")
        figures.draw_range_doppler(file, power, mask, radar, heading, spreading=spreading)
        angles = {
            angle: (maps[f"range_{angle}"][frame], maps[angle][:])
            for angle in ("azimuth", "elevation")
            if angle in maps
        }
        if angles:
            panels = " and ".join(f"range-{angle}" for angle in angles).capitalize()
            file = to(panels, "range_angle.png")
            figures.draw_range_angle(file, angles, radar, heading, **options)
        heading = title + cleaned
        figures.draw_rdt_cloud(
            to("Range-Doppler-time cloud", "cloud_rdt.png"), clouds.rdt.points, heading
        )
        if angles:
            strongest = clouds.spatial.strongest()
            every = math.ceil(max(len(strongest.points), 1) / _SPATIAL_DOTS)
            points, velocity = strongest.points[::every], strongest.velocity[::every]
            file = to("Spatial cloud", "cloud_xyz.png")
            figures.draw_spatial_cloud(file, points, velocity, radar, heading)
        if capture.inside:
            drawn |= _draw_room(folder, capture, capture.inside, maps, frame)
    return drawn


def _draw_room(
    folder: Path, capture: Capture, inside: Indoors, maps: Any, frame: int
) -> dict[str, Path]:
    """Draw the plan of a room, its walls over range and azimuth, and clutter before and after.

    What was received is shown of the frame kept before clutter removal, or else of this ``frame``.
    """
    radar, body, scene = capture.radar, capture.body, capture.scene
    suffix = "_received" if "range_doppler_received" in maps else ""
    if suffix:
        time_s = float(maps["range_doppler_received"].attrs["time_s"])
        frame = int(np.abs(maps["time"][:] - time_s).argmin())
    else:
        time_s = float(maps["time"][frame])

    def received(name: str) -> NDArray[Any]:
        return np.asarray(maps[name + suffix][:] if suffix else maps[name][frame])

    panels = {"As received": (received("range_doppler"), received("detections").astype(bool))}
    if suffix:
        after = removed(maps["range_doppler"]).strip().capitalize()
        panels[after] = maps["range_doppler"][frame], maps["detections"][frame].astype(bool)
    found = ghosts(inside.model, radar, time_s)
    heading = f"{capture.title}, window at {time_s:.2f} s"
    # Out and back over the same walls is as long as the reverse: one mark, with their names.
    by_walls = {_walls(ghost.path): ghost for ghost in found}
    marked = [(walls, ghost.range_m, ghost.velocity_mps) for walls, ghost in by_walls.items()]
    name = f"Range-Doppler{' before and after' if suffix else ''}, and ghosts"
    drawn = {name: folder / "clutter_removal.png"}
    rooms.draw_before_after(drawn[name], panels, marked, radar, heading)
    if "azimuth" in maps and "range_azimuth" + suffix in maps:
        name = "Range-azimuth with walls and ghosts"
        drawn[name] = folder / "range_azimuth_walls.png"
        places = [(ghost.path, ghost.range_m, ghost.azimuth_rad) for ghost in found]
        power, azimuth = received("range_azimuth"), maps["azimuth"][:]
        windows = capture.processing.window_functions
        axes = power, azimuth, scene, radar
        rooms.draw_range_azimuth_with_walls(drawn[name], *axes, places, heading, windows)
    track = body.motion.at(np.linspace(0, body.duration_s, _TRACK_POINTS))[0][:, 0, :2]
    middle = body.motion.at([min(time_s, body.duration_s)])[0][0, 0]
    paths = {ghost.path: inside.model.course(ghost.path, middle) for ghost in found}
    drawn["Plan of the room, with paths"] = folder / "plan.png"
    rooms.draw_plan(folder / "plan.png", scene, radar, track, paths, heading)
    return drawn


def _walls(path: str) -> str:
    return " > ".join(sorted(name for name in path.split(" > ") if name != "body"))


def removed(data: Any) -> str:
    """Return a second line of a title for an open dataset whose static clutter was removed."""
    how = data.attrs["clutter_removal"]
    return "" if how == "none" else f"\nstatic clutter removed: {how}"


def busiest_frame(maps: Any) -> int:
    """Return the index of the frame with the most detections in an open file of maps."""
    return int(np.argmax([np.count_nonzero(mask) for mask in maps["detections"]]))


def thinned(maps: Any, name: str, axis: str) -> tuple[NDArray[np.floating], NDArray[np.float64]]:
    """Return a map (time, ...) and its times [s], averaged to a few hundred steps."""
    every = math.ceil(len(maps[axis]) / _COLUMNS)
    starts = range(0, len(maps[axis]), every)
    times = np.array([maps[axis][first : first + every].mean() for first in starts])
    return np.stack([maps[name][first : first + every].mean(axis=0) for first in starts]), times
