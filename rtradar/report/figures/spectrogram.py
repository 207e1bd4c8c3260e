"""Picture of a spectrogram."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rtradar.radar import Radar
from rtradar.report.figures.field_units import HANN_BINS, VELOCITY_LABEL, field_unit
from rtradar.report.figures.maps import bin_edges, colour_limits, new_figure, save_figure


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
    """Spectrogram, time across and velocity up.

    Parameters
    ----------
    path : path
        PNG file.
    power : (time, velocity)
        Of one channel, summed over range [m^2]; at least one row.
    time : (time,)
        [s], evenly spaced.
    velocity : (velocity,)
        [m/s], ascending.
    radar : Radar
    title : str
    spreading : bool
        Whether amplitudes hold the loss over distance.
    """
    figure = new_figure(8, 4.5)
    axes = figure.subplots()
    unit = field_unit(radar, spreading=spreading, strongest_m2=float(power.max()) / HANN_BINS)
    values = unit.level(power / HANN_BINS)  # what one echo gives is spread over as many range bins
    low, high = colour_limits(values)
    extent = (*bin_edges(time), *bin_edges(velocity))
    image = axes.imshow(
        values.T, origin="lower", aspect="auto", cmap="viridis", vmin=low, vmax=high, extent=extent
    )
    axes.set(xlabel="Time [s]", ylabel=VELOCITY_LABEL, title=title)
    figure.colorbar(image, label=unit.label("one channel"))
    save_figure(figure, path)
