"""A walk in free space, a living room and a corridor: clutter, its removal, and the cost of a room.

Each case is a whole run of `specular` at 12 GHz with noise 20 dB below the person in free space.
The truth is the person alone: a cell is a target where a run in free space without noise exceeds
the mean noise power of the cell by 13 dB. In the room the person's ghosts are therefore false
alarms, and what walls and furniture occlude of the person is missed. The cloud is compared with
that of free space by the Chamfer distance in bins of range, velocity and hop. The cost is the wall
time after warm-up over that of free space in the same run of this script; twice is wanted, and not
reached.

    python validation/closed_forms/rooms.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from detection_score import DetectionScore, cell_noise_power, score, target_cells

import rtradar as rt
from rtradar.pipeline.compare import chamfer
from rtradar.process import CLUTTER_REMOVALS
from rtradar.validate.rows import Row, main, reported

ACTIVITY, MARGIN_DB = "walk", 13.0
ROOMS = ("living-room", "corridor")


def scored(out: Path, truth: np.ndarray[Any, Any]) -> DetectionScore:
    """Score all frames of a run against the truth (time, range, velocity)."""
    with h5py.File(out / "maps.h5") as maps:
        return score(maps["detections"][:].astype(bool), truth)


def measure(quick: bool) -> list[Row]:
    rows: list[Row] = []
    duration_s = 0.5 if quick else 3.0
    rooms, removals = (ROOMS[:1], ("none", "mean")) if quick else (ROOMS, CLUTTER_REMOVALS)
    motion = rt.synthetic_motion(ACTIVITY, seed=0, duration_s=duration_s)
    with tempfile.TemporaryDirectory() as folder:
        for name in ("free-space", *rooms):
            # The scene may place the radar; free space is then seen from the same position.
            scene = rt.Scene.load(name)
            radar = scene.place(rt.Radar.preset("paper-12ghz"))
            free = Path(folder, name, "free")
            quiet = Path(folder, name, "quiet")
            alone = rt.run(motion, radar, out=free, heading_deg=scene.heading_deg)
            rt.run(motion, radar, out=quiet, snr_db=np.inf, heading_deg=scene.heading_deg)
            noise = alone.summary["noise_power_m2"]
            with h5py.File(quiet / "maps.h5") as maps:
                truth = target_cells(
                    maps["range_doppler"][:],
                    cell_noise_power(noise, radar, radar.n_channels),
                    MARGIN_DB,
                )
            if name == "free-space":
                rows += detection_rows("free space, none", scored(free, truth))
                continue
            for removal in removals:
                out = Path(folder, name, removal)
                found = rt.run(
                    motion, radar, scene, out=out, noise_power_m2=noise, clutter_removal=removal
                )
                claim = f"{name}, {removal}"
                if removal == "none":
                    clutter = found.summary["room"]["clutter"]
                    rows.append(
                        reported(claim, "signal to clutter", "dB", clutter["signal_to_clutter_db"])
                    )
                cost = found.summary["wall_s"] / alone.summary["wall_s"]
                rows.append(reported(claim, "cost over free space", "", cost))
                once = found.summary["stages"]["room"] / alone.summary["wall_s"]
                rows.append(
                    reported(
                        claim, "of it once a capture: tracing the room, choosing paths", "", once
                    )
                )
                rows += detection_rows(claim, scored(out, truth))
                if len(found.points) and len(alone.points):
                    scale = np.array([radar.frame_hop_s, radar.range_bin_m, radar.velocity_bin_mps])
                    rows.append(
                        reported(
                            claim,
                            "RDT cloud to that of free space",
                            "bins",
                            chamfer(found.points, alone.points, scale),
                        )
                    )
    return rows


def detection_rows(claim: str, found: DetectionScore) -> list[Row]:
    return [
        reported(claim, "CFAR precision", "%", 100 * found.precision),
        reported(claim, "CFAR missing rate", "%", 100 * found.missing_rate),
    ]


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
