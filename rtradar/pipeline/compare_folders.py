"""`compare_folders`: what `run` and `process_samples` left in folders, beside each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.pipeline.compared import (
    MAP_PICTURES,
    MEASURES,
    Compared,
    Comparison,
    comparison_rows,
    draw_maps_and_clouds,
    figures_of,
    write_figures,
)
from rtradar.pipeline.output.view import run_maps, run_points, run_summary
from rtradar.pipeline.output.writer import files_of_pictures, files_of_runs
from rtradar.report import comparison
from rtradar.report.canvas import field_unit
from rtradar.system.checks import printable
from rtradar.system.output_folder import atomic_folder, check_whole

_OWN = ("compare.html", "compare.json", "compare.csv", *files_of_pictures(MAP_PICTURES.values()))
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
    read = {name: _read(Path(path)) for name, path in zip(names, folders, strict=True)}
    reference = read[names[-1]]
    for folder in read.values():
        _check_axes(folder, reference)
    found = {name: _figures(folder, reference) for name, folder in read.items()}
    # What was measured has no run file.
    runs = {name: own for name, folder in read.items() if (own := folder.summary.get("run"))}
    summary = {"reference": names[-1], "folders": found, "differ": differing(runs)}
    with atomic_folder(Path(out), _FILES, overwrite=overwrite) as place:
        pictures = _draw(place, read)
        rows = comparison_rows(summary, _ROWS)
        comparison.write_folders(place / "compare.html", summary, rows, pictures)
        write_figures(place, summary, _FILES, _ROWS)
    return Comparison(summary, Path(out), _ROWS)


def _read(folder: Path) -> Compared:
    """Read a folder; InputError if it is none of `run` or `process_samples`, or damaged."""
    check_whole(folder)
    summary, radar, _ = run_summary(folder)
    return Compared(folder, summary, radar, run_points(folder))


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


def _check_axes(folder: Compared, reference: Compared) -> None:
    """Raise InputError where maps cannot be laid on those of the reference."""
    with run_maps(folder.out) as ours, run_maps(reference.out) as other:
        for axis in _AXES:
            if axis not in ours or axis not in other:
                raise InputError(f"'{folder.out}' or the reference has no maps over {axis}")
            one, two = ours[axis][:], other[axis][:]
            if one.shape != two.shape or not np.allclose(one, two, rtol=1e-6):
                says = (f"{len(one)} steps to {one[-1]:.6g}", f"{len(two)} to {two[-1]:.6g}")
                raise InputError(
                    f"'{folder.out}' has a {axis} axis of {says[0]}, '{reference.out}' of "
                    f"{says[1]}; make both with one radar"
                )
        if not len(ours["time"]) or not len(ours["spectrogram_time"]):
            raise InputError(f"'{folder.out}' holds no frame; give a longer capture")


def _figures(folder: Compared, reference: Compared) -> dict[str, Any]:
    """Return the figures of one folder; differences of the reference from itself are zero."""
    return {
        **figures_of(folder, reference),
        **{name: folder.summary.get(name) for name in ("windows", "xyz_points")},
        "unit": folder.unit,
        "parameters": folder.summary["parameters"],
    }


def _draw(place: Path, folders: Mapping[str, Compared]) -> dict[str, Path]:
    """Draw the pictures, each map in decibels below its own maximum."""

    def levels(powers: Mapping[str, NDArray[Any]]) -> tuple[dict[str, Any], str]:
        units = {
            name: field_unit(folders[name].radar, strongest_m2=float(power.max()), relative=True)
            for name, power in powers.items()
        }
        found = {name: units[name].level(power) for name, power in powers.items()}
        return found, next(iter(units.values())).label("all channels")

    names = " and ".join(folders)
    titles = f"{names}, frame of most detections of each", names, names
    frames = [folder.best_frame() for folder in folders.values()]
    return draw_maps_and_clouds(place, folders, frames, (levels, levels), titles)
