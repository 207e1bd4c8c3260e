"""What pictures and the page show of a run, from its maps and clouds."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rtradar.pipeline.capture import Capture, PreparedRoom
from rtradar.pipeline.output.truth import truth_of
from rtradar.pipeline.result import Result
from rtradar.report import rooms, write_report
from rtradar.report.plots import Plots, how_made
from rtradar.report.rooms import ShownRoom
from rtradar.report.run_view import RunView
from rtradar.scatter.multipath.path_summary import Ghost, ghosts
from rtradar.system.figure_style import new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TRACK_POINTS = 400


@dataclass(frozen=True, eq=False)
class Shown:
    """What pictures and the page show of a run: its maps and clouds, and its room if it has one."""

    plots: Plots
    room: ShownRoom | None
    heading: str

    @classmethod
    def of(cls, result: Result, maps: Any, capture: Capture | None = None) -> Shown:
        """Return what is shown of a result and its open maps, with the room of its capture."""
        found = maps, result.points, result.spatial, result.radar, result.summary
        plots = Plots(*found, new_figure=new_figure)
        if capture is None or not capture.room:
            return cls(plots, None, "")
        frame = plots.frame()[0]
        if "range_doppler_received" in maps:
            time_s = float(maps["range_doppler_received"].attrs["time_s"])
            frame = int(np.abs(maps["time"][:] - time_s).argmin())
        else:
            time_s = float(maps["time"][frame])
        room = _room_of(capture, capture.room, maps, frame, time_s)
        return cls(plots, room, f"{capture.title}, window at {time_s:.2f} s")

    def draw(self, folder: Path) -> None:
        """Draw the PNG files of maps, clouds and room into a folder."""
        plots, maps = self.plots, self.plots.maps
        pictures: dict[str, Callable[[], Axes]] = {
            "range_time": plots.range_time,
            "range_doppler": plots.range_doppler,
            "cloud_rdt": plots.rdt,
        }
        if len(maps["spectrogram_time"]):
            pictures["spectrogram"] = plots.spectrogram
        if "azimuth" in maps or "elevation" in maps:
            pictures |= {"range_angle": plots.range_angle, "cloud_xyz": plots.spatial}
        for name, draw in pictures.items():
            save_figure(draw().get_figure(root=True), folder / f"{name}.png")
        if (room := self.room) is not None:
            maps_of = {"clutter_removal": room.before_after, "range_azimuth_walls": room.azimuth}
            for name, shown in maps_of.items():
                if shown:
                    rooms.draw_room_maps(folder / f"{name}.png", shown, room.key, self.heading)
            rooms.draw_room_plan(folder / "plan.png", room, self.heading)

    def write_page(self, folder: Path, result: Result, run_view: RunView | None = None) -> None:
        """Write the report into a folder."""
        write_report(
            folder / "report.html",
            radar=result.radar,
            summary=result.summary,
            maps=self.plots.shown,
            room=self.room,
            rdt_points=result.points,
            spatial=result.spatial,
            run_view=run_view,
        )


def _room_of(
    capture: Capture, room: PreparedRoom, maps: Any, frame: int, time_s: float
) -> ShownRoom:
    """Return what is shown of a room.

    What was received is that of the frame kept before clutter removal, or else of this ``frame``.
    """
    radar, body, scene = capture.radar, capture.body, capture.scene
    suffix = "_received" if "range_doppler_received" in maps else ""

    def received(name: str) -> NDArray[Any]:
        return np.asarray(maps[name + suffix][:] if suffix else maps[name][frame])

    panels = {"As received": (received("range_doppler"), received("detections").astype(bool))}
    if suffix:
        after = how_made(maps["range_doppler"]).partition("\n")[0].capitalize()
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
    azimuth = []
    if "azimuth" in maps and "range_azimuth" + suffix in maps:
        places = [
            rooms.GhostMark(numbers[_walls(ghost.path)], ghost.range_m, ghost.azimuth_rad)
            for ghost in found
        ]
        power = received("range_azimuth"), maps["azimuth"][:]
        windows = capture.processing.window_functions
        azimuth = [rooms.azimuth_and_walls(power, scene, there, places, windows)]
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
    return ShownRoom(
        scene=scene,
        radar=there,
        tracks=named,
        paths=paths,
        key=key,
        before_after=rooms.before_after(panels, marked, radar),
        azimuth=azimuth,
    )


def _range(ghost: Ghost) -> float:
    return ghost.range_m


def _walls(path: str) -> str:
    return " > ".join(sorted(name for name in path.split(" > ") if name != "body"))
