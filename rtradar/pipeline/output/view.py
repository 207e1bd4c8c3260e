"""Reader of the folder of a run, for `rtradar view`; the files may be damaged or anybody's."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from rtradar.clouds.spatial import SpatialCloud
from rtradar.errors import InputError
from rtradar.pipeline.output.writer import read_maps
from rtradar.pipeline.result import Result
from rtradar.process import WindowFunctions
from rtradar.radar import Radar
from rtradar.report.canvas import FieldUnit, field_unit, spectrogram_power
from rtradar.report.maps import Levels, colour_limits, limits_of, spaced, strongest
from rtradar.report.run_view import COLOURS, RunView, write_view
from rtradar.report.snapshots import DAMAGE, Snapshots, checked, load_snapshots, refused
from rtradar.system.checks import printable
from rtradar.system.files import open_regular, read_arrays, read_json
from rtradar.system.hdf5 import stored
from rtradar.system.output_folder import check_whole

_MAX_ROWS, _MAX_COLUMNS = 256, 200
"""Size of a range-Doppler map; larger ones are pooled to the strongest of neighbouring cells."""

_MAPS = {
    "range_doppler": ("time", "range", "velocity"),
    "spectrogram": ("spectrogram_time", "spectrogram_velocity"),
}
"""Datasets that are read from ``maps.h5``, with their axes."""

_MAX_LETTERS = 200
"""Length of a name from the summary that is shown."""

_SAMPLED = 16
"""Number of maps whose medians give the noise."""


def view(
    folder: str | Path,
    *,
    page: str | Path | None = None,
    still: str | Path | None = None,
    time_s: float | None = None,
    colour: str | None = None,
) -> dict[str, Any]:
    """Show what `run` left in a folder: a page that moves (HTML), a still (PNG), or both.

    The still is of the frame nearest to ``time_s`` [s], by default the middle of the capture.
    Colours show ``colour``, one of `COLOURS`, on the page until the reader chooses another; by
    default the person where several people or objects are, else the body part. Returns
    the numbers of ``windows`` and ``echoes`` shown, times ``first_s`` and ``last_s`` of the
    windows, and path and bytes of each file. InputError if a file of the folder is missing or
    damaged, the time lies outside of the capture, or a file cannot be written.
    """
    if colour not in (None, *COLOURS):
        raise InputError(f"colour '{colour}' is unknown; allowed: {', '.join(COLOURS)} (--colour)")
    if not os.path.isdir(folder):
        raise InputError(f"'{folder}' is no folder; give the one that 'rtradar run --out' named")
    # A folder that a run has not finished is refused before it is read.
    check_whole(Path(folder))
    run_view = load_run_view(Path(folder))
    times, margin_s = run_view.snapshots.times, run_view.radar.frame_duration_s
    if time_s is not None and not times[0] - margin_s <= time_s <= times[-1] + margin_s:
        raise InputError(
            f"time_s = {time_s}; the capture has windows "
            f"from {times[0]:.3f} to {times[-1]:.3f} s (--time)"
        )
    shown: dict[str, Any] = {
        "windows": len(times),
        "echoes": len(run_view.snapshots.echo_part),
        "first_s": float(times[0]),
        "last_s": float(times[-1]),
    }
    # The page and the still are made of the same view.
    if page is not None:
        write_view(page, run_view, name=printable(Path(folder).resolve().name), colour=colour)
        shown["page"] = {"path": str(page), "bytes": Path(page).stat().st_size}
    if still is not None:
        from rtradar.report.still import draw_still

        step = run_view.snapshots.nearest(float(times.mean()) if time_s is None else time_s)
        draw_still(still, run_view, step, colour=colour)
        size = Path(still).stat().st_size
        shown["still"] = {"path": str(still), "bytes": size, "time_s": float(times[step])}
    return shown


def load_run_view(folder: Path) -> RunView:
    """Read what a run left in a folder.

    InputError if a file is missing or damaged, or they are not of one run.
    """
    result = read_result(folder)
    if "unit" in result.summary["parameters"]:  # which a simulation does not name
        raise InputError(
            f"'{folder}' holds what was found in IF samples, which have no body to show; look at "
            "its report.html"
        )
    snapshots = load_snapshots(folder / "view.npz")
    with run_maps(folder) as file:
        maps = _maps(file)
        if snapshots.window.min() < 0 or snapshots.window.max() >= len(maps["time"]):
            raise ValueError("it is not of one run with view.npz")
        return run_view_of(result, maps, snapshots)


def run_view_of(result: Result, maps: Mapping[str, Any], snapshots: Snapshots) -> RunView:
    """Return the view of a run from what it found, its maps with their axes, and snapshots."""
    # The summary may be anybody's: what it lacks has a default, and its texts are made fit to
    # print.
    summary, radar, points = result.summary, result.radar, result.points
    parameters = summary["parameters"]
    spreading = parameters.get("spreading", True) is not False
    fidelity = _line(summary.get("fidelity", ""))
    scene = _line(parameters.get("scene", "free-space"))
    removal = _line(parameters.get("clutter_removal", "none"))
    power_db, source = _of_points(maps, points, radar, spreading, len(snapshots.sources))
    cleaned = "" if removal == "none" else f", static clutter removed: {removal}"
    return RunView(
        heading=_line(parameters.get("motion", "Recording")),
        subtitle=", ".join([f"radar {radar.name}", f"fidelity {fidelity}", scene]) + cleaned,
        snapshots=snapshots,
        radar=radar,
        range_doppler=_range_doppler(maps, snapshots, radar, spreading),
        spectrogram=_spectrogram(maps, radar, spreading, _windows(parameters)),
        rdt_points=points,
        rdt_power_db=power_db,
        rdt_source=source,
        spatial=result.spatial,
        spreading=spreading,
    )


def read_result(folder: Path) -> Result:
    """Read the summary, the radar and both clouds of a folder.

    InputError if there is no run, or a file is missing or damaged.
    """
    # The path is set anew before each file, so that a complaint names the one that is damaged.
    path = folder / "summary.json"
    if not os.path.isfile(path):
        raise InputError(
            f"'{folder}' holds no run (there is no summary.json); give the folder that "
            "'rtradar run --out' named"
        )
    try:
        summary = read_json(path)
        radar = Radar(**summary["parameters"]["radar"])
        _windows(summary["parameters"])
        path = folder / "cloud_rdt.npz"
        points = _sound("points", read_arrays(path)["points"], {}, "f8", ("point", 3))
        path = folder / "cloud_xyz.npz"
        arrays, sizes = read_arrays(path), dict[str, int]()
        columns = [_sound("points", arrays["points"], sizes, "f8", ("point", 3), True)]
        kinds = {"velocity": "f8", "power": "f8", "time": "f8", "source": "i8"}
        columns += [
            _sound(name, arrays[name], sizes, kind, ("point",))
            for name, kind in kinds.items()
            if name in arrays or name != "source"
        ]
        return Result(points, SpatialCloud(*columns), summary, radar, out=folder)
    except DAMAGE as error:
        raise refused(path, error) from None


def _windows(parameters: Mapping[str, Any]) -> WindowFunctions:
    # Folders of older versions name none; theirs were Hann windows.
    names = (parameters.get(f"{axis}_window", "hann") for axis in ("range", "doppler"))
    return WindowFunctions(*names)


@contextmanager
def run_maps(folder: Path) -> Iterator[h5py.File]:
    """Open the maps of a folder; InputError if they are missing or damaged."""
    path = folder / "maps.h5"
    try:
        with open_regular(path) as raw, read_maps(raw) as file:
            yield file
    except InputError:
        raise
    except DAMAGE as error:
        raise refused(path, error) from None


def _line(value: Any) -> str:
    """As a page shows it: JSON may hold half of a character, which no file can."""
    return printable(str(value)[:_MAX_LETTERS])


def _sound(*given: Any) -> NDArray[Any]:
    """Return what `checked` does; ValueError where that refuses it."""
    try:
        return checked(*given)
    except InputError as error:
        raise ValueError(str(error)) from None


# -- maps ----------------------------------------------------------------------------------------


def _maps(file: h5py.File) -> dict[str, Any]:
    """Datasets of `_MAPS` and their axes, checked but for the maps' values."""
    maps = {name: stored(file, name) for names in _MAPS.items() for name in (names[0], *names[1])}
    if "source" in file:
        maps["source"] = stored(file, "source")
    for name, axes in _MAPS.items():
        if maps[name].dtype not in (np.float32, np.float64) or maps[name].shape != tuple(
            len(_sound(axis, maps[axis][:], {}, "f8", (axis,))) for axis in axes
        ):
            raise ValueError(f"{name} does not fit its axes")
    if not all(len(maps[axis]) for axis in _MAPS["range_doppler"]):
        raise ValueError("it is empty")
    return maps


def _powers(power: NDArray[np.floating]) -> NDArray[np.float64]:
    if not np.isfinite(power).all():
        raise ValueError("a power is not finite")
    return power.astype(np.float64)


def _range_doppler(maps: Any, snapshots: Snapshots, radar: Radar, spreading: bool) -> Levels:
    """Maps of the windows of the snapshots, mean of the channels."""
    power, velocity, distance = maps["range_doppler"], maps["velocity"][:], maps["range"][:]
    # In the unit of the pictures, which may take out the loss with distance, range by range.
    unit = field_unit(radar, spreading=spreading, range_m=distance[:, None])
    scale = np.asarray(unit.scale) / radar.n_channels
    windows = snapshots.window.tolist()
    # Large maps are pooled to the strongest of neighbouring cells, so that no echo is lost.
    rows, columns = math.ceil(len(distance) / _MAX_ROWS), math.ceil(len(velocity) / _MAX_COLUMNS)
    shape = len(windows), math.ceil(len(distance) / rows), math.ceil(len(velocity) / columns)
    pooled, medians = np.empty(shape, np.float32), []
    for number, window in enumerate(windows):  # read once, because that takes longest
        found = power[window] * scale
        pooled[number] = strongest(found, rows, columns)
        if number % math.ceil(len(windows) / _SAMPLED) == 0:
            medians.append(float(np.median(found)))
    # The scale of the colours runs from the noise, the median of some maps, to the strongest cell.
    scaled = FieldUnit(unit.name, 1.0)
    extremes = np.array([pooled.max(), np.median(medians)])
    limits = limits_of(*scaled.level(_powers(extremes)).tolist())
    maps_db = (scaled.level(_powers(one)) for one in pooled)
    axes = {"across": spaced(velocity, columns), "up": spaced(distance, rows)}
    label = unit.label("mean of channels")
    return Levels.of(maps_db, shape, limits, label=label, **axes)


def _spectrogram(maps: Any, radar: Radar, spreading: bool, windows: WindowFunctions) -> Levels:
    """Velocity up, time across."""
    velocity = maps["spectrogram_velocity"][:]
    up = (float(velocity[0]), float(velocity[1] - velocity[0]))
    if not len(maps["spectrogram_time"]):
        none = np.zeros((1, len(velocity), 0), dtype=np.uint8)
        return Levels(level=none, low_db=0.0, step_db=1.0, label="", across=(0.0, 1.0), up=up)
    found, times = spectrogram_power(maps, radar, windows.range)
    power = _powers(found.T)
    unit = field_unit(radar, spreading=spreading, strongest_m2=float(power.max()))
    level_db = unit.level(power)
    step_s = float(times[-1] - times[0]) / (len(times) - 1) if len(times) > 1 else 1.0
    axes = {"across": (float(times[0]), step_s), "up": up}
    label, shape = unit.label("one channel"), (1, *level_db.shape)
    return Levels.of([level_db], shape, colour_limits(level_db), label=label, **axes)


def _of_points(
    maps: Any, points: NDArray[np.float64], radar: Radar, spreading: bool, n_sources: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the power of the cell nearest to each point, mean of channels [dB], and its source.

    That is who returned the detected cell nearest to the point, -1 where nobody is known: points
    lie on the surface about detected cells, half a cell away from one.
    """
    power, found = np.zeros(len(points)), np.full(len(points), -1)
    if not len(points):
        return power, found
    # The cell of a point is that between whose borders, half-way between the middles of cells, it
    # lies.
    axes = [maps[axis][:] for axis in _MAPS["range_doppler"]]
    cells = [
        np.searchsorted((values[1:] + values[:-1]) / 2, column)
        for values, column in zip(axes, points.T, strict=True)
    ]
    # The 27 cells about a point, its own first, then those across a face, an edge and a corner.
    nearest_first = sorted(np.ndindex(3, 3, 3), key=lambda step: sum(abs(i - 1) for i in step))
    for window in np.unique(cells[0]).tolist():
        own = np.flatnonzero(cells[0] == window)
        power[own] = maps["range_doppler"][window][cells[1][own], cells[2][own]]
        if "source" not in maps:
            continue
        # Only three frames of sources are in memory at a time.
        first = max(window - 1, 0)
        near = np.asarray(maps["source"][first : window + 2])
        sources = _sound("source", near, {}, "i8", _MAPS["range_doppler"])
        # Points that no nearer cell has given a source look at the next one.
        for step in nearest_first:
            lacking = own[found[own] < 0]
            at = [cells[axis][lacking] + step[axis] - 1 for axis in range(3)]
            at[0] -= first
            inside = np.all(
                [(i >= 0) & (i < n) for i, n in zip(at, sources.shape, strict=True)], axis=0
            )
            found[lacking[inside]] = sources[tuple(index[inside] for index in at)]
    unit = field_unit(radar, spreading=spreading, range_m=axes[1][cells[1]])
    level_db = unit.level(_powers(power) / radar.n_channels)
    return level_db, np.where(found < n_sources, found, -1)
