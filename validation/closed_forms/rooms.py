"""A walk in free space, a living room and a corridor: clutter, its removal, and the cost of a room.

Each case is a whole run of `specular` at 12 GHz with noise 20 dB below the person in free space,
with isotropic antennas and with patches (`helpers.patch_antenna`), which look ahead.
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
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from detection_score import DetectionScore, cell_noise_power, score, target_cells

import rtradar as rt
from rtradar.pipeline.compared import chamfer
from rtradar.process import CLUTTER_REMOVALS
from rtradar.validate.rows import Row, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import patch_antenna

ACTIVITY, MARGIN_DB = "walk", 13.0
ROOMS = ("living-room", "corridor")


def scored(out: Path, truth: np.ndarray[Any, Any]) -> DetectionScore:
    """Score all frames of a run against the truth (time, range, velocity)."""
    with h5py.File(out / "maps.h5") as maps:
        return score(maps["detections"][:].astype(bool), truth)


def measure(quick: bool) -> list[Row]:
    rows: list[Row] = []
    duration_s = 0.15 if quick else 3.0
    rooms, removals = (ROOMS[:1], ("none", "mean")) if quick else (ROOMS, CLUTTER_REMOVALS)
    motion = rt.synthetic_motion(ACTIVITY, seed=0, duration_s=duration_s)
    with tempfile.TemporaryDirectory() as folder:
        for name in ("free-space", *rooms):
            for antenna, said in ((None, name), (patch_antenna(), f"{name}, patch"))[
                : 1 + (not quick)
            ]:
                radar = replace(
                    rt.Radar.preset("paper-12ghz"), tx_antenna=antenna, rx_antenna=antenna
                )
                scene, out = rt.Scene.load(name), Path(folder, said)
                rows += scene_rows(said, motion, radar, scene, removals, out)
    return rows


def scene_rows(
    said: str,
    motion: rt.Motion,
    radar: rt.Radar,
    scene: rt.Scene,
    removals: Sequence[str],
    folder: Path,
) -> Iterator[Row]:
    """Rows of one scene, by each removal of clutter, beside free space with the same antennas."""
    # The scene may place the radar; free space is then seen from the same position.
    radar = scene.place(radar)
    free, quiet = folder / "free", folder / "quiet"
    alone = rt.run(motion, radar, out=free, heading_deg=scene.heading_deg)
    silent = {"snr_db": np.inf}
    rt.run(motion, radar, out=quiet, heading_deg=scene.heading_deg, **silent)
    noise = alone.summary["noise_power_m2"]
    with h5py.File(quiet / "maps.h5") as maps:
        truth = target_cells(
            maps["range_doppler"][:], cell_noise_power(noise, radar, radar.n_channels), MARGIN_DB
        )
    if scene.name == "free-space":
        yield from detection_rows(f"{said}, none", scored(free, truth))
        return
    for removal in removals:
        out = folder / removal
        found = rt.run(motion, radar, scene, out=out, noise_power_m2=noise, clutter_removal=removal)
        claim = f"{said}, {removal}"
        if removal == "none":
            clutter = found.summary["room"]["clutter"]
            yield reported(claim, "signal to clutter", "dB", clutter["signal_to_clutter_db"])
        cost = found.summary["wall_s"] / alone.summary["wall_s"]
        yield reported(claim, "cost over free space", "", cost)
        once = found.summary["stages"]["room"] / alone.summary["wall_s"]
        yield reported(claim, "of it once a capture: tracing the room, choosing paths", "", once)
        yield from detection_rows(claim, scored(out, truth))
        if len(found.points) and len(alone.points):
            scale = np.array([radar.frame_hop_s, radar.range_bin_m, radar.velocity_bin_mps])
            distance = chamfer(found.points, alone.points, scale)
            yield reported(claim, "RDT cloud to that of free space", "bins", distance)


def detection_rows(claim: str, found: DetectionScore) -> list[Row]:
    return [
        reported(claim, "CFAR precision", "%", 100 * found.precision),
        reported(claim, "CFAR missing rate", "%", 100 * found.missing_rate),
    ]


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
