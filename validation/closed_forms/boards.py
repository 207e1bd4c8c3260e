"""Radars that come along as files: within the datasheets of their chips, and like their data sets.

within    sweep, slope, sample rate and chirp of each board over the limit of its datasheet
beam      half-power width in azimuth against the 15 degrees that TI states for 8 columns of
          virtual elements (files of its demos, guide SWRU585), within a degree: 2 / 8 radians is
          14.3, and -3 dB is another width
corner    a trihedral of 0.1 m that recedes, by `specular`, through range-Doppler map and angles:
          each off by at most a tenth of a bin, or of the beam at broadside; `any_radar.py` reads
          points back through the same radars
radhar    range and velocity bins against those of the recorded points, and, where the recording is
          at hand (RTRADAR_MEASURED), of all of them
mars      the same: the grid of an FFT of 128 for 80 samples, and the step of the velocities

`DATASHEETS` is what is known of each chip, with its source; None: not known.
"""

from __future__ import annotations

import dataclasses
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

import rtradar as rt
from rtradar.process import angle, power_map, range_spectrum
from rtradar.system.files import shipped_folder
from rtradar.validate.rows import Row, judged, main

sys.path.insert(0, str(Path(__file__).resolve().parent))
from moving_objects import echoes_of

RANGE_M, AZIMUTH_DEG, SPEED_MPS = 4.1, 15.0, 1.3


@dataclass(frozen=True)
class Datasheet:
    """Limits of a chip: band of a sweep [GHz], slope [MHz/us], complex rate [MHz], chirp [us].

    ``beam_deg`` is the angular resolution in azimuth that is stated.
    """

    source: str
    band_ghz: tuple[float, float]
    slope_mhz_per_us: float | None
    rate_mhz: float
    chirp_us: float | None
    beam_deg: float | None


DATASHEETS = {
    "iwr1443": Datasheet("SWRS211C", (77, 81), 100, 18.75, 15, 15),
    "iwr1642": Datasheet("SWRS212D", (77, 81), 100, 6.25, 15, None),
    "awr1642": Datasheet("SWRS203C", (77, 81), 100, 6.25, 15, None),
    "iwr1843": Datasheet("SWRS228B", (77, 81), 100, 12.5, 15, 15),
    "awr1843": Datasheet("SWRS228B", (77, 81), 100, 12.5, 15, 15),
    "awr2243": Datasheet("SWRS223D", (76, 81), 266, 22.5, None, 15),
    "awr2243-cascade": Datasheet("SWRS223D", (76, 81), 266, 22.5, None, None),
    "iwr6843": Datasheet("SWRS219F", (60, 64), 250, 12.5, 13, 15),
    "iwr6843ods": Datasheet("SWRS219F", (60, 64), 250, 12.5, 13, None),
    "iwr6843aop": Datasheet("SWRS219F", (60, 64), 250, 12.5, 13, None),
    "iwrl6432": Datasheet("SWRS276A", (57, 64), None, 6.25, None, None),
    "awr2944": Datasheet("SWRS273D", (76, 81), None, 18.75, None, None),
}
"""Of the 77 GHz chips that say so a sweep lies in 76 to 78 or 77 to 81 GHz."""


def within_rows(name: str, sheet: Datasheet) -> Iterator[Row]:
    radar = rt.Radar.preset(name)
    stop_ghz = (radar.start_frequency_hz + radar.bandwidth_hz) / 1e9
    used = {
        "start of the band over that of the sweep": sheet.band_ghz[0]
        / (radar.start_frequency_hz / 1e9),
        "end of the sweep over that of the band": stop_ghz / sheet.band_ghz[1],
        "sample rate over the largest": radar.sample_rate_hz / 1e6 / sheet.rate_mhz,
    }
    if sheet.slope_mhz_per_us is not None:
        used["slope over the largest"] = radar.slope_hz_per_s / 1e12 / sheet.slope_mhz_per_us
    if sheet.chirp_us is not None:
        used["shortest chirp over the chirp"] = sheet.chirp_us / (radar.chirp_period_s * 1e6)
    says = "waveform of each preset of a board over the limits of its chip's datasheet"
    for what, ratio in used.items():
        yield judged(f"{name} ({sheet.source})", what, "", ratio, 1.0, says=says)


def beam_row(name: str, beam_deg: float) -> Row:
    width = rt.Radar.preset(name).azimuth_resolution_deg
    says = "beam width in azimuth of each preset of a board against what TI states"
    return judged(name, "beam width in azimuth", "deg", width, 1.0, reference=beam_deg, says=says)


def middle(power: NDArray[np.floating]) -> float:
    """Centroid [bins] of the lobe about the highest bin, on an axis that is cyclic."""
    bins = power.argmax() + np.arange(-5, 6)
    weights = power[bins % len(power)]
    return float(weights @ bins / weights.sum())


def corner_rows(name: str) -> Iterator[Row]:
    count = 32 * rt.Radar.preset(name).n_tx
    radar = dataclasses.replace(
        rt.Radar.preset(name), position_m=(0.0, 0.0, 1.0), chirps_per_frame=count
    )
    way = np.array([np.cos(np.radians(AZIMUTH_DEG)), np.sin(np.radians(AZIMUTH_DEG)), 0.0])
    times = radar.chirp_times(count)
    mesh = trimesh.load(shipped_folder("meshes") / "trihedral.ply", process=False)
    mesh.apply_scale(0.25)
    corner = rt.Object(
        "corner",
        mesh,
        "perfect-conductor",
        position_m=tuple([0, 0, 1] + way * (RANGE_M - SPEED_MPS * times.mean())),
        yaw_deg=180 + AZIMUTH_DEG,
        motion=rt.FollowingPath(velocity_mps=tuple(SPEED_MPS * way)),
    )
    x = rt.signal.synthesize(echoes_of(radar, corner, np.arange(count)), radar, times)
    cycles = radar.cycles_per_frame
    spectra = range_spectrum(x, radar).reshape(cycles, radar.n_tx, radar.n_rx, -1)
    power = power_map(spectra, radar)
    azimuth, elevation = np.degrees(angle(x, radar, RANGE_M, SPEED_MPS))
    step = SPEED_MPS / radar.velocity_bin_mps
    off = {
        "range [bins]": middle(power.sum(axis=1)) - RANGE_M / radar.range_bin_m,
        "velocity [bins]": middle(power.sum(axis=0)) - cycles // 2 - step,
        "azimuth [beams]": (azimuth - AZIMUTH_DEG) / radar.azimuth_resolution_deg,
        "elevation [beams]": elevation / radar.elevation_resolution_deg,
    }
    for what, error in off.items():
        if np.isnan(error) and name in ("iwr1642", "awr1642"):
            continue  # their antennas stand on one line, and measure no elevation
        says = f"a corner reflector reads back through each board: {what.split()[0]}"
        yield judged(f"{name}, corner reflector", what, "", abs(float(error)), 0.1, says=says)


def data_set_rows() -> Iterator[Row]:
    radhar, mars = rt.Radar.preset("radhar"), rt.Radar.preset("mars")
    says = "bins of the presets of RadHAR and MARS against those of their recorded points"
    grid = mars.range_bin_m * mars.samples_per_chirp / 128
    known = {
        "radhar": (0.043577, 0.6147, 5e-7, 5e-5),
        "mars": (0.02929, 0.356, 3e-5, 5e-4),  # the chip computes MARS's places to a thousandth
    }
    found = {"radhar": (radhar.range_bin_m, radhar), "mars": (grid, mars)}
    for name, (range_m, step_mps, range_limit, step_limit) in known.items():
        bin_m, radar = found[name]
        yield judged(name, "range bin", "m", bin_m, range_limit, reference=range_m, says=says)
        step = radar.velocity_bin_mps
        yield judged(name, "velocity bin", "m/s", step, step_limit, reference=step_mps, says=says)
    largest = {
        "range": (radhar.max_range_m, "m", 126 * 0.043577, 1e-4),
        "velocity": (radhar.max_velocity_mps, "m/s", 4.917, 5e-4),
    }
    for what, (value, unit, limit, tolerance) in largest.items():
        yield judged(
            "radhar", f"largest {what}", unit, value, tolerance, reference=limit, says=says
        )
    folder = Path(os.environ.get("RTRADAR_MEASURED", ""), "radhar")
    if "RTRADAR_MEASURED" in os.environ and folder.is_dir():
        points = np.concatenate([np.load(file)["points"] for file in sorted(folder.glob("*.npz"))])
        ranges, velocities = points[:, 3].astype(float), np.abs(points[:, 4].astype(float))
        numbers = np.rint(ranges / 0.0436)
        good = (numbers > 0) & (numbers < 200)
        range_m = float((ranges[good] @ numbers[good]) / (numbers[good] @ numbers[good]))
        step_mps = float(velocities[velocities > 0].min())
        # Points are in float32, whose step at 5 m is 5e-7.
        for what, unit, ours, recorded in (
            ("range bin of all points", "m", radhar.range_bin_m, range_m),
            ("least velocity of all points", "m/s", radhar.velocity_bin_mps, step_mps),
        ):
            yield judged("radhar", what, unit, ours, 5e-7, reference=recorded, says=says)


def measure(quick: bool) -> list[Row]:
    rows = [row for name, sheet in DATASHEETS.items() for row in within_rows(name, sheet)]
    known = {name: sheet.beam_deg for name, sheet in DATASHEETS.items() if sheet.beam_deg}
    rows += [beam_row(name, beam_deg) for name, beam_deg in known.items()]
    for name in list(DATASHEETS)[-1:] if quick else DATASHEETS:
        rows += corner_rows(name)
    return [*rows, *data_set_rows()]


if __name__ == "__main__":
    sys.exit(main("Radars that come along as files", measure))
