"""Names in a picture, each where it covers no other."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from rtradar.system.figure_style import STYLE, theme_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Point = tuple[float, float]

_LEADER_PT = 15.0
"""Distance from which a thin line leads from a name to what it names [pt]."""

_GAP_PX = 2.0


@dataclass(frozen=True)
class Label:
    """A name, and where it may stand.

    Parameters
    ----------
    text : str
        Name, which may have several lines.
    places : sequence of (point, offset)
        Points of the data that it may stand at, and by how much it is moved from there [pt]. The
        first are preferred.
    colour : str
        Colour of the letters.
    rotation : float
        Rotation of the letters, anticlockwise [deg].
    """

    text: str
    places: Sequence[tuple[Point, Point]]
    colour: str
    rotation: float = 0.0


def around(point: Point, nearest_pt: float = 0.0) -> list[tuple[Point, Point]]:
    """Return places on circles around a point, for `Label`; the point itself is the first.

    Parameters
    ----------
    point : tuple of float
        Point of the data.
    nearest_pt : float
        Radius of the first circle [pt]. The point itself is left out where it is not 0.

    Returns
    -------
    list of (point, offset)
        Places, the nearest first.
    """
    found: list[tuple[Point, Point]] = [] if nearest_pt else [(point, (0.0, 0.0))]
    for ring in range(6):
        radius = max(nearest_pt, 10.0) + 10.0 * ring
        for turn in range(16):  # above and below first, then slanting, then beside
            angle = math.radians(90 + 180 * (turn % 2) + 22.5 * (turn // 2))
            found.append((point, (1.6 * radius * math.cos(angle), radius * math.sin(angle))))
    return found


def place_labels(
    axes: Axes, labels: Iterable[Label], avoided: Iterable[ArrayLike] = ()
) -> list[str]:
    """Write each label at the first of its places where it covers no other and is inside the axes.

    The limits of the axes must be final, because places are compared on the screen.

    Parameters
    ----------
    axes : Axes
        Axes that the labels are written on.
    labels : iterable of Label
        Labels, the most important first.
    avoided : iterable of (2, 2) array_like
        Two opposite corners, in units of the data, of each rectangle that no label may cover.

    Returns
    -------
    list of str
        Texts for which there was no place.
    """
    # Everything is compared in pixels, for which the layout of the figure must be settled.
    figure: Any = axes.get_figure(root=True)
    figure.draw_without_rendering()  # settles where the axes are
    theme, inside, pixels = theme_of(axes), axes.get_window_extent(), figure.dpi / 72
    corners = np.array([axes.transData.transform(rectangle) for rectangle in avoided])
    corners = corners.reshape(-1, 2, 2)
    lows, highs = [*corners.min(axis=1)], [*corners.max(axis=1)]
    style: dict[str, Any] = {"textcoords": "offset points", "in_layout": False}
    box: dict[str, Any] = {"facecolor": theme.page, "alpha": 0.65, "edgecolor": "none", "pad": 0.8}
    words: dict[str, Any] = {"fontsize": STYLE["font.size"], "bbox": box, "parse_math": False}
    words |= {"ha": "center", "va": "center", "zorder": 10, **style}
    left_out = []
    # Labels are placed one by one; each is an obstacle for those after it.
    for label in labels:
        turned: dict[str, Any] = {"rotation": label.rotation, "color": label.colour}
        text = axes.annotate(label.text, label.places[0][0], (0, 0), **words, **turned)
        half = np.array(text.get_window_extent().size) / 2 + _GAP_PX
        for point, offset in label.places:
            middle = axes.transData.transform(point) + pixels * np.array(offset)
            low, high = middle - half, middle + half
            covered = (low < highs).all(axis=-1) & (high > lows).all(axis=-1) if lows else False
            if (low >= inside.min).all() and (high <= inside.max).all() and not np.any(covered):
                lows, highs = [*lows, low], [*highs, high]
                text.xy, text.xyann = point, offset
                # A label that stands far from its point needs a line to it.
                if math.hypot(*offset) > _LEADER_PT and not label.rotation:
                    line: dict[str, Any] = {
                        "arrowstyle": "-",
                        "color": label.colour,
                        "linewidth": 0.6,
                    }
                    line |= {"shrinkA": 5, "shrinkB": 0}
                    axes.annotate("", point, offset, arrowprops=line, zorder=9, **style)
                break
        else:
            text.remove()
            left_out.append(label.text)
    return left_out
