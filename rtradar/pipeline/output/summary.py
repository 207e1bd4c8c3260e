"""Contents of ``summary.json``: parameters, cost, findings, and what was near its limits."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rtradar.description import versions
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.output.writer import RUN_FILES
from rtradar.pipeline.processing import Clouds
from rtradar.pipeline.timing import peak_memory_mb, to_cloud_s
from rtradar.report.plots import Plots
from rtradar.scatter import account_of
from rtradar.scatter.multipath.path_summary import ghosts
from rtradar.scatter.validity import Limit
from rtradar.settings import ProcessingOptions
from rtradar.system.clock import Moment
from rtradar.trace.rays import rays_traced

if TYPE_CHECKING:
    from rtradar.pipeline.recorded import Samples

_SINGLE_REFLECTIONS = {
    "name": "single_reflections",
    "share": None,
    "message": "what parts of a body reflect to one another is left out, which near each other "
    "changes both by decibels; specular and physical-optics add it with bounces=2 (--model-option "
    "bounces=2)",
}
"""A limit of every run without it, whose share only such a run could tell."""
_REST_BINS = 2
"""Doppler bins on either side of zero that hold what does not move: the lobe of a Hann window."""


def cost(source: Capture | Samples) -> dict[str, Any]:
    """Return the time and the memory that a run has taken so far."""
    now, stages = Moment.now(), source.processing.stages
    wall_s = now.work_s - stages.begun.work_s
    capture_s = source.processing.radar.duration_of(source.n_chirps)
    return {
        "stages": {name: round(spent, 4) for name, spent in stages.seconds.items()},
        "wall_s": round(wall_s, 4),
        "cloud_s": round(to_cloud_s(stages.seconds, wall_s), 4),
        "warmup_s": round(now.warm_up_s - stages.begun.warm_up_s, 4),
        "capture_s": capture_s,
        "real_time_factor": round(wall_s / capture_s, 4),
        "peak_memory_mb": round(peak_memory_mb(), 1),
    }


def summary_of(source: Capture | Samples, clouds: Clouds) -> dict[str, Any]:
    """Return the summary of a run, as far as it is known before its files are written.

    Of IF samples that were recorded it has no entries of motion, scene, echoes and noise, which are
    not known.
    """
    processing = source.processing
    radar, settings, n_chirps = processing.radar, processing.settings, source.n_chirps
    ranges = clouds.ranges
    summary = {
        "parameters": settings.parameters() | {"radar": dataclasses.asdict(radar)},
        "seed": settings.seed,
        "versions": versions(),
        **cost(source),
        "windows": len(radar.window_starts(n_chirps)),
        "chirps": n_chirps,
        "detections": clouds.rdt.n_voxels,
        "rdt_triangles": clouds.rdt.n_triangles,
        "rdt_points": len(clouds.rdt.points),
        "xyz_points": len(clouds.spatial.points),
        "xyz_points_found": clouds.n_spatial,
        "detected_range_m": ranges and (ranges.low_m, ranges.high_m),
        "limits": _limits_of_detections(clouds),
    }
    if isinstance(source, Capture):
        return _of_simulation(summary, source)
    # Samples that were recorded have no settings of a simulation.
    taken = {"radar", *ProcessingOptions.__annotations__}
    parameters = {key: value for key, value in summary["parameters"].items() if key in taken}
    told = {"duration_s": radar.duration_of(n_chirps), "unit": processing.unit}
    return summary | {"parameters": parameters | told}


def _of_simulation(summary: dict[str, Any], capture: Capture) -> dict[str, Any]:
    """Return a summary with what is known of a simulation alone."""
    radar, budget, settings = capture.radar, capture.link_budget, capture.settings
    # A model may trace nothing yet, and would if a part came near a line of sight.
    traces = capture.model.variant is not None or getattr(
        capture.model.people_alone, "traces", False
    )
    of_motion = {"motion": capture.motion, "scene": capture.scene.name}
    duration = {"duration_s": capture.body.duration_s}
    summary = summary | {
        "parameters": of_motion | summary["parameters"] | duration,
        "fidelity": settings.fidelity,
        "variant": capture.model.variant,
        "occlusion": "mitsuba" if traces else "none",
        "echo_power_m2": budget.power if budget.visible else 0.0,
        "part_power_m2": budget.part_power,
        "noise_power_m2": capture.noise.power,
        "people": _people(capture),
        "limits": _limits(capture) + summary["limits"],
        "rays_traced": rays_traced() - capture.stages.rays,
    }
    if radar.transmit_power_dbm is not None and settings.spreading:
        # Powers per IF sample as received at the port of the antenna: the radar equation.
        scale = radar.watts_per_m2
        summary["watts"] = {
            "watts_per_m2": scale,
            "echo_power_w": budget.power * scale,
            "noise_power_w": capture.noise.power * scale,
        }
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


def finished(summary: dict[str, Any], folder: Path | None = None) -> dict[str, Any]:
    """Return a summary as JSON has it; with a folder, list the files there, and write it beside."""
    if folder is not None:
        summary = summary | {"files": RUN_FILES.list_of(folder)}
    text = json.dumps(_plain(summary), indent=2, allow_nan=False)
    if folder is not None:
        (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    found: dict[str, Any] = json.loads(text)
    return found


def _plain(value: Any) -> Any:
    """Return the same for JSON, without scalars of NumPy; ``inf``, which it lacks, as text."""
    if isinstance(value, dict):
        return {key: _plain(own) for key, own in value.items()}
    if isinstance(value, list):
        return [_plain(own) for own in value]
    value = value.item() if isinstance(value, np.generic) else value
    return str(value) if isinstance(value, float) and math.isinf(value) else value


def _limits(capture: Capture) -> list[dict[str, Any]]:
    limits = [dataclasses.asdict(limit) for limit in capture.link_budget.limits]
    single = (capture.settings.model_options or {}).get("bounces", 1) == 1
    return limits + ([_SINGLE_REFLECTIONS] if single and capture.link_budget.visible else [])


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


def room_findings(capture: Capture, plots: Plots) -> dict[str, Any]:
    """Return the ``room`` of the summary with what its maps tell; nothing without a room.

    The ``plots`` are those of the run. They add ``ghosts``, with ``time_s`` and ``paths``, a
    list of path, range [m], velocity [m/s], azimuth [deg] and power [m^2]; and ``clutter``, to
    which ``after_removal_db`` is added, the signal to clutter ratio after removal, at least, and of
    a room in which nobody and nothing moves ``false_alarm_rate``, that of a cell.
    """
    if capture.room is None:
        return {}
    # The instant is that of the frame kept as received, or else of the frame with most detections.
    maps: Any = plots.maps
    times = np.asarray(maps["time"])
    if "range_doppler_received" in maps:
        time_s = float(maps["range_doppler_received"].attrs["time_s"])
        frame = int(np.abs(times - time_s).argmin())
    else:
        frame = int(plots.detections.argmax())
        time_s = float(times[frame])
    # Where the ghosts of that instant lie.
    paths = [
        {
            "path": ghost.path,
            "range_m": ghost.range_m,
            "velocity_mps": ghost.velocity_mps,
            "azimuth_deg": math.degrees(ghost.azimuth_rad),
            "power_m2": ghost.power_m2,
        }
        for ghost in ghosts(capture.model.room, capture.radar, time_s)
    ]
    clutter = dict(capture.room.summary["clutter"])
    # Where nobody and nothing moves, every detection is a false alarm.
    if not (capture.people or capture.scene.objects):
        clutter["false_alarm_rate"] = float(plots.detections.sum() / maps["detections"].size)
    before_db = clutter["signal_to_clutter_db"]
    # What removal gains is measured on the map, over the Doppler bins in which echoes at rest lie.
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
