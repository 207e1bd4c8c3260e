"""What files of motion mean: unit, up, rate, T-pose, speed; each file is made here.

A person of 1.75 m walks ahead for two seconds, in the axes and the unit, and with the faults, of
what people have. What is right stands beside each.
"""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar import InputError, Motion, ValidityWarning, load_motion, synthetic_motion
from rtradar.motion.skeleton import NODES, to_nodes
from rtradar.recordings import UNITS_M, UPWARD

Array = NDArray[np.float64]

# Name, parent, offset of Mixamo's rest pose [m], y up, who looks along z; the left is at x > 0.
_SIDE = (
    ("UpLeg", "Hips", (0.09, -0.06, 0)),
    ("Leg", "UpLeg", (0, -0.42, 0)),
    ("Foot", "Leg", (0, -0.42, 0)),
    ("ToeBase", "Foot", (0, -0.08, 0.13)),
    ("Toe_End", "ToeBase", (0, 0, 0.07)),
    ("Shoulder", "Spine2", (0.06, 0.10, 0)),
    ("Arm", "Shoulder", (0.12, 0, 0)),
    ("ForeArm", "Arm", (0.28, 0, 0)),
    ("Hand", "ForeArm", (0.25, 0, 0)),
    ("HandMiddle1", "Hand", (0.09, 0, 0)),
)
_MIDDLE = (
    ("Spine", "Hips", (0, 0.1, 0)),
    ("Spine1", "Spine", (0, 0.12, 0)),
    ("Spine2", "Spine1", (0, 0.12, 0)),
    ("Neck", "Spine2", (0, 0.17, 0)),
    ("Head", "Neck", (0, 0.09, 0.01)),
    ("HeadTop_End", "Head", (0, 0.18, 0)),
)


def _bones() -> list[tuple[str, str, tuple[float, ...]]]:
    found = [("Hips", "", (0.0, 0.0, 0.0)), *_MIDDLE]
    for side, sign in (("Left", 1), ("Right", -1)):
        for name, parent, (x, y, z) in _SIDE:
            above = parent if parent in ("Hips", "Spine2") else side + parent
            found.append((side + name, above, (sign * x, y, z)))
    return found


HIP_M = 0.98
RATE_HZ = 30


def walker(
    *,
    turn: Rotation | None = None,
    unit_m: float = 0.01,
    frames: int = 60,
    t_poses: int = 0,
    layout: str = "usual",
    way: tuple[float, float, float] = (0.0, 0.0, 1.0),
    swing_deg: float = 25.0,
) -> str:
    """A BVH file of a walker, whose root is turned as a whole."""
    turn = Rotation.identity() if turn is None else turn
    bones = _bones()
    lines = ["HIERARCHY"]

    def write(name: str, depth: int) -> None:
        own = {bone: offset for bone, _, offset in bones}
        kids = [bone for bone, parent, _ in bones if parent == name]
        offset = " ".join(f"{value / unit_m:.6f}" for value in own[name])
        key = "ROOT" if depth == 0 else "JOINT"
        places = "6 Xposition Yposition Zposition " if depth == 0 else "3 "
        open_brace = [f"{key} {name} {{"] if layout == "braces" else [f"{key} {name}", "{"]
        lines.extend([*open_brace, f"OFFSET {offset}"])
        lines.append(f"CHANNELS {places}Zrotation Xrotation Yrotation")
        for kid in kids:
            write(kid, depth + 1)
        for _ in range(0 if kids else 2 if layout == "two ends" else 1):
            lines.extend(["End Site", "{", "OFFSET 0 0 0", "}"])
        lines.append("}")

    write("Hips", 0)
    order = [line.split()[1] for line in lines if line.startswith(("ROOT", "JOINT"))]
    if layout == "one line":
        lines = [" ".join(lines)]
    rows = []
    for frame in range(t_poses + frames):
        swing = swing_deg * np.sin(2 * np.pi * 0.9 * frame / RATE_HZ) * (frame >= t_poses)
        gone = 1.1 * frame / RATE_HZ * np.array(way)
        place = turn.apply(np.array([0.0, HIP_M + 0.005, 0.0]) + gone) / unit_m
        angles = dict.fromkeys(order, (0.0, 0.0, 0.0))
        angles["LeftUpLeg"], angles["RightUpLeg"] = (0, swing, 0), (0, -swing, 0)
        if frame >= t_poses:  # the arms hang down
            angles["LeftArm"], angles["RightArm"] = (-75, 0, 0), (75, 0, 0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a turn by 90 degrees two angles are one
            angles["Hips"] = tuple(turn.as_euler("ZXY", degrees=True))
        values = [f"{value:.5f}" for value in place]
        values += [f"{angle:.5f}" for name in order for angle in angles[name]]
        breaks = 40 if layout == "wrapped" else len(values)
        rows += [" ".join(values[k : k + breaks]) for k in range(0, len(values), breaks)]
    lines += ["MOTION", f"Frames: {t_poses + frames}", f"Frame Time: {1 / RATE_HZ:.6f}", *rows]
    return "\n".join(lines) + "\n"


def read(folder: Path, text: str, **said: object) -> tuple[Motion, list[str]]:
    """The motion of a BVH file, and what is warned of."""
    path = folder / "a.bvh"
    path.write_text(text)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        motion = load_motion(path, **said)  # type: ignore[arg-type]
    return motion, [str(one.message) for one in caught]


def nodes_of(motion: Motion) -> dict[str, Array]:
    """Positions (frame, 3) by node."""
    return dict(zip(NODES, np.moveaxis(to_nodes(motion).positions, 1, 0), strict=True))


def walks_upright(motion: Motion) -> None:
    """Check that the walker stands on the floor, walks ahead, and has the left on the left."""
    node = nodes_of(motion)
    assert node["head"][:, 2].min() > 1.5
    assert abs(np.minimum(node["l_toe"], node["r_toe"])[:, 2].min()) < 0.06
    ahead = node["root"][-1] - node["root"][0]
    left = node["l_hip"][0] - node["r_hip"][0]
    assert np.cross([0, 0, 1.0], ahead) @ left > 0
    assert np.linalg.norm(ahead) == pytest.approx(1.1 * (len(motion.root_positions) - 1) / 30, 1e-4)


Z_UP, Y_DOWN = (
    Rotation.from_euler("x", 90, degrees=True),
    Rotation.from_euler("z", 180, degrees=True),
)


# -- up --------------------------------------------------------------------------------------------


def test_a_file_of_the_format_is_read_without_a_word(tmp_path: Path) -> None:
    motion, said = read(tmp_path, walker())
    walks_upright(motion)
    assert not said
    assert [one.name for one in motion.findings] == [
        "unit_m", "stature_m", "up", "rate_hz", "largest_speed_mps",
    ]  # fmt: skip


@pytest.mark.parametrize(("turn", "up"), [(Z_UP, "z"), (Y_DOWN, "-y")])
def test_another_axis_that_is_up_is_found_and_said(tmp_path: Path, turn: Rotation, up: str) -> None:
    motion, (said,) = read(tmp_path, walker(turn=turn))
    walks_upright(motion)
    assert f"a.bvh: up: {up}, not y as the format has it" in said
    told, silent = read(tmp_path, walker(turn=turn), up=up)
    assert not silent
    np.testing.assert_allclose(told.positions, motion.positions)


def test_who_lies_stays_lying(tmp_path: Path) -> None:
    # On the back, moving along the body: y has a floor at zero, -z one that goes away.
    lying = Rotation.from_euler("x", -90, degrees=True)
    shifted = walker(turn=lying, swing_deg=5.0, way=(0.0, 1.0, 0.0))
    motion, said = read(tmp_path, shifted)
    assert not said
    assert "the person lies on a floor" in {one.name: one.text for one in motion.findings}["up"]
    assert np.ptp(nodes_of(motion)["head"][:, 2]) < 0.1


def test_who_may_as_well_stand_is_refused(tmp_path: Path) -> None:
    lying = Rotation.from_euler("x", -90, degrees=True)
    with pytest.raises(InputError, match=r"a.bvh: the person lies if y is up.*--up y or --up -z"):
        read(tmp_path, walker(turn=lying, frames=1))


# -- units -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [0.5, 1.0, 1.1])
@pytest.mark.parametrize("unit", ["m", "cm", "mm"])
def test_children_and_tall_people_are_found_in_their_unit(
    tmp_path: Path, unit: str, size: float
) -> None:
    motion, said = read(tmp_path, walker(unit_m=UNITS_M[unit] / size))
    assert np.ptp(motion.positions[0, :, 2]) == pytest.approx(1.76 * size, rel=0.01)
    assert not said
    assert motion.findings[0].text == f"unit: {unit}, by the stature"


@pytest.mark.parametrize("unit", UNITS_M)
def test_adults_are_found_in_every_unit(tmp_path: Path, unit: str) -> None:
    motion, said = read(tmp_path, walker(unit_m=UNITS_M[unit]))
    walks_upright(motion)
    assert not said


def test_two_units_that_are_as_good_are_refused(tmp_path: Path) -> None:
    # A child of 0.83 m in centimetres, or a man of 2.1 m in inches.
    text = walker(unit_m=0.01 * 1.76 / 0.83)
    with pytest.raises(InputError, match=r"a.bvh: a person of .* m in in, 0.8.* m in cm.*--unit"):
        read(tmp_path, text)
    motion, _ = read(tmp_path, text, unit="cm")
    assert np.ptp(motion.positions[0, :, 2]) == pytest.approx(0.83, abs=0.01)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ({"up": "w"}, "up = 'w'; it must be one of x, y, z, -x, -y, -z"),
        ({"unit": "ell"}, "unit = 'ell'; it must be one of m, cmu, in, cm, mm, or the metres"),
        ({"unit": 0.0}, "unit = 0.0; it must be a number"),
        ({"rate_hz": 0.0}, "rate_hz = 0.0; it must be a number from 1 to 100000"),
        ({"unit_m": float("nan")}, "unit = nan"),
    ],
)
def test_what_cannot_be_said_is_refused(
    tmp_path: Path, said: dict[str, object], words: str
) -> None:
    with pytest.raises(InputError) as caught:
        read(tmp_path, walker(), **said)
    assert words in str(caught.value)


# -- frames ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [1, 2, 30])
def test_a_t_pose_before_the_motion_is_dropped_and_said(tmp_path: Path, count: int) -> None:
    motion, (said,) = read(tmp_path, walker(t_poses=count))
    walks_upright(motion)
    assert len(motion.root_positions) == 60
    assert "frame 1 is a T-pose" in said


def test_a_t_pose_that_is_held_is_part_of_the_motion(tmp_path: Path) -> None:
    motion, said = read(tmp_path, walker(frames=1, t_poses=70))
    assert len(motion.root_positions) == 71
    assert not said


def test_the_rate_may_be_said(tmp_path: Path) -> None:
    wrong = walker().replace("Frame Time: 0.033333", "Frame Time: 33.333")
    with pytest.raises(InputError, match=r"line \d+: Frame Time: is 33.333; .*--rate"):
        read(tmp_path, wrong)
    assert read(tmp_path, wrong, rate_hz=30.0)[0].rate_hz == 30


@pytest.mark.parametrize("rate_hz", [30.0, 60.0])
def test_a_rate_counts_in_place_of_the_file_s(tmp_path: Path, rate_hz: float) -> None:
    walk = synthetic_motion("walk", seed=0, duration_s=1.0)
    path = joints(tmp_path, walk, np.eye(3), np.zeros(3), up="z", time_s=np.arange(121) * 1e-3)
    motion = load_motion(path, rate_hz=rate_hz)
    assert motion.duration_s == pytest.approx(120 / rate_hz)
    assert ("rate_hz", rate_hz) in [one[:2] for one in motion.findings]


def test_what_nobody_can_do_is_said(tmp_path: Path) -> None:
    lines = walker().splitlines()
    words = lines[-20].split()
    words[0] = "10000"
    lines[-20] = " ".join(words)
    _, (said,) = read(tmp_path, "\n".join(lines))
    assert "moves at 3e+03 m/s after frame 40, faster than people do" in said


# -- the language of BVH ---------------------------------------------------------------------------


@pytest.mark.parametrize("layout", ["braces", "one line", "two ends", "wrapped"])
def test_words_of_a_bvh_may_stand_on_any_line(tmp_path: Path, layout: str) -> None:
    expected, _ = read(tmp_path, walker())
    motion, said = read(tmp_path, walker(layout=layout))
    assert not said
    some = [motion.joints.index(name) for name in expected.joints]
    np.testing.assert_array_equal(motion.positions[:, some], expected.positions)


def test_more_frames_than_promised_are_taken_and_said(tmp_path: Path) -> None:
    motion, (said,) = read(tmp_path, walker().replace("Frames: 60", "Frames: 53"))
    assert len(motion.root_positions) == 60
    assert "60 frames where the header promises 53; all are taken" in said


def test_decimal_commas_are_named(tmp_path: Path) -> None:
    head, motion, rows = walker().partition("MOTION")
    frames, time, values = rows.partition("0.033333")
    with pytest.raises(InputError, match="has a decimal comma"):
        read(tmp_path, head + motion + frames + time + values.replace(".", ","))


# -- names -----------------------------------------------------------------------------------------

_SIDED = ("UpLeg", "Leg", "Foot", "ToeBase", "Shoulder", "Arm", "ForeArm", "Hand", "HandMiddle1")
_TRUNK = ("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head")
CONVENTIONS = {
    "DAZ": (
        "hip abdomen abdomen2 chest neck head",
        "@Thigh @Shin @Foot @Toe @Collar @Shldr @ForeArm @Hand @Mid1",
        "lr",
    ),
    "OptiTrack Motive": (
        "Hip Ab Spine Chest Neck Head",
        "@Thigh @Shin @Foot @Toe @Shoulder @UArm @FArm @Hand @Fingers",
        "LR",
    ),
    "3ds Max Biped": (
        "Bip01_Pelvis Bip01_Spine Bip01_Spine1 Bip01_Spine2 Bip01_Neck Bip01_Head",
        "Bip01_@_Thigh Bip01_@_Calf Bip01_@_Foot Bip01_@_Toe0 Bip01_@_Clavicle Bip01_@_UpperArm "
        "Bip01_@_Forearm Bip01_@_Hand Bip01_@_Finger2",
        "LR",
    ),
    "Unreal Engine": (
        "pelvis spine_01 spine_02 spine_03 neck_01 head",
        "thigh_@ calf_@ foot_@ ball_@ clavicle_@ upperarm_@ lowerarm_@ hand_@ middle_01_@",
        "lr",
    ),
    "Rokoko": (
        "Hips Spine Spine2 Spine3 Neck Head",
        "@Thigh @Shin @Foot @Toe @Shoulder @Arm @ForeArm @Hand @HandMiddle1",
        ("Left", "Right"),
    ),
    "SMPL": (
        "pelvis spine1 spine2 spine3 neck head",
        "@_hip @_knee @_ankle @_foot @_collar @_shoulder @_elbow @_wrist @_hand",
        ("left", "right"),
    ),
}


@pytest.mark.parametrize("spaces", [False, True])
@pytest.mark.parametrize("name", CONVENTIONS)
def test_names_of_other_programs_are_known(tmp_path: Path, name: str, spaces: bool) -> None:
    trunk, limbs, sides = CONVENTIONS[name]
    names = dict(zip(_TRUNK, trunk.split(), strict=True))
    for ours, side in zip(("Left", "Right"), sides, strict=True):
        for bone, other in zip(_SIDED, limbs.split(), strict=True):
            names[ours + bone] = other.replace("@", side)
    lines = walker().splitlines()
    for number, line in enumerate(lines):
        words = line.split()
        if words[0] in ("ROOT", "JOINT") and words[1] in names:
            other = names[words[1]]
            lines[number] = f"{words[0]} {other.replace('_', ' ') if spaces else other}"
    motion, said = read(tmp_path, "\n".join(lines))
    walks_upright(motion)
    assert not said


# -- joints ----------------------------------------------------------------------------------------

SMPL = {
    "pelvis": "root", "spine1": "lowerback", "spine2": "upperback", "spine3": "thorax",
    "neck": "neck", "head": "head",
} | {
    f"{side}_{joint}": f"{side[0]}_{node}"
    for side in ("left", "right")
    for joint, node in (
        ("hip", "hip"), ("knee", "knee"), ("ankle", "ankle"), ("foot", "toe"),
        ("shoulder", "shoulder"), ("elbow", "elbow"), ("wrist", "wrist"),
    )
}  # fmt: skip


def joints(folder: Path, motion: Motion, axes: Array, shift: Array, **more: object) -> Path:
    """An archive of SMPL's joints, in axes (3, 3) that a file may have."""
    every = motion.positions @ axes.T + shift
    chosen = every[:, [NODES.index(node) for node in SMPL.values()]]
    arrays = {"joints": np.array(list(SMPL)), "positions": chosen, "rate_hz": motion.rate_hz}
    np.savez(folder / "a.npz", **(arrays | more))  # type: ignore[arg-type]
    return folder / "a.npz"


AZURE = {
    "PELVIS": "root", "SPINE_NAVEL": "lowerback", "SPINE_CHEST": "upperback", "NECK": "thorax",
    "HEAD": "head",
} | {
    f"{joint}_{side}": f"{side[0].lower()}_{node}"
    for side in ("LEFT", "RIGHT")
    for joint, node in (
        ("HIP", "hip"), ("KNEE", "knee"), ("ANKLE", "ankle"), ("FOOT", "toe"),
        ("SHOULDER", "shoulder"), ("ELBOW", "elbow"), ("WRIST", "wrist"), ("HAND", "wrist"),
        ("HANDTIP", "hand"),
    )
}  # fmt: skip
HUMAN36M = {"Hip": "root", "Spine": "upperback", "Thorax": "thorax", "Head": "head"} | {
    f"{side}{joint}": f"{side.lower()}_{node}"
    for side in "LR"
    for joint, node in (
        ("Hip", "hip"), ("Knee", "knee"), ("Foot", "ankle"),
        ("Shoulder", "shoulder"), ("Elbow", "elbow"), ("Wrist", "wrist"),
    )
}  # fmt: skip


@pytest.mark.parametrize("names", [AZURE, HUMAN36M], ids=["Azure Kinect", "Human3.6M"])
def test_joints_of_cameras_in_millimetres_with_y_down(
    tmp_path: Path, names: dict[str, str]
) -> None:
    walk = synthetic_motion("walk", seed=0)
    places = walk.positions[:, [NODES.index(node) for node in names.values()]]
    places = places[..., [1, 2, 0]] * [1.0, -1.0, -1.0] * 1000.0 + [300.0, 900.0, 3000.0]
    arrays = {"joints": np.array(list(names)), "positions": places, "rate_hz": walk.rate_hz}
    np.savez(tmp_path / "a.npz", **arrays)  # type: ignore[arg-type]
    motion = load_motion(tmp_path / "a.npz")
    found = {one.name: one.value for one in motion.findings}
    assert (found["unit_m"], found["up"]) == (0.001, "-y")
    ours, theirs = nodes_of(motion), nodes_of(walk)
    turned = [-1.0, -1.0, 1.0]  # a camera that looks back at who comes
    for limb in ("hip", "knee", "ankle", "elbow", "wrist"):
        for side in "lr":
            away = (ours[f"{side}_{limb}"] - ours["root"]) * turned
            apart = np.linalg.norm(away - theirs[f"{side}_{limb}"] + theirs["root"], axis=1)
            assert np.median(apart) < 0.03
    ahead = (ours["root"][-1] - ours["root"][0]) * turned
    assert ahead @ (theirs["root"][-1] - theirs["root"][0]) > 0


def falls() -> Motion:
    """A person who lies for most of the time, gets up, falls and lies."""
    return synthetic_motion("fall", seed=0, duration_s=8.0)


@pytest.mark.parametrize("up", UPWARD)
def test_who_falls_does_not_get_up(tmp_path: Path, up: str) -> None:
    cyclic = np.roll(np.eye(3), "xyz".index(up[-1]) - 2, axis=0)
    axes = cyclic @ np.diag([1.0, -1.0, -1.0]) if up[0] == "-" else cyclic
    recorded = falls()
    motion = load_motion(joints(tmp_path, recorded, axes, np.zeros(3)))
    height = nodes_of(recorded)["head"][:, 2]
    assert np.ptp(height) > 1.4
    np.testing.assert_allclose(nodes_of(motion)["head"][:, 2], height, atol=0.15)
    assert ("up", up) in [one[:2] for one in motion.findings]


def test_who_lies_in_bed_may_as_well_stand(tmp_path: Path) -> None:
    still = synthetic_motion("stand", seed=0, duration_s=1.0)
    lying = np.roll(np.eye(3), 1, axis=0)  # the body along x
    with pytest.raises(InputError, match=r"up is unknown.*--up"):
        load_motion(joints(tmp_path, still, lying, np.array([1.0, 2.0, 0.4])))
    motion = load_motion(joints(tmp_path, still, lying, np.array([1.0, 2.0, 0.4])), up="z")
    assert np.ptp(nodes_of(motion)["head"][:, 2]) < 0.1
    assert nodes_of(motion)["head"][0, 2] < 0.5


def test_an_axis_by_which_a_walker_lies_is_warned_of(tmp_path: Path) -> None:
    path = joints(tmp_path, synthetic_motion("walk", seed=0), np.eye(3), np.zeros(3), up="x")
    with pytest.warns(ValidityWarning, match="with x up, as given, the person lies"):
        load_motion(path)


def test_frames_hardly_apart_are_one(tmp_path: Path) -> None:
    walk = synthetic_motion("walk", seed=0, duration_s=1.0)
    times = np.arange(len(walk.root_positions)) / walk.rate_hz
    times[31] = times[30] + 2e-6
    path = joints(tmp_path, walk, np.eye(3), np.zeros(3), time_s=times, up="z")
    motion = load_motion(path)
    assert ("joined_frames", 1) in [one[:2] for one in motion.findings]
    expected = load_motion(joints(tmp_path, walk, np.eye(3), np.zeros(3), up="z"))
    np.testing.assert_allclose(motion.at(0.25)[0], expected.at(0.25)[0], atol=2e-3)


def test_a_jump_of_the_whole_person_is_said(tmp_path: Path) -> None:
    walk = synthetic_motion("walk", seed=0, duration_s=1.0)
    shift = np.zeros((len(walk.root_positions), 1, 3))
    shift[60:, :, 0] = 100.0
    path = joints(tmp_path, walk, np.eye(3), shift, up="z")
    with pytest.warns(ValidityWarning, match="faster than people do"):
        load_motion(path)
