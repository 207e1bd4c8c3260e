"""Recognition of activities by weights that have learnt from simulated people; NumPy alone runs it.

Weights that come with the package know the RDT clouds of runs
(``validation/measurements/shipped_weights.py``); ``rtradar recogniser build`` makes those that know
what the board of one's own radar lists.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from rtradar.description import made_from
from rtradar.errors import InputError
from rtradar.recognition.board_files import COLUMNS, beside_cells, read_points
from rtradar.recognition.points import Grid, Points, in_axes, step_of
from rtradar.recognition.recogniser import (
    EDGE_S,
    NOBODY,
    UNKNOWN,
    WEIGHTS,
    WINDOW_S,
    Array,
    Recogniser,
    cut_windows,
    starts_of,
)
from rtradar.system.checks import is_real, printable
from rtradar.system.files import read_arrays, read_json

if TYPE_CHECKING:
    from rtradar.radar import Radar

__all__ = ["COLUMNS", "NOBODY", "UNKNOWN", "Grid", "Points", "Recogniser", "predict", "read_points"]

_TOLERANCE = 0.2  # relative difference of a radar's resolution that is not worth a warning
_FEW_POINTS, _UNSURE = 64, 0.5
_BESIDE = 0.2  # fraction of the velocities that may lie between the cells
_NEEDED = "name a folder that 'rtradar run --out DIR' or 'rtradar process' made"


def predict(
    place: Path, weights: Path | None = None, *, ahead: str | None = None
) -> dict[str, Any]:
    """Say which activity the cloud of a run shows, or the points that a board has listed.

    Parameters
    ----------
    place : path
        Folder of a run, of which ``summary.json`` is read and ``cloud_rdt.npz``, or, for weights of
        points, ``cloud_xyz.npz``; or a file of points, see `read_points`.
    weights : path, optional
        Weights that ``rtradar recogniser build`` has made; by default those of the package, which
        know RDT clouds.
    ahead : {"x", "y"}, optional
        Axis of a file of points that points away from the radar, see `read_points`.

    Returns
    -------
    dict
        Plain JSON values: ``activity``, ``probabilities`` by class, the means over all windows,
        ``windows``, for each its ``start_s``, ``probabilities`` and ``activity``, ``warnings``, a
        list of sentences, and ``made_from``: the files and the weights with their digests, and
        versions. Beside the activities there are the class `UNKNOWN` and, of points, `NOBODY`.
        ``reading`` says which axis of a file of points is ahead.

    Raises
    ------
    InputError
        If the folder holds no run, a file is damaged, a cloud is empty, or the weights are not for
        what is given.
    """
    recogniser = Recogniser.shipped() if weights is None else Recogniser.load(weights)
    if recogniser.grid is None and place.is_file():
        raise InputError(
            f"'{place}': these weights know RDT clouds of runs; give a folder of one, or weights "
            "for your board (--weights, made by rtradar recogniser build)"
        )
    files, starts, windows, warnings, reading = _asked(place, recogniser, ahead)
    if (distance := recogniser.distance(windows)) > 1:
        warnings.append(
            f"the motion is unlike any that was learnt from ({distance:.1f} times the distance "
            "within which 199 of 200 lie)"
        )
    # The answers of all windows, and their mean.
    chances = recogniser.probabilities(windows)
    listed = [
        {"start_s": round(start, 6)} | _answer(recogniser.classes, own)
        for start, own in zip(starts, chances, strict=True)
    ]
    answer = _answer(recogniser.classes, chances.mean(axis=0))
    if max(answer["probabilities"].values()) < _UNSURE:
        warnings.append(f"no activity has a probability of {_UNSURE:g}")
    made = made_from(*files, WEIGHTS if weights is None else weights)
    return answer | {"windows": listed, "warnings": warnings, "made_from": made} | reading


class _Asked(NamedTuple):
    """Files that are asked about, their windows from their starts on [s], and what is said."""

    files: list[Path]
    starts: list[float]
    windows: Sequence[Array | Points]
    warnings: list[str]
    reading: dict[str, str]


def _asked(place: Path, recogniser: Recogniser, ahead: str | None) -> _Asked:
    """Cut what is asked about into windows, and say where it is not as what was learnt from."""
    grid, card = recogniser.grid, recogniser.card
    if grid is None:
        points, summary = _read(place, "cloud_rdt.npz")
        windows = cut_windows(points, summary["capture_s"])
        starts = starts_of(summary["capture_s"]).tolist()
        said = [*_of_rdt(summary, windows), *_of_radar(summary, card), *_of_scene(summary, card)]
        return _Asked([place / "cloud_rdt.npz", place / "run.toml"], starts, windows, said, {})
    if place.is_dir():
        table, summary = _read(place, "cloud_xyz.npz")
        radar, reading = _radar_of(summary), {}
        own = Points.on_grid(in_axes(table, radar), grid, summary["capture_s"], radar.frame_hop_s)
        files = [place / "cloud_xyz.npz", place / "run.toml"]
        said = [*_of_radar(summary, card), *_of_scene(summary, card)]
    else:
        table, read_as = read_points(place, grid, ahead)
        own, files, reading = Points.on_grid(table, grid), [place], {"reading": read_as}
        said = [*_of_table(table, grid)]
    if own.frames < grid.frames:
        said.append(f"it is shorter than the {grid.window_s:g} s of a window")
    begun, cut = (list(part) for part in zip(*own.windows(grid), strict=True))
    return _Asked(files, begun, cut, said, reading)


def _answer(names: Sequence[str], chances: Array) -> dict[str, Any]:
    return {
        "activity": names[int(chances.argmax())],
        "probabilities": dict(zip(names, chances.tolist(), strict=True)),
    }


def _read(folder: Path, name: str) -> tuple[Array, dict[str, Any]]:
    """Read a cloud and the summary of a run, checked as far as they are used.

    Of ``cloud_xyz.npz`` these are columns of time, places and velocity.
    """
    try:
        summary = read_json(folder / "summary.json")
        arrays = read_arrays(folder / name)
        points = np.asarray(arrays["points"], dtype=np.float64)
        known = isinstance(summary["parameters"], dict) and is_real(summary["capture_s"])
        cloud = points.ndim == 2 and points.shape[1] == 3
        if name == "cloud_xyz.npz" and cloud:
            points = np.column_stack([arrays["time"], np.nan_to_num(points), arrays["velocity"]])
        if not (known and cloud and np.isfinite(points).all() and 0 < summary["capture_s"] < 1e6):
            raise ValueError
    except OSError as error:
        name = Path(error.filename or folder).name
        raise InputError(f"'{folder}' holds no run ({name}: {error.strerror}); {_NEEDED}") from None
    except (ValueError, KeyError, TypeError):
        raise InputError(f"a file of '{folder}' is damaged; make the run anew") from None
    if not len(points) and name == "cloud_rdt.npz":
        raise InputError(f"the cloud of '{folder}' is empty; make the run with a higher SNR")
    return points, summary


def _radar_of(summary: Mapping[str, Any]) -> Radar:
    """Make the radar of a run, at its place."""
    from rtradar.radar import Radar

    try:
        return Radar(**{"name": "?", **summary["parameters"]["radar"]})
    except (InputError, KeyError, TypeError):
        raise InputError(
            "the summary does not say where the radar was; make the run anew"
        ) from None


def _of_rdt(summary: Mapping[str, Any], windows: Sequence[Array]) -> Iterator[str]:
    """Warn of a short capture and of few points."""
    if summary["capture_s"] < WINDOW_S + 2 * EDGE_S - 1e-6:
        yield (
            f"the capture has {summary['capture_s']:.2f} s, "
            f"less than the {WINDOW_S + 2 * EDGE_S:.1f} s of those that were learnt from"
        )
    if (few := float(np.median([len(window) for window in windows]))) < _FEW_POINTS:
        yield (
            f"windows have {few:.0f} points, fewer than {_FEW_POINTS}; "
            "give shorter intervals (rtradar run --duration)"
        )


def _of_table(table: Array, grid: Grid) -> Iterator[str]:
    """Warn of frames and cells of another radar."""
    step_s = step_of(table[:, 0], grid)
    every = max(1, round(grid.frame_s / step_s))
    if abs(math.log(step_s * every / grid.frame_s)) > math.log1p(_TOLERANCE):
        yield f"frames follow each other by {step_s:.3g} s, not by {grid.frame_s:.3g}"
    if (beside := beside_cells(table, grid)) > _BESIDE:
        yield (
            f"{beside:.0%} of the velocities lie between the cells of {grid.velocity_bin_mps:.3g} "
            "m/s: another profile of the radar"
        )


def _of_radar(summary: Mapping[str, Any], card: Mapping[str, Any]) -> Iterator[str]:
    """Warn where the radar resolves otherwise than that of the training."""
    from rtradar.radar import Radar

    known = card["radar"]
    try:
        radar = Radar(**{"name": "?", **summary["parameters"]["radar"]})
    except (InputError, KeyError, TypeError):
        yield "the summary does not say which radar it was"
        return
    found = {
        "range resolution": ("m", radar.range_bin_m, known["range_bin_m"]),
        "frame": ("s", radar.frame_duration_s, known["frame_duration_s"]),
        "step of frames": ("s", radar.frame_hop_s, known["frame_hop_s"]),
        "velocity resolution": (
            "m/s",
            float(np.diff(radar.velocity_mps(radar.cycles_per_frame)[:2])[0]),
            known["velocity_bin_mps"],
        ),
    }
    off = [
        f"{what} {value:.3g} {unit}, not {wanted:.3g}"
        for what, (unit, value, wanted) in found.items()
        if abs(math.log(value / wanted)) > math.log1p(_TOLERANCE)
    ]
    if radar.max_velocity_mps < known["max_velocity_mps"] / (1 + _TOLERANCE):
        off.append(
            f"velocities of at most {radar.max_velocity_mps:.3g} m/s, "
            f"not {known['max_velocity_mps']:.3g}"
        )
    if off:
        yield (
            f"radar '{radar.name}' is not like '{known['name']}', for which the weights are: "
            f"{'; '.join(off)}"
        )


def _of_scene(summary: Mapping[str, Any], card: Mapping[str, Any]) -> Iterator[str]:
    """Warn of rooms, several people and noise that were not learnt from."""
    parameters = summary["parameters"]
    scene = parameters.get("scene")
    if scene is None:
        yield "measured samples: the weights have learnt from simulated ones only"
    elif scene != "free-space" and "grid" not in card:
        yield f"scene '{printable(str(scene))}': the weights have learnt in free space"
    people = summary.get("people")
    if isinstance(people, list) and len(people) > 1:
        yield f"{len(people)} people: the weights have learnt from one alone"
    snr_db, (least, most) = parameters.get("snr_db"), card.get("snr_db", (-math.inf, math.inf))
    if isinstance(snr_db, float | int) and not least - 3 <= snr_db <= most + 10:
        yield f"SNR {snr_db:g} dB: the weights have learnt from {least:g} to {most:g} dB"
