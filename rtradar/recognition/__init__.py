"""Recognition of activities with weights that come with the package; NumPy alone runs them.

They have learnt from synthetic actors only (``validation/measurements/shipped_weights.py``). What a
person does in a run is recognised in windows of its cloud, and averaged.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rtradar.description import made_from
from rtradar.errors import InputError
from rtradar.recognition.recogniser import EDGE_S, OTHER, WEIGHTS, WINDOW_S, Recogniser, cut_windows
from rtradar.system.checks import is_real, printable
from rtradar.system.files import read_arrays, read_json

__all__ = ["Recogniser", "predict_run"]


_TOLERANCE = 0.2  # relative difference of a radar's resolution that is not worth a warning
_FEW_POINTS, _UNSURE = 64, 0.5
_NEEDED = "name a folder that 'rtradar run --out DIR' or 'rtradar process' made"


def predict_run(folder: Path) -> dict[str, Any]:
    """Say which activity the RDT cloud of a run shows.

    Parameters
    ----------
    folder : path
        Folder of a run, of which ``cloud_rdt.npz`` and ``summary.json`` are read.

    Returns
    -------
    dict
        Plain JSON values: ``activity``, ``probabilities`` by activity, the means over all windows
        if it is one of those, ``windows`` (their number), ``warnings``, a list of sentences, and
        ``made_from``: the files of the run and the weights with their digests, and versions.

    Raises
    ------
    InputError
        If the folder holds no run, a file is damaged, or the cloud is empty.
    """
    points, summary = _read(folder)
    recogniser = Recogniser.shipped()
    windows = cut_windows(points, summary["capture_s"])
    mean = recogniser.probabilities(windows).mean(axis=0)
    chances = dict(zip(recogniser.classes, mean.tolist(), strict=True))
    none_of_them = chances.pop(OTHER)
    chances = {name: chance / (1 - none_of_them) for name, chance in chances.items()}
    warnings = [*_of_radar(summary, recogniser.card), *_of_scene(summary, recogniser.card)]
    if summary["capture_s"] < WINDOW_S + 2 * EDGE_S - 1e-6:
        warnings.append(
            f"the capture has {summary['capture_s']:.2f} s, "
            f"less than the {WINDOW_S + 2 * EDGE_S:.1f} s of those that were learnt from"
        )
    if (few := float(np.median([len(window) for window in windows]))) < _FEW_POINTS:
        warnings.append(
            f"windows have {few:.0f} points, fewer than {_FEW_POINTS}; "
            "give shorter intervals (rtradar run --duration)"
        )
    if (distance := recogniser.distance(windows)) > 1:
        warnings.append(
            f"the motion is unlike any that was learnt from ({distance:.1f} times the distance "
            "within which 199 of 200 lie)"
        )
    if none_of_them > _UNSURE:
        warnings.append(
            f"it is probably none of {', '.join(chances)} (probability {none_of_them:.2f}), but "
            "something else that a person does"
        )
    if max(chances.values()) < _UNSURE:
        warnings.append(f"no activity has a probability of {_UNSURE:g}")
    return {
        "activity": max(chances, key=lambda name: chances[name]),
        "probabilities": chances,
        "windows": len(windows),
        "warnings": warnings,
        "made_from": made_from(folder / "cloud_rdt.npz", folder / "run.toml", WEIGHTS),
    }


def _read(folder: Path) -> tuple[np.ndarray[Any, np.dtype[np.float64]], dict[str, Any]]:
    """Read the cloud and the summary of a run, checked as far as they are used."""
    try:
        summary = read_json(folder / "summary.json")
        points = np.asarray(read_arrays(folder / "cloud_rdt.npz")["points"], dtype=np.float64)
        known = isinstance(summary["parameters"], dict) and is_real(summary["capture_s"])
        cloud = points.ndim == 2 and points.shape[1] == 3 and np.isfinite(points).all()
        if not known or not cloud or not 0 < summary["capture_s"] < 1e6:
            raise ValueError
    except OSError as error:
        name = Path(error.filename or folder).name
        raise InputError(f"'{folder}' holds no run ({name}: {error.strerror}); {_NEEDED}") from None
    except (ValueError, KeyError, TypeError):
        raise InputError(f"a file of '{folder}' is damaged; make the run anew") from None
    if not len(points):
        raise InputError(f"the cloud of '{folder}' is empty; make the run with a higher SNR")
    return points, summary


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
    elif scene != "free-space":
        yield f"scene '{printable(str(scene))}': the weights have learnt in free space"
    people = summary.get("people")
    if isinstance(people, list) and len(people) > 1:
        yield f"{len(people)} people: the weights have learnt from one alone"
    snr_db, (least, most) = parameters.get("snr_db"), card["snr_db"]
    if isinstance(snr_db, float | int) and not least - 3 <= snr_db <= most + 10:
        yield f"SNR {snr_db:g} dB: the weights have learnt from {least:g} to {most:g} dB"
