"""Pictures of a run, drawn from its maps and clouds."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rtradar.pipeline.capture import Capture, PreparedRoom
from rtradar.pipeline.output.truth import truth_of
from rtradar.pipeline.output.writer import read_maps
from rtradar.pipeline.result import Result
from rtradar.report import rooms, write_report
from rtradar.report.plots import Plots
from rtradar.report.run_view import RunView
from rtradar.scatter.multipath.path_summary import Ghost, ghosts
from rtradar.system.figure_style import new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TRACK_POINTS = 400


def draw_pictures(folder: Path, capture: Capture, result: Result) -> dict[str, Path]:
    """Draw ``maps.h5`` of this folder, the clouds of its result, and the room if there is one.

    Returns the PNG files by their titles, in the order in which they are best looked at.
    """
    drawn, frame = draw_found(folder, result)
    if capture.room:
        with read_maps(folder / "maps.h5") as maps:
            drawn |= _draw_room(folder, capture, capture.room, maps, frame)
    return drawn


def draw_found(folder: Path, result: Result) -> tuple[dict[str, Path], int]:
    """Draw ``maps.h5`` of this folder and the clouds; also return the frame that was chosen."""
    drawn: dict[str, Path] = {}
    with read_maps(folder / "maps.h5") as maps:
        found = maps, result.points, result.spatial, result.radar, result.summary
        plots = Plots(*found, new_figure=new_figure)
        angles = [name for name in ("azimuth", "elevation") if name in maps]
        pictures: dict[str, tuple[str, Callable[[], Axes]]] = {
            "Range over time": ("range_time.png", plots.range_time)
        }
        if len(maps["spectrogram_time"]):
            pictures["Spectrogram"] = "spectrogram.png", plots.spectrogram
        name = "Range-Doppler map and detections"
        pictures[name] = "range_doppler.png", plots.range_doppler
        if angles:
            name = " and ".join(f"range-{angle}" for angle in angles).capitalize()
            pictures[name] = "range_angle.png", plots.range_angle
        pictures["Range-Doppler-time cloud"] = "cloud_rdt.png", plots.rdt
        if angles:
            pictures["Spatial cloud"] = "cloud_xyz.png", plots.spatial
        for name, (file, draw) in pictures.items():
            drawn[name] = folder / file
            save_figure(draw().get_figure(root=True), drawn[name])
        return drawn, plots.frame()[0]


def write_page(
    folder: Path, result: Result, pictures: Mapping[str, Path], run_view: RunView | None = None
) -> None:
    """Write the report of what was found into a folder."""
    write_report(
        folder / "report.html",
        radar=result.radar,
        summary=result.summary,
        pictures=pictures,
        rdt_points=result.points,
        spatial=result.spatial,
        run_view=run_view,
    )


def _draw_room(
    folder: Path, capture: Capture, room: PreparedRoom, maps: Any, frame: int
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
    there = radar.at(time_s)
    found = [
        ghost for ghost in ghosts(room.model, radar, time_s) if ghost.range_m < radar.max_range_m
    ]
    # Out and back over the same walls is as long as the reverse: both have one number.
    key = dict(enumerate(dict.fromkeys(_walls(one.path) for one in sorted(found, key=_range)), 1))
    numbers = {walls: number for number, walls in key.items()}
    numbered = {numbers[_walls(ghost.path)]: ghost for ghost in found}
    marked = [
        rooms.GhostMark(number, ghost.range_m, ghost.velocity_mps)
        for number, ghost in numbered.items()
    ]
    heading = f"{capture.title}, window at {time_s:.2f} s"
    name = f"Range-Doppler{' before and after' if suffix else ''}, and ghosts"
    drawn = {name: folder / "clutter_removal.png"}
    rooms.draw_before_after(drawn[name], panels, marked, key, radar, heading)
    if "azimuth" in maps and "range_azimuth" + suffix in maps:
        name = "Range-azimuth with walls and ghosts"
        drawn[name] = folder / "range_azimuth_walls.png"
        places = [
            rooms.GhostMark(numbers[_walls(ghost.path)], ghost.range_m, ghost.azimuth_rad)
            for ghost in found
        ]
        windows = capture.processing.window_functions
        axes = (received("range_azimuth"), maps["azimuth"][:]), scene, there
        rooms.draw_range_azimuth_with_walls(drawn[name], *axes, places, key, heading, windows)
    times = np.linspace(0, body.duration_s, _TRACK_POINTS)
    tracks = truth_of(body, times)["person_position"][..., :2]
    named = dict(zip(body.names, np.swapaxes(tracks, 0, 1), strict=True))
    if len(named) == 1:
        named = {"person": tracks[:, 0]}
    paths = {}
    if room.model is not None:
        middle = body.people[0].motion.at([min(time_s, body.duration_s)])[0][0, 0]
        paths = {
            number: room.model.course(ghost.path, middle, there)
            for number, ghost in numbered.items()
        }
    drawn["Plan of the room, with paths"] = folder / "plan.png"
    rooms.draw_room_plan(folder / "plan.png", scene, there, named, paths, key, heading)
    return drawn


def _range(ghost: Ghost) -> float:
    return ghost.range_m


def _walls(path: str) -> str:
    return " > ".join(sorted(name for name in path.split(" > ") if name != "body"))


def removed(data: Any) -> str:
    """Return a second line of a title for an open dataset whose static clutter was removed."""
    how = data.attrs["clutter_removal"]
    return "" if how == "none" else f"\nstatic clutter removed: {how}"
