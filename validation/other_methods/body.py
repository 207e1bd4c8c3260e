"""`analytic` against `specular` on whole bodies: unoccluded parts differ by near-field spreading.

The far-field formula assumes plane wavefronts. The effect of their curvature is found here by
stationary phase: the path Tx-surface-Rx as a function of two parameters of the surface, its minimum
by Newton's method and its Hessian, both from differences of the path, give |F| =
2 sqrt(pi) cos(i) |dp/ds x dp/dt| / sqrt(det L'') for each Tx, Rx and part, and its spreading
1 / (R1 R2). No curvature and no wavefront matrix is written down, so nothing is shared with
`specular`. The near-field factor is the ratio of this to the same for plane waves, with the
spreading of the path to the point that these meet.

A standing person goes through `rtradar.compare`, and those parts are judged that it reports as
fully visible. Four activities are compared instant by instant. What is left between the two models
is occluded by other parts, and reported.

    python validation/other_methods/body.py [--quick] [--json FILE]
"""

from __future__ import annotations

import dataclasses
import sys
import tempfile
import warnings
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.motion import place
from rtradar.scatter import build_model
from rtradar.scatter.common.poses import keyframe_step
from rtradar.scatter.link_budget import link_budget, power_of_parts_alone
from rtradar.validate.rows import Row, judged, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import power_db

Array = NDArray[np.float64]
ACTIVITIES = ("walk", "kick", "punch", "jumping_jack")
TOLERANCE_DB = 0.1
VISIBLE = 1e-6
"""Fraction of its power alone that a part may lack and still be fully visible: rounding."""
STEP = 1e-4
FAR = 1e6  # distance of the source of a plane wave, over that of the radar


def path(points: Array, antennas: tuple[Array, Array]) -> Array:
    """Path Tx-point-Rx less that over the origin, without cancellation (...,) [m]."""
    total = np.zeros(points.shape[:-1])
    for antenna in antennas:
        lengths = np.linalg.norm(points - antenna, axis=-1) + np.linalg.norm(antenna, axis=-1)
        total = total + np.sum(points * (points - 2 * antenna), axis=-1) / lengths
    return total


def tangents(unit: Array) -> tuple[Array, Array]:
    helper = np.eye(3)[np.argmin(np.abs(unit), axis=-1)]
    east = np.cross(unit, helper)
    east /= np.linalg.norm(east, axis=-1, keepdims=True)
    return east, np.cross(unit, east)


def stationary(tx: Array, rx: Array, axes: Array) -> tuple[Array, Array]:
    """|F|^2 (n,) and specular point (n, 3) of ellipsoids about the origin for antennas (n, 3)."""

    def on_surface(unit: Array, s: float, t: float) -> Array:
        east, north = tangents(unit)
        moved = unit + s * east + t * north
        return np.asarray(moved / np.linalg.norm(moved, axis=-1, keepdims=True) * axes)

    unit = axes * (
        tx / np.linalg.norm(tx, axis=1, keepdims=True)
        + rx / np.linalg.norm(rx, axis=1, keepdims=True)
    )
    unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    for _ in range(40):
        f = {
            (i, j): path(on_surface(unit, i * STEP, j * STEP), (tx, rx))
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
        }
        slope_s, slope_t = (f[1, 0] - f[-1, 0]) / (2 * STEP), (f[0, 1] - f[0, -1]) / (2 * STEP)
        ss = (f[1, 0] - 2 * f[0, 0] + f[-1, 0]) / STEP**2
        tt = (f[0, 1] - 2 * f[0, 0] + f[0, -1]) / STEP**2
        st = (f[1, 1] - f[1, -1] - f[-1, 1] + f[-1, -1]) / (4 * STEP**2)
        determinant = ss * tt - st * st
        step = (
            np.stack([st * slope_t - tt * slope_s, st * slope_s - ss * slope_t], axis=-1)
            / determinant[:, None]
        )
        size = np.linalg.norm(step, axis=1, keepdims=True)
        step *= 0.3 / np.maximum(size, 0.3)
        east, north = tangents(unit)
        unit = unit + step[:, :1] * east + step[:, 1:] * north
        unit /= np.linalg.norm(unit, axis=1, keepdims=True)
    # Differences of the path are accurate to 1e-9 of it, by which Newton's last steps vary.
    assert size.max() < 1e-5, size.max()
    east, north = tangents(unit)
    across = np.cross(axes * east, axes * north)
    area = np.linalg.norm(across, axis=1)
    normal = across / area[:, None]
    normal *= np.sign(np.sum(normal * unit * axes, axis=1, keepdims=True))
    point = unit * axes
    cosine = np.zeros(len(point))
    for antenna in (tx, rx):
        way = antenna - point
        cosine += np.sum(normal * way, axis=1) / np.linalg.norm(way, axis=1) / 2
    return 4 * np.pi * (cosine * area) ** 2 / determinant, point


def near_and_far(radar: rt.Radar, body: rt.Body, n_chirps: int) -> tuple[Array, Array]:
    """Power (time, part) [m^2] of each part by stationary phase, near by and for plane waves."""
    chirps = np.arange(0, n_chirps, keyframe_step(radar))
    poses = body.at(np.minimum((chirps + 0.5) * radar.chirp_duration_s, body.duration_s))
    index = radar.tx_of_chirp(chirps)
    tx, rx = radar.tx[index], radar.rx[radar.rx_of_tx[index]]
    times, parts, receivers = len(chirps), len(body.part_names), radar.n_rx
    shape = (times, receivers, parts, 3)
    local = [
        np.einsum(
            "tpji,trpj->trpi",
            poses.frames,
            np.broadcast_to(antenna, shape) - poses.centres[:, None],
        ).reshape(-1, 3)
        for antenna in (tx[:, None, None], rx[:, :, None])
    ]
    axes = np.broadcast_to(poses.semi_axes, shape).reshape(-1, 3)
    powers = []
    for farther in (1.0, FAR):
        size, point = stationary(local[0] * farther, local[1] * farther, axes)
        ranges = [np.linalg.norm(antenna - point, axis=1) for antenna in local]
        powers.append((size / (ranges[0] * ranges[1]) ** 2).reshape(shape[:3]).mean(axis=1))
    return powers[0], powers[1]


def still(motion: rt.Motion, frame: int) -> rt.Motion:
    """A person who stands as in one frame of the motion, for a second."""
    return dataclasses.replace(
        motion,
        name=f"{motion.name}, standing",
        root_positions=np.repeat(motion.root_positions[frame : frame + 1], 101, axis=0),
        rotations=np.repeat(motion.rotations[frame : frame + 1], 101, axis=0),
        rate_hz=100.0,
        first_frame_s=0.0,
        length_s=None,
    )


def compared_rows(preset: str) -> Iterator[Row]:
    """Each part of a standing person that no channel misses, by `compare`."""
    radar = rt.Radar.preset(preset)
    motion, duration = still(rt.synthetic_motion("jumping_jack", seed=0), 0), 0.15
    with tempfile.TemporaryDirectory() as folder:
        found = rt.compare(
            motion,
            radar,
            out=Path(folder, "out"),
            fidelities=("analytic", "specular"),
            duration_s=duration,
        )
    by_fidelity = found.summary["fidelities"]
    body = rt.Body.from_motion(place(motion, duration_s=duration))
    n_chirps = radar.n_tx * int(body.duration_s / radar.cycle_duration_s * (1 + 1e-12))
    near, far = near_and_far(radar, body, n_chirps)
    factor = dict(zip(body.part_names, near.mean(axis=0) / far.mean(axis=0), strict=True))
    claim = f"compare, standing, {preset}"
    hidden = by_fidelity["specular"]["part_occluded_share"]
    seen = [part for part, fraction in hidden.items() if abs(fraction) < VISIBLE]
    for part in seen:
        ratio = (
            by_fidelity["specular"]["part_power_m2"][part]
            / by_fidelity["analytic"]["part_power_m2"][part]
        )
        expected = float(power_db(factor[part]))
        quantity = f"{part}: specular over analytic, ref. near field"
        says = (
            "`compare` of `analytic` with `specular`, standing: "
            "fully visible parts, echo power corrected for the near field"
        )
        yield judged(
            claim,
            quantity,
            "dB",
            float(power_db(ratio)),
            TOLERANCE_DB,
            reference=expected,
            says=says,
        )
    says = "`compare` of `analytic` with `specular`, standing: parts that are occluded, of 21"
    yield judged(
        claim,
        "parts that are occluded, of 21",
        "",
        len(hidden) - len(seen),
        len(hidden) - 1,
        says=says,
    )


def activity_rows(activity: str, preset: str, duration_s: float) -> Iterator[Row]:
    """Parts that no channel misses at each instant, and the effect of the others on frame power."""
    radar = rt.Radar.preset(preset)
    body = rt.Body.from_motion(
        place(rt.synthetic_motion(activity, seed=0), start_s=0.5, duration_s=duration_s)
    )
    n_chirps = radar.n_tx * int(body.duration_s / radar.cycle_duration_s * (1 + 1e-12))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rt.ValidityWarning)
        found = {
            fidelity: link_budget(build_model(fidelity, radar, body), radar, body, n_chirps)
            for fidelity in ("analytic", "specular")
        }
    near, far = near_and_far(radar, body, n_chirps)
    analytic, specular = (found[fidelity].power_at for fidelity in ("analytic", "specular"))
    alone = power_of_parts_alone(partial(build_model, "specular", radar), radar, body, n_chirps)
    hidden = 1 - specular / alone
    seen = np.abs(hidden) < VISIBLE
    claim = f"{activity}, {preset}, {duration_s:g} s"
    error = power_db(specular[seen] / analytic[seen]) - power_db(near[seen] / far[seen])
    count = f"{seen.sum()} of {seen.size} parts and instants"
    quantity = f"fully visible, {count}: worst |dB| after the near field"
    says = "`analytic` against `specular`, four activities: the same of visible parts, each instant"
    worst = float(abs(error).max())
    yield judged(claim, quantity, "dB", worst, TOLERANCE_DB, says=says, cases=int(seen.sum()))
    yield reported(claim, "the same, rms", "dB", float(np.sqrt(np.mean(error**2))))
    yield reported(
        claim, "near field of these, mean", "dB", float(power_db(near[seen] / far[seen]).mean())
    )
    yield reported(
        claim, "near field of these, most", "dB", float(power_db(near[seen] / far[seen]).min())
    )
    # The frame powers of the models differ by the near field of all parts and occlusion of some.
    whole = power_db(specular.sum(axis=1) / analytic.sum(axis=1))
    bent = power_db((analytic * near / far).sum(axis=1) / analytic.sum(axis=1))
    yield reported(claim, "frame power, specular over analytic, mean", "dB", float(whole.mean()))
    yield reported(claim, "of that, near field", "dB", float(bent.mean()))
    yield reported(claim, "of that, occlusion", "dB", float((whole - bent).mean()))
    left = power_db(specular.sum(axis=1) / (analytic * near / far * (1 - hidden)).sum(axis=1))
    yield reported(
        claim, "left after occluded fractions, rms", "dB", float(np.sqrt(np.mean(left**2)))
    )


def measure(quick: bool) -> list[Row]:
    presets = ("paper-12ghz",) if quick else ("paper-12ghz", "paper-77ghz")
    rows: list[Row] = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rt.ValidityWarning)
        for preset in presets:
            rows += compared_rows(preset)
            for activity in ACTIVITIES[:2] if quick else ACTIVITIES:
                rows += activity_rows(activity, preset, 0.3 if quick else 1.0)
    return rows


if __name__ == "__main__":
    sys.exit(
        main("`analytic` against `specular` on whole bodies, with near-field spreading.", measure)
    )
