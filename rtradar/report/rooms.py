"""Pictures of a room: its plan with echo paths, and maps before and after clutter removal.

Ghosts have numbers, the same in all pictures of a room, with a key below; their names would cover
each other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

from rtradar.process import WindowFunctions
from rtradar.process.window_functions import DEFAULT_WINDOWS, noise_bandwidth_bins
from rtradar.radar import Radar
from rtradar.report.canvas import (
    VELOCITY_LABEL,
    add_colour_bar,
    angle_label,
    angle_view,
    draw_levels,
    draw_view,
    field_unit,
    fitted_limits,
    masking_note,
)
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

_HALF_TURN = 180.0


class GhostMark(NamedTuple):
    """Place of a ghost in a picture: its number, range [m], and coordinate across the picture."""

    number: int
    range_m: float
    across: float


def draw_room_plan(
    path: Path,
    scene: Scene,
    radar: Radar,
    tracks: Mapping[str, NDArray[np.float64]],
    paths: Mapping[int, NDArray[np.float64]],
    key: Mapping[int, str],
    title: str,
) -> None:
    """Draw the room from above: walls, furniture, radar, people's tracks and paths of echoes.

    ``tracks`` (time, 2) are positions of each person's root [m] by name, ``paths`` the corners
    (point, 3) of the path of each ghost [m] by its number, ``key`` the walls of each.
    """
    place = radar.position_m[:2]
    walked = np.concatenate([np.empty((0, 2)), *tracks.values()])
    ways = [xy for way in paths.values() for xy in way[:, :2]]
    limits = plan_limits(scene, [place, *walked, *ways])
    axes = new_figure(height_of_plan(limits) + 0.5).add_subplot()
    theme = theme_of(axes)
    draw_plan(axes, scene, limits)
    # Paths over floor and ceiling are the same seen from above.
    seen: dict[bytes, list[int]] = {}
    for number, corners in paths.items():
        seen.setdefault(np.round(corners[:, :2], 2)[[1, -2]].tobytes(), []).append(number)
    labels = []
    for turn, numbers in enumerate(seen.values()):
        corners, colour = paths[numbers[0]][:, :2], theme.cycle[turn % len(theme.cycle)]
        axes.plot(*corners.T, color=colour, linewidth=1.2)
        first, last = max(pairwise(corners), key=lambda leg: float(np.ptp(leg, axis=0).sum()))
        places = [((1 - at) * first + at * last).tolist() for at in (0.5, 0.35, 0.65, 0.2, 0.8)]
        words = ", ".join(map(str, numbers))
        labels.append(Label(words, [((x, y), (0.0, 0.0)) for x, y in places], colour))
    draw_radar(axes, place, radar)
    labels.append(Label("radar", around((place[0], place[1]), 12.0), theme.radar))
    for name, track in tracks.items():
        axes.plot(*track.T, color=theme.person, linewidth=2.5)
        x, y = track[len(track) // 2].tolist()
        labels.append(Label(name, around((x, y), 12.0), theme.person))
    square = np.array([[-0.03], [0.03]])
    avoided = [point + square for point in walked[:: len(walked) // (20 * max(1, len(tracks))) + 1]]
    notes = [_key("Paths of echoes over", key), plan_note(scene)]
    dress(axes, title=f"Plan of the room\n{title}", note="\n".join(filter(None, notes)))
    name_parts(axes, scene, labels, avoided)
    save_figure(axes.get_figure(root=True), path)


def draw_before_after(
    path: Path,
    maps: Mapping[str, tuple[NDArray[np.floating], NDArray[np.bool_]]],
    ghosts: Sequence[GhostMark],
    key: Mapping[int, str],
    radar: Radar,
    title: str,
) -> None:
    """Draw range-Doppler maps, their detections beside them, and ghosts where they are predicted.

    ``maps`` are, by what was done with them, power summed over all channels [m^2] and detections,
    (range, velocity); ``ghosts`` are marked over velocity [m/s].
    """
    figure = new_figure(1.2 + 3.2 * len(maps))
    panels = figure.subplots(len(maps), 2, sharex=True, sharey=True, squeeze=False)
    unit = field_unit(radar, range_m=radar.range_m[:, None])
    found = np.sum([mask for _, mask in maps.values()], axis=0)
    velocity, distance = radar.velocity_mps(found.shape[1]), radar.range_m
    view = (
        fitted_limits(found.sum(axis=0), velocity, include=[0.0, *(one.across for one in ghosts)]),
        fitted_limits(found.sum(axis=1), distance, include=[one.range_m for one in ghosts]),
    )
    colours: tuple[float, float] | None = None
    for (left, right), (name, (power, mask)) in zip(panels, maps.items(), strict=True):
        level = unit.level(power / radar.n_channels)
        if colours is None:
            image, words = draw_view(left, level, velocity, distance, view, unit=unit)
            colours = image.get_clim()
        else:
            draw_levels(left, level, velocity, distance, colours)
        rows, columns = np.nonzero(mask)
        style: dict[str, Any] = {"s": 2, "linewidths": 0, "color": theme_of(right).detection}
        right.scatter(velocity[columns], distance[rows], **style)
        labels = [_circle(axes, ghosts) for axes in (left, right)]
        left.set_ylabel("Range [m]")
        first, last = left is panels[0, 0], left is panels[-1, 0]
        heading = f"{name}: {len(rows)} detections"
        if first:
            heading = f"Range-Doppler map and detections\n{title}\n{heading}"
        notes = [masking_note(power, mask)]
        if last:
            notes = [words, _key("Circles are ghosts, predicted over", key), *notes]
            for axes in (left, right):
                axes.set_xlabel(VELOCITY_LABEL.replace(" (", "\n("))
        dress(left, title=heading, note="\n".join(filter(None, notes)), grid=False, across=2)
        dress(right)
    add_colour_bar(image, list(panels.flat), unit.label("mean of channels"))
    for left in panels[:, 0]:
        left.set(xlim=view[0], ylim=view[1])
        place_labels(left, labels[0])
    save_figure(figure, path)


def draw_range_azimuth_with_walls(
    path: Path,
    found: tuple[NDArray[np.floating], NDArray[np.float64]],
    scene: Scene,
    radar: Radar,
    ghosts: Sequence[GhostMark],
    key: Mapping[int, str],
    title: str,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
) -> None:
    """Draw power over azimuth and range, with upright walls and furniture where they are.

    What was ``found`` is the power (range, azimuth), summed over detected cells [m^2], and the
    angles (azimuth,) of its columns [rad], over which ``ghosts`` are marked. The
    ``window_functions`` are those of the transforms that gave the power.
    """
    power, azimuth = found
    axes = new_figure(5.6).add_subplot()
    unit = field_unit(radar, range_m=radar.range_m[:, None])
    velocities = noise_bandwidth_bins(window_functions.doppler, radar.cycles_per_frame)
    level = unit.level(power / velocities)  # one echo is spread over as many velocities
    angles = np.degrees(azimuth)
    marked = [one._replace(across=float(np.degrees(one.across))) for one in ghosts]
    view = angle_view(power, angles, radar, [(one.across, one.range_m) for one in marked])
    image, words = draw_view(axes, level, angles, radar.range_m, view, unit=unit, below_peak_db=40)
    place = np.asarray(radar.position_m)[:2]
    yaw = np.radians(radar.yaw_deg)
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    labels = _circle(axes, marked)
    for first, last, wall in feet_of_walls(scene):
        along = first + np.linspace(0, 1, 200)[:, None] * (last - first) - place
        labels += _line(axes, along @ turn, wall.name, "wall", linestyle="--")
    for piece in scene.furniture:
        kind = "furniture" if piece.triangles().closed else "reflector"
        labels += _line(axes, (_outline(piece) - place) @ turn, piece.name, kind)
    axes.set(xlabel=angle_label("azimuth", radar), ylabel="Range [m]")
    notes = [words, _key("Circles are ghosts, predicted over", key)]
    notes += ["Dashed: walls. Outlined: furniture and reflectors."] if labels else []
    note = "\n".join(filter(None, notes))
    dress(axes, title=f"Range-azimuth map and room\n{title}", note=note, grid=False)
    add_colour_bar(image, [axes], unit.label("detected cells"))
    place_labels(axes, labels)
    save_figure(axes.get_figure(root=True), path)


def _line(axes: Axes, xy: NDArray[np.float64], name: str, kind: str, **style: Any) -> list[Label]:
    """Draw points (point, 2) [m] from the radar over azimuth and range; return their name."""
    angle, distance = np.degrees(np.arctan2(xy[:, 1], xy[:, 0])), np.hypot(*xy.T)
    # A line behind the radar would cross the whole picture.
    gaps = np.abs(np.diff(angle, prepend=angle[0])) > _HALF_TURN
    # Maps are dark on every page.
    axes.plot(
        np.where(gaps, np.nan, angle), distance, color=getattr(DARK, kind), linewidth=1.2, **style
    )
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    shown = (angle > left) & (angle < right) & (distance > low) & (distance < high)
    points = np.column_stack([angle, distance])[shown]
    if not len(points):
        return []
    chosen = points[(np.array([0.5, 0.3, 0.7, 0.1, 0.9]) * len(points)).astype(int)].tolist()
    places = [place for x, y in chosen for place in around((x, y))[:17]]
    return [Label(name, places, theme_of(axes).text)]


def _outline(piece: Furniture) -> NDArray[np.float64]:
    """Return the outline of a piece seen from above, (point, 2) [m]."""
    points = piece.triangles().vertices[:, :2]
    try:
        corners = points[ConvexHull(points).vertices]
    except QhullError:  # an upright plate is a line
        corners = points[np.lexsort(points.T)][[0, -1]]
    steps = np.linspace(0, 1, 20)[:, None]
    sides = zip(corners, np.roll(corners, -1, axis=0), strict=True)
    return np.concatenate([first + steps * (last - first) for first, last in sides])


def _circle(axes: Axes, ghosts: Sequence[GhostMark]) -> list[Label]:
    """Draw a circle about each ghost, and return the numbers to be written beside them."""
    theme = theme_of(axes)
    style: dict[str, Any] = {"markerfacecolor": "none", "markersize": 8}
    for one in ghosts:
        axes.plot(one.across, one.range_m, "o", markeredgecolor=theme.ghost, **style)
    return [
        Label(str(one.number), around((one.across, one.range_m), 9.0), theme.text) for one in ghosts
    ]


def _key(words: str, key: Mapping[int, str]) -> str:
    listed = ", ".join(f"{number} {walls}" for number, walls in key.items())
    return f"{words}: {listed}." if key else ""
