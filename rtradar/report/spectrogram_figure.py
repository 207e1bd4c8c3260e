"""Picture of a spectrogram."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rtradar.report.figures import bin_edges, decibels, new_figure, save_figure


def draw_spectrogram(
    path: Path, power: NDArray[np.floating], time: NDArray[np.float64], velocity: NDArray[np.float64], title: str
) -> None:
    """Spectrogram, time across and velocity up.

    Parameters
    ----------
    path : path
        PNG file.
    power : (time, velocity)
        [m^2]; at least one row.
    time : (time,)
        [s], evenly spaced.
    velocity : (velocity,)
        [m/s], ascending.
    title : str
    """
    figure = new_figure(8, 4.5)
    axes = figure.subplots()
    values, low, high = decibels(power)
    extent = (*bin_edges(time), *bin_edges(velocity))
    image = axes.imshow(values.T, origin="lower", aspect="auto", cmap="viridis", vmin=low, vmax=high, extent=extent)
    axes.set(xlabel="Time [s]", ylabel="Velocity [m/s], positive receding", title=title)
    figure.colorbar(image, label="Power, one channel [dB re 1 m²]")
    save_figure(figure, path)
