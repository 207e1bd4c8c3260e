"""How far the maps of two runs are from each other: whether a faster version gives what the one before it gave.

python validation/cost/same_maps.py BEFORE AFTER

BEFORE and AFTER are folders of `rtradar run`, of the same motion, radar, scene, model and seed. Told is the largest difference of
each map over its peak. Maps that only detected cells have (range_azimuth, range_elevation) change by all that a cell holds when
it comes to stand on the other side of its threshold: these are compared in the windows whose detections are the same.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import h5py
import numpy as np

_OF_DETECTIONS = ("range_azimuth", "range_elevation")
_LIMIT = 1e-5
"""float32 sums of tens of tones or of 96 channels are good to some 1e-6 of the largest."""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("before", type=Path, help="folder of a run")
    parser.add_argument("after", type=Path, help="folder of the same run by another version")
    options = parser.parse_args()
    worst = 0.0
    with (
        h5py.File(options.before / "maps.h5") as before,
        h5py.File(options.after / "maps.h5") as after,
    ):
        same = (before["detections"][:] == after["detections"][:]).all(axis=(1, 2))
        for name in (
            "range_doppler",
            "range_time",
            "spectrogram",
            *(name for name in _OF_DETECTIONS if name in before),
        ):
            one, other = before[name][:].astype(np.float64), after[name][:].astype(np.float64)
            peak = one.max()
            if name in _OF_DETECTIONS:
                one, other = one[same], other[same]
            difference = float(np.abs(one - other).max(initial=0.0) / peak)
            worst = max(worst, difference)
            print(f"{name:<16} {difference:.1e} of its peak")
        cells, all_cells = (
            int((before["detections"][:] != after["detections"][:]).sum()),
            int(before["detections"][:].sum()),
        )
        print(
            f"{'detections':<16} {cells} of {all_cells} differ, in {int((~same).sum())} of {len(same)} windows"
        )
    print(f"largest: {worst:.1e}, limit {_LIMIT:g}")
    return int(worst > _LIMIT)


if __name__ == "__main__":
    sys.exit(main())
