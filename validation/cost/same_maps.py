"""Difference between the maps of two versions' runs: does a faster version give the same result?

    python validation/cost/same_maps.py BEFORE AFTER [BEFORE AFTER ...] [--limit 1e-6]

Each BEFORE and AFTER is the folder of a run by `rtradar run`, both of the same motion, radar,
scene, model and seed. The largest difference of each map is printed, over the peak of the map. Maps
that only detected cells have (range_azimuth, range_elevation) change by the whole value of a cell
that crosses its threshold, so they are compared in the frames whose detections are the same.

The limit of 1e-6 of the peak is what a rewrite that keeps the physics must meet: maps are stored in
float32, whose rounding is 6e-8 of a value, and sums of some tens of echoes or 96 channels in
another order add up to a few times that. A larger difference is a change of method, for which a
larger limit is given by hand.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import h5py
import numpy as np

MAPS = ("range_doppler", "range_time", "spectrogram")
OF_DETECTIONS = ("range_azimuth", "range_elevation")
LIMIT = 1e-6


def largest_difference(before_folder: Path, after_folder: Path) -> float:
    """Print the differences of all maps of two runs, and return the largest over its map's peak."""
    worst = 0.0
    with (
        h5py.File(before_folder / "maps.h5") as before,
        h5py.File(after_folder / "maps.h5") as after,
    ):
        different = before["detections"][:] != after["detections"][:]
        same = ~different.any(axis=(1, 2))
        for name in (*MAPS, *(name for name in OF_DETECTIONS if name in before)):
            one, other = before[name][:].astype(np.float64), after[name][:].astype(np.float64)
            peak = one.max()
            if name in OF_DETECTIONS:
                one, other = one[same], other[same]
            difference = float(np.abs(one - other).max(initial=0.0) / peak)
            worst = max(worst, difference)
            print(f"{name:<16} {difference:.1e} of its peak")
        cells, frames = int(different.sum()), int((~same).sum())
        of_cells = int(before["detections"][:].sum())
        print(f"{'detections':<16} {cells} of {of_cells} differ, in {frames} of {len(same)} frames")
    return worst


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "folders", type=Path, nargs="+", metavar="BEFORE AFTER", help="folders of runs, in pairs"
    )
    parser.add_argument(
        "--limit",
        type=float,
        default=LIMIT,
        help="largest difference that is allowed, over the peak of the map (default: 1e-6)",
    )
    options = parser.parse_args()
    if len(options.folders) % 2:
        parser.error("the folders must come in pairs: BEFORE AFTER [BEFORE AFTER ...]")
    worst = 0.0
    for before, after in zip(options.folders[::2], options.folders[1::2], strict=True):
        print(f"{before} and {after}")
        worst = max(worst, largest_difference(before, after))
    print(f"largest: {worst:.1e}, limit {options.limit:g}")
    return int(not worst <= options.limit)


if __name__ == "__main__":
    sys.exit(main())
