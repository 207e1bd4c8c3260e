"""The take that exists as C3D and as AMC, CMU 135_02: the distance between the joints of both.

The offsets of `rtradar.motion.formats.markers` were fitted to the first half of the take; only the
second half is judged, frame by frame. It is the same person, so how well the offsets fit others is
not measured here. The median of each joint must stay within 6 cm. The distance that 99 % of the
frames keep, the largest distance with its frame, and the fraction beyond 6 cm are reported.

Two causes are measured. One is the median distance of the AMC's joint from the one point that fits
it best in the axes of three markers of its segment ("rigid"): no point that is fixed to the markers
can be nearer. The other is how far the knee is bent, in all frames and in those beyond the limit;
and the largest acceleration of a hand in the AMC and of its marker, which shows jumps of one frame.

Then markers are removed for 0.1 s, one at a time, and the error of the interpolation is measured.
Last, without --quick, both go through radar and detector: the distance of their RDT clouds of a
kick, in bins, beside that of two samplings of one of them.

    RTRADAR_MOCAP=/path/to/mocap python validation/measurements/c3d_take.py [--quick] [--json FILE]
"""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.motion.formats.markers import LONGEST_GAP_S, NEEDED, bridged, chosen, read_c3d
from rtradar.motion.skeleton import NODES, to_nodes
from rtradar.pipeline.compared import chamfer
from rtradar.validate.rows import Row, judged, main, reported

LIMIT_CM = 6.0

MM = 1e-3  # unit of the take, whose axes are those of the world

# Three markers of the segment to which a joint belongs; on the left side where there are two.
SEGMENTS = {
    "root": "LFWT RFWT LBWT",
    "hip": "LFWT RFWT LBWT",
    "lowerback": "LFWT RFWT LBWT",
    "upperback": "C7 T10 STRN",
    "thorax": "C7 T10 STRN",
    "neck": "C7 T10 STRN",
    "head": "LFHD RFHD LBHD",
    "shoulder": "C7 T10 STRN",
    "knee": "LKNE LANK LTOE",
    "ankle": "LKNE LANK LTOE",
    "toe": "LANK LHEE LTOE",
    "elbow": "LSHO LELB LUPA",
    "wrist": "LELB LWRA LWRB",
    "hand": "LFIN LWRA LWRB",
}


def folder() -> Path:
    named = os.environ.get("RTRADAR_MOCAP")
    if not named:
        raise SystemExit("RTRADAR_MOCAP is not set: it names the folder of real recordings")
    return Path(named) / "cmu"


def rigid(
    points: NDArray[np.float64],
    a: NDArray[np.float64],
    b: NDArray[np.float64],
    c: NDArray[np.float64],
) -> float:
    """Median distance [cm] of points (frame, 3) from their median position in markers' axes."""
    x = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    z = np.cross(x, c - a)
    z /= np.linalg.norm(z, axis=1, keepdims=True)
    local = np.einsum("tij,tj->ti", np.stack([x, np.cross(z, x), z], axis=1), points - a)
    return float(np.median(np.linalg.norm(local - np.median(local, axis=0), axis=1))) * 100


def segment_of(node: str) -> list[str]:
    """Three markers of the segment to which a node belongs."""
    names = SEGMENTS[node[2:] if node[1] == "_" else node].split()
    on_the_left = node.startswith("r_") and all(name[0] == "L" for name in names)
    return [f"R{name[1:]}" if on_the_left else name for name in names]


def joints(take: Path, amc: rt.Motion, c3d: rt.Motion) -> list[Row]:
    half = len(c3d.root_positions) // 2
    names = tuple(sorted({marker for node in NODES for marker in segment_of(node)}))
    seen = chosen(read_c3d(take), names).positions[half:] * MM
    marker = {name: seen[:, k] for k, name in enumerate(names)}
    apart = np.linalg.norm(c3d.positions - amc.positions, axis=2)[half:] * 100
    rows = []
    for j, node in enumerate(NODES):
        own = [marker[name] for name in segment_of(node)]
        distance = apart[:, j]
        rows += [
            judged(node, "median", "cm", float(np.median(distance)), LIMIT_CM, cases=len(distance)),
            reported(node, "99 %", "cm", float(np.quantile(distance, 0.99))),
            reported(
                node,
                f"largest, frame {half + 1 + int(np.argmax(distance))}",
                "cm",
                float(distance.max()),
            ),
            reported(
                node,
                f"fraction beyond {LIMIT_CM:g} cm",
                "%",
                float((distance > LIMIT_CM).mean()) * 100,
            ),
            reported(node, "rigid", "cm", rigid(amc.positions[half:, j], *own)),
        ]
    return rows


def reasons(take: Path, amc: rt.Motion, c3d: rt.Motion) -> list[Row]:
    half = len(c3d.root_positions) // 2
    knuckles = chosen(read_c3d(take), ("LFIN", "RFIN")).positions[half:] * MM
    rows = []
    for side, key in enumerate("lr"):
        hip, knee, ankle, hand = (
            amc.positions[half:, NODES.index(f"{key}_{name}")]
            for name in ("hip", "knee", "ankle", "hand")
        )
        thigh, shank = (
            bone / np.linalg.norm(bone, axis=1, keepdims=True)
            for bone in (knee - hip, ankle - knee)
        )
        bend = np.degrees(np.arccos(np.clip(np.sum(thigh * shank, axis=1), -1, 1)))
        beyond = (
            np.linalg.norm(c3d.positions[half:, NODES.index(f"{key}_knee")] - knee, axis=1) * 100
            > LIMIT_CM
        )
        rows.append(reported(f"{key}_knee", "bend, median", "deg", float(np.median(bend))))
        if beyond.any():
            rows.append(
                reported(
                    f"{key}_knee",
                    "bend in frames beyond it, median",
                    "deg",
                    float(np.median(bend[beyond])),
                )
            )
        jumps = [
            float(np.linalg.norm(np.diff(path, 2, axis=0), axis=1).max()) * c3d.rate_hz**2
            for path in (hand, knuckles[:, side])
        ]
        rows.append(
            reported(
                f"{key}_hand",
                "largest acceleration, AMC beside marker",
                "m/s^2",
                jumps[0],
                reference=jumps[1],
            )
        )
    return rows


def gaps(take: Path) -> list[Row]:
    seen = chosen(read_c3d(take), NEEDED)
    longest = round(LONGEST_GAP_S * seen.rate_hz)
    rng = np.random.default_rng(0)
    errors = []
    for k in range(len(seen.names)):
        lost = seen.positions[:, k : k + 1].copy()
        begins = np.arange(30, len(lost) - 60, 60) + rng.integers(0, 30)
        for begin in begins:
            lost[begin : begin + longest] = np.nan
        hidden = np.isnan(lost[:, 0, 0])
        filled = bridged(seen._replace(names=(seen.names[k],), positions=lost))
        errors.append(np.linalg.norm(filled[hidden, 0] - seen.positions[hidden, k], axis=1))
    off = np.concatenate(errors)
    worst = seen.names[int(np.argmax([error.max() for error in errors]))]
    label = f"a marker lost for {LONGEST_GAP_S} s"
    return [
        reported(label, "median", "mm", float(np.median(off))),
        reported(label, "99 %", "mm", float(np.quantile(off, 0.99))),
        reported(label, f"largest, {worst}", "mm", float(off.max())),
    ]


def clouds(amc: rt.Motion, c3d: rt.Motion) -> list[Row]:
    radar = rt.Radar.preset("paper-12ghz")
    bins = (radar.frame_hop_s, radar.range_bin_m, radar.velocity_bin_mps)
    found = {}
    for name, motion, seed in (("AMC", amc, 0), ("C3D", c3d, 0), ("AMC again", amc, 1)):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", rt.ValidityWarning)  # feet faster than 7 m/s
            found[name] = rt.run(
                motion, radar, variant="cpu", start_s=11.0, duration_s=1.5, seed=seed
            ).points
    rows = [
        reported(
            "cloud of a kick", f"{name} from AMC", "bins", chamfer(found[name], found["AMC"], bins)
        )
        for name in ("C3D", "AMC again")
    ]
    for axis, (name, unit) in enumerate((("range", "m"), ("velocity", "m/s")), start=1):
        ours, other = (
            np.quantile(found[key][:, axis], [0.05, 0.5, 0.95]) for key in ("C3D", "AMC")
        )
        rows += [
            reported(
                "cloud of a kick",
                f"{name}, {share} of the points",
                unit,
                float(a),
                reference=float(b),
            )
            for share, a, b in zip(("5 %", "half", "95 %"), ours, other, strict=True)
        ]
    return rows


def compare(quick: bool) -> list[Row]:
    take = folder() / "135_02.c3d"
    c3d = rt.load_motion(take)
    amc = to_nodes(rt.load_motion(take.with_suffix(".amc"), skeleton=folder() / "135.asf"))
    return (
        joints(take, amc, c3d)
        + reasons(take, amc, c3d)
        + gaps(take)
        + ([] if quick else clouds(amc, c3d))
    )


if __name__ == "__main__":
    raise SystemExit(main(__doc__.splitlines()[0], compare))
