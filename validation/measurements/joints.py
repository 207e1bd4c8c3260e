"""Joint positions read as motions: one take reduced to each set of joints, and real recordings.

The take CMU 135_02 (AMC, 120 Hz) is reduced to the joints of each set that is understood, which
stand where the origin of the set has them by its recordings, written as ``.npz`` and read back. The
limbs' joints, which all skeletons have, and the nodes of the trunk, which each skeleton has
elsewhere, are compared with those of the AMC. First at 120 Hz, then as recorded: Kinect at 30 Hz
and uneven times, with the jitter of the recordings in each coordinate (4 mm by v1, 8 mm by v2);
MHAD at 24 Hz; HumanML3D at 20 Hz. The limits are 1.5 cm for limbs at 120 Hz, for lines between
joints that are no bone of the AMC change their length by 1 cm, and the low-pass of a camera stands
between; and 2.5 cm as recorded, for 8 mm in each coordinate are 1.4 cm. Trunk nodes may be 11 cm
off, the length of the bones between them. Speeds are compared in medians and at their peaks, which
a low-pass and few frames lower.

Then a kick of it goes through radar and spectrogram: the velocities that 5, 50 and 95 % of the
power lie below, in each column, from both; the limit is 0.3 m/s in the median, two velocity bins.

With RTRADAR_JOINTS, the folder of recordings, all are read, warnings being errors. Centres of mass
of the jumps of Berkeley MHAD must fall with 9.81 m/s^2 within 3 %, which is what 24 frames a second
and the masses of segments (Winter 2009) allow; the left hip must be on the left of where toes
point, and children of Kinder-Gator as tall, relative to its adults, as the height of their heads
says, within 5 %.

    RTRADAR_MOCAP=folder RTRADAR_JOINTS=folder python validation/measurements/joints.py [--quick]
"""

from __future__ import annotations

import dataclasses
import os
import tempfile
import warnings
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.motion.reading import FASTEST_M_S
from rtradar.motion.skeleton import NODES, to_nodes
from rtradar.validate.rows import Row, judged, leave_out, main, reported

Array = NDArray[np.float64]

LIMBS = [
    f"{side}_{node}"
    for side in "lr"
    for node in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
]
TRUNK = ["root", "lowerback", "upperback", "thorax", "neck", "head"]
ENDS = [f"{side}_{node}" for side in "lr" for node in ("toe", "hand")]

_KINECT = (
    "hip{s}=@hipjoint knee{s}=@femur ankle{s}=@tibia foot{s}=@foot "
    "shoulder{s}=@clavicle elbow{s}=@humerus wrist{s}=@wrist hand{s}=@hand"
)
# Each joint of a set, and the joint of ASF, or the two on either side of it, where it stands.
SETS = {
    "Kinect v1": (
        "hipcenter=root spine=lowerback shouldercenter=lowerneck head=head",
        _KINECT,
        30.0,
        0.004,
    ),
    "Kinect v2": (
        "spine_base=lhipjoint,rhipjoint spine_mid=upperback spine_shoulder=lowerneck "
        "neck=upperneck head=head",
        _KINECT,
        30.0,
        0.008,
    ),
    "Berkeley MHAD": (
        "hips=lhipjoint,rhipjoint spine=root spine1=lowerback spine2=upperback neck=lowerneck "
        "head=upperneck head_end=head",
        "{s}_up_leg=@hipjoint {s}_leg=@femur {s}_foot=@tibia {s}_toe_base=@foot "
        "{s}_toe_end=@toes {s}_arm=@clavicle {s}_forearm=@humerus {s}_hand=@wrist "
        "{s}_hand_end=@wrist",
        24.0,
        0.0,
    ),
    "HumanML3D": (
        "pelvis=root spine1=lowerback spine2=upperback spine3=thorax neck=lowerneck head=upperneck",
        "{s}_hip=@hipjoint {s}_knee=@femur {s}_ankle=@tibia {s}_foot=@foot {s}_collar=thorax "
        "{s}_shoulder=@clavicle {s}_elbow=@humerus {s}_wrist=@wrist",
        20.0,
        0.0,
    ),
}

# Segments between nodes, their fractions of the mass, and where on them it is (Winter 2009).
MASSES = [
    ("neck", "head", 0.081, 0.5),
    *((f"{s}_shoulder", f"{s}_elbow", 0.028, 0.436) for s in "lr"),
    *((f"{s}_elbow", f"{s}_wrist", 0.016, 0.43) for s in "lr"),
    *((f"{s}_wrist", f"{s}_hand", 0.006, 0.5) for s in "lr"),
    *((f"{s}_hip", f"{s}_knee", 0.1, 0.433) for s in "lr"),
    *((f"{s}_knee", f"{s}_ankle", 0.0465, 0.433) for s in "lr"),
    *((f"{s}_ankle", f"{s}_toe", 0.0145, 0.5) for s in "lr"),
    *((f"{s}_hip", f"{s}_shoulder", 0.2485, 0.5) for s in "lr"),
]


def joints_of(name: str, asf: rt.Motion) -> tuple[list[str], Array]:
    """Names and positions (frame, joint, 3) of a set, from all joints of the AMC."""
    middle, sided, _, _ = SETS[name]
    entries = middle.split()
    for side in ("left", "right"):
        entries += sided.replace("@", side[0]).replace("{s}", side).split()
    names, places = [], []
    for entry in entries:
        joint, _, found = entry.partition("=")
        columns = [asf.joints.index(one) for one in found.split(",")]
        names.append(joint)
        places.append(asf.positions[:, columns].mean(axis=1))
    return names, np.stack(places, axis=1)


def read_back(names: list[str], places: Array, times: Array) -> rt.Motion:
    """The motion of joints (frame, joint, 3) in world axes, written with y up."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "take.npz"
        arrays = {"positions": places[..., [1, 2, 0]].astype(np.float32), "time_s": times}
        np.savez(path, joints=np.array(names), up=np.array("y"), **arrays)
        return rt.load_motion(path)


def reductions(asf: rt.Motion) -> Iterator[tuple[str, rt.Motion, rt.Motion]]:
    """Each set as it is read back, at 120 Hz and as recorded."""
    rng = np.random.default_rng(0)
    times = asf.frame_times
    for name, (_, _, rate_hz, noise_m) in SETS.items():
        names, places = joints_of(name, asf)
        step = asf.rate_hz / rate_hz
        frames = np.arange(0, len(places), step)
        if noise_m:
            frames += rng.uniform(-0.25, 0.25, len(frames))
        frames = np.clip(np.round(frames), 0, len(places) - 1).astype(int)
        recorded = places[frames] + rng.normal(0, 1, (len(frames), *places.shape[1:])) * noise_m
        yield name, read_back(names, places, times), read_back(names, recorded, times[frames])


def apart(ours: rt.Motion, nodes: rt.Motion) -> tuple[Array, Array, Array]:
    """Distances (time, node) [m], and both speeds (time, node) [m/s], at 120 Hz."""
    times = np.arange(0.5, min(ours.duration_s, nodes.duration_s) - 0.5, 1 / 120)
    mine, theirs = ours.at(times)[0].copy(), nodes.at(times)[0]
    mine[..., 2] += np.median(theirs[:, 2, 2] - mine[:, 2, 2])  # floors are found otherwise
    speeds = (np.linalg.norm(np.gradient(p, 1 / 120, axis=0), axis=2) for p in (mine, theirs))
    return (np.linalg.norm(mine - theirs, axis=2), *speeds)


def joint_rows(
    name: str, case: str, limb_cm: float, ours: rt.Motion, nodes: rt.Motion
) -> list[Row]:
    distance, mine, theirs = apart(ours, nodes)
    claim = f"{name}, {case}"
    columns = {
        key: [NODES.index(node) for node in group]
        for key, group in (("limbs", LIMBS), ("trunk", TRUNK), ("toes and hands", ENDS))
    }
    by_node = {key: np.median(distance[:, own], axis=0) * 100 for key, own in columns.items()}
    fast = columns["limbs"]
    peak = [np.quantile(speed[:, fast], 0.999, axis=0) for speed in (mine, theirs)]
    moving = theirs[:, fast] > 1.0
    left = ours.positions[:, NODES.index("l_hip")] - ours.positions[:, NODES.index("r_hip")]
    step = min(len(left), len(nodes.positions))
    truly = nodes.positions[:, NODES.index("l_hip")] - nodes.positions[:, NODES.index("r_hip")]
    same = np.sum(left[:step] * truly[:step], axis=1) > 0 if ours.rate_hz == 120 else np.ones(1)
    return [
        judged(claim, "limbs, median, worst joint", "cm", float(by_node["limbs"].max()), limb_cm),
        reported(claim, "limbs, 99 %", "cm", float(np.quantile(distance[:, fast], 0.99) * 100)),
        judged(claim, "trunk, median, worst node", "cm", float(by_node["trunk"].max()), 11.0),
        reported(
            claim, "toes and hands, median, worst", "cm", float(by_node["toes and hands"].max())
        ),
        reported(
            claim,
            "speed of limbs over 1 m/s, ratio",
            "",
            float(np.median(mine[:, fast][moving] / theirs[:, fast][moving])),
            reference=1.0,
        ),
        reported(
            claim,
            "peak speed of limbs, least ratio",
            "",
            float((peak[0] / peak[1]).min()),
            reference=1.0,
        ),
        judged(claim, "frames with left on the right", "%", float((1 - same).mean() * 100), 0.1),
    ]


def doppler(motion: rt.Motion) -> Array:
    """Velocities (quantile, time) below which 5, 50 and 95 % of the power of a kick lie [m/s]."""
    radar = rt.Radar.preset("paper-12ghz")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rt.ValidityWarning)  # feet faster than 7 m/s
        found = rt.run(
            motion,
            radar,
            fidelity="analytic",
            variant="cpu",
            start_s=11.0,
            duration_s=1.5,
            snr_db=np.inf,
        ).maps["spectrogram"]
    axis = next(str(dim) for dim in found.dims if "velocity" in str(dim))
    other = next(str(dim) for dim in found.dims if str(dim) != axis)
    power = found.transpose(other, axis).to_numpy()
    power = np.where(power >= 1e-4 * power.max(), power, 0)
    share = np.cumsum(power, axis=1) / power.sum(axis=1, keepdims=True)
    velocity = found[axis].to_numpy()
    return np.stack([velocity[np.argmax(share >= level, axis=1)] for level in (0.05, 0.5, 0.95)])


def spectrogram_rows(name: str, ours: rt.Motion, truth: Array) -> list[Row]:
    away = np.abs(doppler(dataclasses.replace(ours, girth=1.0)) - truth)
    return [
        judged(
            f"{name}, spectrogram of a kick",
            f"{level} of the power, median",
            "m/s",
            float(np.median(row)),
            0.3,
        )
        for level, row in zip(("5 %", "50 %", "95 %"), away, strict=True)
    ]


def free_fall(folder: Path, quick: bool) -> list[Row]:
    found = []
    for path in sorted((folder / "mhad").glob("a01_*.npz"))[:: 5 if quick else 1]:
        motion = rt.load_motion(path)
        joints = motion.positions
        weight = sum(mass for *_, mass, _ in MASSES)
        height = sum(
            mass
            / weight
            * ((1 - at) * joints[:, NODES.index(a), 2] + at * joints[:, NODES.index(b), 2])
            for a, b, mass, at in MASSES
        )
        lowest = joints[..., 2].min(axis=1)
        flying = np.flatnonzero(np.diff(np.concatenate([[0], lowest > 0.05, [0]])))
        for begin, end in zip(flying[::2], flying[1::2], strict=True):
            if end - begin > 0.25 * motion.rate_hz:
                times = np.arange(end - begin) / motion.rate_hz
                found.append(2 * np.polyfit(times, np.asarray(height)[begin:end], 2)[0])
    return [
        judged(
            "jumps of MHAD",
            "acceleration of the centre of mass, median",
            "m/s^2",
            float(np.median(found)),
            0.03 * 9.81,
            reference=-9.81,
            cases=len(found),
        ),
        reported("jumps of MHAD", "standard deviation over flights", "m/s^2", float(np.std(found))),
    ]


def raw_head_height(path: Path) -> float:
    """Median height of the head's joint over the lowest joint of each frame [m]."""
    with np.load(path) as file:
        places, names = file["positions"].astype(float), list(file["joints"])
    return float(np.median(places[:, names.index("Head"), 1] - places[..., 1].min(axis=1)))


def recordings(folder: Path, quick: bool) -> list[Row]:
    refused, wrong, fast, files = 0, 0, 0, sorted(folder.glob("*/*.npz"))[:: 25 if quick else 1]
    sizes: dict[str, list[tuple[float, float]]] = {"adults": [], "children": []}
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # A camera that loses a hand may find it again far away: that is counted.
        warnings.filterwarnings("ignore", message=".*faster than people do")
        for path in files:
            try:
                motion = rt.load_motion(path)
            except (rt.InputError, Warning):
                refused += 1
                continue
            speed = {one.name: one.value for one in motion.findings}["largest_speed_mps"]
            fast += float(speed) > FASTEST_M_S
            joints = motion.positions
            node = {name: joints[:, k] for k, name in enumerate(NODES)}
            toes = sum(node[f"{s}_toe"] - node[f"{s}_ankle"] for s in "lr")
            left = np.cross([0.0, 0.0, 1.0], toes)
            wrong += np.median(np.sum(left * (node["l_hip"] - node["r_hip"]), axis=1)) <= 0
            if path.parent.name == "kinder_gator":
                pair = motion.girth * 1.75, raw_head_height(path)
                sizes[path.name.split("__")[0]].append(pair)
    adults, children = (np.median(np.array(sizes[who]), axis=0) for who in sizes)
    return [
        judged("recordings", "refused, or with a warning", "", refused, 0.5, cases=len(files)),
        judged(
            "recordings", "left hip on the right of the toes", "", int(wrong), 0.5, cases=len(files)
        ),
        reported("recordings", "a joint is warned of for its speed", "", float(fast)),
        reported("Kinder-Gator", "stature of adults, median", "m", float(adults[0])),
        reported("Kinder-Gator", "stature of children, median", "m", float(children[0])),
        judged(
            "Kinder-Gator",
            "children over adults, by stature and by height of the head",
            "",
            float(children[0] / adults[0]),
            0.05 * float(children[1] / adults[1]),
            reference=float(children[1] / adults[1]),
        ),
    ]


def measure(quick: bool) -> list[Row]:
    rows: list[Row] = []
    mocap, joints = os.environ.get("RTRADAR_MOCAP"), os.environ.get("RTRADAR_JOINTS")
    for variable, folder in (("RTRADAR_MOCAP", mocap), ("RTRADAR_JOINTS", joints)):
        if not folder:
            leave_out("recordings", f"{variable}, the folder of real ones")
    if mocap:
        take = Path(mocap) / "cmu/135_02.amc"
        asf = rt.load_motion(take, skeleton=take.with_name("135.asf"))
        if quick:
            cut = {"root_positions": asf.root_positions[:1800], "rotations": asf.rotations[:1800]}
            asf = dataclasses.replace(asf, **cut)
        nodes = to_nodes(asf)
        truth = doppler(nodes)
        for name, clean, recorded in reductions(asf):
            rows += joint_rows(name, "120 Hz", 1.5, clean, nodes)
            rows += joint_rows(name, f"{SETS[name][2]:g} Hz", 2.5, recorded, nodes)
            rows += spectrogram_rows(name, recorded, truth)
    if joints:
        rows += free_fall(Path(joints), quick) + recordings(Path(joints), quick)
    return rows


if __name__ == "__main__":
    raise SystemExit(main(__doc__.splitlines()[0], measure))
