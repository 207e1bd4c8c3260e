"""What pictures and the page show of a run, from its maps and clouds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rtradar.pipeline.capture import Capture
from rtradar.pipeline.output.truth import truth_of
from rtradar.report import rooms
from rtradar.report.maps import ghost_mark
from rtradar.report.plots import Plots, how_made
from rtradar.report.rooms import ShownRoom
from rtradar.system.figure_style import save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_TRACK_POINTS = 400


def draw_pictures(folder: Path, plots: Plots, room: ShownRoom | None) -> None:
    """Draw the PNG files of maps, clouds and room into a folder."""
    maps = plots.maps
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
    # A room has two more maps, before and after clutter removal and over azimuth with its walls,
    # and a plan.
    if room is not None:
        time_s = plots.summary["room"]["ghosts"]["time_s"]
        heading = f"{maps.attrs['title']}, window at {time_s:.2f} s"
        maps_of = {"clutter_removal": room.before_after, "range_azimuth_walls": room.azimuth}
        for name, shown in maps_of.items():
            if shown:
                rooms.draw_room_maps(folder / f"{name}.png", shown, room.key, heading)
        rooms.draw_room_plan(folder / "plan.png", room, heading)


def room_of(capture: Capture, plots: Plots) -> ShownRoom | None:
    """Return what is shown of the room of a capture, if it has one, at the time of its findings.

    What was received is that of the frame kept before clutter removal, or else of the frame then.
    """
    if not capture.room:
        return None
    maps: Any = plots.maps
    # Everything is shown at the instant for which the summary lists the ghosts.
    radar, body, scene, model = capture.radar, capture.body, capture.scene, capture.model.room
    findings = plots.summary["room"]["ghosts"]
    time_s = findings["time_s"]
    frame = int(np.abs(maps["time"][:] - time_s).argmin())
    # Where clutter was removed, one frame was kept as it was received; else every frame is such a
    # one.
    suffix = "_received" if "range_doppler_received" in maps else ""

    def received(name: str) -> NDArray[Any]:
        return np.asarray(maps[name + suffix][:] if suffix else maps[name][frame])

    # One panel as received, and one beside it where clutter was removed.
    panels = {"As received": (received("range_doppler"), received("detections").astype(bool))}
    if suffix:
        after = how_made(maps["range_doppler"]).partition("\n")[0].capitalize()
        panels[after] = maps["range_doppler"][frame], maps["detections"][frame].astype(bool)
    # A number for each set of walls, the nearest ghost first, marks the same ghost on map and plan.
    there = radar.at(time_s)
    # Out and back over the same walls is as long as the reverse: both have one number.
    found = [(one, _walls(one["path"])) for one in findings["paths"]]
    found = [(one, walls) for one, walls in found if one["range_m"] < radar.max_range_m]
    nearest = sorted(found, key=lambda one: one[0]["range_m"])
    numbers = {walls: n for n, walls in enumerate(dict.fromkeys(own for _, own in nearest), 1)}
    numbered = {numbers[walls]: one for one, walls in found}
    marked = [
        ghost_mark(number, one["range_m"], one["velocity_mps"]) for number, one in numbered.items()
    ]
    # The same numbers on the map over azimuth, if the radar measures it.
    azimuth = []
    if "azimuth" in maps and "range_azimuth" + suffix in maps:
        places = [
            ghost_mark(numbers[walls], one["range_m"], one["azimuth_deg"]) for one, walls in found
        ]
        power = received("range_azimuth"), maps["azimuth"][:]
        windows = capture.processing.window_functions
        azimuth = [rooms.azimuth_and_walls(power, scene, there, places, windows)]
    # The ways of all people over the floor.
    times = np.linspace(0, body.duration_s, _TRACK_POINTS)
    tracks = truth_of(body, times)["person_position"][..., :2]
    named = dict(zip(body.names, np.swapaxes(tracks, 0, 1), strict=True))
    if len(named) == 1:
        named = {"person": tracks[:, 0]}
    # The course of each ghost, drawn to the pelvis of the first person.
    paths = {}
    if model is not None:
        middle = body.people[0].motion.at([min(time_s, body.duration_s)])[0][0, 0]
        paths = {
            number: model.course(one["path"], middle, there) for number, one in numbered.items()
        }
    return ShownRoom(
        scene=scene,
        radar=there,
        tracks=named,
        paths=paths,
        key={number: walls for walls, number in numbers.items()},
        before_after=rooms.before_after(panels, marked, radar),
        azimuth=azimuth,
    )


def _walls(path: str) -> str:
    return " > ".join(sorted(name for name in path.split(" > ") if name != "body"))
