"""`compare_folders`: what `run` and `process_samples` left in folders, beside each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.pipeline.compare import (
    MEASURES,
    Comparison,
    chamfer_bins,
    comparison_rows,
    map_figures,
    write_figures,
)
from rtradar.pipeline.output.view import run_maps, run_points, run_summary
from rtradar.pipeline.output.writer import files_of_pictures, files_of_runs
from rtradar.radar import Radar
from rtradar.report.figures.canvas import VELOCITY_LABEL, FieldUnit, field_unit, thinned
from rtradar.report.figures.fitting import above_floor
from rtradar.report.pages import comparison
from rtradar.system.checks import printable
from rtradar.system.output_folder import atomic_folder, check_whole

_PICTURES = {
    "Range-Doppler": "compare_range_doppler.png",
    "Spectrogram": "compare_spectrogram.png",
    "Range-Doppler-time clouds": "compare_cloud.png",
}
_OWN = ("compare.html", "compare.json", "compare.csv", *files_of_pictures(_PICTURES.values()))
_FILES = files_of_runs("compare.json", _OWN, ())
_COMPARED = (
    "range_doppler_correlation", "range_doppler_mean_db", "range_doppler_rms_db", "detections",
    "detection_overlap", "spectrogram_correlation", "spectrogram_rms_db", "rdt_chamfer_bins",
)  # fmt: skip
_ROWS = (
    ("windows", "Frames", 0),
    *(measure for measure in MEASURES if measure[0] in _COMPARED),
    ("xyz_points", "Points in space", 0),
)
_AXES = ("range", "velocity", "spectrogram_velocity")


@dataclass(frozen=True)
class _Folder:
    """What a folder holds."""

    path: Path
    summary: dict[str, Any]
    radar: Radar
    points: NDArray[np.float64]

    @classmethod
    def read(cls, path: Path) -> _Folder:
        """Read a folder; InputError if it is none of `run` or `process_samples`, or damaged."""
        check_whole(path)
        summary, radar, _ = run_summary(path)
        return cls(path, summary, radar, run_points(path))

    @property
    def unit(self) -> str:
        """Unit of the samples."""
        return str(self.summary["parameters"].get("unit", "m"))

    def maps(self) -> AbstractContextManager[h5py.File]:
        """Open the maps."""
        return run_maps(self.path)


def compare_folders(
    folders: Sequence[str | Path], *, out: str | Path, overwrite: bool = False
) -> Comparison:
    """Compare folders that `run` or `process_samples` made, such as measured and simulated ones.

    The last folder is the reference. Frames are compared one by one from the start, as far as the
    shorter of two captures goes. Where the unit of the samples differs, the mean difference of the
    maps is the factor between both, and root mean squares are about it.

    Parameters
    ----------
    folders : sequence of path
        Two folders or more of different names, whose maps have the same axes.
    out : path
        Folder for ``compare.json``, ``compare.html`` and pictures.
    overwrite : bool
        Whether files that ``out`` holds under names of the new ones are replaced even where no
        ``compare.json`` lists them.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        If there are fewer than two folders, two have one name, one is damaged or holds no maps, or
        their axes differ; nothing is written then.
    """
    names = [printable(Path(folder).resolve().name) for folder in folders]
    if len(names) < 2 or len(set(names)) < len(names):
        raise InputError(
            f"folders {', '.join(names) or '(none)'}; give two or more, each of another name"
        )
    read = {name: _Folder.read(Path(path)) for name, path in zip(names, folders, strict=True)}
    reference = read[names[-1]]
    for folder in read.values():
        _check_axes(folder, reference)
    found = {name: _figures(folder, reference) for name, folder in read.items()}
    # What was measured has no run file.
    runs = {name: own for name, folder in read.items() if (own := folder.summary.get("run"))}
    summary = {"reference": names[-1], "folders": found, "differ": differing(runs)}
    with atomic_folder(Path(out), _FILES, overwrite=overwrite) as place:
        pictures = _draw(read, place)
        rows = comparison_rows(summary, _ROWS)
        comparison.write_folders(place / "compare.html", summary, rows, pictures)
        write_figures(place, summary, _FILES, _ROWS)
    return Comparison(summary, Path(out), _ROWS)


def differing(runs: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the keys of run files whose values are not the same in all, with these by name."""
    flat = {name: dict(_flat(run)) for name, run in runs.items()}
    keys = dict.fromkeys(key for own in flat.values() for key in own)
    found = {key: {name: own.get(key) for name, own in flat.items()} for key in keys}
    return {
        key: values
        for key, values in found.items()
        if any(value != next(iter(values.values())) for value in values.values())
    }


def _flat(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Yield each value of tables in tables with its dotted key; versions are no settings."""
    entries = value.items() if isinstance(value, Mapping) else enumerate(value)
    for name, own in entries:
        if key or name not in ("versions", "files"):
            where = f"{key}.{name}" if key else str(name)
            tables = isinstance(own, list) and own and isinstance(own[0], dict)
            yield from _flat(own, where) if isinstance(own, dict) or tables else [(where, own)]


def _check_axes(folder: _Folder, reference: _Folder) -> None:
    """Raise InputError where maps cannot be laid on those of the reference."""
    with folder.maps() as ours, reference.maps() as other:
        for axis in _AXES:
            if axis not in ours or axis not in other:
                raise InputError(f"'{folder.path}' or the reference has no maps over {axis}")
            one, two = ours[axis][:], other[axis][:]
            if one.shape != two.shape or not np.allclose(one, two, rtol=1e-6):
                says = (f"{len(one)} steps to {one[-1]:.6g}", f"{len(two)} to {two[-1]:.6g}")
                raise InputError(
                    f"'{folder.path}' has a {axis} axis of {says[0]}, '{reference.path}' of "
                    f"{says[1]}; make both with one radar"
                )
        if not len(ours["time"]) or not len(ours["spectrogram_time"]):
            raise InputError(f"'{folder.path}' holds no frame; give a longer capture")


def _figures(folder: _Folder, reference: _Folder) -> dict[str, Any]:
    """Return the figures of one folder; differences of the reference from itself are zero."""
    maps, its_maps = folder.path / "maps.h5", reference.path / "maps.h5"
    summary = folder.summary
    return {
        **map_figures(maps, its_maps, gain=folder.unit != reference.unit),
        "rdt_chamfer_bins": chamfer_bins(folder.points, reference.points, reference.radar),
        **{name: summary.get(name) for name in ("detections", "windows", "xyz_points")},
        "unit": folder.unit,
        "parameters": summary["parameters"],
    }


def _draw(folders: Mapping[str, _Folder], place: Path) -> dict[str, Path]:
    """Draw the pictures, each map in decibels below its own maximum."""
    drawn = {name: place / file for name, file in _PICTURES.items()}
    levels, spectrograms, shown, strong = {}, {}, [], []
    label, names = "", " and ".join(folders)
    with next(iter(folders.values())).maps() as maps:
        velocity, slow = maps["velocity"][:], maps["spectrogram_velocity"][:]
        radius = maps["range"][:]
    columns, times = _shared_columns(folders)
    for name, folder in folders.items():
        with folder.maps() as maps:
            frame = int(np.argmax([np.count_nonzero(mask) for mask in maps["detections"]]))
            power = maps["range_doppler"][frame]
            unit = _relative(folder, power)
            levels[name], label = unit.level(power), unit.label("all channels")
            shown.append(above_floor(power))
            power, times = thinned(maps["spectrogram"][:columns], times[:columns])
            spectrograms[name] = _relative(folder, power).level(power.T)
            strong.append(above_floor(power.T))
    axes = (VELOCITY_LABEL, velocity), ("Range [m]", radius)
    title = f"{names}, frame of most detections of each"
    comparison.draw_maps(drawn["Range-Doppler"], levels, label, *axes, title, np.any(shown, axis=0))
    axes = ("Time [s]", times), (VELOCITY_LABEL, slow)
    comparison.draw_maps(
        drawn["Spectrogram"], spectrograms, label, *axes, names, np.any(strong, axis=0)
    )
    clouds = {name: folder.points for name, folder in folders.items()}
    comparison.draw_rdt_clouds(drawn["Range-Doppler-time clouds"], clouds, names)
    return drawn


def _shared_columns(folders: Mapping[str, _Folder]) -> tuple[int, NDArray[np.float64]]:
    """Return how many columns all spectrograms have, and their times [s]."""
    found = []
    for folder in folders.values():
        with folder.maps() as maps:
            found.append(maps["spectrogram_time"][:])
    shortest = min(found, key=len)
    return len(shortest), shortest


def _relative(folder: _Folder, power: NDArray[np.floating]) -> FieldUnit:
    return field_unit(folder.radar, strongest_m2=float(power.max()), relative=True)
