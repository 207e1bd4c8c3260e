"""Picture of measured clouds beside predicted ones, for `measured_radar`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from cloud_figures import Reals, weighted_means
from mars_clouds import DOPPLER_BIN_MPS, FRAME_S, Points, Take
from matplotlib.axes import Axes
from matplotlib.figure import Figure

SHOWN = slice(0, 20)  # frames whose points are drawn together


def draw(takes: list[Take], ours: list[Points], path: Path) -> None:
    """Draw points from the front and from above, and the mean Doppler, move by move.

    ``ours`` are the predicted points of each take.
    """
    drawn = Figure(figsize=(3.6 * len(takes), 12), layout="constrained")
    table = drawn.subplots(5, len(takes), squeeze=False)
    shade = None
    for column, (take, points) in enumerate(zip(takes, ours, strict=True)):
        for row, (name, own) in enumerate((("measured", take.measured), ("predicted", points))):
            shade = _cloud(table[row, column], own, "height [m]", 2)
            _cloud(table[row + 2, column], own, "away [m]", 1)
            table[row, column].set_title(f"move {take.move + 1}, 2 s, {name}", fontsize=9)
            table[row + 2, column].set_title(f"from above, {name}", fontsize=9)
        _over_time(table[4, column], take, points)
    drawn.colorbar(shade, ax=table[:4], label="Doppler [m/s], positive receding", shrink=0.5)
    drawn.savefig(path, dpi=76)


def _cloud(axes: Axes, points: Points, label: str, axis: int) -> object:
    """Points sideways and along another axis, coloured by their Doppler."""
    own = points.of((points.frame >= SHOWN.start) & (points.frame < SHOWN.stop))
    limits = {1: (1.2, 2.6), 2: (-1.0, 1.0)}[axis]
    axes.set(xlabel="to the right [m]", ylabel=label, xlim=(-1, 1), ylim=limits)
    colour = own.doppler * DOPPLER_BIN_MPS
    return axes.scatter(
        own.places[:, 0], own.places[:, axis], c=colour, s=5, cmap="coolwarm", vmin=-1.1, vmax=1.1
    )


def _over_time(axes: Axes, take: Take, points: Points) -> None:
    frames = len(take.numbers)
    for name, own in (("measured", take.measured), ("predicted", points)):
        mean: Reals = weighted_means(own.doppler, own.level, own.frame, frames) * DOPPLER_BIN_MPS
        axes.plot(np.arange(frames) * FRAME_S, mean, label=name, linewidth=1)
    axes.set(xlabel="time [s]", ylabel="mean Doppler [m/s]")
    axes.legend(fontsize=7)
