"""Breath and heart of people who hold still, read from frames of one cycle at 20 Hz.

A person sits before a board, or lies in a bed below one, for 60 s. The chest moves by a sine of the
breath and one of the heart; what `vital_signs` reads from the phase over the frames (``slow_time =
"capture"``) is held against these: both rates, and the amplitude of the breath times the cosine
between the chest's normal and the line of sight. The normal is that of the joints, across the
shoulders and the spine, at rest. The second harmonic of the way tells how straight the phase is
read. Who stands sways as slowly as a breath; what that does is reported.

    python validation/closed_forms/vital_signs.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator

import numpy as np

import rtradar as rt
from rtradar.process import range_spectrum, vital_signs
from rtradar.validate.rows import Row, judged, main, reported

BREATH_MM, BREATH_HZ, HEART_MM, HEART_HZ = 3.0, 0.25, 0.3, 1.2
FRAMES_HZ, SNR_DB = 20.0, 20.0
PLACES = {"sit,style=still": ((-1.2, 0.0, 1.0), 0.0), "lie,style=bed": ((0.3, 0.0, 2.0), -90.0)}
"""Where the radar is, and how far up it looks, for who sits and who lies."""

BOARDS = {"iwr6843": "60 GHz", "iwr1443": "77 GHz"}


def board(name: str, place: tuple[float, float, float], pitch_deg: float) -> rt.Radar:
    """A board whose frames have one cycle."""
    table = {
        "base": name,
        "chirps_per_frame": rt.Radar.preset(name).n_tx,
        "frame_period_s": 1 / FRAMES_HZ,
        "position_m": list(place),
        "pitch_deg": pitch_deg,
    }
    return rt.Radar.load(table)


def cosine(motion: rt.Motion, place: tuple[float, float, float]) -> float:
    """Cosine between the normal of the chest and the line to the radar, of who holds still."""
    joints = dict(zip(motion.joints, motion.at([0.0])[0][0], strict=True))
    across = joints["l_shoulder"] - joints["r_shoulder"]
    chest = (joints["lowerback"] + joints["thorax"]) / 2
    normal = np.cross(across, joints["thorax"] - joints["lowerback"])
    line = np.asarray(place) - chest
    return float(abs(normal @ line) / np.linalg.norm(normal) / np.linalg.norm(line))


def seen(
    motion: rt.Motion, radar: rt.Radar, level: str, duration_s: float
) -> tuple[rt.process.VitalSigns, float]:
    """What is read of a person, and the second harmonic of the breath over the first [dB]."""
    samples = rt.simulate(
        motion,
        radar,
        fidelity=level,
        duration_s=duration_s,
        snr_db=SNR_DB,
        slow_time="capture",
        breathing=rt.Breathing(BREATH_MM, BREATH_HZ, 0.0, HEART_MM, HEART_HZ),
    ).samples
    slow = radar.over_capture()
    found = vital_signs(range_spectrum(samples.values, slow), slow)
    columns = [np.ones(len(found.time_s)), found.time_s]
    for rate in (BREATH_HZ, 2 * BREATH_HZ, HEART_HZ):
        turned = 2 * np.pi * rate * found.time_s
        columns += [np.cos(turned), np.sin(turned)]
    fit = np.linalg.lstsq(np.column_stack(columns), found.way_m, rcond=None)[0]
    first, second = np.hypot(fit[2], fit[3]), np.hypot(fit[4], fit[5])
    return found, float(20 * np.log10(second / first))


def rows_of(
    name: str, posture: str, level: str, duration_s: float, *, still: bool = True
) -> Iterator[Row]:
    place, pitch_deg = PLACES.get(posture, PLACES["sit,style=still"])
    motion = rt.synthetic_motion(posture, duration_s=duration_s)
    found, harmonic_db = seen(motion, board(name, place, pitch_deg), level, duration_s)
    claim = f"{posture.partition(',')[0]}, {BOARDS[name]}, {level}"
    breath, heart = found.breath_hz / BREATH_HZ - 1, found.heart_hz / HEART_HZ - 1
    aim_m = 1e-3 * BREATH_MM * cosine(motion, place)
    if not still:
        yield reported(claim, "rate of the breath, off", "1", breath)
        yield reported(claim, "rate of the heart, off", "1", heart)
        yield reported(claim, "amplitude over that of the breath", "1", found.breath_m / aim_m)
        return
    # Rates: a tenth of what 60 s resolve would be 0.7 % of the breath.
    yield judged(
        claim, "rate of the breath", "1", abs(breath), 0.01, says="rate of the breath, 20 Hz"
    )
    yield judged(claim, "rate of the heart", "1", abs(heart), 0.02, says="rate of the heart, 20 Hz")
    # The specular point is not at the middle of the chest, where the normal is taken.
    says = "amplitude of the chest along the line of sight"
    yield judged(claim, says, "1", abs(found.breath_m / aim_m - 1), 0.02, says=says)
    says = "second harmonic of the way of the chest"
    yield judged(claim, says, "dB", max(harmonic_db, -100.0), -20.0, says=says)


def measure(quick: bool) -> list[Row]:
    warnings.simplefilter("ignore", rt.ValidityWarning)
    duration_s, levels = (30.0, ("analytic",)) if quick else (60.0, ("analytic", "specular"))
    rows = []
    for name in list(BOARDS)[: 1 if quick else 2]:
        for level in levels:
            for posture in PLACES:
                rows += rows_of(name, posture, level, duration_s)
    return [*rows, *rows_of("iwr6843", "stand", "analytic", duration_s, still=False)]


if __name__ == "__main__":
    sys.exit(main("Breath and heart over frames of one cycle", measure))
