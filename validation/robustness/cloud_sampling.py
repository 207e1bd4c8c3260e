"""Distance between the RDT clouds of two seeds of one run, which differ by noise and sampling.

python validation/robustness/cloud_sampling.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import tempfile

from scipy.spatial import KDTree

import rtradar as rt
from rtradar.validate.rows import Row, main, reported


def measure(quick: bool) -> list[Row]:
    radar = rt.Radar.preset("paper-12ghz")
    bins = (radar.frame_hop_s, radar.range_bin_m, radar.velocity_bin_mps)
    rows = []
    for activity in ("walk",) if quick else ("walk", "jumping_jack"):
        motion = rt.synthetic_motion(activity, seed=0, duration_s=1.0 if quick else 3.0)
        clouds = []
        for seed in (0, 1):
            with tempfile.TemporaryDirectory() as folder:
                clouds.append(
                    rt.run(motion, radar, out=folder, fidelity="analytic", seed=seed).points / bins
                )
        there, back = (
            KDTree(other).query(cloud)[0].mean() for cloud, other in (clouds, clouds[::-1])
        )
        rows.append(
            reported(
                f"{activity}, two seeds",
                "Chamfer distance of RDT clouds",
                "bins",
                float(there + back) / 2,
            )
        )
    return rows


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
