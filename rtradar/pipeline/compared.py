"""Results beside each other: how far maps and clouds differ, and the files that say so."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from rtradar.cards import text_table
from rtradar.errors import InputError
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.output.truth import compared_echoes
from rtradar.pipeline.output.writer import read_maps
from rtradar.pipeline.result import Result, plots_of
from rtradar.radar import Radar
from rtradar.report import comparison
from rtradar.report.canvas import thinned
from rtradar.system.files import csv_text
from rtradar.system.output_folder import OutputFiles

if TYPE_CHECKING:
    import xarray as xr

MEASURES = (
    # key, heading, digits
    ("windows", "Frames", 0),
    ("power_mean_db", "Echo power, mean difference [dB]", 2),
    ("power_rms_db", "Echo power, rms difference [dB]", 2),
    ("field_error", "Field of the echoes, rms difference over rms", 3),
    ("occluded_share", "Echo power that other parts occlude, fraction", 3),
    ("range_doppler_correlation", "Range-Doppler correlation [dB maps]", 3),
    ("range_doppler_mean_db", "Range-Doppler, mean difference [dB]", 2),
    ("range_doppler_rms_db", "Range-Doppler, rms difference [dB]", 2),
    ("detections", "Detections", 0),
    ("detection_overlap", "Overlap of detections", 3),
    ("spectrogram_correlation", "Spectrogram correlation [dB maps]", 3),
    ("spectrogram_rms_db", "Spectrogram, rms difference [dB]", 2),
    ("rdt_chamfer_bins", "RDT clouds, Chamfer distance [bins]", 2),
    ("xyz_points", "Points in space", 0),
    ("scatter_s", "Scattering [s]", 2),
    ("wall_s", "Whole run [s]", 2),
    ("real_time_factor", "Seconds a second of radar", 2),
    ("peak_memory_mb", "Peak memory [MB]", 0),
)
"""Figures that are shown where they are known; differences are to the last model or folder."""

MAP_PICTURES = {
    "Range-Doppler": "compare_range_doppler.png",
    "Spectrogram": "compare_spectrogram.png",
    "Range-Doppler-time clouds": "compare_cloud.png",
}
"""Files of the pictures that `draw_maps_and_clouds` draws, by their titles."""


CONFIDENCE = 0.95
"""Confidence of the intervals of means over recordings."""


@dataclass(frozen=True)
class Comparison:
    """Results of a comparison.

    Parameters
    ----------
    summary : dict
        Contents of ``compare.json``.
    out : path
        Folder of the files; the run of each model is in a folder of its name.
    """

    summary: dict[str, Any]
    out: Path
    _captures: Callable[[], Mapping[str, Capture]] | None = None

    @cached_property
    def echoes(self) -> xr.Dataset:
        """The echoes of the people and objects by each level, part by part, and how they differ.

        By ``fidelity``, ``chirp``, ``rx`` and ``part``, in some 40 TDM cycles of the recording:
        ``length_m``, the mean length of the paths, weighted by power, NaN where nothing is seen
        [m]; ``field_m``, the complex sum of the echoes at the centre of the sweep [m]; and
        ``length_difference_m`` and ``field_difference_m`` from the reference. They are computed at
        the first access. An `InputError` is raised for a comparison of several recordings or of
        folders, which knows no echoes.
        """
        if self._captures is None:
            raise InputError(
                "echoes: known of one recording that is compared by levels, rt.compare(...)"
            )
        return compared_echoes(self._captures(), self.summary["reference"])

    def table(self) -> str:
        """Return the figures as aligned text, one column for each model."""
        return text_table(comparison_rows(self.summary))


def open_run_maps(result: Result) -> h5py.File:
    """Open the maps of a result that is in a folder."""
    assert result.out is not None
    return read_maps(result.out / "maps.h5")


def unit_of(result: Result) -> str:
    """Return the unit of the samples."""
    return str(result.summary["parameters"].get("unit", "m"))


def figures_of(ours: Result, reference: Result) -> dict[str, Any]:
    """Return how far maps and clouds differ; differences of the reference from itself are zero."""
    return {
        **_map_figures(ours, reference),
        "detections": ours.summary.get("detections"),
        "rdt_chamfer_bins": chamfer_bins(ours.points, reference.points, reference.radar),
    }


def write_figures(folder: Path, summary: dict[str, Any], kind: OutputFiles) -> None:
    """Write what a comparison found as ``compare.json``, and its table as ``compare.csv``.

    The table has a row for each measure and column; over several recordings that is the mean, with
    both ends of its interval. The files of the folder are added to the summary.
    """
    several = "recordings" in summary
    rows = [
        (key, name, *((value or {}).values() if several else (value,)))
        for name, figures in _columns(summary)
        for key, value in ((key, figures[key]) for key, *_ in MEASURES if key in figures)
    ]
    head = ("measure", "of", *(("mean", "low", "high") if several else ("value",)))
    write_tables(folder, summary, kind, head, rows)


def write_tables(
    folder: Path,
    summary: dict[str, Any],
    kind: OutputFiles,
    head: Sequence[str],
    rows: Iterable[Sequence[object]],
) -> None:
    """Write a summary as the JSON file that lists the files of its kind, and a table as CSV.

    The files of the folder are added to the summary.
    """
    path = folder / kind.listing
    path.with_suffix(".csv").write_text(csv_text(head, rows), encoding="utf-8")
    summary["files"] = kind.list_of(folder)
    text = json.dumps(summary, indent=2, allow_nan=False) + "\n"
    path.write_text(text, encoding="utf-8")


def _columns(summary: Mapping[str, Any]) -> Iterable[tuple[str, Mapping[str, Any]]]:
    """Yield the heading and the figures of each column of a comparison."""
    yield from (summary["fidelities"] if "fidelities" in summary else summary["folders"]).items()
    if "other_seed" in summary:
        yield f"{summary['reference']}, other seed", summary["other_seed"]


def comparison_rows(summary: Mapping[str, Any]) -> list[list[str]]:
    """Return a comparison as text: a heading row, then a row a measure with a column a model."""
    headings, columns = zip(*_columns(summary), strict=True)
    reference = summary["reference"]
    told = (f"{name} (reference)" if name == reference else name for name in headings)
    rows = [["", *told]]
    for key, heading, digits in MEASURES:
        if key in columns[0]:
            rows.append([heading, *(_shown(figures[key], digits) for figures in columns)])
    return rows


def _shown(value: float | Mapping[str, float] | None, digits: int) -> str:
    """Return a figure as text, or a mean with half its interval."""
    if value is None:
        return "-"
    if isinstance(value, Mapping):
        half = value["high"] - value["mean"]
        return f"{value['mean']:.{digits}f} ± {half:.{digits}f}"
    return f"{value:.{digits}f}"


def means_of(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the mean of each figure over recordings, and its interval; None where one has none."""
    means: dict[str, Any] = {}
    for key in [key for key, *_ in MEASURES if key in found[0]]:
        values = [one[key] for one in found]
        means[key] = None
        if None not in values:
            mean, count = float(np.mean(values)), len(values)
            # Half the interval is Student's quantile times the standard error of the mean.
            half = float(stdtrit(count - 1, (1 + CONFIDENCE) / 2) * np.std(values, ddof=1))
            half /= math.sqrt(count)
            means[key] = {"mean": mean, "low": mean - half, "high": mean + half}
    return means


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


# -- agreement of maps and clouds ------------------------------------------------------------------


class LevelAgreement(NamedTuple):
    """Agreement of two maps in decibels.

    ``correlation`` is Pearson's, NaN if a map is flat or fewer than two cells count. ``mean_db``
    and ``rms_db`` are those of the difference, map less reference [dB], NaN if no cell counts.
    """

    correlation: float
    mean_db: float
    rms_db: float


def level_agreement(
    power: ArrayLike, reference: ArrayLike, where: NDArray[np.bool_]
) -> LevelAgreement:
    """Compare two power maps of one shape in decibels over the cells of a mask, all positive.

    The mask should leave out noise that both share: it would make any two maps alike.
    """
    ours, other = (
        10 * np.log10(np.asarray(values)[where].astype(np.float64)) for values in (power, reference)
    )
    if not ours.size:
        return LevelAgreement(np.nan, np.nan, np.nan)
    difference = ours - other
    # A correlation divides by the spread of both maps.
    flat = ours.size < 2 or np.ptp(ours) == 0 or np.ptp(other) == 0
    correlation = np.nan if flat else float(np.corrcoef(ours, other)[0, 1])
    rms_db = float(np.sqrt((difference**2).mean()))
    return LevelAgreement(correlation, float(difference.mean()), rms_db)


def above_noise(power: ArrayLike) -> NDArray[np.bool_]:
    """Mark cells 10 dB above the median, which is noise, and at most 60 dB below the peak."""
    values = np.asarray(power)
    if not values.size:  # a capture too short for a spectrogram
        return np.zeros(values.shape, dtype=np.bool_)
    # Most cells of a spectrogram hold noise alone, so that the median is its level.
    floor = max(10 * float(np.median(values)), 1e-6 * float(values.max(initial=0.0)))
    return np.asarray(values > floor)


def chamfer(points: NDArray[np.float64], reference: NDArray[np.float64], bins: ArrayLike) -> float:
    """Compute the Chamfer distance: mean distance to the nearest point of the other cloud.

    The distance between clouds (n, axis) and (m, axis), in the unit ``bins`` (axis,) of each axis,
    is the average over both directions. Two samplings of one surface have half the mean distance
    between points, not 0. Infinite if one cloud alone is empty, 0 if both are.
    """
    from scipy.spatial import KDTree  # slow to import

    if not len(points) or not len(reference):
        return 0.0 if len(points) == len(reference) else np.inf
    ours, other = (np.divide(cloud, bins) for cloud in (points, reference))
    there, back = KDTree(other).query(ours)[0], KDTree(ours).query(other)[0]
    return float(there.mean() + back.mean()) / 2


def chamfer_bins(
    points: NDArray[np.float64], reference: NDArray[np.float64], radar: Radar
) -> float | None:
    """Compute the Chamfer distance of range-Doppler-time clouds [bins]; None if it is infinite."""
    bins = (radar.frame_hop_s, radar.range_bin_m, radar.velocity_bin_mps)
    return finite(chamfer(points, reference, bins))


def _map_figures(ours: Result, reference: Result) -> dict[str, float | None]:
    """Compare range-Doppler maps over cells that either detects, detections, and spectrograms.

    Of captures of other lengths the frames at the start count. Where units differ there is a gain
    between both, and root mean squares are about the mean difference.
    """
    # Maps are read frame by frame, and of each only the cells that either detects are kept.
    with open_run_maps(ours) as first, open_run_maps(reference) as second:
        both = first, second
        shared, either, cells = 0, 0, []
        for frame in range(min(len(maps["time"]) for maps in both)):
            masks = [maps["detections"][frame].astype(bool) for maps in both]
            union = masks[0] | masks[1]
            shared, either = shared + int((masks[0] & masks[1]).sum()), either + int(union.sum())
            cells.append(np.array([maps["range_doppler"][frame][union] for maps in both]))
        power = np.concatenate(cells, axis=1)
        # Long spectrograms are thinned alike, so that columns still belong together.
        columns = min(len(maps["spectrogram_time"]) for maps in both)
        spectrograms = [
            thinned(maps["spectrogram"], maps["spectrogram_time"][:columns])[0] for maps in both
        ]
    seen = above_noise(spectrograms[0]) | above_noise(spectrograms[1])
    levels = level_agreement(power[0], power[1], np.ones(power.shape[1], dtype=bool))
    alike = level_agreement(spectrograms[0], spectrograms[1], seen)
    # The factor between two units is a mean difference in decibels. The rms about the mean follows
    # from rms^2 = mean^2 + variance.
    if unit_of(ours) != unit_of(reference):
        levels, alike = (
            one._replace(rms_db=math.sqrt(max(one.rms_db**2 - one.mean_db**2, 0.0)))
            for one in (levels, alike)
        )
    return {
        "range_doppler_correlation": finite(levels.correlation),
        "range_doppler_mean_db": finite(levels.mean_db),
        "range_doppler_rms_db": finite(levels.rms_db),
        "detection_overlap": shared / either if either else 1.0,
        "spectrogram_correlation": finite(alike.correlation),
        "spectrogram_rms_db": finite(alike.rms_db),
    }


def finite(value: float) -> float | None:
    """Replace NaN and infinity, which JSON has not."""
    return value if np.isfinite(value) else None


# -- pictures --------------------------------------------------------------------------------------


def draw_maps_and_clouds(
    place: Path, compared: Mapping[str, Result], title: str, reference: str | None = None
) -> dict[str, Path]:
    """Draw `MAP_PICTURES` into a folder; return the files by their titles.

    Results of one recording are shown at the time and in the unit of the ``reference``, others in
    their frames of most energy, and each below its own maximum. A capture may be too short for a
    spectrogram.
    """
    drawn = {name: place / file for name, file in MAP_PICTURES.items()}
    # The maps of all results are open at once, because the reference chooses the frame that all of
    # them show.
    with ExitStack() as stack:
        plots = {
            name: plots_of(one, stack.enter_context(open_run_maps(one)))
            for name, one in compared.items()
        }
        time_s = None
        if reference is not None:
            its = plots[reference]
            time_s = float(its.maps["time"][its.frame()[0]])
        kinds = "range_doppler", "spectrogram"
        shown = {name: own.maps_at(time_s, kinds) for name, own in plots.items()}
    # A kind of map is drawn only where every result has it.
    for name, kind in zip(("Range-Doppler", "Spectrogram"), kinds, strict=True):
        maps = {own: found[kind] for own, found in shown.items() if kind in found}
        if len(maps) == len(compared):
            comparison.draw_maps(drawn[name], maps, title, reference)
        else:
            del drawn[name]
    clouds = {name: one.points for name, one in compared.items()}
    comparison.draw_rdt_clouds(drawn["Range-Doppler-time clouds"], clouds, title)
    return drawn
