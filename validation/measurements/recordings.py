"""Real recordings through the whole chain, with two models and both radars; prints a table.

RTRADAR_MOCAP=folder python validation/measurements/recordings.py [--out out/recordings]
"""

from __future__ import annotations

import argparse
import os
import warnings
from pathlib import Path

import rtradar as rt

# file, skeleton, activity, start [s], duration [s]
RECORDINGS = [
    ("hdm05/HDM_bd_kickLFront1Reps_001_120.amc", "hdm05/HDM_bd.asf", "kick", 0.0, None),
    ("hdm05/HDM_bk_sneak2StepsLStart_004_120.amc", "hdm05/HDM_bk.asf", "sneaking walk", 0.0, None),
    ("cmu/07_05.amc", "cmu/07.asf", "walk", 0.5, 3.0),
    ("cmu/135_04.amc", "cmu/135.asf", "kick", 2.5, 2.0),
    ("cmu/143_23.amc", "cmu/143_reconstructed.asf", "punch", 0.25, 2.0),
    ("cmu/13_29.amc", "cmu/13_reconstructed.asf", "jumping jack", 0.5, 2.0),
    ("bandai_namco_CC-BY-NC/dataset-2_walk_normal_001.bvh", None, "walk", 2.0, 3.0),
    ("bandai_namco_CC-BY-NC/dataset-1_kick_normal_001.bvh", None, "kick", 1.0, 2.0),
    ("bandai_namco_CC-BY-NC/dataset-1_punch_normal_001.bvh", None, "punch", 1.5, 2.0),
]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--radar", action="append", choices=("paper-12ghz", "paper-77ghz"))
    parser.add_argument("--only", default="", help="a part of the file name")
    options = parser.parse_args()
    folder = os.environ.get("RTRADAR_MOCAP")
    if not folder:
        raise SystemExit("RTRADAR_MOCAP is not set: it names the folder of real recordings")
    print(
        f"{'recording':34} {'activity':14} {'radar':12} {'model':9} {'points':>6} "
        f"{'detections':>10} {'wall s':>7} {'capture s':>9} {'MB':>6}"
    )
    for file, skeleton, activity, start_s, duration_s in RECORDINGS:
        if options.only not in file:
            continue
        path = Path(folder, file)
        motion = rt.load_motion(path, skeleton=Path(folder, skeleton) if skeleton else None)
        for radar in options.radar or ("paper-12ghz", "paper-77ghz"):
            for fidelity in ("analytic", "specular"):
                with warnings.catch_warnings(record=True) as caught:
                    warnings.simplefilter("always")
                    result = rt.run(
                        motion,
                        rt.Radar.preset(radar),
                        out=options.out / f"{path.stem}-{radar}-{fidelity}",
                        fidelity=fidelity,
                        start_s=start_s,
                        duration_s=duration_s,
                    )
                said = result.summary
                print(
                    f"{path.stem[:34]:34} {activity:14} {radar:12} {fidelity:9} "
                    f"{said['rdt_points']:6} {said['detections']:10} "
                    f"{said['wall_s']:7.1f} {said['capture_s']:9.2f} {said['peak_memory_mb']:6.0f} "
                    + "; ".join(str(warning.message) for warning in caught),
                    flush=True,
                )


if __name__ == "__main__":
    main()
