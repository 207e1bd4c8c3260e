"""Clouds that a board recorded (RadHAR) beside simulated ones of the same kind.

The data set RadHAR (Singh et al., mmNets 2019) has clouds of an IWR1443BOOST, 20 s of people who
box, jump, squat and walk before it. Here synthetic actors do so before the preset ``radhar``, with
noise in watts and ``detector="ti-oob"``. Nothing is fitted but the place, for which the files give
the distance. Judged are the grids of the points, on which both must lie:

velocity  whole steps of the preset's velocity bin
azimuth   whole numbers of 1/32 of the sine (64 bins of the chip's FFT)
range     places x, y, z are 240 / 256 of the column "range": the chip pads 240 samples to 256 bins,
          and the ROS driver counts with 240, so that places are right and the column is 1/15 too
          long, as is the preset's bin, which is that column's

neighbours  hardly any cell has a point in the next one over Doppler, along which peaks are grouped

Reported, because the people, their places and the room are others: cells with a neighbour in range,
points in a frame that move, spread of distance, of speed and of level. As the recorded profile has
it, clutter is not removed, CFAR is over range alone (``cfarCfg 0 2 8 4 3 0 768``: the smaller of
both sides, 8 noise and 4 guard cells, 9 dB), and peaks are grouped over Doppler alone
(``peakGrouping 1 0 1``). Points that stand still are the room in the files, and are left out in
both. Levels are taken for magnitudes, of which the driver keeps 10 log10(1 + level). The profile is
``cfg/archive/1443_3d_original.cfg`` of ti_mmwave_rospkg; modes and threshold are those of TI's
mmWave SDK user guide (mode 2 is CFAR_CASO, 512 dB / 6).

Without the folder only the grids of simulated points are judged.

    RTRADAR_MEASURED=folder python validation/measurements/radhar.py [--quick] [--json FILE]
"""

from __future__ import annotations

import dataclasses
import os
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.validate.rows import Row, judged, leave_out, main, reported

ACTIVITIES = {  # of the files, and of actors: activity, place [m] and heading [deg]
    "boxing": ("punch", (1.5, 0.0), 0.0),
    "jack": ("jumping_jack", (1.9, 0.0), 0.0),
    "walk": ("walk", (1.6, 0.0), 90.0),
}


class Cloud(NamedTuple):
    """Points that move, seen from the radar.

    ``beside`` are the fractions of their cells that have a neighbour with a point in the same
    frame, over range and over Doppler.
    """

    places: NDArray[np.float64]
    speed: NDArray[np.float64]
    level_db: NDArray[np.float64]
    frames: int
    beside: tuple[float, float]
    in_a_row: float  # still cells that follow each other over range, median

    @property
    def distance(self) -> NDArray[np.float64]:
        return np.asarray(np.linalg.norm(self.places, axis=1))


def recorded(activity: str) -> tuple[Cloud, NDArray[np.float64]]:
    """Points of an activity that move, and distance over column "range" of all far ones."""
    parts, frames, ratios, codes, still = [], 0, [], [], []
    for file in sorted(Path(os.environ["RTRADAR_MEASURED"], "radhar").glob(f"*{activity}*.npz")):
        with np.load(file) as stored:
            points, frame = stored["points"].astype(np.float64), stored["frame"].astype(np.int64)
        good = (points[:, 3] > 0) & (points[:, 3] < 6)  # two have a garbled number
        points, frame = points[good], frame[good] - frame.min() + frames
        frames += len(np.unique(frame))
        every = codes_of(frame, points[:, 3], points[:, 4])
        codes.append(every[points[:, 4] != 0])
        still.append(every[points[:, 4] == 0])
        far = points[points[:, 3] > 2]
        ratios.append(np.linalg.norm(far[:, :3], axis=1) / far[:, 3])
        parts.append(points[points[:, 4] != 0])
    found = np.concatenate(parts)
    level_db = 20 * np.log10(10 ** (found[:, 7] / 10) - 1)
    beside, row = with_neighbours(np.concatenate(codes)), in_a_row(np.concatenate(still))
    return Cloud(found[:, :3], found[:, 4], level_db, frames, beside, row), np.concatenate(ratios)


def codes_of(
    frame: NDArray[np.int64], range_m: NDArray[np.float64], speed: NDArray[np.float64]
) -> NDArray[np.int64]:
    """One number for each cell: neighbours in Doppler differ by 1, in range by 100."""
    radar = rt.Radar.preset("radhar")
    cell, doppler = (
        np.rint(values / step).astype(np.int64)
        for values, step in ((range_m, radar.range_bin_m), (speed, radar.velocity_bin_mps))
    )
    return np.asarray((frame * 1000 + cell) * 100 + doppler + 50)


def with_neighbours(codes: NDArray[np.int64]) -> tuple[float, float]:
    """Fractions of cells that have a neighbour in range, and in Doppler."""
    only = np.unique(codes)
    over_range, over_doppler = (
        float((np.isin(only - step, only) | np.isin(only + step, only)).mean()) for step in (100, 1)
    )
    return over_range, over_doppler


def in_a_row(codes: NDArray[np.int64]) -> float:
    """How many still cells follow each other over range, median."""
    only = np.unique(codes)
    ends = np.flatnonzero(np.diff(only, append=only[-1] + 1) != 100)
    return float(np.median(np.diff(ends, prepend=-1)))


def simulated(activity: str, seconds: float) -> Cloud:
    name, place, heading = ACTIVITIES[activity]
    radar = dataclasses.replace(rt.Radar.preset("radhar"), position_m=(0.0, 0.0, 1.0))
    motion = rt.synthetic_motion(name, seed=0, duration_s=seconds)
    person = rt.Person(motion, position_m=place, heading_deg=heading)
    result = rt.run(
        person,
        radar,
        fidelity="specular",
        snr_db="physical",
        detector="ti-oob",
    )
    cloud = result.spatial
    moving = cloud.velocity != 0
    frame = np.unique(cloud.time, return_inverse=True)[1].astype(np.int64)
    distance = np.linalg.norm(cloud.points - radar.position_m, axis=1)
    codes = codes_of(frame, distance, cloud.velocity)
    return Cloud(
        cloud.points[moving] - radar.position_m,
        cloud.velocity[moving],
        10 * np.log10(cloud.power[moving]),
        int(result.summary["windows"]),
        with_neighbours(codes[moving]),
        in_a_row(codes[~moving]),
    )


def grid_rows(name: str, cloud: Cloud) -> Iterator[Row]:
    step = rt.Radar.preset("radhar").velocity_bin_mps
    off = np.abs(cloud.speed / step - np.rint(cloud.speed / step)).max()
    says = "recorded and simulated points lie on one grid: velocity, in bins"
    # The driver computes in float32, and rounds the bandwidth to 1 kHz.
    yield judged(name, "farthest from the grid of velocity", "bins", float(off), 1e-3, says=says)
    sines = 32 * cloud.places[:, 1] / cloud.distance
    off = np.quantile(np.abs(sines - np.rint(sines)), 0.99)
    says = "recorded and simulated points lie on one grid: azimuth, in 1/32 of the sine"
    # The chip rounds places to 1/256 m: at 0.8 m, 1/256 / sqrt(12) of each coordinate is 0.045,
    # and half a step, which 1 % may have, 0.08.
    yield judged(name, "99 % from the grid of azimuth", "1/32", float(off), 0.08, says=says)
    over_range, over_doppler = cloud.beside
    yield reported(name, "moving cells with a neighbour in range", "1", over_range)
    yield reported(name, "still cells in a row over range, median", "1", cloud.in_a_row)
    says = "recorded and simulated peaks are grouped over Doppler: cells with a neighbour there"
    # The chip lists a second direction of a cell at the end, and compares rounded levels, so that
    # two of the same level may stay.
    yield judged(name, "cells with a neighbour in Doppler", "1", over_doppler, 0.05, says=says)


def figures(cloud: Cloud) -> dict[tuple[str, str], float]:
    """Return figures of a cloud by their names and units."""
    size = np.abs(cloud.speed)
    return {
        ("distance, median", "m"): float(np.median(cloud.distance)),
        ("distance, 5 to 95 %", "m"): width(cloud.distance),
        ("speed, mean", "m/s"): float(size.mean()),
        ("points in the lowest bin of speed", "1"): float((size < 1.5 * size.min()).mean()),
        ("level, 5 to 95 %", "dB"): width(cloud.level_db),
        ("moving points a frame", "1"): len(size) / cloud.frames,
    }


def width(values: NDArray[np.float64]) -> float:
    return float(np.ptp(np.quantile(values, (0.05, 0.95))))


def beside_rows(activity: str, ours: Cloud, theirs: Cloud) -> Iterator[Row]:
    """What is comparable, but not the same: ours, and the recorded figure as the reference."""
    (found, expected) = (figures(cloud) for cloud in (ours, theirs))
    for (quantity, unit), value in found.items():
        yield reported(activity, quantity, unit, value, reference=expected[quantity, unit])


def measure(quick: bool) -> list[Row]:
    warnings.simplefilter("ignore", rt.ValidityWarning)
    rows: list[Row] = []
    at_hand = Path(os.environ.get("RTRADAR_MEASURED", ""), "radhar").is_dir()
    if not at_hand:
        leave_out("recorded clouds", "RTRADAR_MEASURED, the folder of radhar/")
    for activity in list(ACTIVITIES)[:1] if quick else ACTIVITIES:
        ours = simulated(activity, 2.0 if quick else 8.0)
        rows += grid_rows(f"simulated {activity}", ours)
        if not at_hand:
            continue
        theirs, ratios = recorded(activity)
        says = "distance of recorded places over the column range, 240 bins where the chip has 256"
        # Places are to 1/256 m, beyond 2 m to 0.1 %; c is 3e8 m/s in one of both, 0.07 %.
        rows.append(
            judged(
                f"recorded {activity}", "distance over column range", "1", float(np.median(ratios)),
                2e-3, reference=240 / 256, says=says,
            )
        )  # fmt: skip
        rows += grid_rows(f"recorded {activity}", theirs)
        rows += beside_rows(activity, ours, theirs)
    return rows


if __name__ == "__main__":
    sys.exit(main("Recorded clouds of RadHAR beside simulated ones", measure))
