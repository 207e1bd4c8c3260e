"""Pictures of a room: its plan with echo paths, and maps before and after clutter removal.

Ghosts have numbers, the same in all pictures of a room, with a key below; their names would cover
each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from rtradar.process import WindowFunctions
from rtradar.process.window_functions import DEFAULT_WINDOWS
from rtradar.radar import Radar
from rtradar.report.canvas import add_colour_bar, field_unit
from rtradar.report.maps import Overlay, ShownMap, range_angle_map, range_doppler_map
from rtradar.scene import Furniture, Scene
from rtradar.scene.plan import (
    draw_plan,
    draw_radar,
    feet_of_walls,
    height_of_plan,
    name_parts,
    plan_limits,
    plan_note,
)
from rtradar.system.figure_labels import Label, around, place_labels
from rtradar.system.figure_style import DARK, dress, new_figure, save_figure, theme_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CIRCLES = "Circles are ghosts, predicted over"
_HALF_TURN = 180.0


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownRoom:
    """What pictures and page show of a room.

    ``tracks`` (time, 2) are positions of each person's root [m] by name, ``paths`` the corners
    (point, 3) of the path of each ghost [m] by its number, ``key`` the walls of each. Maps are
    ``before_after`` the removal of clutter, and one over ``azimuth`` where it is measured.
    """

    scene: Scene
    radar: Radar
    tracks: Mapping[str, NDArray[np.float64]]
    paths: Mapping[int, NDArray[np.float64]]
    key: Mapping[int, str]
    before_after: Sequence[ShownMap]
    azimuth: Sequence[ShownMap]

    @property
    def plan_limits(self) -> NDArray[np.float64]:
        """Limits of the plan, of x and of y (2, 2) [m]."""
        ways = [xy for way in self.paths.values() for xy in way[:, :2]]
        walked = np.concatenate([np.empty((0, 2)), *self.tracks.values()])
        return plan_limits(self.scene, [self.radar.position_m[:2], *walked, *ways])

    def plan(self) -> dict[str, Any]:
        """Return the plan as plain values for JSON, as `ShownMap.packed` has them."""
        place = np.asarray(self.radar.position_m)[None, :2]
        over = [
            *(Overlay("path", str(number), way[:, :2]) for number, way in self.paths.items()),
            *outlines(self.scene),
            *(Overlay("person", name, track) for name, track in self.tracks.items()),
            Overlay("radar", "radar", place),
        ]
        return {
            "labels": ["x [m]", "y [m]"],
            "view": self.plan_limits.tolist(),
            "over": [one.packed() for one in over],
            "note": key_of("Paths of echoes over", self.key),
        }


def outlines(scene: Scene) -> list[Overlay]:
    """Return the feet of upright walls, and what furniture covers of the floor [m]."""
    feet = feet_of_walls(scene)
    found = [Overlay("wall", one.wall.name, np.stack([one.first, one.last])) for one in feet]
    for piece in scene.furniture:
        kind = "furniture" if piece.triangles().closed else "reflector"
        found.append(Overlay(kind, piece.name, _outline(piece)))
    return found


def draw_room_plan(path: Path, room: ShownRoom, title: str) -> None:
    """Draw a room from above: walls, furniture, radar, people's tracks and paths of echoes."""
    scene, radar, paths, limits = room.scene, room.radar, room.paths, room.plan_limits
    walked = np.concatenate([np.empty((0, 2)), *room.tracks.values()])
    place = radar.position_m[:2]
    axes = new_figure(height_of_plan(limits) + 0.5).add_subplot()
    theme = theme_of(axes)
    draw_plan(axes, scene, limits)
    # Paths over floor and ceiling are the same seen from above.
    seen: dict[bytes, list[int]] = {}
    for number, corners in paths.items():
        seen.setdefault(np.round(corners[:, :2], 2)[[1, -2]].tobytes(), []).append(number)
    labels = []
    # One line and one label for all ghosts that look alike, on its longest leg.
    for turn, numbers in enumerate(seen.values()):
        corners, colour = paths[numbers[0]][:, :2], theme.cycle[turn % len(theme.cycle)]
        axes.plot(*corners.T, color=colour, linewidth=1.2)
        first, last = max(pairwise(corners), key=lambda leg: float(np.ptp(leg, axis=0).sum()))
        places = [((1 - at) * first + at * last).tolist() for at in (0.5, 0.35, 0.65, 0.2, 0.8)]
        words = ", ".join(map(str, numbers))
        labels.append(Label(words, [((x, y), (0.0, 0.0)) for x, y in places], colour))
    draw_radar(axes, place, radar)
    labels.append(Label("radar", around((place[0], place[1]), 12.0), theme.radar))
    for name, track in room.tracks.items():
        axes.plot(*track.T, color=theme.person, linewidth=2.5)
        x, y = track[len(track) // 2].tolist()
        labels.append(Label(name, around((x, y), 12.0), theme.person))
    # Labels keep off the tracks of people, of which some points stand for all.
    square = np.array([[-0.03], [0.03]])
    every = len(walked) // (20 * max(1, len(room.tracks))) + 1
    avoided = [point + square for point in walked[::every]]
    notes = [key_of("Paths of echoes over", room.key), plan_note(scene)]
    dress(axes, title=f"Plan of the room\n{title}", note="\n".join(filter(None, notes)))
    name_parts(axes, scene, labels, avoided)
    save_figure(axes.get_figure(root=True), path)


def before_after(
    maps: Mapping[str, tuple[NDArray[np.floating], NDArray[np.bool_]]],
    ghosts: Sequence[Overlay],
    radar: Radar,
) -> list[ShownMap]:
    """Return range-Doppler maps with their detections, and ghosts where they are predicted.

    ``maps`` are, by what was done with them, power summed over all channels [m^2] and detections,
    (range, velocity); ``ghosts`` are marked over velocity [m/s]. All have the colours of the first.
    """
    # Limits and colours are common, so that what was removed can be seen.
    unit = field_unit(radar, range_m=radar.range_m[:, None])
    counts = np.sum([mask for _, mask in maps.values()], axis=0)
    shown: list[ShownMap] = []
    for name, (power, mask) in maps.items():
        title = f"{name}: {np.count_nonzero(mask)} detections"
        told: dict[str, Any] = {"title": title, "colours_db": shown[0].limits_db if shown else None}
        shown.append(
            range_doppler_map(power, mask, radar, unit, ghosts=ghosts, counts=counts, **told)
        )
    return shown


def azimuth_and_walls(
    found: tuple[NDArray[np.floating], NDArray[np.float64]],
    scene: Scene,
    radar: Radar,
    ghosts: Sequence[Overlay],
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
) -> ShownMap:
    """Return power over azimuth and range, with upright walls and furniture where they are.

    What was ``found`` is the power (range, azimuth), summed over detected cells [m^2], and the
    angles (azimuth,) of its columns [rad]; ``ghosts`` are marked over degrees. The
    ``window_functions`` are those of the transforms that gave the power.
    """
    power, azimuth = found
    # Walls and furniture from the place of the radar, in polar coordinates, in which straight lines
    # bend.
    place = np.asarray(radar.position_m)[:2]
    yaw = np.radians(radar.yaw_deg)
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    over = list(ghosts)
    for one in outlines(scene):
        xy = one.xy
        if one.kind == "wall":
            xy = xy[0] + np.linspace(0, 1, 200)[:, None] * (xy[1] - xy[0])
        x, y = ((xy - place) @ turn).T
        angle = np.degrees(np.arctan2(y, x))
        # A line behind the radar would cross the whole picture.
        gaps = np.abs(np.diff(angle, prepend=angle[0])) > _HALF_TURN
        line = np.column_stack([np.where(gaps, np.nan, angle), np.hypot(x, y)])
        over.append(one._replace(xy=line))
    unit, title = field_unit(radar, range_m=radar.range_m[:, None]), "Range-azimuth map and room"
    given = np.degrees(azimuth), radar, unit, window_functions.doppler, over
    return range_angle_map("azimuth", power, *given, title=title)


def draw_room_maps(
    path: Path, shown: Sequence[ShownMap], key: Mapping[int, str], title: str
) -> None:
    """Draw maps one above another with what lies over them; ``key`` names the walls of ghosts."""
    figure = new_figure(1.2 + 4.4 * len(shown))
    # What lies over a map is drawn first; names find their places when everything else is there.
    for axes, one in zip(figure.subplots(len(shown), squeeze=False).flat, shown, strict=True):
        image = one.draw(axes)
        labels = [label for line in one.over for label in _overlaid(axes, line)]
        kinds = {line.kind for line in one.over}
        notes = [one.colours, key_of(CIRCLES, key) if "ghost" in kinds else "", one.note]
        notes += ["Dashed: walls. Outlined: furniture and reflectors."] if "wall" in kinds else []
        heading = f"{one.title}\n{title}" if one is shown[0] else one.title
        dress(axes, title=heading, note="\n".join(filter(None, notes)), grid=False)
        add_colour_bar(image, [axes], one.unit.label(one.qualifier))
        place_labels(axes, labels)
    save_figure(figure, path)


def _overlaid(axes: Axes, over: Overlay) -> list[Label]:
    """Draw detections, a ghost or a line over a map; return its name where it is in view."""
    theme = theme_of(axes)
    x, y = over.xy.T
    if over.kind == "detection":
        axes.scatter(x, y, s=2, linewidths=0, color=theme.detection)
        return []
    if over.kind == "ghost":
        style: dict[str, Any] = {"markerfacecolor": "none", "markersize": 8}
        axes.plot(x, y, "o", markeredgecolor=theme.ghost, **style)
        return [Label(over.name, around((float(x[0]), float(y[0])), 9.0), theme.text)]
    # Maps are dark on every page.
    style = {"color": getattr(DARK, over.kind), "linestyle": "--" if over.kind == "wall" else "-"}
    axes.plot(x, y, linewidth=1.2, **style)
    # A name stands at some point of the line that is in view.
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    points = over.xy[(x > left) & (x < right) & (y > low) & (y < high)]
    if not len(points):
        return []
    chosen = points[(np.array([0.5, 0.3, 0.7, 0.1, 0.9]) * len(points)).astype(int)].tolist()
    return [Label(over.name, [at for x, y in chosen for at in around((x, y))[:17]], theme.text)]


def _outline(piece: Furniture) -> NDArray[np.float64]:
    """Return the outline of a piece seen from above, (point, 2) [m]."""
    points = piece.triangles().vertices[:, :2]
    try:
        corners = points[ConvexHull(points).vertices]
    except QhullError:  # an upright plate is a line
        corners = points[np.lexsort(points.T)][[0, -1]]
    # Sides with many points, because they bend on a map over angle and range.
    steps = np.linspace(0, 1, 20)[:, None]
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    return np.concatenate([first + steps * (last - first) for first, last in sides])


def key_of(words: str, key: Mapping[int, str]) -> str:
    """Return a sentence that names the walls of each number, empty where there is none."""
    listed = ", ".join(f"{number} {walls}" for number, walls in key.items())
    return f"{words}: {listed}." if key else ""
