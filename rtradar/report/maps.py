"""Maps as they are shown: levels over two axes, what lies over them, in figures and on pages."""

from __future__ import annotations

import base64
import math
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.process.window_functions import WindowName, noise_bandwidth_bins
from rtradar.radar import Radar
from rtradar.report.canvas import (
    VELOCITY_LABEL,
    FieldUnit,
    angle_label,
    angle_view,
    fitted_limits,
    masking_note,
)
from rtradar.report.three_d import packed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage

MOST_LEVEL = 250
"""Highest quantised level."""

_MOST_CELLS = 600
"""Cells of a page's map along each axis; of more, the strongest of neighbours are shown."""

_Limits = tuple[float, float]


class Overlay(NamedTuple):
    """Points or a line ``xy (point, 2)`` over a map, in the units of its axes.

    ``kind`` is one of detection, ghost, wall, furniture, reflector, person, path and radar.
    """

    kind: str
    name: str
    xy: NDArray[np.float64]

    def packed(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {"kind": self.kind, "name": self.name, "xy": packed(self.xy)}


def ghost_mark(number: int, range_m: float, across: float) -> Overlay:
    """Return the mark of a ghost over a map, with its number as the name."""
    return Overlay("ghost", str(number), np.array([[across, range_m]]))


@dataclass(frozen=True, kw_only=True, eq=False)
class ShownMap:
    """One map as a figure or a page shows it.

    ``level_db`` (up, across) is in ``unit``, over evenly spaced centres ``across`` and ``up`` with
    these ``labels``; ``qualifier`` says of what it is the power. The ``view`` has the limits
    across, None for the whole axis, and up. Colours reach ``below_peak_db`` below the strongest
    cell in view, unless ``colours_db`` are their limits. ``made`` says how static clutter was
    removed and where chirps are missing, ``note`` what a reader must know.
    """

    title: str
    labels: tuple[str, str]
    level_db: NDArray[np.float64]
    across: NDArray[np.float64]
    up: NDArray[np.float64]
    view: tuple[_Limits | None, _Limits]
    unit: FieldUnit
    qualifier: str
    below_peak_db: float = 60.0
    colours_db: _Limits | None = None
    over: tuple[Overlay, ...] = ()
    made: str = ""
    note: str = ""

    @property
    def limits(self) -> tuple[_Limits, _Limits]:
        """Limits of the axes across and up."""
        return self.view[0] or bin_edges(self.across), self.view[1]

    @property
    def heading(self) -> str:
        """The title, with the number of detections where there are any over a map."""
        found = [one.name for one in self.over if one.kind == "detection"]
        return self.title.replace("map,", f"map and {found[0]},") if found else self.title

    @cached_property
    def limits_db(self) -> _Limits:
        """Floor and ceiling of the colours [dB], as `colour_limits` sets them for the view."""
        if self.colours_db is not None:
            return self.colours_db
        return colour_limits(self.level_db[np.ix_(*self._inside())], self.below_peak_db)

    @property
    def colours(self) -> str:
        """Sentence on floor and ceiling of the colours.

        It also says what removing the loss with range does to echoes that are not at the range of
        their cell.
        """
        low, high = self.limits_db
        floor = (
            f"{self.below_peak_db:.0f} dB below that"
            if low <= high - self.below_peak_db
            else "3 dB below the median of the view"
        )
        unit = self.unit.decibels
        words = f"Colours: ceiling {round(high)} {unit}, the strongest cell; "
        lifted = np.size(self.unit.scale) > 1
        return f"{words}floor {round(low)} {unit}, {floor}." + (
            " What leaks or folds over from near shows R^4 higher." if lifted else ""
        )

    def draw(self, axes: Axes) -> AxesImage:
        """Draw the map within its limits, without what lies over it."""
        image = draw_levels(axes, self.level_db, self.across, self.up, self.limits_db)
        across, up = self.limits
        axes.set(xlim=across, ylim=up, xlabel=self.labels[0], ylabel=self.labels[1])
        return image

    def packed(self) -> dict[str, Any]:
        """Return what is in view as plain values for JSON."""
        up, across = self._inside()
        level = self.level_db[np.ix_(up, across)]
        # A page needs no more cells than a screen has pixels.
        together = [math.ceil(count / _MOST_CELLS) for count in level.shape]
        shown = strongest(level, *together)
        low, high = self.limits_db
        levels = Levels.of(
            [shown],
            (1, *shown.shape),
            (low, high),
            label=self.unit.label(self.qualifier),
            across=spaced(self.across[across], together[1]),
            up=spaced(self.up[up], together[0]),
        )
        return levels.packed() | {
            "labels": list(self.labels),
            "view": [list(one) for one in self.limits],
            "over": [one.packed() for one in self.over],
        }

    def _inside(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Return the rows and columns whose centres are in view, or all where none is."""

        def inside(centres: NDArray[np.float64], limits: _Limits) -> NDArray[np.intp]:
            found = np.flatnonzero((centres >= limits[0]) & (centres <= limits[1]))
            return found if len(found) else np.arange(len(centres))

        across, up = self.limits
        return inside(self.up, up), inside(self.across, across)


def range_doppler_map(
    power: NDArray[np.floating],
    mask: NDArray[np.bool_],
    radar: Radar,
    unit: FieldUnit,
    *,
    ghosts: Sequence[Overlay] = (),
    counts: NDArray[np.integer] | None = None,
    **others: Any,
) -> ShownMap:
    """Return a range-Doppler map (range, velocity) with its detections, and ghosts.

    ``power`` is the sum over all channels [m^2]. The view fits ``counts`` of detections, by default
    those of the ``mask``, and all ghosts. Others are fields of `ShownMap`.
    """
    velocity, distance = radar.velocity_mps(mask.shape[1]), radar.range_m
    # Detections as points, and limits that show them, the ghosts, and velocity 0.
    rows, columns = np.nonzero(mask)
    places = np.column_stack([velocity[columns], distance[rows]])
    found = mask if counts is None else counts
    across, ahead = np.concatenate([np.empty((0, 2)), *(one.xy for one in ghosts)]).T
    # The power is a sum over the channels, and the map shows their mean.
    fields: dict[str, Any] = {
        "labels": (VELOCITY_LABEL, "Range [m]"),
        "level_db": unit.level(power / radar.n_channels),
        "across": velocity,
        "up": distance,
        "view": (
            fitted_limits(found.sum(axis=0), velocity, include=[0.0, *across]),
            fitted_limits(found.sum(axis=1), distance, include=ahead),
        ),
        "unit": unit,
        "qualifier": "mean of channels",
        "over": (Overlay("detection", f"{len(rows)} detections", places), *ghosts),
        "note": masking_note(power, mask),
    }
    return ShownMap(**fields | others)


def range_angle_map(
    name: str,
    power: NDArray[np.floating],
    angles: NDArray[np.float64],
    radar: Radar,
    unit: FieldUnit,
    window: WindowName,
    over: Sequence[Overlay] = (),
    **others: Any,
) -> ShownMap:
    """Return a map (range, angle) of detected cells, over ``angles`` [degree].

    ``power`` [m^2] is a sum over velocities, over as many of which the ``window`` function spreads
    one echo. Others are fields of `ShownMap`.
    """
    ghosts = [(one.xy[0, 0], one.xy[0, 1]) for one in over if one.kind == "ghost"]
    return ShownMap(
        labels=(angle_label(name, radar), "Range [m]"),
        level_db=unit.level(power / noise_bandwidth_bins(window, radar.cycles_per_frame)),
        across=angles,
        up=radar.range_m,
        view=angle_view(power, angles, radar, ghosts),
        unit=unit,
        qualifier="detected cells",
        below_peak_db=40,
        over=tuple(over),
        **others,
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class Levels:
    """Maps in decibels, quantised coarsely so that a page stays small.

    ``level`` (map, row, column) means ``low_db + step_db level`` [dB]; ``label`` is that of a
    colour bar; ``across`` and ``up`` are the value of the first column or row and the step to the
    next.
    """

    level: NDArray[np.uint8]
    low_db: float
    step_db: float
    label: str
    across: tuple[float, float]
    up: tuple[float, float]

    @classmethod
    def of(
        cls,
        maps_db: Iterable[NDArray[np.floating]],
        shape: tuple[int, int, int],
        limits_db: _Limits,
        **axes: Any,
    ) -> Levels:
        """Quantise so many maps of rows and columns, ``shape``, between these limits [dB]."""
        low, high = limits_db
        # Values beyond the limits take the outermost levels.
        step = (high - low) / MOST_LEVEL
        level = np.empty(shape, np.uint8)
        for one, quantised in zip(maps_db, level, strict=True):
            quantised[:] = np.clip(np.rint((one - low) / step), 0, MOST_LEVEL)
        return cls(level=level, low_db=low, step_db=step, **axes)

    @property
    def high_db(self) -> float:
        """Power of the highest level of the colour scale [dB]."""
        return self.low_db + self.step_db * MOST_LEVEL

    def drawn(self, number: int) -> tuple[Any, ...]:
        """Return one map [dB], its axes across and up, and the limits of its colours."""
        rows, columns = self.level.shape[1:]
        across = self.across[0] + self.across[1] * np.arange(columns)
        up = self.up[0] + self.up[1] * np.arange(rows)
        decibels = self.low_db + self.step_db * self.level[number]
        return decibels, across, up, (self.low_db, self.high_db)

    def packed(self) -> dict[str, Any]:
        """Return plain values for JSON; ``levels`` are compressed by zlib and encoded in base64."""
        return {
            # A higher level takes much longer, and leaves little less.
            "levels": base64.b64encode(zlib.compress(self.level.tobytes(), 4)).decode(),
            "shape": list(self.level.shape[1:]),
            "x": list(self.across),
            "y": list(self.up),
            "low_db": self.low_db,
            "high_db": self.high_db,
            "step_db": self.step_db,
            "label": self.label,
        }


def strongest(values: NDArray[np.floating], rows: int, columns: int) -> NDArray[np.floating]:
    """Return the strongest of so many neighbouring rows and columns each."""
    by_row = np.maximum.reduceat(values, np.arange(0, values.shape[0], rows), axis=0)
    return np.asarray(np.maximum.reduceat(by_row, np.arange(0, values.shape[1], columns), axis=1))


def spaced(values: NDArray[np.float64], together: int = 1) -> tuple[float, float]:
    """Return the first of evenly spaced centres and their step, of so many bins taken together."""
    # The centre of bins that are taken together is half-way between the first and the last.
    width = float(values[1] - values[0]) if len(values) > 1 else 1.0
    return float(values[0]) + width * (together - 1) / 2, width * together


def colour_limits(level_db: NDArray[np.float64], below_peak_db: float = 60.0) -> _Limits:
    """Return the limits of the colour scale [dB], as `limits_of` sets them."""
    return limits_of(float(level_db.max()), float(np.median(level_db)), below_peak_db)


def limits_of(top_db: float, median_db: float, below_peak_db: float = 60.0) -> _Limits:
    """Return the limits of colours for a peak and a median [dB].

    They are the peak and 3 dB below the median, or ``below_peak_db`` below the peak if higher.
    """
    return max(top_db - below_peak_db, min(median_db - 3, top_db - 1)), top_db


def bin_edges(centres: NDArray[np.float64]) -> _Limits:
    """Outer edges of evenly spaced bins."""
    half = (centres[1] - centres[0]) / 2 if len(centres) > 1 else 0.5
    return float(centres[0] - half), float(centres[-1] + half)


def draw_levels(
    axes: Axes,
    level_db: NDArray[np.float64],
    across: NDArray[np.float64],
    up: NDArray[np.float64],
    limits_db: _Limits | None = None,
    **style: Any,
) -> AxesImage:
    """Draw ``level_db`` (up, across) over evenly spaced axes, in the colours of `colour_limits`.

    Each pixel shows the nearest cell.
    """
    low, high = limits_db or colour_limits(level_db)
    extent = (*bin_edges(across), *bin_edges(up))
    style = {"cmap": "viridis", "aspect": "auto", "origin": "lower"} | style
    # Levels are resampled before they have colours, and in float32, which takes less memory.
    style |= {"interpolation": "nearest", "interpolation_stage": "data"}
    return axes.imshow(level_db.astype(np.float32), vmin=low, vmax=high, extent=extent, **style)
