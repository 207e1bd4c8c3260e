"""What a run tells of itself, in ``summary.json``: parameters, cost, what was found, and what was near its limits."""

from __future__ import annotations

import dataclasses
import os
import platform
from collections.abc import Mapping
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from rtradar.pipeline.capture import Capture
from rtradar.pipeline.cloud_maker import Clouds
from rtradar.pipeline.timing import peak_memory_mb
from rtradar.scatter import Accountable

_VERSIONS = (
    "rtradar",
    "mitsuba",
    "drjit",
    "numpy",
    "scipy",
    "numba",
    "scikit-image",
    "trimesh",
    "torch",
)


def cost(capture: Capture, spent_s: float) -> dict[str, Any]:
    """Seconds and megabytes so far, ``spent_s`` since the run began, the warm-up among them."""
    wall_s = spent_s - capture.warmup_s
    capture_s = capture.n_chirps * capture.radar.chirp_interval_s
    return {
        "stages": capture.stages.rounded(),
        "wall_s": round(wall_s, 4),
        "warmup_s": round(capture.warmup_s, 4),
        "capture_s": capture_s,
        "real_time_factor": round(wall_s / capture_s, 4),
        "peak_memory_mb": round(peak_memory_mb(), 1),
    }


def summary_of(
    capture: Capture,
    clouds: Clouds,
    parameters: Mapping[str, Any],
    seed: int,
    spent: Mapping[str, Any],
) -> dict[str, Any]:
    """The summary of a run with these ``parameters``, which has ``spent`` so much, as of `cost`."""
    with_watts = capture.radar.transmit_power_dbm is not None and parameters["spreading"]
    return {
        "parameters": dict(parameters),
        "seed": seed,
        "versions": {"python": platform.python_version(), **_versions()},
        "fidelity": parameters["fidelity"],
        "variant": capture.model.variant,
        "occlusion": "mitsuba" if _traces(capture) else "none",
        **spent,
        "windows": len(capture.windows),
        "chirps": capture.n_chirps,
        "detections": clouds.rdt.n_voxels,
        "rdt_triangles": clouds.rdt.n_triangles,
        "rdt_points": len(clouds.rdt.points),
        "xyz_points": len(clouds.spatial.points),
        "xyz_points_found": clouds.n_spatial,
        "echo_power_m2": capture.survey.power if capture.survey.visible else 0.0,
        "part_power_m2": capture.survey.part_power,
        "noise_power_m2": capture.noise.power,
        **({"watts": _watts(capture)} if with_watts else {}),
        "limits": _limits(capture),
        **({"modelled": capture.model.account()} if isinstance(capture.model, Accountable) else {}),
        **({"room": capture.inside.account} if capture.inside else {}),
    }


def _traces(capture: Capture) -> bool:
    """Whether the model asks Mitsuba, or would if a part came near a line of sight."""
    return capture.model.variant is not None or getattr(capture.model, "traces", False)


def plain(value: object) -> Any:
    """For JSON, which knows no scalars of NumPy: seeds from ``np.arange``, a model's account."""
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"a {type(value).__name__} has no place in summary.json")


def _watts(capture: Capture) -> dict[str, float]:
    """Powers per IF sample in watts, as received at the antenna's port: the radar equation's."""
    scale = capture.radar.watts_per_m2
    return {
        "watts_per_m2": scale,
        "echo_power_w": capture.survey.power * scale,
        "noise_power_w": capture.noise.power * scale,
    }


def _limits(capture: Capture) -> list[dict[str, Any]]:
    of_room = capture.inside.limits if capture.inside else ()
    limits: list[dict[str, Any]] = [
        dataclasses.asdict(limit) for limit in (*capture.survey.limits, *of_room)
    ]
    if not capture.survey.visible:
        limits += [
            {"name": "nobody_visible", "share": 0.0, "message": message}
            for message in capture.warned
        ]
    return limits


def _versions() -> dict[str, str]:
    found = {}
    for name in _VERSIONS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found | {"cores": str(os.cpu_count())}
