"""What a motion shows of itself: who moves, how long, how tall and where, and its picture."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rtradar.system.figure_style import (
    LIGHT,
    STYLE,
    axes_given,
    dress,
    figure_for,
    new_figure,
    png_of,
    theme_of,
    write_heading,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

    from rtradar.motion.motion import Motion


def rows(motion: Motion) -> dict[str, str]:
    """Return what the motion is, as texts with units by their labels."""
    joints = poses(motion, 5000)[1]
    roots, height_m = joints[:, 0], float(np.median(np.ptp(joints[..., 2], axis=1)))
    low, high = roots.min(axis=0), roots.max(axis=0)
    path_m = float(np.linalg.norm(np.diff(roots[:, :2], axis=0), axis=1).sum())
    girth = "" if motion.girth == 1 else f", {motion.girth:.3g} times as thick as the nominal body"
    first, last = motion.joints[0], motion.joints[-1]
    spans = [f"{axis} {_span(*ends)}" for axis, *ends in zip("xyz", low, high, strict=True)]
    return {
        "Duration": f"{motion.duration_s:.4g} s",
        "Frames": f"{len(motion.root_positions):,} at {motion.rate_hz:.5g} Hz",
        "Joints": f"{len(motion.joints)}, from {first} to {last}",
        "Height": f"{height_m:.3g} m from the lowest to the highest joint{girth}",
        "Place": f"root at {', '.join(spans)} m",
        "Path": f"{path_m:.3g} m over the floor",
    }


def poses(motion: Motion, most: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times (pose,) [s] of ``most`` frames or fewer, and their joints (pose, joint, 3) [m].

    They are spread evenly over the motion. Other frames are not computed, because there may be a
    million of them.
    """
    times = motion.frame_times
    inside = np.flatnonzero((times > -0.5 / motion.rate_hz) & (times <= motion.duration_s + 1e-9))
    some = inside[np.unique(np.linspace(0, len(inside) - 1, most).astype(int))]
    rows = {"root_positions": motion.root_positions[some], "rotations": motion.rotations[some]}
    taken = replace(motion, first_frame_s=0.0, length_s=None, **rows)
    return times[some], taken.positions


def _span(least: float, most: float) -> str:
    low, high = (f"{round(value, 2) + 0.0:.2f}" for value in (least, most))  # never -0.00
    return low if low == high else f"{low} to {high}"


# -- the picture ---------------------------------------------------------------------------------

_POSES, _PATH_POSES = 6, 400
"""Numbers of skeletons, and of points of the root's path."""


def plot_motion(motion: Motion, ax: Axes | None) -> Axes:
    """Draw a motion from the side, and from above unless axes are given, as `Motion.plot` does."""
    _, ax = axes_given(None, ax)
    _, path = poses(motion, _PATH_POSES)
    joints = path.reshape(-1, 3)
    span = np.ptp(joints, axis=0)
    across = int(span[1] > span[0])  # the body is seen where it is wider
    if ax is not None:
        handles = _draw(ax, motion, path, (across, 2))
        ax.legend(handles=handles, loc="center left", bbox_to_anchor=(1.0, 0.5))
        dress(ax, title=motion.name)
        return ax
    # Both views have one scale, and heights that follow from how far the person moves.
    wide, *tall = (float(span[axis]) + 0.4 for axis in (across, 2, 1 - across))
    scale = min(5.2 / wide, *(3.0 / height for height in tall))  # [inch/m], the same in both views
    heights = [max(scale * height, 0.9) for height in tall]
    figure = figure_for(sum(heights) + 2.0)
    # Above and below share the legend, which is therefore one of the figure.
    side, above = figure.subplots(2, 1, height_ratios=heights)
    handles = _draw(side, motion, path, (across, 2))
    _draw(above, motion, path, (across, 1 - across))
    dress(side, title="As the radar sees it" if across else "From the side")
    dress(above, title="From above")
    write_heading(figure, f"Motion {motion.name}")
    style: dict[str, Any] = {"fontsize": STYLE["legend.fontsize"], "frameon": False}
    style |= {"loc": "outside lower center", "ncols": _POSES, "labelcolor": theme_of(side).text}
    figure.legend(handles=handles, **style)
    return side


def picture_from_the_side(motion: Motion) -> bytes:
    """Draw the view from the side as a PNG file, for a card."""
    figure = new_figure(3.2)
    plot_motion(motion, figure.add_subplot())
    return png_of(figure)


def _draw(
    axes: Axes, motion: Motion, path: NDArray[np.float64], seen: tuple[int, int]
) -> list[Line2D]:
    """Draw skeletons and the root's ``path`` in two coordinates; return a line for each time.

    ``path`` (pose, joint, 3) are the joints [m], of which the first is the root.
    """
    from matplotlib import colormaps  # slow to import
    from matplotlib.collections import LineCollection
    from matplotlib.lines import Line2D

    theme, view = theme_of(axes), list(seen)
    times, joints = poses(motion, _POSES)
    # A bone is a line from each joint's parent to the joint, seen in two of the three coordinates.
    children = [joint for joint, parent in enumerate(motion.parents) if parent >= 0]
    parents = [motion.parents[joint] for joint in children]
    bones = np.stack([joints[:, parents], joints[:, children]], axis=2)[..., view]
    # The bright end of the colours is hard to see on white, the dark end on black.
    ends = (0.0, 0.82) if theme is LIGHT else (0.25, 1.0)
    colours = colormaps["viridis"](np.linspace(*ends, len(times)))
    if seen[1] == 2:
        axes.axhline(0.0, color=theme.wall, linewidth=1)
    axes.plot(*path[:, 0, view].T, color=theme.faint, linewidth=1.2, linestyle="--")
    for lines, colour in zip(bones, colours, strict=True):
        axes.add_collection(LineCollection(list(lines), colors=[colour], linewidths=1.8))
    axes.autoscale_view()
    axes.margins(0.05)
    axes.set(xlabel=f"{'xyz'[seen[0]]} [m]", ylabel=f"{'xyz'[seen[1]]} [m]")
    if seen[0] == 1:  # y is at the left of the radar
        axes.invert_xaxis()
    axes.set_aspect("equal", adjustable="datalim")
    return [
        Line2D([], [], color=colour, label=f"{time:.2f} s")
        for time, colour in zip(times, colours, strict=True)
    ]
