"""Contents of ``summary.json``: parameters, cost, findings, and what was near its limits."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.description import versions
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.output.writer import RUN_FILES
from rtradar.pipeline.processing import Clouds, Processing
from rtradar.pipeline.timing import peak_memory_mb, to_cloud_s
from rtradar.radar import Radar
from rtradar.scatter import account_of
from rtradar.scatter.multipath.path_summary import ghosts
from rtradar.scatter.validity import Limit
from rtradar.settings import ProcessingOptions
from rtradar.system.clock import Moment

_SINGLE_REFLECTIONS = {
    "name": "single_reflections",
    "share": None,
    "message": "what parts of a body reflect to one another is left out, which near each other "
    "changes both by decibels; bounces=2 (--model-option bounces=2) adds it",
}
"""A limit of every run without it, whose share only such a run could tell."""
_REST_BINS = 2
"""Doppler bins on either side of zero that hold what does not move: the lobe of a Hann window."""


def cost(processing: Processing, n_chirps: int, started: Moment) -> dict[str, Any]:
    """Return time since ``started``, and memory, for so many chirps."""
    now = Moment.now()
    wall_s, warmup_s = now.work_s - started.work_s, now.warm_up_s - started.warm_up_s
    capture_s = processing.radar.duration_of(n_chirps)
    stages = processing.stages.seconds
    return {
        "stages": {name: round(spent, 4) for name, spent in stages.items()},
        "wall_s": round(wall_s, 4),
        "cloud_s": round(to_cloud_s(stages, wall_s), 4),
        "warmup_s": round(warmup_s, 4),
        "capture_s": capture_s,
        "real_time_factor": round(wall_s / capture_s, 4),
        "peak_memory_mb": round(peak_memory_mb(), 1),
    }


def summary_of(capture: Capture, clouds: Clouds, started: Moment) -> dict[str, Any]:
    """Return the summary of a run that started at ``started``, see `cost`."""
    settings, radar, budget = capture.settings, capture.radar, capture.link_budget
    # A model may trace nothing yet, and would if a part came near a line of sight.
    traces = capture.model.variant is not None or getattr(
        capture.model.people_alone, "traces", False
    )
    summary = {
        "parameters": {
            "motion": capture.motion,
            "scene": capture.scene.name,
            **settings.parameters(),
            "duration_s": capture.body.duration_s,
            "radar": dataclasses.asdict(radar),
        },
        "seed": settings.seed,
        "versions": versions(),
        "fidelity": settings.fidelity,
        "variant": capture.model.variant,
        "occlusion": "mitsuba" if traces else "none",
        **cost(capture.processing, capture.n_chirps, started),
        **_found(radar, capture.n_chirps, clouds),
        "echo_power_m2": budget.power if budget.visible else 0.0,
        "part_power_m2": budget.part_power,
        "noise_power_m2": capture.noise.power,
        "people": _people(capture),
    }
    if radar.transmit_power_dbm is not None and settings.spreading:
        # Powers per IF sample as received at the port of the antenna: the radar equation.
        scale = radar.watts_per_m2
        summary["watts"] = {
            "watts_per_m2": scale,
            "echo_power_w": budget.power * scale,
            "noise_power_w": capture.noise.power * scale,
        }
    summary["limits"] = _limits(capture) + _limits_of_detections(clouds)
    if (modelled := account_of(capture.model)) is not None:
        summary["modelled"] = modelled
    if capture.receiver is not None:
        summary["receiver"] = [dataclasses.asdict(effect) for effect in capture.receiver.effects]
    if capture.room:
        summary["room"] = capture.room.summary
    return summary


def _people(capture: Capture) -> list[dict[str, Any]]:
    """Return who was where, and the power of the echoes of each."""
    found, noise, settings = [], capture.noise.power, capture.settings
    for name, person, body, power in zip(
        capture.body.names,
        capture.people,
        capture.body.people,
        capture.link_budget.person_power,
        strict=True,
    ):
        snr_db = float(10 * np.log10(power / noise)) if power > 0 and noise > 0 else None
        found.append(
            {
                "name": name,
                "motion": person.motion.name,
                "findings": [one.text for one in person.motion.findings],
                "position_m": person.position_m,
                "heading_deg": person.heading_deg + settings.heading_deg,
                "start_s": person.start_s + settings.start_s,
                "body": person.body,
                "material": body.material,
                "breathing": body.breathing and dataclasses.asdict(body.breathing),
                "echo_power_m2": power,
                "snr_db": snr_db,
            }
        )
    return found


def summary_of_samples(
    processing: Processing, n_chirps: int, clouds: Clouds, started: Moment
) -> dict[str, Any]:
    """Return the summary of so many chirps of IF samples; their processing began at ``started``.

    It has no entries of motion, scene, echoes and noise, which are not known.
    """
    radar, settings = processing.radar, processing.settings
    names = set(ProcessingOptions.__annotations__)
    of_processing = {key: value for key, value in settings.parameters().items() if key in names}
    capture_s = radar.duration_of(n_chirps)
    return {
        "parameters": of_processing
        | {"duration_s": capture_s, "unit": processing.unit, "radar": dataclasses.asdict(radar)},
        "seed": settings.seed,
        "versions": versions(),
        **cost(processing, n_chirps, started),
        **_found(radar, n_chirps, clouds),
        "limits": _limits_of_detections(clouds),
    }


def _found(radar: Radar, n_chirps: int, clouds: Clouds) -> dict[str, Any]:
    return {
        "windows": len(radar.window_starts(n_chirps)),
        "chirps": n_chirps,
        "detections": clouds.rdt.n_voxels,
        "rdt_triangles": clouds.rdt.n_triangles,
        "rdt_points": len(clouds.rdt.points),
        "xyz_points": len(clouds.spatial.points),
        "xyz_points_found": clouds.n_spatial,
        "detected_range_m": clouds.ranges and (clouds.ranges.low_m, clouds.ranges.high_m),
    }


def finished(summary: dict[str, Any], folder: Path | None = None) -> dict[str, Any]:
    """Return a summary as JSON has it; with a folder, list the files there, and write it beside."""
    if folder is not None:
        summary = summary | {"files": RUN_FILES.list_of(folder)}
    text = json.dumps(_finite(summary), indent=2, allow_nan=False, default=_plain)
    if folder is not None:
        (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    found: dict[str, Any] = json.loads(text)
    return found


def _finite(value: Any) -> Any:
    """The same without infinity, which JSON does not know: ``inf`` as text."""
    if isinstance(value, dict):
        return {key: _finite(own) for key, own in value.items()}
    if isinstance(value, list):
        return [_finite(own) for own in value]
    return str(value) if isinstance(value, float) and math.isinf(value) else value


def _plain(value: object) -> Any:
    """Convert a NumPy scalar for JSON: seeds from ``np.arange``, figures of a model."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a {type(value).__name__} has no place in summary.json")


def _limits(capture: Capture) -> list[dict[str, Any]]:
    of_room = capture.room.limits if capture.room else ()
    limits = [dataclasses.asdict(limit) for limit in (*capture.link_budget.limits, *of_room)]
    if not capture.link_budget.visible:
        invisible = {"name": "nobody_visible", "share": 0.0}
        limits += [invisible | {"message": message} for message in capture.warned]
    elif (capture.settings.model_options or {}).get("bounces", 1) == 1:
        limits.append(_SINGLE_REFLECTIONS)
    return limits


def _limits_of_detections(clouds: Clouds) -> list[dict[str, Any]]:
    ranges = clouds.ranges
    if ranges is None or not ranges.side_lobes:
        return []
    message = (
        f"detections nearer than {ranges.low_m:.1f} m or farther than {ranges.high_m:.1f} m, which "
        "may be range side lobes of stronger echoes: past the last range they go on from the "
        "first; a window function with lower ones does away with them, such as --range-window "
        "blackmanharris"
    )
    share = ranges.side_lobes / ranges.detections
    return [dataclasses.asdict(Limit("range_side_lobes", share, message))]


def room_findings(capture: Capture, maps: Any) -> dict[str, Any]:
    """Return the ``room`` of the summary with what its maps tell; nothing without a room.

    ``maps`` are those of the run, open. They add ``ghosts``, with ``time_s`` and ``paths``, a
    list of path, range [m], velocity [m/s], azimuth [deg] and power [m^2]; and ``clutter``, to
    which ``after_removal_db`` is added, the signal to clutter ratio after removal, at least, and of
    a room in which nobody and nothing moves ``false_alarm_rate``, that of a cell.
    """
    if capture.room is None:
        return {}
    times = np.asarray(maps["time"])
    if "range_doppler_received" in maps:
        time_s = float(maps["range_doppler_received"].attrs["time_s"])
        frame = int(np.abs(times - time_s).argmin())
    else:
        frame = int(np.asarray(maps["detections"]).sum(axis=(1, 2)).argmax())
        time_s = float(times[frame])
    paths = [
        {
            "path": ghost.path,
            "range_m": ghost.range_m,
            "velocity_mps": ghost.velocity_mps,
            "azimuth_deg": math.degrees(ghost.azimuth_rad),
            "power_m2": ghost.power_m2,
        }
        for ghost in ghosts(capture.room.model, capture.radar, time_s)
    ]
    clutter = dict(capture.room.summary["clutter"])
    if not (capture.people or capture.scene.objects):
        clutter["false_alarm_rate"] = float(np.asarray(maps["detections"]).mean())
    before_db = clutter["signal_to_clutter_db"]
    if "range_doppler_received" in maps and before_db is not None:
        velocity = np.asarray(maps["velocity"])
        received, left = (
            at_rest(np.asarray(power), velocity)
            for power in (maps["range_doppler_received"], maps["range_doppler"][frame])
        )
        if received > 0 and left > 0:
            clutter["after_removal_db"] = before_db + 10 * math.log10(received / left)
    added = {"ghosts": {"time_s": time_s, "paths": paths}, "clutter": clutter}
    return {"room": capture.room.summary | added}


def at_rest(power: NDArray[np.floating], velocity: NDArray[np.float64]) -> float:
    """Sum the power of a map (range, velocity) [m^2] within two Doppler bins of rest."""
    bins = velocity / (velocity[1] - velocity[0]) if len(velocity) > 1 else velocity
    return float(power[:, np.abs(bins) < _REST_BINS + 0.5].sum(dtype=np.float64))
