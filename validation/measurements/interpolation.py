"""How well each method of interpolating rotations predicts frames that were left out.

Every second frame of each real recording is left out (120 Hz to 60 Hz, BVH 30 Hz to 15 Hz), the
rest is interpolated, and the frames left out are compared: rotation error of every bone [deg] and
position error of every joint with the true root [mm], both as rms and maximum, over recordings.
Two dangers follow: the largest step of angular velocity at a frame relative to the typical change
over one frame (smoothness; slerp has steps there), and the effect of a spike of a single frame on
its neighbours. Last, the effect on smooth motion as a radar sees it: a limb of 0.8 m that swings
1.5 rad at 2 Hz and a root that moves up and down by 2 cm at 2 Hz, both sampled at 120 Hz. Their
position error is the phase of a 77 GHz echo relative to a carrier of 0 dB. All of that phase
repeats with the frames, so it is the power of false Doppler lines.

Without RTRADAR_MOCAP, the folder of recordings, only the last two are measured.

    RTRADAR_MOCAP=folder python validation/measurements/interpolation.py [--quick] [--json FILE]
"""

from __future__ import annotations

import itertools
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import Akima1DInterpolator, CubicSpline, PchipInterpolator
from scipy.spatial.transform import Rotation, RotationSpline, Slerp

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.motion.formats import load_motion
from rtradar.motion.motion import Motion
from rtradar.motion.quaternions import quaternion_rotate, sign_continuous
from rtradar.validate.rows import Row, leave_out, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import rms

Array = NDArray[np.float64]
Method = Callable[[Array, Array, Array], Array]

CASES = {
    "HDM05 kicks": [
        ("hdm05", f"HDM_bd_kickLFront1Reps_{k:03d}_120.amc", "HDM_bd.asf") for k in (1, 4, 5)
    ]
    + [("hdm05", "HDM_bk_kickLFront1Reps_011_120.amc", "HDM_bk.asf")],
    "CMU walks": [("cmu", "02_01.amc", "02.asf"), ("cmu", "07_05.amc", "07.asf")],
    "CMU jacks, punches": [
        ("cmu", "14_14.amc", "14_reconstructed.asf"),
        ("cmu", "143_23.amc", "143_reconstructed.asf"),
    ],
    "CMU 135_02 (spikes)": [("cmu", "135_02.amc", "135.asf")],
    "BVH 30 Hz": [
        ("bandai_namco_CC-BY-NC", f"dataset-1_{name}_normal_001.bvh", None)
        for name in ("kick", "punch", "walk")
    ],
}


def _components(spline: Callable[[Array, Array], Callable[[Array], Array]]) -> Method:
    def method(times: Array, quaternions: Array, at: Array) -> Array:
        values = spline(times, sign_continuous(quaternions))(at)
        return np.asarray(values / np.linalg.norm(values, axis=-1, keepdims=True))

    return method


def _per_joint(kind: type[Slerp] | type[RotationSpline]) -> Method:
    def method(times: Array, quaternions: Array, at: Array) -> Array:
        joints = range(quaternions.shape[1])
        return np.stack(
            [kind(times, Rotation.from_quat(quaternions[:, j]))(at).as_quat() for j in joints],
            axis=1,
        )

    return method


METHODS: dict[str, Method] = {
    "slerp": _per_joint(Slerp),
    "pchip": _components(PchipInterpolator),
    "makima": _components(lambda t, q: Akima1DInterpolator(t, q, method="makima")),
    "cubic": _components(CubicSpline),
    "RotationSpline": _per_joint(RotationSpline),
}


def angle_deg(first: Array, second: Array) -> Array:
    """Angle between rotations (..., 4) [deg], from the chord, which is exact for small angles."""
    chord = np.minimum(
        np.linalg.norm(first - second, axis=-1), np.linalg.norm(first + second, axis=-1)
    )
    return np.asarray(np.degrees(4 * np.arcsin(np.minimum(chord / 2, 1.0))))


def place(motion: Motion, quaternions: Array) -> Array:
    """Positions of the joints relative to the root (frame, joint, 3) [m]."""
    places = quaternion_rotate(quaternions, motion.offsets)
    places[:, 0] = 0.0
    for joint, parent in enumerate(motion.parents[1:], start=1):
        places[:, joint] += places[:, parent]
    return places


def held_out(motion: Motion, method: Method) -> tuple[Array, Array]:
    """Rotation errors [deg] and position errors [mm] at the frames left out."""
    keep = motion.rotations[::2]
    times = np.arange(len(keep)) * 2.0
    at = np.arange(1.0, times[-1], 2.0)
    truth = motion.rotations[1 : 2 * len(at) : 2]
    guess = method(times, keep, at)
    return angle_deg(guess, truth), 1e3 * np.linalg.norm(
        place(motion, guess) - place(motion, truth), axis=-1
    )


def velocity_step(motion: Motion, method: Method) -> float:
    """Rms step of the angular velocity at a frame, over its rms change in one frame interval."""
    times = np.arange(len(motion.rotations), dtype=np.float64)
    inner = times[2:-2]
    d = 1e-4
    samples = [method(times, motion.rotations, inner + k * d) for k in (-2, -1, 0, 1, 2)]
    speeds = [
        (
            Rotation.from_quat(b.reshape(-1, 4)) * Rotation.from_quat(a.reshape(-1, 4)).inv()
        ).as_rotvec()
        / d
        for a, b in itertools.pairwise(samples)
    ]
    step = speeds[2] - speeds[1] - (speeds[1] - speeds[0] + speeds[3] - speeds[2]) / 2
    mean = speeds[1].reshape(len(inner), -1, 3)
    return float(np.sqrt(np.mean(step**2)) / np.sqrt(np.mean(np.diff(mean, axis=0) ** 2)))


def spike_reach(method: Method) -> Array:
    """Largest angle [deg] in intervals 1 to 4 beside a spike of 60 deg in one frame of a bone."""
    rotations = np.tile([0.0, 0.0, 0.0, 1.0], (41, 1, 1))
    rotations[20, 0] = Rotation.from_euler("x", 60, degrees=True).as_quat()
    times = np.arange(41.0)
    reach = []
    for first in range(21, 25):
        inside = method(times, rotations, first + np.linspace(0, 1, 101))
        reach.append(angle_deg(inside[:, 0], np.array([0.0, 0.0, 0.0, 1.0])).max())
    return np.array(reach)


def error_db(error_m: Array) -> float:
    """Rms phase that a range error causes on a 77 GHz echo, in dB of its carrier."""
    wavenumber = 2 * np.pi * 77e9 / SPEED_OF_LIGHT_MPS
    return float(20 * np.log10(np.sqrt(np.mean((2 * wavenumber * error_m) ** 2))))


def smooth_limb(method: Method) -> float:
    """False Doppler power [dB] of the tip of a swinging limb."""
    times, at = np.arange(241) / 120, np.linspace(0.1, 1.9, 20001)

    def swing(t: Array) -> Array:
        return Rotation.from_euler("y", (0.75 * np.sin(4 * np.pi * t))[:, None]).as_quat()[:, None]

    limb = np.array([0.0, 0.0, -0.8])
    return error_db(
        (
            quaternion_rotate(method(times, swing(times), at), limb)
            - quaternion_rotate(swing(at), limb)
        )[..., 0]
    )


def smooth_root(spline: Callable[[Array, Array], Callable[[Array], Array]]) -> float:
    """False Doppler power [dB] of a root that moves up and down, seen from above."""
    times, at = np.arange(241) / 120, np.linspace(0.1, 1.9, 20001)
    return error_db(
        spline(times, 0.01 * np.sin(4 * np.pi * times))(at) - 0.01 * np.sin(4 * np.pi * at)
    )


def recorded_rows(folder: Path, quick: bool) -> Iterator[Row]:
    for case, files in CASES.items():
        motions = [
            load_motion(folder / d / f, folder / d / s if s else None)
            for d, f, s in (files[:1] if quick else files)
        ]
        for name, method in METHODS.items():
            errors = [held_out(motion, method) for motion in motions]
            turn, shift = (np.concatenate([pair[k].ravel() for pair in errors]) for k in (0, 1))
            yield reported(f"{case}, {name}", "rotations, rms", "deg", rms(turn))
            yield reported(f"{case}, {name}", "rotations, largest", "deg", float(turn.max()))
            yield reported(f"{case}, {name}", "places, rms", "mm", rms(shift))
            yield reported(f"{case}, {name}", "places, largest", "mm", float(shift.max()))
    kick = load_motion(
        folder / "hdm05/HDM_bd_kickLFront1Reps_001_120.amc", folder / "hdm05/HDM_bd.asf"
    )
    for name, method in METHODS.items():
        yield reported(
            f"kick, {name}",
            "step of angular velocity at a frame, relative",
            "",
            velocity_step(kick, method),
        )


def measure(quick: bool) -> list[Row]:
    rows: list[Row] = []
    for name, method in METHODS.items():
        for interval, reach in enumerate(spike_reach(method), start=1):
            rows.append(
                reported(
                    f"spike of 60 deg, {name}",
                    f"left in interval {interval} beside it",
                    "deg",
                    float(reach),
                )
            )
        rows.append(
            reported(f"smooth limb, 77 GHz, {name}", "false Doppler", "dB", smooth_limb(method))
        )
    for name, spline in (("pchip", PchipInterpolator), ("cubic", CubicSpline)):
        rows.append(
            reported(f"bobbing root, 77 GHz, {name}", "false Doppler", "dB", smooth_root(spline))
        )
    folder = os.environ.get("RTRADAR_MOCAP")
    if folder:
        rows += recorded_rows(Path(folder), quick)
    else:
        leave_out("recordings", "RTRADAR_MOCAP, the folder of them")
    return rows


if __name__ == "__main__":
    sys.exit(main("How well interpolation of rotations predicts frames left out.", measure))
