"""Pictures of maps and clouds, with axes and units, as PNG files."""

from __future__ import annotations

from pathlib import Path
from typing import BinaryIO

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from rtradar.radar import Radar
from rtradar.report.figures.field_units import HANN_BINS, VELOCITY_LABEL, field_unit


def new_figure(width: float, height: float) -> Figure:
    """Make an empty figure of this size [inch] without a window."""
    return Figure(figsize=(width, height), dpi=130, layout="constrained")


def save_figure(figure: Figure, file: Path | BinaryIO) -> None:
    """Save in the format of the path's suffix, or as PNG to an open file, and clear the figure.

    Figure and axes refer to each other. Without clearing, the memory of one picture could
    still be in use with the next, until Python's garbage collector runs.
    """
    for axes in figure.axes:
        axes.title.set_wrap(True)
    figure.savefig(file, format=None if isinstance(file, Path) else "png")
    figure.clear()


def colour_limits(
    level_db: NDArray[np.float64], below_peak_db: float = 60.0
) -> tuple[float, float]:
    """Return the limits of the colour scale [dB].

    They are the peak and 3 dB below the median, or ``below_peak_db`` below the peak if higher.
    """
    top = float(level_db.max())
    return max(top - below_peak_db, min(float(np.median(level_db)) - 3, top - 1)), top


def bin_edges(centres: NDArray[np.float64]) -> tuple[float, float]:
    """Outer edges of evenly spaced bins."""
    half = (centres[1] - centres[0]) / 2 if len(centres) > 1 else 0.5
    return float(centres[0] - half), float(centres[-1] + half)


def draw_range_time(
    path: Path,
    power: NDArray[np.floating],
    slow_time: NDArray[np.float64],
    radar: Radar,
    title: str,
    *,
    spreading: bool = True,
) -> None:
    """Range-time picture.

    Parameters
    ----------
    path : path
        PNG file.
    power : (slow_time, range)
        [m^2].
    slow_time : (slow_time,)
        [s].
    radar : Radar
    title : str
    spreading : bool
        Whether amplitudes hold the loss over distance.
    """
    figure = new_figure(8, 4.5)
    axes = figure.subplots()
    unit = field_unit(radar, spreading=spreading, range_m=radar.range_m)
    values = unit.level(power)
    low, high = colour_limits(values)
    image = axes.imshow(
        values.T,
        origin="lower",
        aspect="auto",
        cmap="viridis",
        vmin=low,
        vmax=high,
        extent=(*bin_edges(slow_time), *bin_edges(radar.range_m)),
    )
    axes.set(xlabel="Time [s]", ylabel="Range [m]", title=title)
    figure.colorbar(image, label=unit.label("mean of channels"))
    save_figure(figure, path)


def draw_range_doppler(
    path: Path,
    power: NDArray[np.floating],
    mask: NDArray[np.bool_],
    radar: Radar,
    title: str,
    *,
    spreading: bool = True,
) -> None:
    """Range-Doppler map beside itself with its detections.

    Parameters
    ----------
    path : path
        PNG file.
    power : (range, velocity)
        Sum over all channels [m^2].
    mask : (range, velocity) bool
        Detections.
    radar : Radar
    title : str
    spreading : bool
        Whether amplitudes hold the loss over distance.
    """
    figure = new_figure(11, 4.5)
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    unit = field_unit(radar, spreading=spreading, range_m=radar.range_m[:, None])
    values = unit.level(power / radar.n_channels)
    low, high = colour_limits(values)
    velocity, distance = radar.velocity_mps(power.shape[1]), radar.range_m
    extent = (*bin_edges(velocity), *bin_edges(distance))
    image = left.imshow(
        values, origin="lower", aspect="auto", cmap="viridis", vmin=low, vmax=high, extent=extent
    )
    right.imshow(
        values, origin="lower", aspect="auto", cmap="Greys", vmin=low, vmax=high, extent=extent
    )
    rows, columns = np.nonzero(mask)
    right.scatter(
        velocity[columns], distance[rows], s=3, color="crimson", label=f"{len(rows)} detections"
    )
    right.legend(loc="upper right")
    for axes, name in ((left, "Range-Doppler map"), (right, "Detections, over the map in grey")):
        axes.set(xlabel=VELOCITY_LABEL, title=name)
    left.set_ylabel("Range [m]")
    figure.colorbar(image, ax=[left, right], label=unit.label("mean of channels"))
    figure.suptitle(title, wrap=True)
    save_figure(figure, path)


def draw_rdt_cloud(path: Path, points: NDArray[np.float64], title: str) -> None:
    """Range-Doppler-time cloud, coloured by velocity.

    Parameters
    ----------
    path : path
        PNG file.
    points : (point, 3) float64
        Time [s], range [m], velocity [m/s].
    title : str
    """
    figure = new_figure(8, 6.5)
    axes = figure.add_subplot(projection="3d")
    time, distance, velocity = points.T
    largest = float(np.abs(velocity).max(initial=1e-9))
    dots = axes.scatter(
        time, distance, velocity, c=velocity, s=4, cmap="coolwarm", vmin=-largest, vmax=largest
    )
    axes.set(
        xlabel="Time [s]",
        ylabel="Range [m]",
        zlabel=VELOCITY_LABEL,
        title=f"{title}\n{len(points)} points",
    )
    axes.set_box_aspect((1.6, 1, 1))
    figure.colorbar(dots, label=VELOCITY_LABEL, shrink=0.6, pad=0.1)
    save_figure(figure, path)


def draw_spectrogram(
    path: Path,
    power: NDArray[np.floating],
    time: NDArray[np.float64],
    velocity: NDArray[np.float64],
    radar: Radar,
    title: str,
    *,
    spreading: bool = True,
) -> None:
    """Draw a spectrogram, time across and velocity up.

    Parameters
    ----------
    path : path
        PNG file.
    power : (time, velocity)
        Power of one channel, summed over range [m^2]; at least one row.
    time : (time,)
        Evenly spaced times [s].
    velocity : (velocity,)
        Ascending velocities [m/s].
    radar : Radar
        Radar of the run.
    title : str
        Title of the picture.
    spreading : bool
        Whether amplitudes include the spreading loss.
    """
    figure = new_figure(8, 4.5)
    axes = figure.subplots()
    unit = field_unit(radar, spreading=spreading, strongest_m2=float(power.max()) / HANN_BINS)
    values = unit.level(power / HANN_BINS)  # one echo is spread over as many range bins
    low, high = colour_limits(values)
    extent = (*bin_edges(time), *bin_edges(velocity))
    image = axes.imshow(
        values.T, origin="lower", aspect="auto", cmap="viridis", vmin=low, vmax=high, extent=extent
    )
    axes.set(xlabel="Time [s]", ylabel=VELOCITY_LABEL, title=title)
    figure.colorbar(image, label=unit.label("one channel"))
    save_figure(figure, path)
