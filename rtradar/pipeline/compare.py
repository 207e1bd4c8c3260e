"""`compare`: one recording by several echo models, with the same noise, and how far apart they end."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Unpack

import h5py
import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.motion import Motion
from rtradar.pipeline.agreement import LevelAgreement, above_noise, chamfer, level_agreement
from rtradar.pipeline.chain import Result, simulate
from rtradar.pipeline.output.output_files import comparison_files
from rtradar.pipeline.pictures.run_pictures import busiest_window, removed, thinned
from rtradar.radar import Radar
from rtradar.report.figures.canvas import HANN_BINS, VELOCITY_LABEL, FieldUnit, field_unit
from rtradar.report.pages.comparison import (
    draw_maps,
    draw_part_power,
    draw_power_over_time,
    draw_rdt_clouds,
    write_comparison,
)
from rtradar.scatter import MODELS
from rtradar.scene import Scene
from rtradar.settings import RunOptions, RunSettings
from rtradar.system.output_folder import atomic_folder

_MEASURES = (
    # key, heading, digits
    ("power_mean_db", "Echo power, mean difference [dB]", 2),
    ("power_rms_db", "Echo power, rms difference [dB]", 2),
    ("hidden_share", "Hidden share of part, time and channel", 3),
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
"""What is told of each model, in the order of the chain; differences are to the last model named."""


@dataclass(frozen=True)
class Comparison:
    """What a comparison gave.

    Parameters
    ----------
    summary : dict
        All that stands in ``compare.json``.
    out : path
        Folder of the files; the run of each model is in a folder of its name.
    """

    summary: dict[str, Any]
    out: Path

    def table(self) -> str:
        """The figures of each model, aligned, a column a model."""
        rows = comparison_rows(self.summary)
        widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
        return "\n".join(
            "  ".join(
                [
                    row[0].ljust(widths[0]),
                    *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True)),
                ]
            )
            for row in rows
        )


def compare(
    motion: Motion,
    radar: Radar,
    scene: Scene | None = None,
    *,
    out: str | Path,
    fidelities: Sequence[str] = ("analytic-paper", "analytic", "specular"),
    overwrite: bool = False,
    **options: Unpack[RunOptions],
) -> Comparison:
    """Run several models on the same recording and say what differs.

    All runs have the same noise, sample by sample: that of the first model, whose echo ``snr_db`` is relative to. The last
    model named is the reference.

    Parameters
    ----------
    motion : Motion
    radar : Radar
    scene : Scene, optional
        Free space if left out.
    out : path
        Folder; a run of each model in a folder of its name, and ``compare.json``, ``compare.html`` and pictures.
    fidelities : sequence of str
        Two models or more, each once; `rtradar.scatter.MODELS` has their names.
    overwrite : bool
        Whether files that ``out`` holds under names of the new ones are replaced even where no ``compare.json`` lists them.
    **options
        Settings of all runs, the fields of `rtradar.RunSettings` but ``fidelity``.

    Returns
    -------
    Comparison

    Raises
    ------
    InputError
        Where fewer than two models are named, one twice, or one that does not exist; and as in `run`.
    BackendError
        As in `run`.
    """
    names = list(fidelities)
    for name in names:
        if name not in MODELS:
            raise InputError(
                f"fidelity '{name}' is unknown; allowed: {', '.join(MODELS)} (--fidelities)"
            )
    if len(names) < 2 or len(set(names)) < len(names):
        raise InputError(
            f"fidelities {', '.join(names) or '(none)'}; name two or more, each once (--fidelities)"
        )
    if "fidelity" in options:
        raise InputError("compare has no option 'fidelity'; name the models in fidelities")
    settings = RunSettings(**options)
    kind = comparison_files(list(MODELS))
    with atomic_folder(Path(out), kind, overwrite=overwrite) as folder:
        results: dict[str, Result] = {}
        for name in names:
            results[name] = simulate(
                motion, radar, scene or Scene(), replace(settings, fidelity=name), folder / name
            )
            noise = results[name].summary["noise_power_m2"]  # that of the first model
            settings = replace(settings, noise_power_m2=noise)
        summary = _summary(results, folder, radar, names[-1])
        mean_power = {name: result.survey.power_at.mean(axis=0) for name, result in results.items()}
        unit = _unit(radar, summary, mean_power.values())
        pictures = _draw(results, mean_power, unit, folder, radar, names[-1])
        write_comparison(folder / "compare.html", summary, comparison_rows(summary), pictures, unit)
        summary["files"] = kind.list_of(folder)
        (folder / "compare.json").write_text(
            json.dumps(summary, indent=2, allow_nan=False) + "\n", encoding="utf-8"
        )
    return Comparison(summary, Path(out))


def comparison_rows(summary: Mapping[str, Any]) -> list[list[str]]:
    """The table of a comparison as text: a heading row, then a row a measure, with a column a model."""
    fidelities = summary["fidelities"]
    rows = [
        [
            "",
            *(
                f"{name} (reference)" if name == summary["reference"] else name
                for name in fidelities
            ),
        ]
    ]
    for key, heading, digits in _MEASURES:
        values = [found[key] for found in fidelities.values()]
        rows.append(
            [heading, *("-" if value is None else f"{value:.{digits}f}" for value in values)]
        )
    return rows


def _summary(
    results: Mapping[str, Result], folder: Path, radar: Radar, reference: str
) -> dict[str, Any]:
    first = next(iter(results.values())).summary
    return {
        "reference": reference,
        "parameters": {
            key: value
            for key, value in first["parameters"].items()
            if key not in ("fidelity", "variant")
        },
        "seed": first["seed"],
        "noise_power_m2": first["noise_power_m2"],
        "versions": first["versions"],
        "fidelities": {
            name: _of_one(result, results[reference], folder, radar)
            for name, result in results.items()
        },
    }


def _of_one(result: Result, reference: Result, folder: Path, radar: Radar) -> dict[str, Any]:
    """Every figure of one model; differences from itself are zero, which tells that the comparison works."""
    said, cost = result.summary, result.summary["stages"]
    power = _level_db(result.survey.power_at.sum(axis=1)) - _level_db(
        reference.survey.power_at.sum(axis=1)
    )
    maps, shared, spectrogram = _map_agreement(
        folder / said["fidelity"], folder / reference.summary["fidelity"]
    )
    bins = (radar.frame_hop_s, radar.range_bin_m, radar.velocity_bin_mps)
    return {
        "power_mean_db": _finite(float(power.mean())),
        "power_rms_db": _finite(float(np.sqrt((power**2).mean()))),
        "hidden_share": float(result.survey.hidden_at.mean()),
        "range_doppler_correlation": _finite(maps.correlation),
        "range_doppler_mean_db": _finite(maps.mean_db),
        "range_doppler_rms_db": _finite(maps.rms_db),
        "detections": said["detections"],
        "detection_overlap": shared,
        "spectrogram_correlation": _finite(spectrogram.correlation),
        "spectrogram_rms_db": _finite(spectrogram.rms_db),
        "rdt_chamfer_bins": _finite(chamfer(result.points, reference.points, bins)),
        "scatter_s": cost["scatter"] + cost["survey"],
        "wall_s": said["wall_s"],
        "real_time_factor": said["real_time_factor"],
        "peak_memory_mb": said["peak_memory_mb"],
        "stages": cost,
        "limits": said["limits"],
        "part_power_m2": said["part_power_m2"],
        "part_hidden_share": dict(
            zip(said["part_power_m2"], result.survey.hidden_at.mean(axis=0).tolist(), strict=True)
        ),
    }


def _map_agreement(ours: Path, reference: Path) -> tuple[LevelAgreement, float, LevelAgreement]:
    """Range-Doppler maps over cells that either detects, overlap of detections, spectrograms over cells above the noise."""
    with h5py.File(ours / "maps.h5") as first, h5py.File(reference / "maps.h5") as second:
        cells, both, either = [], 0, 0
        for window in range(len(first["time"])):
            masks = [maps["detections"][window].astype(bool) for maps in (first, second)]
            union = masks[0] | masks[1]
            both, either = both + int((masks[0] & masks[1]).sum()), either + int(union.sum())
            cells.append([maps["range_doppler"][window][union] for maps in (first, second)])
        power, other = (np.concatenate(column) for column in zip(*cells, strict=True))
        levels = level_agreement(power, other, np.ones(len(power), dtype=bool))
        spectrogram, its = (
            thinned(maps, "spectrogram", "spectrogram_time")[0] for maps in (first, second)
        )
        alike = level_agreement(spectrogram, its, above_noise(spectrogram) | above_noise(its))
        return levels, both / either if either else 1.0, alike


def _unit(
    radar: Radar, said: Mapping[str, Any], powers: Iterable[NDArray[np.floating]]
) -> FieldUnit:
    """The unit of powers that sum over ranges, by the strongest of them; ``said`` is a summary with the parameters of the run."""
    return field_unit(
        radar,
        spreading=said["parameters"]["spreading"],
        strongest_m2=max(float(one.max()) for one in powers),
    )


def _draw(
    results: Mapping[str, Result],
    mean_power: Mapping[str, NDArray[np.float64]],
    unit: FieldUnit,
    folder: Path,
    radar: Radar,
    reference: str,
) -> dict[str, Path]:
    any_result = next(iter(results.values()))
    said = any_result.summary
    title = f"{any_result.summary['parameters']['motion']}, {radar.name}"
    drawn = {
        "Echo power over time": folder / "compare_power.png",
        "Echo power and hiding of each part": folder / "compare_parts.png",
        "Range-Doppler": folder / "compare_range_doppler.png",
        "Spectrogram": folder / "compare_spectrogram.png",
        "Range-Doppler-time clouds": folder / "compare_cloud.png",
    }
    paths = iter(drawn.values())
    surveys = {name: result.survey for name, result in results.items()}
    power = {name: survey.power_at.sum(axis=1) for name, survey in surveys.items()}
    draw_power_over_time(
        next(paths),
        any_result.survey.times,
        power,
        _unit(radar, said, power.values()),
        reference,
        title,
    )
    hidden = {name: survey.hidden_at.mean(axis=0) for name, survey in surveys.items()}
    draw_part_power(next(paths), list(said["part_power_m2"]), mean_power, hidden, unit, title)
    with h5py.File(folder / reference / "maps.h5") as maps:
        window = busiest_window(maps)
        moment, velocity = float(maps["time"][window]), maps["velocity"][:]
        cleaned = {name: title + removed(maps[name]) for name in ("range_doppler", "spectrogram")}
        slow, times = (
            maps["spectrogram_velocity"][:],
            thinned(maps, "spectrogram", "spectrogram_time")[1],
        )
    range_doppler, spectrogram = {}, {}
    for name in results:
        with h5py.File(folder / name / "maps.h5") as maps:
            range_doppler[name] = maps["range_doppler"][window]
            spectrogram[name] = thinned(maps, "spectrogram", "spectrogram_time")[0].T / HANN_BINS
    across, up = (VELOCITY_LABEL, velocity), ("Range [m]", radar.range_m)
    by_range = field_unit(
        radar, spreading=said["parameters"]["spreading"], range_m=radar.range_m[:, None]
    )
    levels = {
        name: by_range.level(power / radar.n_channels) for name, power in range_doppler.items()
    }
    label = by_range.label("mean of channels")
    draw_maps(
        next(paths),
        levels,
        label,
        across,
        up,
        f"{cleaned['range_doppler']}, window at {moment:.2f} s",
    )
    summed = _unit(radar, said, spectrogram.values())
    levels = {name: summed.level(power) for name, power in spectrogram.items()}
    draw_maps(
        next(paths),
        levels,
        summed.label("one channel"),
        ("Time [s]", times),
        (across[0], slow),
        cleaned["spectrogram"],
    )
    draw_rdt_clouds(next(paths), {name: result.points for name, result in results.items()}, title)
    return drawn


def _level_db(power: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(10 * np.log10(np.maximum(power, np.finfo(np.float64).tiny)))


def _finite(value: float) -> float | None:
    """JSON has no NaN."""
    return value if np.isfinite(value) else None
