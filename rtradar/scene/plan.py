"""What a scene shows of itself: its room, walls and furniture, and its plan, seen from above."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scene.objects import Furniture, Wall
from rtradar.system.checks import brief, printable
from rtradar.system.figure_labels import Label, around, place_labels
from rtradar.system.figure_style import (
    STYLE,
    axes_given,
    dress,
    figure_for,
    new_figure,
    png_of,
    theme_of,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from rtradar.scene.scene import Scene

_UPRIGHT = 0.5
"""Largest vertical component of the normals of walls in a plan; others are floor or ceiling."""

MOST_NAMES = 40
"""Most pieces of furniture that a plan names, the largest first."""

_ARROW_M = 0.9
"""Length of the arrow along the boresight [m]."""


class Foot(NamedTuple):
    """Foot of an upright wall: both ends (2,) [m] of its front face, and the wall."""

    first: NDArray[np.float64]
    last: NDArray[np.float64]
    wall: Wall

    def at(self, fractions: ArrayLike) -> NDArray[np.float64]:
        """Return points (fraction, 2) at fractions of the way from the first end to the last."""
        return self.first + np.asarray(fractions)[:, None] * (self.last - self.first)


def feet_of_walls(scene: Scene) -> list[Foot]:
    """Find the feet of the upright walls."""
    found = []
    for wall in filter(_is_upright, scene.walls):
        # Seen from above an upright rectangle is a line, between the two corners that are farthest
        # apart.
        corners = wall.corners[:, :2]
        gaps = np.linalg.norm(corners[:, None] - corners[None], axis=-1)
        one, other = np.unravel_index(int(gaps.argmax()), gaps.shape)
        found.append(Foot(corners[one], corners[other], wall))
    return found


def _between_openings(foot: Foot) -> list[NDArray[np.float64]]:
    """Ends (2, 2) [m] of what is left of the foot of a wall between its openings."""
    wall, way = foot.wall, foot.last - foot.first
    edges = np.array([wall.edge_u_m, wall.edge_v_m])[:, :2]
    gaps = []
    # Each opening as a gap along the foot, whatever its height.
    for u, v, wide, high in wall.openings:
        corners = np.array([(u, v), (u + wide, v), (u, v + high), (u + wide, v + high)])
        points = wall.corner_m[:2] + corners / wall.size_m @ edges
        along = ((points - foot.first) @ way / (way @ way)).tolist()
        gaps.append((min(along), max(along)))
    # What is left between gaps, which may overlap.
    start, left = 0.0, []
    for low, high in [*sorted(gaps), (1.0, 1.0)]:
        if low > start:
            left.append(foot.at([start, low]))
        start = max(start, high)
    return left


def plot_scene(
    scene: Scene,
    radar: Radar | Axes | None,
    ax: Axes | None,
    make: Callable[[float], Figure] = figure_for,
) -> Axes:
    """Draw the plan of a scene with its radar and the person's place, as `Scene.plot` does.

    Without axes a figure of the right height [inch] is made.
    """
    radar, ax = axes_given(radar, ax)
    if not isinstance(radar, Radar | None):
        raise InputError(f"plot: radar = {brief(radar)}; it must be a Radar, such as a preset")
    # Where the radar will stand, and what must be inside of the picture.
    x, y = scene.radar_place(Radar() if radar is None else radar)[:2]
    # Who are there, whoever may come.
    people = {
        f"{number}: {one.motion.name}": one.position_m
        for number, one in enumerate(scene.people, start=1)
    } or {"person": scene.person_position_m}
    limits = plan_limits(scene, [(x, y), (x + _ARROW_M, y), *people.values()])
    axes = make(height_of_plan(limits)).add_subplot() if ax is None else ax
    theme = theme_of(axes)
    draw_plan(axes, scene, limits)
    draw_radar(axes, (x, y), radar)
    for place in people.values():
        axes.plot(*place, "o", color=theme.person, markersize=7)
    # Names last, when the limits are final.
    title = printable(f"{scene.name}: {scene.description}")
    dress(axes, title=title, note=plan_note(scene))
    others = [
        Label("radar", around((x, y), 12.0), theme.radar),
        *(Label(name, around(place, 12.0), theme.person) for name, place in people.items()),
    ]
    # Names keep off the arrow, the person's mark and the lines of walls.
    avoided = [_square((x + fraction * _ARROW_M, y)) for fraction in np.linspace(0, 1, 12)]
    name_parts(axes, scene, others, [*avoided, *map(_square, people.values())])
    return axes


def picture_of_plan(scene: Scene) -> bytes:
    """Draw the plan of a scene as a PNG file, for a card."""
    figure: Any = plot_scene(scene, None, None, new_figure).figure
    return png_of(figure)


def plan_limits(scene: Scene, points: ArrayLike) -> NDArray[np.float64]:
    """Return the limits of a plan, of x and of y (2, 2) [m], with room for names around it.

    ``points`` (point, 2) [m] are those to be shown beside walls and furniture.
    """
    corners = [np.asarray(points, dtype=np.float64)]
    corners += [np.concatenate(foot[:2]).reshape(2, 2) for foot in feet_of_walls(scene)]
    corners += [piece.triangles().vertices[:, :2] for piece in (*scene.furniture, *scene.objects)]
    every = np.concatenate(corners)
    low, high = every.min(axis=0), every.max(axis=0)
    # A margin for names, and more across a narrow plan.
    span = high - low
    margin = 0.3 + 0.08 * span.max() + np.maximum(0, 0.4 * span.max() - span) / 2
    return np.stack([low - margin, high + margin], axis=1)


def height_of_plan(limits: NDArray[np.float64]) -> float:
    """Return the height [inch] of the picture of a plan, with its title and its note."""
    wide, high = np.ptp(limits, axis=1)
    return float(np.clip(5.3 * high / wide, 2.0, 5.5)) + 1.2


def draw_plan(axes: Axes, scene: Scene, limits: NDArray[np.float64]) -> None:
    """Draw walls, furniture and reflectors without their names, which `name_parts` writes."""
    from matplotlib.collections import PolyCollection
    from matplotlib.colors import to_rgb

    theme = theme_of(axes)
    covering: dict[str, list[NDArray[np.float64]]] = {theme.furniture: [], theme.reflector: []}
    for piece in (*scene.furniture, *scene.objects):
        triangles = piece.triangles()
        corners = triangles.corners[..., :2]
        (ax, ay), (bx, by) = ((corners[:, k] - corners[:, 0]).T for k in (1, 2))
        # Faces that look up cover a closed body; upright ones cover nothing.
        seen = ax * by - ay * bx
        colour = theme.furniture if triangles.closed else theme.reflector
        covering[colour].extend(corners[seen > 0 if triangles.closed else seen != 0])
        if not triangles.closed:  # a thin sheet of metal, which may be small and upright
            axes.plot(*corners.reshape(-1, 2).mean(axis=0), "D", color=colour, markersize=5)
    for colour, faces in covering.items():
        # Boards of a shelf lie over each other, and would add up if they were transparent.
        pale = 0.45 * np.array(to_rgb(colour)) + 0.55 * np.array(to_rgb(theme.page))
        style: dict[str, Any] = {"color": tuple(pale.tolist()), "linewidth": 0.5}
        if faces:
            axes.add_collection(PolyCollection(faces, **style), autolim=False)
    # Walls lie behind their front faces, which are drawn as lines.
    for foot in feet_of_walls(scene):
        behind = foot.wall.thickness_m * foot.wall.normal[:2]
        for first, last in _between_openings(foot):
            axes.fill(*np.array([first, last, last - behind, first - behind]).T, color=theme.wall)
            axes.plot(*np.array([first, last]).T, color=theme.wall, linewidth=2)
    axes.set(xlim=limits[0], ylim=limits[1], xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal")


def draw_radar(axes: Axes, position_m: Sequence[float], radar: Radar | None) -> None:
    """Draw the radar and an arrow along its boresight, +x without one."""
    x, y = position_m
    ahead, left = (1.0, 0.0) if radar is None else radar.axes[:2, 0].tolist()
    end = x + ahead * _ARROW_M, y + left * _ARROW_M
    colour = theme_of(axes).radar
    arrow: dict[str, Any] = {"arrowstyle": "-|>", "color": colour, "linewidth": 1.5}
    axes.annotate("", end, (x, y), arrowprops={**arrow, "shrinkA": 0, "shrinkB": 0})
    axes.plot([x], [y], ">", color=colour, markersize=8)


def name_parts(
    axes: Axes, scene: Scene, first: Sequence[Label] = (), avoided: Sequence[ArrayLike] = ()
) -> None:
    """Write the names of walls, reflectors and furniture where they cover nothing.

    Labels in ``first`` get their places before all others, and ``avoided`` are the rectangles
    (2, 2) [m] that none of them covers. Limits of the axes must be final.
    """
    theme = theme_of(axes)
    # Closed pieces are named in their middle, sheets, which are small, beside it.
    feet, pieces = feet_of_walls(scene), []
    for piece in (*scene.furniture, *scene.objects):
        triangles = piece.triangles()
        low, high = triangles.vertices[:, :2].min(axis=0), triangles.vertices[:, :2].max(axis=0)
        x, y = ((low + high) / 2).tolist()
        closed, area = triangles.closed, float(np.prod(high - low))
        places = around((x, y), 0.0 if closed else 12.0)
        colour = theme.furniture if closed else theme.reflector
        pieces.append((closed, -area, Label(piece.name, places, colour)))
    # Sheets first, then the largest, because names that find no place are left out.
    pieces.sort(key=lambda piece: piece[:2])
    lines = [_square(point) for foot in feet for point in foot.at(np.linspace(0, 1, 100))]
    labels = [*first, *(_wall_label(foot, theme.wall) for foot in feet)]
    labels += [label for *_, label in pieces[:MOST_NAMES]]
    left_out = len(place_labels(axes, labels, [*avoided, *lines])) + len(pieces[MOST_NAMES:])
    if left_out:
        style: dict[str, Any] = {"fontsize": STYLE["font.size"], "color": theme.text, "ha": "right"}
        style |= {"transform": axes.transAxes, "in_layout": False}
        said = "1 piece is not named" if left_out == 1 else f"{left_out} pieces are not named"
        axes.text(0.99, 0.015, said, **style)


def plan_note(scene: Scene) -> str:
    """Describe what a plan does not show: floor, ceiling, and other walls that are not upright."""
    flat = [wall for wall in scene.walls if not _is_upright(wall)]
    return "; ".join(f"{wall.name}: {_slab(wall)}" for wall in flat).capitalize()


def _is_upright(wall: Wall) -> bool:
    return abs(float(wall.normal[2])) < _UPRIGHT


def _slab(wall: Wall) -> str:
    return f"{wall.material.name}, {1e3 * wall.thickness_m:g} mm"


def _square(point: ArrayLike) -> NDArray[np.float64]:
    """Return two corners of a small square about a point (2,) [m]."""
    return np.asarray(point) + np.array([[-0.02], [0.02]])


def _wall_label(foot: Foot, colour: str) -> Label:
    """Make a label that stands outside its wall, along it."""
    wall, (x, y) = foot.wall, foot.last - foot.first
    # Along the wall, and never upside down.
    rotation = (float(np.degrees(np.arctan2(y, x))) + 89.9) % 180 - 89.9
    outward = -wall.normal[:2] / np.linalg.norm(wall.normal[:2])
    places = []
    # Places to try: outside near and far, then inside, each at some points along the wall.
    for distance, depth in ((9, wall.thickness_m), (25, wall.thickness_m), (-10, 0), (-25, 0)):
        for x, y in (foot.at([0.5, 0.3, 0.7, 0.15, 0.85]) + depth * outward).tolist():
            places.append(((x, y), (distance * outward[0], distance * outward[1])))
    return Label(f"{wall.name}: {_slab(wall)}", places, colour, rotation)


_MOST_ROWS = 9
"""Most walls and most pieces of furniture that a card lists."""

_KINDS = ("walls", "furniture", "objects")


def brief_rows(scene: Scene) -> dict[str, str]:
    """Return the rows of a scene's ``repr``."""
    rows = room_rows(scene)
    for kind in _KINDS:
        names = [part.name for part in getattr(scene, kind)]
        # Few scenes have objects: the others need not say so.
        if names or kind != "objects":
            rows[kind] = f"{len(names)}: {', '.join(names)}" if names else "none"
    if scene.materials:
        rows["materials"] = ", ".join(material.name for material in scene.materials)
    return {label.lower(): value for label, value in rows.items()}


def tables(scene: Scene) -> dict[str, dict[str, str]]:
    """Return the tables of a scene's card by their headings."""
    found = {"": room_rows(scene)}
    for kind in _KINDS:
        parts = getattr(scene, kind)
        if parts:
            shown = {part.name: _part(part) for part in parts[:_MOST_ROWS]}
            if len(parts) > _MOST_ROWS:
                shown["..."] = f"and {len(parts) - _MOST_ROWS} more"
            found[f"{kind.capitalize()} ({len(parts)})"] = shown
    return found


def room_rows(scene: Scene) -> dict[str, str]:
    """Return what the scene is as a whole, as texts with units by their labels."""
    rows = {"Description": scene.description}
    if (box := scene.room_box()) is not None:
        rows["Room"] = f"{' × '.join(f'{length:.4g}' for length in box[1] - box[0])} m"
    place = scene.radar_position_m
    rows["Radar"] = "at its own position" if place is None else f"at {_point(place)}"
    if place is not None and scene.is_outside(place):
        rows["Radar"] += ", outside of the room"
    for name in ("yaw", "pitch", "roll"):
        if (angle := getattr(scene, f"radar_{name}_deg")) is not None:
            rows["Radar"] += f", {name} {angle:g}°"
    rows["Person"] = _place(scene.person_position_m, scene.heading_deg)
    if scene.people:
        people = [
            f"{one.motion.name} {_place(one.position_m, one.heading_deg)}" for one in scene.people
        ]
        rows["People"] = f"{len(people)}: {', '.join(people)}"
    return rows


def _point(position_m: Iterable[float]) -> str:
    return f"({', '.join(f'{value:g}' for value in position_m)}) m"


def _place(position_m: Iterable[float], turned_deg: float) -> str:
    return f"at {_point(position_m)}{f', turned by {turned_deg:g}°' if turned_deg else ''}"


def _part(part: Wall | Furniture) -> str:
    if isinstance(part, Wall):
        low, high = sorted(part.size_m)
        return f"{_slab(part)}, {high:.4g} × {low:.4g} m"
    return f"{part.material.name}, {_place(part.position_m, part.yaw_deg)}"
