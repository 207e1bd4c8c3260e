"""`compare`: one recording by several echo models with the same noise, or folders of results."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Person
from rtradar.body.people import body_of_people
from rtradar.description import Movers, Moving, given_parts
from rtradar.errors import InputError
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.compared import (
    CONFIDENCE,
    MAP_PICTURES,
    Comparison,
    comparison_rows,
    differing,
    draw_maps_and_clouds,
    figures_of,
    finite,
    means_of,
    unit_of,
    write_figures,
)
from rtradar.pipeline.output.view import load_run_view, read_result, run_maps
from rtradar.pipeline.output.writer import files_of_pictures, files_of_runs
from rtradar.pipeline.prepare import people_in, power_alone, prepare
from rtradar.pipeline.result import Result
from rtradar.pipeline.run import run_into
from rtradar.radar import Radar
from rtradar.report import comparison
from rtradar.report.canvas import FieldUnit, field_unit
from rtradar.scatter import MODELS
from rtradar.scatter.link_budget import LinkBudget
from rtradar.scatter.models.auto import choose_level
from rtradar.scene import Scene
from rtradar.settings import (
    RunOptions,
    RunSettings,
    check_fidelities,
    settings_of,
    takes_settings,
)
from rtradar.system.checks import check_path, printable
from rtradar.system.output_folder import OutputFiles, atomic_folder, check_whole

_PICTURES = {
    "Echo power over time": "compare_power.png",
    "Echo power and occlusion of each part": "compare_parts.png",
    **MAP_PICTURES,
}
_COSTS = ("wall_s", "real_time_factor", "peak_memory_mb", "stages", "variant")
_NAMED = ("compare.html", "compare.json", "compare.csv")
_FILES = [*_NAMED, *files_of_pictures(_PICTURES.values())]
_SEVERAL = OutputFiles("compare.json", r"compare\.(json|csv)")

_OF_FOLDERS = files_of_runs(
    "compare.json", [*_NAMED, *files_of_pictures(MAP_PICTURES.values())], ()
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
    pictures: bool = False,
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
    pictures : bool
        Whether each run draws PNG files of its own as well, as `run` does.
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
    asked, parts = _given("compare", motion, radar, scene, options)
    settings = asked
    kind = files_of_runs("compare.json", _FILES, [*MODELS, *MODELS.gone])
    place = check_path("out", out)
    # Nothing is left in the folder where one of the runs fails.
    with atomic_folder(place, kind, overwrite=overwrite) as folder:
        results: dict[str, Result] = {}
        occluded: dict[str, dict[str, Any]] = {}
        # A run of each level, with what parts occlude of each other at that level.
        for name in names:
            own = replace(settings, fidelity=name)
            written: dict[str, Any] = {"pictures": pictures, "place": place / name}
            results[name] = run_into(folder / name, *parts, own, **written)
            occluded[name] = _occluded(results[name], *parts, own)
            # The noise of the first model is that of all.
            settings = replace(settings, noise_power_m2=results[name].summary["noise_power_m2"])
        summary, reference = _summary(results, occluded), results[names[-1]]
        # The reference once more with another seed shows how much of a difference is chance.
        with TemporaryDirectory() as again:
            own = replace(settings, fidelity=names[-1], seed=settings.seed + 1)
            other = run_into(Path(again, "again"), *parts, own)
            summary["other_seed"] = _figures(other, occluded[names[-1]], reference)
        # Pictures, the page, and the tables of figures.
        drawn, unit = _draw(results, folder, summary)
        views = {name: load_run_view(folder / name) for name in names}
        rows = comparison_rows(summary)
        comparison.write_comparison(folder / "compare.html", summary, rows, drawn, unit, views)
        write_figures(folder, summary, kind)

    def capture(name: str) -> Capture:
        return prepare(*parts, replace(asked, fidelity=name))

    return Comparison(summary, Path(out), _captures=lambda: {name: capture(name) for name in names})


def _given(
    caller: str,
    motion: Moving,
    radar: Radar | str | Path,
    scene: Scene | str | Path | None,
    options: Mapping[str, Any],
) -> tuple[RunSettings, tuple[Movers, Radar, Scene]]:
    """Return settings, and who moves, radar and scene; InputError where levels have nobody."""
    if "fidelity" in options:
        raise InputError(f"{caller} has no option 'fidelity'; name the models in fidelities")
    settings = settings_of(caller, RunOptions, options)
    parts = moving, _, there = given_parts(motion, radar, scene, settings)
    if not people_in(there, moving)[1]:
        raise InputError(
            f"{caller}: nobody is in scene '{there.name}', and it is people's echoes that levels "
            "differ in; give a motion"
        )
    return settings, parts


@takes_settings
def compare_recordings(
    motions: Sequence[Moving],
    radar: Radar | str | Path,
    scene: Scene | str | Path | None = None,
    *,
    out: str | Path,
    fidelities: Sequence[str] = ("analytic-paper", "analytic", "specular"),
    overwrite: bool = False,
    pictures: bool = False,
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
    pictures : bool
        Whether each run draws PNG files of its own as well, as `run` does.
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
    shared: dict[str, Any] = {"fidelities": fidelities, "overwrite": overwrite, **options}
    # Each recording is compared by itself, in a folder of its own.
    found = [
        compare(motion, radar, scene, out=place / name, pictures=pictures, **shared).summary
        for name, motion in zip(names, motions, strict=True)
    ]
    # What all recordings share is taken from the first, and the figures are averaged.
    first = found[0]
    summary: dict[str, Any] = {name: first[name] for name in ("reference", "versions")}
    summary |= {"recordings": names, "confidence": CONFIDENCE}
    summary["fidelities"] = {
        model: means_of([one["fidelities"][model] for one in found])
        for model in first["fidelities"]
    }
    summary["other_seed"] = means_of([one["other_seed"] for one in found])
    with atomic_folder(place, _SEVERAL, overwrite=overwrite) as folder:
        write_figures(folder, summary, _SEVERAL)
    return Comparison(summary, place)


_LONGER_STEPS, _PATIENCE_S = 24, 20.0
"""Steps from frame to frame by which the second of two short runs is longer than the first, and the
time [s] from which on the first is the only one."""


@takes_settings
def plan_levels(
    motion: Moving,
    radar: Radar | str | Path,
    scene: Scene | str | Path | None = None,
    *,
    fidelities: Sequence[str] = ("analytic-paper", "analytic", "specular"),
    tolerance_db: float | None = None,
    **options: Unpack[RunOptions],
) -> dict[str, Any]:
    """Estimate what a run by each level will take, and which level keeps a tolerance.

    Each level runs for two frames, into a folder that goes again, and for a few frames more; what
    the longer run adds is drawn on to the whole capture. A level whose two frames take long runs
    once, and all its time is drawn on: rather too much than too little.

    Parameters
    ----------
    motion, radar, scene, fidelities
        The same as for `compare`; one level will do.
    tolerance_db : float, optional
        Largest error of the power of a frame [dB], for which the level ``auto`` is asked.
    **options
        Settings of all runs: fields of `rtradar.RunSettings`.

    Returns
    -------
    dict
        ``levels``: of each its ``wall_s`` [s], without compiling, and ``peak_memory_mb`` [MB];
        ``capture_s`` [s]; and ``advice``, the ``level`` and ``why``, if it is asked for.

    Raises
    ------
    InputError, BackendError
        As by `compare`.
    """
    settings, parts = _given("plan_levels", motion, radar, scene, options)
    # How long the capture will be, after the scene has placed the radar.
    moving, before, there = parts
    there, everyone = people_in(there, moving)
    body, placed = body_of_people(everyone, settings), there.place(before)
    capture_s = placed.duration_of(placed.chirps_in(body.duration_s))
    # The level that keeps the tolerance is measured as well, and before the others.
    advice = None
    if tolerance_db is not None:
        level, why = choose_level(placed, body, tolerance_db, None)
        advice = {"level": level, "why": why}
        fidelities = [level, *(name for name in fidelities if name != level)]
    # A run of two frames has a fixed cost; what a few frames more add to it is the cost of radar
    # time.
    first_s = min(placed.frame_duration_s + placed.frame_hop_s, capture_s)
    levels = {}
    for name in fidelities:

        def took(duration_s: float, name: str = name) -> Mapping[str, float]:
            own = replace(settings, fidelity=name, duration_s=duration_s)
            with TemporaryDirectory() as place:
                return run_into(Path(place, "short"), *parts, own).summary

        found = took(first_s)
        longer_s = min(first_s + _LONGER_STEPS * placed.frame_hop_s, capture_s)
        rate = found["wall_s"] / first_s
        if found["wall_s"] <= _PATIENCE_S and longer_s > first_s:
            found = took(first_s)  # without what the first run of a process loads
            rate = max(took(longer_s)["wall_s"] - found["wall_s"], 0.0) / (longer_s - first_s)
        wall_s = found["wall_s"] + rate * (capture_s - first_s)
        levels[name] = {"wall_s": wall_s, "peak_memory_mb": found["peak_memory_mb"]}
    return {"capture_s": capture_s, "levels": levels, "advice": advice}


def _file_name(motion: Moving) -> str:
    """Return the name of a recording as one of a file."""
    alone = isinstance(motion, str | Path) or not isinstance(motion, Sequence)
    everyone: Any = [motion] if alone else motion
    names = [
        one.motion.name if isinstance(one, Person) else getattr(one, "name", str(one))
        for one in everyone
    ]
    return re.sub(r"[^\w.-]+", "-", "-".join(names))[:40]


def _occluded(
    result: Result, motion: Movers, radar: Radar, scene: Scene, settings: RunSettings
) -> dict[str, Any]:
    """Return the fractions of the echo power, of all and of each part, that other parts occlude.

    They are those of the power that the same level has of each part alone.
    """
    seen, names = _budget(result).power_at, result.summary["part_power_m2"]
    if result.summary["occlusion"] == "none":
        return {"occluded_share": 0.0, "part_occluded_share": dict.fromkeys(names, 0.0)}
    alone = power_alone(motion, radar, scene, settings)
    if alone is None:
        alone = np.full(seen.shape, np.nan)
    # A part that returns nothing even alone has no fraction; NaN and infinity become None.
    with np.errstate(divide="ignore", invalid="ignore"):
        of_parts = 1 - seen.sum(axis=0) / alone.sum(axis=0)
        whole = finite(float(1 - seen.sum() / alone.sum()))
    by_part = zip(names, map(finite, of_parts.tolist()), strict=True)
    return {"occluded_share": whole, "part_occluded_share": dict(by_part)}


def _summary(
    results: Mapping[str, Result], occluded: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Return what models have in common, and the figures of each; the last is the reference."""
    (first, *_, reference), of_each = results.values(), ("fidelity", "variant")
    shared = first.summary["parameters"].items()
    return {
        "reference": [*results][-1],
        "parameters": {key: value for key, value in shared if key not in of_each},
        **{name: first.summary[name] for name in ("seed", "noise_power_m2", "versions")},
        "fidelities": {
            name: _figures(one, occluded[name], reference) for name, one in results.items()
        },
    }


def _figures(result: Result, occluded: Mapping[str, Any], reference: Result) -> dict[str, Any]:
    """Return the figures of one model; differences of the reference from itself are zero."""
    summary, stages = result.summary, result.summary["stages"]
    ours, its = _budget(result), _budget(reference)
    # Where nothing is seen, the power is 0, and its level the least that there is instead of minus
    # infinity.
    least = np.finfo(np.float64).tiny
    levels = (10 * np.log10(np.maximum(one.power_at.sum(axis=1), least)) for one in (ours, its))
    power = np.subtract(*levels)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.linalg.norm(ours.field_at - its.field_at) / np.linalg.norm(its.field_at)
    return {
        "power_mean_db": finite(float(power.mean())),
        "power_rms_db": finite(float(np.sqrt((power**2).mean()))),
        "field_error": finite(float(error)),
        **figures_of(result, reference),
        "scatter_s": stages["scatter"] + stages["survey"],
        **{name: summary[name] for name in (*_COSTS, "limits", "part_power_m2")},
        **occluded,
    }


def _budget(result: Result) -> LinkBudget:
    assert result.link_budget is not None  # every run has one
    return result.link_budget


def _draw(
    results: Mapping[str, Result], folder: Path, summary: Mapping[str, Any]
) -> tuple[dict[str, Path], FieldUnit]:
    """Draw the pictures of a comparison; return them and the unit of the power of parts."""
    reference, found = results[summary["reference"]], summary["fidelities"]
    parameters, radar = summary["parameters"], reference.radar
    title = f"{parameters['motion']}, {radar.name}"

    def unit_of(powers: Mapping[str, NDArray[np.floating]]) -> FieldUnit:
        strongest = max(float(power.max()) for power in powers.values())
        return field_unit(radar, spreading=parameters["spreading"], strongest_m2=strongest)

    # The echo power over time, summed over parts, and the mean power of each part.
    power, parts = (folder / file for file in list(_PICTURES.values())[:2])
    total, mean = (
        {name: reduced(_budget(one).power_at, axis) for name, one in results.items()}
        for reduced, axis in ((np.sum, 1), (np.mean, 0))
    )
    times = _budget(reference).times
    over_time = times, total, unit_of(total), summary["reference"], title
    comparison.draw_power_over_time(power, *over_time)
    hidden = {
        name: np.array([*own["part_occluded_share"].values()], dtype=np.float64)
        for name, own in found.items()
    }
    part_unit = unit_of(mean)
    names = list(reference.summary["part_power_m2"])
    comparison.draw_part_power(parts, names, mean, hidden, part_unit, title)
    drawn = draw_maps_and_clouds(folder, results, title, summary["reference"])
    return dict(zip(_PICTURES, (power, parts), strict=False)) | drawn, part_unit


# -- folders ---------------------------------------------------------------------------------------


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
    # All folders are read and checked before anything is written.
    read = {}
    for name, folder in zip(names, map(Path, folders), strict=True):
        check_whole(folder)
        read[name] = read_result(folder)
    for path in folders:
        _check_axes(Path(path), Path(folders[-1]))
    found = {
        name: figures_of(own, read[names[-1]])
        | {"windows": own.summary.get("windows"), "xyz_points": own.summary.get("xyz_points")}
        | {"unit": unit_of(own), "parameters": own.summary["parameters"]}
        for name, own in read.items()
    }
    # What was measured has no run file.
    runs = {name: own for name, folder in read.items() if (own := folder.summary.get("run"))}
    summary = {"reference": names[-1], "folders": found, "differ": differing(runs)}
    # Pictures, the page, and the tables of figures.
    with atomic_folder(Path(out), _OF_FOLDERS, overwrite=overwrite) as place:
        pictures = draw_maps_and_clouds(place, read, " and ".join(names))
        rows = comparison_rows(summary)
        comparison.write_comparison(place / "compare.html", summary, rows, pictures)
        write_figures(place, summary, _OF_FOLDERS)
    return Comparison(summary, Path(out))


def _check_axes(folder: Path, reference: Path) -> None:
    """Raise InputError where maps cannot be laid on those of the reference."""
    with run_maps(folder) as ours, run_maps(reference) as other:
        for axis in ("range", "velocity", "spectrogram_velocity"):
            if axis not in ours or axis not in other:
                raise InputError(f"'{folder}' or the reference has no maps over {axis}")
            one, two = ours[axis][:], other[axis][:]
            if one.shape != two.shape or not np.allclose(one, two, rtol=1e-6):
                says = (f"{len(one)} steps to {one[-1]:.6g}", f"{len(two)} to {two[-1]:.6g}")
                raise InputError(
                    f"'{folder}' has a {axis} axis of {says[0]}, '{reference}' of "
                    f"{says[1]}; make both with one radar"
                )
        if not len(ours["time"]) or not len(ours["spectrogram_time"]):
            raise InputError(f"'{folder}' holds no frame; give a longer capture")
