"""`compare`: one recording by several echo models, with the same noise, and how far they differ."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from rtradar.body import Person
from rtradar.description import Movers, Moving, given_parts
from rtradar.errors import InputError
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.output.map_store import read_maps
from rtradar.pipeline.output.pictures import removed
from rtradar.pipeline.output.truth import compared_echoes
from rtradar.pipeline.output.view import load_run_view
from rtradar.pipeline.output.writer import files_of_pictures, files_of_runs
from rtradar.pipeline.prepare import people_in, power_alone, prepare
from rtradar.pipeline.result import Result
from rtradar.pipeline.run import run_into
from rtradar.process.window_functions import WindowFunctions, noise_bandwidth_bins
from rtradar.radar import Radar
from rtradar.report.figures.canvas import VELOCITY_LABEL, FieldUnit, field_unit, thinned
from rtradar.report.figures.fitting import above_floor
from rtradar.report.pages import comparison
from rtradar.scatter import MODELS
from rtradar.scatter.link_budget import LinkBudget
from rtradar.scene import Scene
from rtradar.settings import (
    RunOptions,
    RunSettings,
    check_fidelities,
    settings_of,
    takes_settings,
)
from rtradar.system.checks import check_path
from rtradar.system.files import csv_text
from rtradar.system.output_folder import OutputFiles, atomic_folder

if TYPE_CHECKING:
    import xarray as xr

MEASURES = (
    # key, heading, digits
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
    ("scatter_s", "Scattering [s]", 2),
    ("wall_s", "Whole run [s]", 2),
    ("real_time_factor", "Seconds a second of radar", 2),
    ("peak_memory_mb", "Peak memory [MB]", 0),
)
"""Figures of each model, in the order of the chain; differences are to the last model named."""

_PICTURES = {
    "Echo power over time": "compare_power.png",
    "Echo power and occlusion of each part": "compare_parts.png",
    "Range-Doppler": "compare_range_doppler.png",
    "Spectrogram": "compare_spectrogram.png",
    "Range-Doppler-time clouds": "compare_cloud.png",
}
_FILES = ("compare.html", "compare.json", "compare.csv", *files_of_pictures(_PICTURES.values()))
_SEVERAL = OutputFiles("compare.json", r"compare\.(json|csv)")
_CONFIDENCE = 0.95


@dataclass(frozen=True)
class Comparison:
    """Results of a comparison.

    Parameters
    ----------
    summary : dict
        Contents of ``compare.json``.
    out : path
        Folder of the files; the run of each model is in a folder of its name.
    measures : tuple
        Key, heading and digits of each figure that is shown.
    """

    summary: dict[str, Any]
    out: Path
    measures: tuple[tuple[str, str, int], ...] = MEASURES
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
        rows = comparison_rows(self.summary, self.measures)
        first, *others = (max(map(len, column)) for column in zip(*rows, strict=True))
        return "\n".join(
            "  ".join([row[0].ljust(first), *map(str.rjust, row[1:], others)]) for row in rows
        )


@takes_settings
def compare(
    motion: Moving,
    radar: Radar | str | Path,
    scene: Scene | str | Path | None = None,
    *,
    out: str | Path,
    fidelities: Sequence[str] = ("analytic-paper", "analytic", "specular"),
    overwrite: bool = False,
    **options: Unpack[RunOptions],
) -> Comparison:
    """Run several models on the same recording and tell how they differ.

    All runs have the same noise, sample by sample: that of the first model, whose echo ``snr_db``
    is relative to. The last model named is the reference.

    Parameters
    ----------
    motion, radar, scene
        The same as for `run`.
    out : path
        Folder for a run of each model, in a folder of its name, and for ``compare.json``,
        ``compare.html`` and pictures. The reference runs once more with the next seed: what
        differs between both is noise and the draw of points, and no difference of models.
    fidelities : sequence of str
        Two models or more, each once; `rtradar.scatter.MODELS` has their names.
    overwrite : bool
        Whether files that ``out`` holds under names of the new ones are replaced even where no
        ``compare.json`` lists them.
    **options
        Settings of all runs, the fields of `rtradar.RunSettings` but ``fidelity``.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        If fewer than two models are named, one twice, or one that does not exist; and as in `run`.
    BackendError
        As in `run`.
    """
    names = list(fidelities)
    check_fidelities(names)
    if "fidelity" in options:
        raise InputError("compare has no option 'fidelity'; name the models in fidelities")
    asked = settings = settings_of("compare", RunOptions, options)
    moving, before, there = given_parts(motion, radar, scene, settings)
    if not people_in(there, moving)[1]:
        raise InputError(
            f"compare: nobody is in scene '{there.name}', and it is people's echoes that levels "
            "differ in; give a motion"
        )
    kind = files_of_runs("compare.json", _FILES, [*MODELS, *MODELS.gone])
    place = check_path("out", out)
    with atomic_folder(place, kind, overwrite=overwrite) as folder:
        results: dict[str, Result] = {}
        occluded: dict[str, _Occluded] = {}
        for name in names:
            own = replace(settings, fidelity=name)
            into = folder / name
            results[name] = run_into(into, moving, before, there, own, place=place / name)
            occluded[name] = _occluded(results[name], moving, before, there, own)
            # The noise of the first model is that of all.
            settings = replace(settings, noise_power_m2=results[name].summary["noise_power_m2"])
        summary = _summary(results, occluded, before, names[-1])
        with TemporaryDirectory() as again:
            own = replace(settings, fidelity=names[-1], seed=settings.seed + 1)
            other = run_into(Path(again, "again"), moving, before, there, own, pictures=False)
            summary["other_seed"] = _figures(other, occluded[names[-1]], results[names[-1]], before)
        pictures, unit = _draw(results, occluded, folder, before, names[-1])
        views = {name: load_run_view(folder / name) for name in names}
        comparison.write_comparison(
            folder / "compare.html", summary, comparison_rows(summary), pictures, unit, views
        )
        write_figures(folder, summary, kind)

    def captures() -> dict[str, Capture]:
        return {
            name: prepare(moving, before, there, replace(asked, fidelity=name)) for name in names
        }

    return Comparison(summary, Path(out), _captures=captures)


@takes_settings
def compare_recordings(
    motions: Sequence[Moving],
    radar: Radar | str | Path,
    scene: Scene | str | Path | None = None,
    *,
    out: str | Path,
    fidelities: Sequence[str] = ("analytic-paper", "analytic", "specular"),
    overwrite: bool = False,
    **options: Unpack[RunOptions],
) -> Comparison:
    """Compare models on several recordings, each by itself, and tell the mean and its interval.

    Parameters
    ----------
    motions : sequence
        Recordings, two or more, each what `compare` takes as ``motion``.
    radar, scene
        The same as for `run`.
    out : path
        Folder for a comparison of each recording, in a folder of its number and name, and for
        ``compare.json`` and ``compare.csv`` with the mean over recordings of each figure and the
        interval that holds it with a confidence of 95 %, by Student's t of as many recordings.
    fidelities : sequence of str
        Two models or more, each once, the reference last; `rtradar.scatter.MODELS` has their names.
    overwrite : bool
        Whether files of other origin are replaced, as by `compare`.
    **options
        Settings of all runs: fields of `rtradar.RunSettings`.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        As of `compare`, and where there is one recording.
    BackendError
        As of `compare`.
    """
    if len(motions) < 2:
        raise InputError(f"{len(motions)} recordings; give two or more, or use compare")
    place = check_path("out", out)
    names = [f"{number:02d}-{_file_name(own)}" for number, own in enumerate(motions, start=1)]
    found = []
    for name, motion in zip(names, motions, strict=True):
        one = compare(
            motion,
            radar,
            scene,
            out=place / name,
            fidelities=fidelities,
            overwrite=overwrite,
            **options,
        )
        found.append(one.summary)
    first = found[0]
    summary: dict[str, Any] = {name: first[name] for name in ("reference", "versions")}
    summary |= {"recordings": names, "confidence": _CONFIDENCE}
    summary["fidelities"] = {
        model: _means([one["fidelities"][model] for one in found]) for model in first["fidelities"]
    }
    summary["other_seed"] = _means([one["other_seed"] for one in found])
    with atomic_folder(place, _SEVERAL, overwrite=overwrite) as folder:
        write_figures(folder, summary, _SEVERAL)
    return Comparison(summary, place)


def _file_name(motion: Moving) -> str:
    """Return the name of a recording as one of a file."""
    alone = isinstance(motion, str | Path) or not isinstance(motion, Sequence)
    everyone: Any = [motion] if alone else motion
    names = [
        one.motion.name if isinstance(one, Person) else getattr(one, "name", str(one))
        for one in everyone
    ]
    return re.sub(r"[^\w.-]+", "-", "-".join(names))[:40]


def _means(found: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the mean of each figure over recordings, and its interval; None where one has none."""
    means: dict[str, Any] = {}
    for key, *_ in MEASURES:
        values = [one[key] for one in found]
        means[key] = None
        if None not in values:
            mean, count = float(np.mean(values)), len(values)
            half = float(stdtrit(count - 1, (1 + _CONFIDENCE) / 2) * np.std(values, ddof=1))
            half /= math.sqrt(count)
            means[key] = {"mean": mean, "low": mean - half, "high": mean + half}
    return means


def write_figures(
    folder: Path,
    summary: dict[str, Any],
    kind: OutputFiles,
    measures: Sequence[tuple[str, str, int]] = MEASURES,
) -> None:
    """Write what a comparison found as ``compare.json``, and its table as ``compare.csv``.

    The table has a row for each measure and column; over several recordings that is the mean, with
    both ends of its interval. The files of the folder are added to the summary.
    """
    several = "recordings" in summary
    rows = [
        (key, name, *((value or {}).values() if several else (value,)))
        for name, figures in _columns(summary)
        for key, value in ((key, figures[key]) for key, *_ in measures)
    ]
    head = ("measure", "of", *(("mean", "low", "high") if several else ("value",)))
    (folder / "compare.csv").write_text(csv_text(head, rows), encoding="utf-8")
    summary["files"] = kind.list_of(folder)
    text = json.dumps(summary, indent=2, allow_nan=False) + "\n"
    (folder / "compare.json").write_text(text, encoding="utf-8")


def _columns(summary: Mapping[str, Any]) -> Iterable[tuple[str, Mapping[str, Any]]]:
    """Yield the heading and the figures of each column of a comparison."""
    yield from (summary["fidelities"] if "fidelities" in summary else summary["folders"]).items()
    if "other_seed" in summary:
        yield f"{summary['reference']}, other seed", summary["other_seed"]


def comparison_rows(
    summary: Mapping[str, Any], measures: Sequence[tuple[str, str, int]] = MEASURES
) -> list[list[str]]:
    """Return a comparison as text: a heading row, then a row a measure with a column a model."""
    headings, columns = zip(*_columns(summary), strict=True)
    reference = summary["reference"]
    told = (f"{name} (reference)" if name == reference else name for name in headings)
    rows = [["", *told]]
    for key, heading, digits in measures:
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


class _Occluded(NamedTuple):
    """Fraction of the echo power that other parts occlude, over all and of each part (part,)."""

    share: float | None
    of_parts: NDArray[np.float64]


def _occluded(
    result: Result, motion: Movers, radar: Radar, scene: Scene, settings: RunSettings
) -> _Occluded:
    """Compare the echo power of each part with that which the same level has of it alone."""
    seen = _budget(result).power_at
    if result.summary["occlusion"] == "none":
        return _Occluded(0.0, np.zeros(seen.shape[1]))
    alone = power_alone(motion, radar, scene, settings)
    if alone is None:
        return _Occluded(None, np.full(seen.shape[1], np.nan))
    with np.errstate(divide="ignore", invalid="ignore"):
        of_parts = 1 - seen.sum(axis=0) / alone.sum(axis=0)
        return _Occluded(_finite(float(1 - seen.sum() / alone.sum())), of_parts)


def _summary(
    results: Mapping[str, Result],
    occluded: Mapping[str, _Occluded],
    radar: Radar,
    reference: str,
) -> dict[str, Any]:
    first = next(iter(results.values())).summary
    shared = dict(first["parameters"])
    del shared["fidelity"], shared["variant"]
    return {
        "reference": reference,
        "parameters": shared,
        **{name: first[name] for name in ("seed", "noise_power_m2", "versions")},
        "fidelities": {
            name: _figures(result, occluded[name], results[reference], radar)
            for name, result in results.items()
        },
    }


def _figures(
    result: Result, occluded: _Occluded, reference: Result, radar: Radar
) -> dict[str, Any]:
    """Return the figures of one model; differences of the reference from itself are zero."""
    summary, stages = result.summary, result.summary["stages"]
    power = _total_db(result) - _total_db(reference)
    of_parts = map(_finite, occluded.of_parts.tolist())
    return {
        "power_mean_db": _finite(float(power.mean())),
        "power_rms_db": _finite(float(np.sqrt((power**2).mean()))),
        "field_error": _field_error(_budget(result).field_at, _budget(reference).field_at),
        "occluded_share": occluded.share,
        **map_figures(_maps_of(result), _maps_of(reference)),
        "detections": summary["detections"],
        "rdt_chamfer_bins": chamfer_bins(result.points, reference.points, radar),
        "scatter_s": stages["scatter"] + stages["survey"],
        "wall_s": summary["wall_s"],
        **{
            name: summary[name]
            for name in ("real_time_factor", "peak_memory_mb", "stages", "variant")
        },
        **{name: summary[name] for name in ("limits", "part_power_m2")},
        "part_occluded_share": dict(zip(summary["part_power_m2"], of_parts, strict=True)),
    }


def _field_error(field: NDArray[np.complex128], reference: NDArray[np.complex128]) -> float | None:
    with np.errstate(divide="ignore", invalid="ignore"):
        return _finite(float(np.linalg.norm(field - reference) / np.linalg.norm(reference)))


# -- pictures --------------------------------------------------------------------------------------


def _draw(
    results: Mapping[str, Result],
    occluded: Mapping[str, _Occluded],
    folder: Path,
    radar: Radar,
    reference: str,
) -> tuple[dict[str, Path], FieldUnit]:
    """Draw the pictures of a comparison; return them and the unit of the power of parts."""
    parameters = results[reference].summary["parameters"]
    spreading, title = parameters["spreading"], f"{parameters['motion']}, {radar.name}"
    drawn = {name: folder / file for name, file in _PICTURES.items()}
    paths = iter(drawn.values())

    def unit_of(powers: Iterable[NDArray[np.floating]]) -> FieldUnit:
        strongest = max(float(power.max()) for power in powers)
        return field_unit(radar, spreading=spreading, strongest_m2=strongest)

    budgets = {name: _budget(result) for name, result in results.items()}
    times = budgets[reference].times
    total = {name: budget.power_at.sum(axis=1) for name, budget in budgets.items()}
    comparison.draw_power_over_time(
        next(paths), times, total, unit_of(total.values()), reference, title
    )
    mean = {name: budget.power_at.mean(axis=0) for name, budget in budgets.items()}
    hidden = {name: found.of_parts for name, found in occluded.items()}
    parts, part_unit = list(results[reference].summary["part_power_m2"]), unit_of(mean.values())
    comparison.draw_part_power(next(paths), parts, mean, hidden, part_unit, title)

    with read_maps(_maps_of(results[reference])) as maps:
        frame = int(np.argmax([np.count_nonzero(mask) for mask in maps["detections"]]))
        velocity, slow = maps["velocity"][:], maps["spectrogram_velocity"][:]
        cleaned = removed(maps["range_doppler"])
        frame_title = f"{title}{cleaned}, window at {maps['time'][frame]:.2f} s"
        slow_title = title + removed(maps["spectrogram"])
    by_range = field_unit(radar, spreading=spreading, range_m=radar.range_m[:, None])
    # One echo is spread over as many range bins.
    windows = WindowFunctions(range=parameters["range_window"])
    range_bins = noise_bandwidth_bins(windows.range, radar.samples_per_chirp)
    levels, spectrograms, shown = {}, {}, []
    for name, result in results.items():
        with read_maps(_maps_of(result)) as maps:
            power = maps["range_doppler"][frame]
            levels[name] = by_range.level(power / radar.n_channels)
            shown.append(above_floor(power))
            power, times = thinned(maps["spectrogram"], maps["spectrogram_time"][:])
            spectrograms[name] = power.T / range_bins
    across, up = (VELOCITY_LABEL, velocity), ("Range [m]", radar.range_m)
    label, seen = by_range.label("mean of channels"), np.any(shown, axis=0)
    comparison.draw_maps(next(paths), levels, label, across, up, frame_title, seen)
    path = next(paths)
    if times.size:
        unit = unit_of(spectrograms.values())
        levels = {name: unit.level(power) for name, power in spectrograms.items()}
        across, up = ("Time [s]", times), (VELOCITY_LABEL, slow)
        seen = above_floor(np.sum(list(spectrograms.values()), axis=0))
        label = unit.label("one channel")
        comparison.draw_maps(path, levels, label, across, up, slow_title, seen)
    comparison.draw_rdt_clouds(
        next(paths), {name: result.points for name, result in results.items()}, title
    )
    # A capture may be too short for a spectrogram.
    return {name: path for name, path in drawn.items() if path.exists()}, part_unit


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
    flat = ours.size < 2 or np.ptp(ours) == 0 or np.ptp(other) == 0
    correlation = np.nan if flat else float(np.corrcoef(ours, other)[0, 1])
    rms_db = float(np.sqrt((difference**2).mean()))
    return LevelAgreement(correlation, float(difference.mean()), rms_db)


def above_noise(power: ArrayLike) -> NDArray[np.bool_]:
    """Mark cells 10 dB above the median, which is noise, and at most 60 dB below the peak."""
    values = np.asarray(power)
    if not values.size:  # a capture too short for a spectrogram
        return np.zeros(values.shape, dtype=np.bool_)
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
    return _finite(chamfer(points, reference, bins))


def map_figures(ours: Path, reference: Path, *, gain: bool = False) -> dict[str, float | None]:
    """Compare range-Doppler maps over cells that either detects, detections, and spectrograms.

    Of captures of other lengths the frames at the start count. With a ``gain`` between both, root
    mean squares are about the mean difference.
    """
    with read_maps(ours) as first, read_maps(reference) as second:
        cells, both, either = [], 0, 0
        for frame in range(min(len(maps["time"]) for maps in (first, second))):
            mask, other = (maps["detections"][frame].astype(bool) for maps in (first, second))
            union = mask | other
            both, either = both + int((mask & other).sum()), either + int(union.sum())
            cells.append([maps["range_doppler"][frame][union] for maps in (first, second)])
        power, its_power = (np.concatenate(column) for column in zip(*cells, strict=True))
        levels = level_agreement(power, its_power, np.ones(len(power), dtype=bool))
        columns = min(len(maps["spectrogram_time"]) for maps in (first, second))
        spectrogram, its = (
            thinned(maps["spectrogram"][:columns], maps["spectrogram_time"][:columns])[0]
            for maps in (first, second)
        )
        alike = level_agreement(spectrogram, its, above_noise(spectrogram) | above_noise(its))
    if gain:
        levels, alike = (
            one._replace(rms_db=math.sqrt(max(one.rms_db**2 - one.mean_db**2, 0.0)))
            for one in (levels, alike)
        )
    return {
        "range_doppler_correlation": _finite(levels.correlation),
        "range_doppler_mean_db": _finite(levels.mean_db),
        "range_doppler_rms_db": _finite(levels.rms_db),
        "detection_overlap": both / either if either else 1.0,
        "spectrogram_correlation": _finite(alike.correlation),
        "spectrogram_rms_db": _finite(alike.rms_db),
    }


def _total_db(result: Result) -> NDArray[np.float64]:
    power = _budget(result).power_at.sum(axis=1)
    return np.asarray(10 * np.log10(np.maximum(power, np.finfo(np.float64).tiny)))


def _budget(result: Result) -> LinkBudget:
    assert result.link_budget is not None  # every run has one
    return result.link_budget


def _maps_of(result: Result) -> Path:
    assert result.out is not None
    return result.out / "maps.h5"


def _finite(value: float) -> float | None:
    """Replace NaN and infinity, which JSON has not."""
    return value if np.isfinite(value) else None
