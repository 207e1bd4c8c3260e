"""Extremes of a run: motion, radar and processing."""

from __future__ import annotations

import dataclasses
import tempfile
import warnings
from pathlib import Path

import numpy as np
from extreme_cases import (
    TRACED,
    ball,
    chain,
    collector,
    motion,
    refused,
    small_radar,
    spectrum,
    warned,
)

import rtradar as rt
import rtradar.body

CASES, case = collector()


# -- motion ----------------------------------------------------------------------------------------


@case("0 m/s", "all power at Doppler 0 and its window's two neighbours")
def _() -> str:
    power = (np.abs(spectrum(small_radar(), ball()).values) ** 2).sum(axis=(0, 2))
    middle = len(power) // 2
    beside = 1 - power[middle - 1 : middle + 2].sum() / power.sum()
    assert abs(beside) < 1e-12, beside
    return f"{abs(beside):.0e} of it elsewhere"


@case("100 m/s", "a warning of motion inside a chirp; finite")
def _() -> str:
    body = ball(speed=100.0)
    found, said = warned(
        lambda: spectrum(small_radar(chirp_duration_s=500e-6), body, "specular"), "inside one chirp"
    )
    assert np.isfinite(found.values).all()
    return f"warned: {said}"


@case("100 m/s, chirps of 12.5 us", "the known alias, to a bin")
def _() -> str:
    radar = small_radar(
        chirp_duration_s=12.5e-6, tx_y=1, frame_duration_s=0.01, samples_per_chirp=256
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rt.ValidityWarning)
        found = spectrum(radar, ball(speed=100.0, place=(-0.5, 1.0, 1.0)))
    power = (np.abs(found.values) ** 2).sum(axis=(0, 2))
    read = float(np.sum(found.velocity * power) / power.sum())
    expected = (100.0 + radar.max_velocity_mps) % (
        2 * radar.max_velocity_mps
    ) - radar.max_velocity_mps
    assert abs(read - expected) < radar.velocity_bin_mps, (read, expected)
    return f"{read:.2f} m/s, the alias is {expected:.2f} m/s"


@case("one frame", "its pose at time 0; the chain refuses it")
def _() -> str:
    whole = motion()
    one = dataclasses.replace(
        whole,
        root_positions=whole.root_positions[:1],
        rotations=whole.rotations[:1],
        first_frame_s=0.0,
        length_s=None,
    )
    assert np.isfinite(rt.Body.from_motion(one).at([0.0]).centres).all()
    return refused(lambda: chain(what=one, duration_s=None), "no whole frame")


@case("NaN in the motion", "refused")
def _() -> str:
    roots = motion().root_positions.copy()
    roots[3, 1] = np.nan
    return refused(lambda: dataclasses.replace(motion(), root_positions=roots), "NaN")


@case("rotations that are none", "refused")
def _() -> str:
    return refused(
        lambda: dataclasses.replace(motion(), rotations=motion().rotations * 0), "unit quaternions"
    )


@case("one time asked for twice, and times out of order", "the same poses")
def _() -> str:
    body = rt.Body.from_motion(motion())
    found, straight = body.at([0.3, 0.1, 0.3]), body.at([0.1, 0.3])
    assert np.array_equal(found.centres, straight.centres[[1, 0, 1]])
    return "the same to the last bit"


BVH = """HIERARCHY
ROOT Hips
{{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  End Site
  {{
    OFFSET 0 10 0
  }}
}}
MOTION
Frames: 2
Frame Time: {time}
0 0 0 0 0 0
0 0 0 0 0 {last}
"""


def bvh(time: str, last: str) -> rt.Motion:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "m.bvh")
        path.write_text(BVH.format(time=time, last=last))
        return rt.load_motion(path)


@case("a recording whose frames all have one time", "refused")
def _() -> str:
    return refused(lambda: bvh("0", "0"), "[Ff]rame [Tt]ime")


@case("a recording with NaN", "refused, with the line")
def _() -> str:
    return refused(lambda: bvh("0.01", "nan"), r"(?i)line 1\d.*nan|nan.*line 1\d")


# -- radar and processing --------------------------------------------------------------------------


@case("one Tx, one Rx", "finite, without angles")
def _() -> str:
    result, _ = chain(small_radar(tx_y=1, rx_y=1, chirp_duration_s=500e-6), fidelity="specular")
    assert result.summary["detections"] > 0
    assert result.summary["xyz_points"] == 0
    return f"{result.summary['detections']} detections, no point in the room"


@case("one chirp a frame", "finite: one Doppler bin")
def _() -> str:
    radar = small_radar(tx_y=1, chirp_duration_s=20e-3, frame_duration_s=20e-3)
    result, said = chain(radar)
    return f"{result.summary['windows']} windows, {result.summary['detections']} detections" + (
        f"; {said[0]}" if said else ""
    )


@case("one sample a chirp", "the person is beyond the range of one bin: refused")
def _() -> str:
    return refused(lambda: chain(small_radar(samples_per_chirp=1)), "never within the range")


@case("one sample a chirp, bins of 15 m", "finite: one range bin")
def _() -> str:
    result, said = chain(small_radar(samples_per_chirp=1, bandwidth_hz=10e6))
    return f"{result.summary['windows']} windows, {result.summary['detections']} detections" + (
        f"; {said[0]}" if said else ""
    )


@case(
    "every model: one Tx, one Rx, one chirp, one sample, 0 and 100 m/s",
    "finite echoes and spectrum",
)
def _() -> str:
    radars = [
        small_radar(tx_y=1, rx_y=1, samples_per_chirp=1, bandwidth_hz=10e6),
        small_radar(tx_y=1, chirp_duration_s=50e-3),
        small_radar(tx_y=2, rx_y=1, chirp_duration_s=1e-3),
    ]
    for fidelity in ("analytic", *TRACED, "reference"):
        for radar in radars:
            for speed in (0.0, 100.0):
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", rt.ValidityWarning)
                    values = spectrum(
                        radar, ball(speed=speed, radius=0.1, place=(-2.5, 0.0, 1.0)), fidelity
                    ).values
                assert np.isfinite(values).all(), (fidelity, radar, speed)
                assert np.abs(values).max() > 0, (fidelity, radar, speed)
    return "finite, and not empty"


@case("SNR of -60 dB", "finite; noise alone, or a warning that nothing was detected")
def _() -> str:
    result, said = chain(snr_db=-60.0)
    assert result.summary["detections"] < 20, result.summary["detections"]
    return f"{result.summary['detections']} detections" + (f"; {said[-1]}" if said else "")


@case("SNR of infinity", "no noise at all")
def _() -> str:
    result, _ = chain(snr_db=np.inf)
    assert result.summary["noise_power_m2"] == 0
    assert result.summary["detections"] > 0
    return f"{result.summary['detections']} detections"


@case("SNR of NaN or -infinity", "refused")
def _() -> str:
    refused(lambda: chain(snr_db=np.nan), "snr_db")
    return refused(lambda: chain(snr_db=-np.inf), "snr_db")


@case("recording and frames that do not divide", "whole cycles, windows on cycle boundaries")
def _() -> str:
    radar = small_radar(chirp_duration_s=237e-6, frame_duration_s=0.0473, frame_hop_s=0.0131)
    result, _ = chain(radar, duration_s=0.1239)
    cycles = int(0.1239 / (2 * 237e-6))
    starts = radar.window_starts(2 * cycles)
    assert result.summary["chirps"] == 2 * cycles
    assert result.summary["windows"] == len(starts)
    assert starts[-1] + radar.cycles_per_frame <= cycles
    return f"{cycles} cycles, {len(starts)} windows"
