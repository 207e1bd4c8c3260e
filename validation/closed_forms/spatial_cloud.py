"""Distance of the points of the spatial cloud from the body that they belong to.

The distance of each point is that to the nearest centre of a body part at any of five instants of
its frame. Points that are more than 0.3 m off belong to no part: they are side lobes of stronger
echoes in range and angle, noise, and echoes too fast for the radar. The figures are reported for
several levels, in decibels below a cell's highest peak, down to which further peaks are kept.

    python validation/closed_forms/spatial_cloud.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

import rtradar as rt
from rtradar.body import Body
from rtradar.motion import place
from rtradar.process import angles as peaks
from rtradar.validate.rows import Row, main, reported

FAR_M = 0.3


def measure(quick: bool) -> list[Row]:
    rows = []
    chosen = peaks.BELOW_HIGHEST_DB
    for activity in ("walk",) if quick else ("walk", "kick"):
        motion = rt.synthetic_motion(activity, seed=0, duration_s=1.0)
        body = Body.from_motion(place(motion))
        for below_db in (chosen,) if quick else (3.0, chosen, 10.0):
            peaks.BELOW_HIGHEST_DB = below_db
            with tempfile.TemporaryDirectory() as folder:
                rt.run(motion, rt.Radar.preset("paper-12ghz"), out=folder)
                cloud = dict(np.load(Path(folder, "cloud_xyz.npz")))
            distance = np.concatenate(
                [
                    from_body(body, time, cloud["points"][cloud["time"] == time])
                    for time in np.unique(cloud["time"])
                ]
            )
            far = distance > FAR_M
            claim = f"{activity}, peaks to {below_db:g} dB below the highest"
            rows.append(reported(claim, "points a second", "", len(distance) / motion.duration_s))
            rows.append(
                reported(
                    claim, "median distance to a part's centre", "m", float(np.median(distance))
                )
            )
            rows.append(
                reported(claim, "fraction of points more than 0.3 m off", "", float(far.mean()))
            )
            rows.append(
                reported(
                    claim,
                    "their fraction of the power",
                    "",
                    float(cloud["power"][far].sum() / cloud["power"].sum()),
                )
            )
    peaks.BELOW_HIGHEST_DB = chosen
    return rows


def from_body(body: Body, time: float, points: np.ndarray) -> np.ndarray:
    instants = np.clip(time + np.array([-0.05, -0.025, 0.0, 0.025, 0.05]), 0.0, body.duration_s)
    centres = body.at(instants).centres.reshape(-1, 3)
    return np.linalg.norm(points[:, None] - centres, axis=-1).min(axis=1)


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
