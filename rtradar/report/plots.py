"""`Plots`: the pictures of a run's maps and clouds, in a notebook and as the files of a run."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds import SpatialCloud
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.report.canvas import (
    COUNTS,
    HANDFUL,
    VELOCITY_LABEL,
    FieldUnit,
    above_floor,
    add_colour_bar,
    field_unit,
    fitted_limits,
    place_limits,
    rdt_points,
    spectrogram_power,
    thinned,
)
from rtradar.report.maps import ShownMap, range_angle_map, range_doppler_map
from rtradar.system.checks import check_number
from rtradar.system.figure_style import DIVERGING, axes_given, dress, figure_for, theme_of

if TYPE_CHECKING:
    import h5py
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

_BYTES_AT_ONCE = 1 << 21  # of a map that is read through
_DOTS = 20_000
_HIGHEST_IN = 6.5
_TWO_LINES = VELOCITY_LABEL.replace(" (", "\n(")


class _Found(NamedTuple):
    """Detections by range, by velocity and by frame, and the moving energy of each frame."""

    by_range: NDArray[np.float64]
    by_velocity: NDArray[np.float64]
    by_frame: NDArray[np.float64]
    moving: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Plots:
    """Pictures of the maps and clouds of a run; each method returns Matplotlib axes.

    Without ``ax``, a method draws on a new figure, which a notebook shows; with it, on these axes
    of the user's own figure. Colours suit the background of the figure, light or dark. Range,
    velocity and angle are limited to where something is, as `fitted_limits` explains. Powers are in
    units of the field, which each picture names: dBm, dBsm or dB relative to the maximum.

    Parameters
    ----------
    maps : xarray.Dataset or h5py.File
        Maps as ``maps.h5`` has them.
    points : (point, 3) float64
        RDT cloud: time [s], range [m], velocity [m/s].
    spatial_cloud : SpatialCloud
        Spatial cloud.
    radar : Radar
        Radar at its position in the scene.
    summary : mapping
        Contents of ``summary.json``, of which ``parameters`` and ``detected_range_m`` are read.
    new_figure : callable
        Function that makes the figure, from its height [inch].
    """

    maps: xr.Dataset | h5py.File
    points: NDArray[np.float64]
    spatial_cloud: SpatialCloud
    radar: Radar
    summary: Mapping[str, Any]
    new_figure: Callable[[float], Figure] = field(default=figure_for)

    def range_doppler(self, time_s: float | Axes | None = None, ax: Axes | None = None) -> Axes:
        """Draw the range-Doppler map of one frame, and its detections in a second panel beside it.

        Parameters
        ----------
        time_s : float, optional
            Time of the frame [s]; the frame in which what moves has most energy if left out. Axes
            may come in its place.
        ax : Axes, optional
            Axes for the map alone.

        Returns
        -------
        Axes
            Axes of the map.
        """
        when_s, ax = axes_given(time_s, ax)
        shown = self._range_doppler(when_s)
        if ax is None:
            left, right = self.new_figure(4.6).subplots(1, 2, sharex=True, sharey=True)
        else:
            left, right = ax, None
        image = shown.draw(left)
        axes = [left]
        # Detections have a panel of their own, because they would cover the map.
        if right is not None:
            style: dict[str, Any] = {"s": 3, "color": theme_of(right).detection, "linewidths": 0}
            right.scatter(*shown.over[0].xy.T, **style)
            left.set_xlabel(_TWO_LINES)
            right.set_xlabel(_TWO_LINES)
            dress(right)
            axes.append(right)
        self._dress(left, shown, image, axes, shown.title if right is None else shown.heading)
        return left

    def range_time(self, ax: Axes | None = None) -> Axes:
        """Draw power over time and range.

        Parameters
        ----------
        ax : Axes, optional
            Axes to draw on.

        Returns
        -------
        Axes
            Axes of the map.
        """
        return self._draw(self._range_time, ax)

    def spectrogram(self, ax: Axes | None = None) -> Axes:
        """Draw power over time and velocity.

        Parameters
        ----------
        ax : Axes, optional
            Axes to draw on.

        Returns
        -------
        Axes
            Axes of the spectrogram.

        Raises
        ------
        InputError
            If the capture is shorter than a window of the spectrogram.
        """
        if not len(self.maps["spectrogram"]):
            raise InputError(
                "spectrogram: the capture is shorter than one window; simulate a longer one"
            )
        return self._draw(self._spectrogram, ax)

    def range_angle(self, time_s: float | Axes | None = None, ax: Axes | None = None) -> Axes:
        """Draw power over range and each measured angle of one frame, in a panel for each.

        Parameters
        ----------
        time_s : float, optional
            Time of the frame, as for `range_doppler`.
        ax : Axes, optional
            Axes for the first angle alone.

        Returns
        -------
        Axes
            Axes of the first angle, azimuth where it is measured.

        Raises
        ------
        InputError
            If the radar measures no angle.
        """
        when_s, ax = axes_given(time_s, ax)
        names = self._measured("range_angle")
        first = self._range_angle(names[0], when_s)
        if ax is not None or len(names) == 1:
            return self._draw(first, ax)
        upper, lower = self.new_figure(7.0).subplots(2, 1)
        self._draw(first, upper)
        self._draw(self._range_angle(names[1], when_s), lower, heading=False)
        return cast("Axes", upper)

    def rdt(self, ax: Axes | None = None) -> Axes:
        """Draw the range-Doppler-time cloud in three dimensions, coloured by velocity.

        Parameters
        ----------
        ax : Axes, optional
            Axes to draw on, made with ``projection="3d"``.

        Returns
        -------
        Axes
            Axes of the cloud.

        Raises
        ------
        InputError
            If the axes have no z axis.
        """
        _, ax = axes_given(None, ax)
        if ax is not None and ax.name != "3d":
            raise InputError("rdt: ax has no z axis; make it with projection='3d'")
        axes: Any = self._axes(ax, 4.7, projection="3d")
        points = self.points
        (low, high), (slow, fast) = self._range_limits, self._velocity_limits
        # Points beyond the limits would be drawn outside of the axes in 3D.
        shown = (points[:, 1] >= low) & (points[:, 1] <= high)
        shown &= (points[:, 2] >= slow) & (points[:, 2] <= fast)
        dots = rdt_points(axes, points[shown], fastest=max(abs(slow), abs(fast)), s=4)
        axes.set(ylim=(low, high), zlim=(slow, fast), zlabel="Velocity [m/s]")
        axes.set_box_aspect((1.6, 1, 1), zoom=0.95)
        axes.xaxis.labelpad = axes.yaxis.labelpad = 10
        title = f"Range-Doppler-time cloud, {len(points)} points"
        if not shown.all():
            title += f" ({int(shown.sum())} of them within the axes)"
        dress(axes, title=self._title(title, how_made(self.maps["range_doppler"])))
        add_colour_bar(dots, [axes], VELOCITY_LABEL, shrink=0.7, pad=0.12)
        return cast("Axes", axes)

    def spatial(self, ax: Axes | None = None) -> Axes:
        """Draw the strongest points of the spatial cloud from above and from the side.

        Points are coloured by velocity. A linear array has only the view that it measures.

        Parameters
        ----------
        ax : Axes, optional
            Axes for the first view alone, that from above where azimuth is measured.

        Returns
        -------
        Axes
            Axes of the first view.

        Raises
        ------
        InputError
            If the radar measures no angle.
        """
        _, ax = axes_given(None, ax)
        ups = [1 if name == "azimuth" else 2 for name in self._measured("spatial")]
        cloud = self._strongest
        # Large clouds are thinned for drawing.
        every = math.ceil(max(len(cloud.points), 1) / _DOTS)
        points, velocity = cloud.points[::every], cloud.velocity[::every]
        slow, fast = self._velocity_limits
        fastest = max(abs(slow), abs(fast))
        colours: dict[str, Any] = {"c": velocity, "cmap": DIVERGING}
        colours |= {"vmin": -fastest, "vmax": fastest}
        heading = f"Spatial cloud, {len(self.spatial_cloud.points)} points"
        if len(points) < len(self.spatial_cloud.points):
            part = f"one in {every} of those" if every > 1 else "those"
            heading += f" ({len(points)} drawn: {part} at most 40 dB below the strongest)"
        # The same limits along x in both views, and equal scales.
        place = self.radar.position_m
        limits = [place_limits(points[:, axis], place[axis]) for axis in range(3)]
        width = limits[0][1] - limits[0][0]
        if ax is not None:
            panels, ups = [ax], ups[:1]
        else:
            # As high as equal scales make the panels, with their titles, labels and notes.
            ratios = [(limits[up][1] - limits[up][0]) / width for up in ups]
            options: dict[str, Any] = {"squeeze": False}
            if 4.3 * sum(ratios) > _HIGHEST_IN:  # beside each other
                high = 4.3 / len(ups) * max(ratios)
                options |= {"ncols": len(ups)}
                # Panels of one size, or the title of the first would meet the second.
                span = width * max(ratios)
                for up in ups:
                    middle = sum(limits[up]) / 2
                    limits[up] = middle - span / 2, middle + span / 2
            else:
                high = 4.3 * sum(ratios) + 0.7 * (len(ups) - 1)
                options |= {"nrows": len(ups), "height_ratios": ratios}
            figure = self.new_figure(min(high, 10.0) + 1.9)
            figure.set_layout_engine("compressed")  # for the colour bar
            panels = list(figure.subplots(**options).flat)
        # Points and the radar, in one view after the other.
        for axes, up in zip(panels, ups, strict=True):
            dots = axes.scatter(points[:, 0], points[:, up], s=2.5, linewidths=0, **colours)
            own: dict[str, Any] = {"color": theme_of(axes).radar, "label": "radar"}
            own |= {"markersize": 8, "clip_on": False}
            axes.plot(place[0], place[up], "^", **own)
            view = "from above" if up == 1 else "from the side"
            label = f"{self._x_label}\n{view}" if len(self._angles) == 2 else self._x_label
            axes.set(xlabel=label, ylabel=f"{'xyz'[up]} [m]")
            axes.set(xlim=limits[0], ylim=limits[up], aspect="equal")
        panels[0].legend(loc="best")
        for axes in panels[1:]:
            dress(axes)
        # The title may be as wide as all panels that stand beside the first.
        lowest = [axes.get_position(original=True).y0 for axes in panels]
        beside = len(panels) if lowest[0] == lowest[-1] else 1
        title = self._title(heading, how_made(self.maps["range_doppler"]))
        dress(panels[0], title=title, across=0.92 * beside)
        add_colour_bar(dots, panels, VELOCITY_LABEL)
        return panels[0]

    def frame(self, time_s: float | None = None) -> tuple[int, str]:
        """Return the index of a frame, and the words for it in a title.

        Parameters
        ----------
        time_s : float, optional
            Time [s], to which the nearest frame is taken. If left out, it is the frame in which the
            detected cells of what moves have most power; without any, those of what stands still.

        Returns
        -------
        index : int
            Index of the frame.
        words : str
            Words such as ``window at 1.20 s``.

        Raises
        ------
        InputError
            If the time is not within the capture.
        """
        times = self._axis("time")
        if time_s is None:
            frame = int(self._found.moving.argmax())
            return frame, f"window of most energy, at {times[frame]:.2f} s"
        half = self.radar.frame_duration_s / 2
        wanted_s = check_number("plot", "time_s", time_s, times[0] - half, times[-1] + half)
        frame = int(np.abs(times - wanted_s).argmin())
        return frame, f"window at {times[frame]:.2f} s"

    @property
    def detections(self) -> NDArray[np.float64]:
        """Number of detections in each frame, (frame,)."""
        return self._found.by_frame

    # -- the maps, for figures and pages -----------------------------------------------------------

    @property
    def shown(self) -> list[ShownMap]:
        """Maps as `maps_at` gives them, those of one frame in the frame of most energy."""
        return [*self.maps_at().values()]

    def maps_at(
        self, time_s: float | None = None, names: Collection[str] | None = None
    ) -> dict[str, ShownMap]:
        """Return maps as `range_time`, `spectrogram`, `range_doppler` and `range_angle` show them.

        Parameters
        ----------
        time_s : float, optional
            Time of the frame, as for `range_doppler`.
        names : collection of str, optional
            Names in ``maps.h5`` of the maps that are wanted; all by default.

        Returns
        -------
        dict
            Maps by their names in ``maps.h5``, in the order of a page.
        """
        makers: dict[str, Callable[[], ShownMap]] = {"range_time": lambda: self._range_time}
        if len(self.maps["spectrogram"]):
            makers["spectrogram"] = lambda: self._spectrogram
        makers["range_doppler"] = partial(self._range_doppler, time_s)
        for name in self._angles:
            makers[f"range_{name}"] = partial(self._range_angle, name, time_s)
        return {name: make() for name, make in makers.items() if names is None or name in names}

    @cached_property
    def _range_time(self) -> ShownMap:
        power, times = thinned(self.maps["range_time"], self._axis("slow_time"))
        unit, view = self._unit(range_m=self.radar.range_m), (None, self._range_limits)
        return ShownMap(
            title="Range over time",
            made=how_made(self.maps["range_time"]),
            labels=("Time [s]", "Range [m]"),
            level_db=unit.level(power).T,
            across=times,
            up=self.radar.range_m,
            view=view,
            unit=unit,
            qualifier="mean of channels",
        )

    @cached_property
    def _spectrogram(self) -> ShownMap:
        velocity = self._axis("spectrogram_velocity")
        window = self._parameters.get("range_window", "hann")
        power, times = spectrogram_power(self.maps, self.radar, window)
        unit = self._unit(strongest_m2=float(power.max()))
        # Limits by what stands out of the floor, and by what was detected on maps.
        fitted = fitted_limits(above_floor(power).sum(axis=0), velocity, include=0.0)
        seen = self._velocity_limits if self._found.by_velocity.any() else fitted
        return ShownMap(
            title="Spectrogram",
            made=how_made(self.maps["spectrogram"]),
            labels=("Time [s]", VELOCITY_LABEL),
            level_db=unit.level(power).T,
            across=times,
            up=velocity,
            view=(None, (min(fitted[0], seen[0]), max(fitted[1], seen[1]))),
            unit=unit,
            qualifier="one channel",
        )

    def _range_doppler(self, time_s: float | None) -> ShownMap:
        frame, when = self.frame(time_s)
        power = np.asarray(self.maps["range_doppler"][frame])
        mask = np.asarray(self.maps["detections"][frame]) > 0
        strongest = float(power.max()) / self.radar.n_channels
        unit = self._unit(range_m=self.radar.range_m[:, None], strongest_m2=strongest)
        told: dict[str, Any] = {"title": f"Range-Doppler map,\n{when}"}
        if self._parameters.get("detector") == "ti-oob":  # which leaves out what is no peak
            told["note"] = ""
        made = how_made(self.maps["range_doppler"])
        return range_doppler_map(power, mask, self.radar, unit, made=made, **told)

    def _range_angle(self, name: str, time_s: float | None = None) -> ShownMap:
        frame, when = self.frame(time_s)
        power = self.maps[f"range_{name}"]
        given = np.asarray(power[frame]), np.degrees(self._axis(name)), self.radar
        unit = self._unit(range_m=self.radar.range_m[:, None])
        window = self._parameters.get("doppler_window", "hann")
        told: dict[str, Any] = {"title": f"Range-{name}, {when}", "made": how_made(power)}
        return range_angle_map(name, *given, unit, window, **told)

    # -- what the pictures share -------------------------------------------------------------------

    @cached_property
    def _strongest(self) -> SpatialCloud:
        """Points of the spatial cloud that are strong enough to be drawn."""
        return self.spatial_cloud.strongest()

    @cached_property
    def _parameters(self) -> Mapping[str, Any]:
        return cast(Mapping[str, Any], self.summary.get("parameters", {}))

    @property
    def _angles(self) -> list[str]:
        return [name for name in ("azimuth", "elevation") if f"range_{name}" in self.maps]

    def _measured(self, picture: str) -> list[str]:
        if not self._angles:
            raise InputError(
                f"{picture}: radar '{self.radar.name}' measures no angle; "
                "it needs more receivers on a line"
            )
        return self._angles

    @property
    def _x_label(self) -> str:
        if len(self._angles) == 2:
            return "x [m]"
        other = "elevation" if self._angles == ["azimuth"] else "azimuth"
        return f"x [m], from the distance to the array's line\n({other} is not measured)"

    def _axes(self, ax: Axes | None, height_in: float = 4.4, **options: Any) -> Axes:
        _, ax = axes_given(None, ax)
        return self.new_figure(height_in).add_subplot(**options) if ax is None else ax

    def _unit(self, **options: Any) -> FieldUnit:
        if self.maps["range_doppler"].attrs.get("units", "m2") != "m2":
            return FieldUnit(COUNTS, 1.0)
        options |= {"spreading": self._parameters.get("spreading", True)}
        return field_unit(self.radar, **options)

    def _axis(self, name: str) -> NDArray[np.float64]:
        return np.asarray(self.maps[name])

    def _title(self, what: str, made: str) -> str:
        lines = (what, str(self.maps.attrs.get("title", "")), made)
        return "\n".join(line for line in lines if line)

    def _draw(self, shown: ShownMap, ax: Axes | None, heading: bool = True) -> Axes:
        axes = self._axes(ax)
        title = shown.title if heading else shown.title.partition(",")[0]
        self._dress(axes, shown, shown.draw(axes), [axes], title, heading)
        return axes

    def _dress(
        self,
        axes: Axes,
        shown: ShownMap,
        image: AxesImage,
        panels: list[Axes],
        title: str,
        heading: bool = True,
    ) -> None:
        """Give a drawn map its title, note and colour bar."""
        note = f"{shown.colours} {shown.note}".strip()
        title = self._title(title, shown.made) if heading else title
        dress(axes, title=title, note=note, grid=False, across=len(panels))
        add_colour_bar(image, panels, shown.unit.label(shown.qualifier))

    @cached_property
    def _found(self) -> _Found:
        """Pass once over the frames, some at a time, so that memory does not grow."""
        masks, maps = self.maps["detections"], self.maps["range_doppler"]
        n_frames, n_range, n_velocity = maps.shape
        by_range, by_velocity = np.zeros(n_range), np.zeros(n_velocity)
        by_frame, moving, still = np.zeros((3, n_frames))
        # Not static clutter, which fills the main lobe of the window function at velocity 0.
        moves = np.abs(self._axis("velocity")) > 2.5 * self.radar.velocity_bin_mps
        at_once = max(1, _BYTES_AT_ONCE // (maps.dtype.itemsize * n_range * n_velocity))
        for first in range(0, n_frames, at_once):
            some = slice(first, first + at_once)
            mask = np.asarray(masks[some]) > 0
            by_range += mask.sum(axis=(0, 2))
            by_velocity += mask.sum(axis=(0, 1))
            by_frame[some] = mask.sum(axis=(1, 2))
            power = np.where(mask, np.asarray(maps[some]), 0).sum(axis=1)  # (frame, velocity)
            moving[some] = power[:, moves].sum(axis=1)
            still[some] = power.sum(axis=1)
        return _Found(by_range, by_velocity, by_frame, moving if moving.any() else still)

    @cached_property
    def _range_limits(self) -> tuple[float, float]:
        counts = self._found.by_range
        # Without any detection, what stands out of the floor of the map over time.
        if not counts.any():
            times = self._axis("slow_time")
            counts = above_floor(thinned(self.maps["range_time"], times)[0]).sum(axis=0)
        range_m = self.radar.range_m
        if (detected := self.summary.get("detected_range_m")) is not None:
            # Side lobes beyond do not set the axis.
            counts = np.where((range_m >= detected[0]) & (range_m <= detected[1]), counts, 0)
        return fitted_limits(counts, range_m, handful=self._handful)

    @cached_property
    def _velocity_limits(self) -> tuple[float, float]:
        counts, velocity = self._found.by_velocity, self._axis("velocity")
        return fitted_limits(counts, velocity, include=0.0, handful=self._handful)

    @property
    def _handful(self) -> float:
        """Detections that may be false alarms, of which about ``pfa`` in each cell is expected."""
        cells = self.maps["detections"].size
        return max(HANDFUL, 2 * self._parameters.get("pfa", 0.0) * cells)


def how_made(data: Any) -> str:
    """Return lines that say how static clutter was removed from a map, and where it has gaps."""
    how = str(data.attrs.get("clutter_removal", "none"))
    lines = ["" if how == "none" else f"static clutter removed: {how}"]
    lines.append(str(data.attrs.get("gaps", "")))
    return "\n".join(line for line in lines if line)
