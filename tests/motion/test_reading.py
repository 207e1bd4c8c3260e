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
from rtradar.motion.skeleton import NODES, recognise, to_nodes
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
    with pytest.raises(InputError, match=r"a.bvh: .* m in in, 0.8.* m in cm.*--unit: m, cmu, in"):
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


@pytest.mark.parametrize("name", CONVENTIONS)
def test_names_of_other_programs_are_known(tmp_path: Path, name: str) -> None:
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
            # Spaces may stand for underscores.
            lines[number] = f"{words[0]} {other.replace('_', ' ')}"
    motion, said = read(tmp_path, "\n".join(lines))
    walks_upright(motion)
    assert not said


# -- joints ----------------------------------------------------------------------------------------

_LIMBS = {
    "hip": "hip", "knee": "knee", "ankle": "ankle", "foot": "toe",
    "shoulder": "shoulder", "elbow": "elbow", "wrist": "wrist",
}  # fmt: skip


def named(middle: dict[str, str], limbs: dict[str, str], *sides: str) -> dict[str, str]:
    """Nodes by the names of joints, of which @ is the side, the left one first."""
    pairs = list(zip("lr", sides, strict=True))
    return middle | {
        joint.replace("@", name): f"{side}_{node}"
        for side, name in pairs
        for joint, node in limbs.items()
    }


_SPINE = ("pelvis", "spine1", "spine2", "spine3", "neck", "head")
SMPL = named(
    dict(zip(_SPINE, ("root", "lowerback", "upperback", "thorax", "neck", "head"), strict=True)),
    {f"@_{joint}": node for joint, node in _LIMBS.items()},
    "left",
    "right",
)
AZURE = named(
    {"PELVIS": "root", "SPINE_NAVEL": "lowerback", "SPINE_CHEST": "upperback", "NECK": "thorax",
     "HEAD": "head"},
    {f"{joint.upper()}_@": node for joint, node in _LIMBS.items()}
    | {"HAND_@": "wrist", "HANDTIP_@": "hand"},
    "LEFT", "RIGHT",
)  # fmt: skip
HUMAN36M = named(
    {"Hip": "root", "Spine": "upperback", "Thorax": "thorax", "Head": "head"},
    {"@Hip": "hip", "@Knee": "knee", "@Foot": "ankle", "@Shoulder": "shoulder", "@Elbow": "elbow",
     "@Wrist": "wrist"},
    "L", "R",
)  # fmt: skip
OPENPOSE = named(
    {"Neck": "thorax", "midHip": "root", "Nose": "head"},
    {"@Shoulder": "shoulder", "@Elbow": "elbow", "@Wrist": "wrist", "@Hip": "hip", "@Knee": "knee",
     "@Ankle": "ankle", "@BigToe": "toe", "@Heel": "ankle"},
    "L", "R",
)  # fmt: skip
MEDIAPIPE = named(
    {"nose": "head", "left_ear": "head", "right_ear": "head"},
    {f"@_{joint}": node for joint, node in _LIMBS.items() if joint != "foot"}
    | {"@_foot_index": "toe", "@_index": "hand"},
    "left", "right",
)  # fmt: skip


def places_of(names: dict[str, str], motion: Motion) -> Array:
    """Positions (frame, joint, 3) of joints of these names, y up."""
    places = motion.positions[:, [NODES.index(node) for node in names.values()]]
    return places[..., [1, 2, 0]]


def limbs_agree(
    ours: dict[str, Array], theirs: dict[str, Array], about: str, turned: Array
) -> None:
    """Check that limbs are where they were, seen from a node of the side, and turned."""
    for side in "lr":
        for limb in ("hip", "knee", "ankle", "elbow", "wrist"):
            node, start = f"{side}_{limb}", about.replace("@", side)
            away = (ours[node] - ours[start]) * turned
            apart = away - (theirs[node] - theirs[start])
            assert np.median(np.linalg.norm(apart, axis=1)) < 0.03


def joints(folder: Path, motion: Motion, axes: Array, shift: Array, **more: object) -> Path:
    """An archive of SMPL's joints, in axes (3, 3) that a file may have."""
    every = motion.positions @ axes.T + shift
    chosen = every[:, [NODES.index(node) for node in SMPL.values()]]
    arrays = {"joints": np.array(list(SMPL)), "positions": chosen, "rate_hz": motion.rate_hz}
    np.savez(folder / "a.npz", **(arrays | more))  # type: ignore[arg-type]
    return folder / "a.npz"


@pytest.mark.parametrize("names", [AZURE, HUMAN36M], ids=["Azure Kinect", "Human3.6M"])
def test_joints_of_cameras_in_millimetres_with_y_down(
    tmp_path: Path, names: dict[str, str]
) -> None:
    walk = synthetic_motion("walk", seed=0)
    places = places_of(names, walk) * [1.0, -1.0, -1.0] * 1000.0 + [300.0, 900.0, 3000.0]
    arrays = {"joints": np.array(list(names)), "positions": places, "rate_hz": walk.rate_hz}
    np.savez(tmp_path / "a.npz", **arrays)  # type: ignore[arg-type]
    motion = load_motion(tmp_path / "a.npz")
    found = {one.name: one.value for one in motion.findings}
    assert (found["unit_m"], found["up"]) == (0.001, "-y")
    ours, theirs = nodes_of(motion), nodes_of(walk)
    turned = np.array([-1.0, -1.0, 1.0])  # a camera that looks back at who comes
    limbs_agree(ours, theirs, "root", turned)
    ahead = (ours["root"][-1] - ours["root"][0]) * turned
    assert ahead @ (theirs["root"][-1] - theirs["root"][0]) > 0


@pytest.mark.parametrize("up", UPWARD)
def test_who_falls_does_not_get_up(tmp_path: Path, up: str) -> None:
    cyclic = np.roll(np.eye(3), "xyz".index(up[-1]) - 2, axis=0)
    axes = cyclic @ np.diag([1.0, -1.0, -1.0]) if up[0] == "-" else cyclic
    # Who lies for most of the time, gets up, falls and lies.
    recorded = synthetic_motion("fall", seed=0, duration_s=8.0)
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


def test_a_skeleton_without_a_neck_is_read(tmp_path: Path) -> None:
    lines = walker().splitlines()
    # The head hangs on the chest, as low as the neck was.
    neck = next(k for k, line in enumerate(lines) if line.split() == ["JOINT", "Neck"])
    head = next(k for k, line in enumerate(lines) if line.split() == ["JOINT", "Head"])
    assert neck < head
    lines[neck] = lines[neck].replace("Neck", "Spine3")
    motion, said = read(tmp_path, "\n".join(lines))
    walks_upright(motion)
    assert not said


def test_names_of_ones_own_count_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    walk = synthetic_motion("walk", seed=0, duration_s=1.0)
    path = joints(tmp_path, walk, np.eye(3), np.zeros(3), joints=[f"Ours-{k}" for k in SMPL])
    with pytest.raises(InputError, match=r"named as in no set that is known.*RTRADAR_NAMES"):
        load_motion(path)
    table = "\n".join(
        ['[[joints]]\nname = "Ours"\nsides = ["oursleft", "oursright"]']
        + [f'middle.{SMPL[name]} = "ours{name}"' for name in SMPL if "_" not in name]
        + [f'sided.{node} = "@{joint}"' for joint, node in _LIMBS.items()]
        + ['sided.hand = "@elbow>@wrist 1.7"']
    )
    (tmp_path / "names.toml").write_text(table)
    monkeypatch.setenv("RTRADAR_NAMES", str(tmp_path / "names.toml"))
    motion = load_motion(path)
    assert np.ptp(motion.root_positions[:, 0]) > 0.9
    assert (nodes_of(motion)["head"][:, 2] > 1.5).all()
    (tmp_path / "worse.toml").write_text('[[joints]]\nname = "Ours"\nside = 1\n')
    monkeypatch.setenv("RTRADAR_NAMES", str(tmp_path / "worse.toml"))
    with pytest.raises(InputError, match=r"worse.toml: \[\[joints\]\] number 1 unknown key 'side'"):
        load_motion(path)


@pytest.mark.parametrize(
    ("middle", "says"),
    [
        ('neck = "spine+head"', "spine\\+head: a node of a skeleton is one joint"),
        ("", "'head'"),
    ],
)
def test_a_skeleton_of_ones_own_names_single_joints(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, middle: str, says: str
) -> None:
    names = '[[skeletons]]\nname = "Ours"\nsides = ["left", "right"]\n'
    (tmp_path / "names.toml").write_text(f"{names}middle = {{{middle}}}\nsided = {{}}\n")
    monkeypatch.setenv("RTRADAR_NAMES", str(tmp_path / "names.toml"))
    with pytest.raises(InputError, match=f"Ours: sides, middle and sided are needed.*({says})"):
        recognise("a file", ["Hips"], "skeletons")


# -- body models -----------------------------------------------------------------------------------

# Joints of the mean person of SMPL in the rest pose, each side as it is [m].
MEAN = {
    "pelvis": ("", (-0.0018, -0.2233, 0.0282)),
    "left_hip": ("pelvis", (0.0695, -0.0914, -0.0068)),
    "right_hip": ("pelvis", (-0.0677, -0.0905, -0.0043)),
    "spine1": ("pelvis", (-0.0025, 0.1089, -0.0267)),
    "left_knee": ("left_hip", (0.0343, -0.3752, -0.0045)),
    "right_knee": ("right_hip", (-0.0383, -0.3826, -0.0089)),
    "spine2": ("spine1", (0.0055, 0.1352, 0.0011)),
    "left_ankle": ("left_knee", (-0.0136, -0.3980, -0.0437)),
    "right_ankle": ("right_knee", (0.0158, -0.3984, -0.0423)),
    "spine3": ("spine2", (0.0015, 0.0529, 0.0254)),
    "left_foot": ("left_ankle", (0.0264, -0.0558, 0.1193)),
    "right_foot": ("right_ankle", (-0.0254, -0.0481, 0.1233)),
    "neck": ("spine3", (-0.0028, 0.2139, -0.0429)),
    "left_collar": ("spine3", (0.0788, 0.1218, -0.0341)),
    "right_collar": ("spine3", (-0.0817, 0.1188, -0.0386)),
    "head": ("neck", (0.0052, 0.0650, 0.0513)),
    "left_shoulder": ("left_collar", (0.0910, 0.0305, -0.0089)),
    "right_shoulder": ("right_collar", (-0.0961, 0.0325, -0.0091)),
    "left_elbow": ("left_shoulder", (0.2596, -0.0128, -0.0275)),
    "right_elbow": ("right_shoulder", (-0.2537, -0.0133, -0.0214)),
    "left_wrist": ("left_elbow", (0.2492, 0.0090, -0.0012)),
    "right_wrist": ("right_elbow", (-0.2553, 0.0078, -0.0056)),
}


def model_walk(heading_deg: float) -> tuple[Array, Array, Array]:
    """Rotations (frame, 66) and trans of a walk in a file whose z is up, and joints (frame, 22, 3).

    The arms hang and swing; the left hand is raised after a second.
    """
    time = np.arange(240) / 120
    swing = 0.45 * np.sin(2 * np.pi * time)
    own = {name: np.zeros((240, 3)) for name in MEAN}
    upright = Rotation.from_euler("z", heading_deg, degrees=True) * Rotation.from_euler(
        "x", 90, degrees=True
    )
    own["pelvis"][:] = upright.as_rotvec()
    for side, sign in (("left", 1.0), ("right", -1.0)):
        own[f"{side}_hip"][:, 0] = sign * swing
        own[f"{side}_knee"][:, 0] = 0.4 + 0.3 * np.cos(2 * np.pi * time + sign)
        own[f"{side}_shoulder"][:, 2] = -1.2 * sign
    own["left_elbow"][:, 1] = -1.5 * (time > 1) * np.minimum(4 * (time - 1), 1)
    ahead = upright.apply([0.0, 0.0, 1.0])
    trans = time[:, None] * 1.1 * ahead + [0.0, 0.0, 1.0]
    places, world = dict[str, Array](), dict[str, Rotation]()
    for name, (parent, offset) in MEAN.items():
        turned = Rotation.from_rotvec(own[name])
        world[name] = world[parent] * turned if parent else turned
        places[name] = (
            places[parent] + world[parent].apply(offset) if parent else trans + np.array(offset)
        )
    return np.concatenate(list(own.values()), axis=1), trans, np.stack(list(places.values()), 1)


@pytest.mark.parametrize("kind", ["smpl", "smplh", "smplx", "parts"])
@pytest.mark.parametrize("heading_deg", [0.0, 70.0, 200.0])
def test_rotations_of_body_models_are_the_joints_of_a_mean_person(
    tmp_path: Path, kind: str, heading_deg: float
) -> None:
    rotations, trans, places = model_walk(heading_deg)
    arrays: dict[str, object] = {"trans": trans, "betas": np.zeros(10), "gender": "neutral"}
    if kind == "parts":
        arrays |= {"root_orient": rotations[:, :3], "pose_body": rotations[:, 3:]}
        arrays["mocap_frame_rate"] = 120.0
    else:
        width = {"smpl": 72, "smplh": 156, "smplx": 165}[kind]
        hands = np.zeros((len(trans), width - 66))
        arrays |= {"poses": np.concatenate([rotations, hands], axis=1), "mocap_framerate": 120.0}
    if kind == "smplx":
        arrays["surface_model_type"] = "smplx"
    np.savez(tmp_path / "rotations.npz", **arrays)  # type: ignore[arg-type]
    given = {"joints": np.array(list(MEAN)), "positions": places, "rate_hz": 120.0, "up": "z"}
    np.savez(tmp_path / "joints.npz", **given)  # type: ignore[arg-type]
    turned, seen = (load_motion(tmp_path / f"{name}.npz") for name in ("rotations", "joints"))
    apart = turned.positions - seen.positions
    shift = np.median(apart, axis=(0, 1))
    # The root of SMPL-X is elsewhere in the rest pose, which shifts the whole walk.
    assert np.linalg.norm(shift) < (0.14 if kind == "smplx" else 0.01)
    assert np.linalg.norm(apart - shift, axis=2).max() < 0.02
    speeds = [
        np.linalg.norm(np.diff(one.positions, axis=0), axis=2) * one.rate_hz
        for one in (turned, seen)
    ]
    assert np.abs(speeds[0] - speeds[1]).max() < 0.02 * speeds[1].max()
    ours = nodes_of(turned)
    walked = ours["root"][-1] - ours["root"][0]
    expected = Rotation.from_euler("z", heading_deg, degrees=True).apply([0.0, -2.2, 0.0])
    np.testing.assert_allclose(walked, expected, atol=0.03)
    left = np.cross([0.0, 0.0, 1.0], walked)
    assert ((ours["l_hip"] - ours["r_hip"]) @ left > 0).all()
    raised = ours["l_wrist"][-1] - ours["l_elbow"][-1]
    assert raised @ walked > 0.2 * np.linalg.norm(walked)
    assert "body: rotations on the skeleton of a mean person" in turned.findings[0].text


def test_rotations_by_which_a_walker_lies_are_warned_of(tmp_path: Path) -> None:
    rotations, trans, _ = model_walk(0.0)
    rotations[:, :3] = 0  # the axes of the model in place of those of the file
    np.savez(tmp_path / "a.npz", trans=trans, poses=rotations, mocap_framerate=120.0)
    with pytest.warns(ValidityWarning, match="never stands, and moves along above the floor"):
        load_motion(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"trans": None}, "trans is missing"),
        ({"trans": np.zeros((3, 3))}, r"trans is float64 of shape \(3, 3\)"),
        (
            {"poses": np.zeros((240, 63))},
            r"poses is float64 .* must be real numbers of shape \(frame, 66\)",
        ),
        ({"poses": np.full((240, 66), np.nan)}, "rotations are not finite in frame 1"),
        ({"mocap_framerate": None}, "rate_hz or time_s is missing"),
        ({"mocap_framerate": 0.0}, "rate_hz = 0"),
    ],
)
def test_damaged_rotations_are_refused(
    tmp_path: Path, change: dict[str, object], says: str
) -> None:
    rotations, trans, _ = model_walk(0.0)
    arrays = {"trans": trans, "poses": rotations, "mocap_framerate": 120.0} | change
    kept = {name: value for name, value in arrays.items() if value is not None}
    np.savez(tmp_path / "a.npz", **kept)  # type: ignore[arg-type]
    with pytest.raises(InputError, match=says):
        load_motion(tmp_path / "a.npz")


# -- points of TRC files ---------------------------------------------------------------------------


def trc(path: Path, names: list[str], places: Array, rate_hz: float, units: str = "m") -> Path:
    """A TRC file of points (frame, point, 3), empty where they are NaN."""
    count, points = places.shape[:2]
    header = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate",
        f"{rate_hz}\t{rate_hz}\t{count}\t{points}\t{units}\t{rate_hz}",
        "Frame#\tTime\t" + "\t\t\t".join(names),
        "\t\t" + "\t".join(f"{axis}{k + 1}" for k in range(points) for axis in "XYZ"),
        "",
    ]
    rows = [
        f"{k + 1}\t{k / rate_hz:.5f}\t"
        + "\t".join("" if np.isnan(value) else f"{value:.6f}" for value in row.ravel())
        for k, row in enumerate(places)
    ]
    path.write_text("\n".join(header + rows) + "\n")
    return path


def test_points_of_opencap_are_joints(tmp_path: Path) -> None:
    walk = synthetic_motion("walk", seed=0)
    places = places_of(OPENPOSE, walk)
    places[40:44, 3] = np.nan
    file = trc(tmp_path / "a.trc", list(OPENPOSE), 1000 * places, walk.rate_hz, "mm")
    motion = load_motion(file)
    ours, theirs = nodes_of(motion), nodes_of(walk)
    limbs_agree(ours | {"o": 0 * ours["root"]}, theirs | {"o": 0 * ours["root"]}, "o", np.ones(3))
    found = {one.name: one.value for one in motion.findings}
    assert (found["unit_m"], found["up"], found["rate_hz"]) == (0.001, "y", 120.0)


def test_landmarks_of_mediapipe_stay_about_the_hips(tmp_path: Path) -> None:
    walk = synthetic_motion("walk", seed=0)
    places = places_of(MEDIAPIPE, walk)
    places[:, :3] += np.array([[0.0, -0.1, 0.1], [0.07, -0.1, 0.0], [-0.07, -0.1, 0.0]])
    hips = [list(MEDIAPIPE).index(f"{side}_hip") for side in ("left", "right")]
    places -= places[:, hips].mean(axis=1, keepdims=True)
    places *= [1.0, -1.0, -1.0]  # y down, the camera behind
    arrays = {"joints": np.array(list(MEDIAPIPE)), "positions": places, "rate_hz": walk.rate_hz}
    np.savez(tmp_path / "a.npz", **arrays)  # type: ignore[arg-type]
    ours, theirs = nodes_of(load_motion(tmp_path / "a.npz")), nodes_of(walk)
    limbs_agree(ours, theirs, "@_hip", np.array([-1.0, -1.0, 1.0]))
    assert (ours["head"][:, 2] > ours["root"][:, 2] + 0.5).all()


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("PathFileType", "PathfileType"), "line 3: not a TRC file"),
        (("Units", "Unit"), "line 3: not a TRC file"),
        (("120.0\t", "many\t"), "line 3: 'many' is not a number"),
        (("0.500000", "0,5"), "line .*decimal comma"),
        (("Neck", "Nack"), "marker LFHD is missing"),
    ],
)
def test_damaged_tables_of_points_are_refused(
    tmp_path: Path, change: tuple[str, str], says: str
) -> None:
    places = np.full((8, len(OPENPOSE), 3), 0.5)
    file = trc(tmp_path / "a.trc", list(OPENPOSE), places, 120.0)
    file.write_text(file.read_text().replace(*change))
    with pytest.raises(InputError, match=says):
        load_motion(file)


# -- the rate --------------------------------------------------------------------------------------


def hopper(rate_hz: float) -> str:
    """A BVH file, at 60 Hz in truth, of who hops three times, half a second in the air each."""
    lines = walker(frames=180, swing_deg=0.0, way=(0.0, 0.0, 0.0)).splitlines()
    first = next(k for k, line in enumerate(lines) if line.startswith("Frame Time")) + 1
    for frame, k in enumerate(range(first, len(lines))):
        words = lines[k].split()
        air_s = frame / 60 % 1.0 - 0.25
        height = max(0.0, 9.81 / 2 * air_s * (0.5 - air_s))
        words[1] = f"{float(words[1]) + 100 * height:.6f}"
        lines[k] = " ".join(words)
    lines[first - 1] = f"Frame Time: {1 / rate_hz:.8f}"
    return "\n".join(lines)


@pytest.mark.parametrize(("rate_hz", "says"), [(60, ""), (120, "2.0 times"), (30, "0.5 times")])
def test_free_fall_tells_of_half_or_twice_the_rate(
    tmp_path: Path, rate_hz: float, says: str
) -> None:
    motion, said = read(tmp_path, hopper(rate_hz))
    assert motion.rate_hz == rate_hz
    assert says in " ".join(said)
    assert bool(says) == bool(said)


def test_a_table_of_points_is_told_of_in_its_own_words(tmp_path: Path) -> None:
    names = [f"{side}{marker}" for side in "LR" for marker in ("ASI", "KNE", "ANK")]
    file = trc(tmp_path / "a.trc", names, np.full((8, 6, 3), 0.5), 0.5)
    with pytest.raises(InputError, match=r"DataRate \[frames a second\] = 0\.5; it must be"):
        load_motion(file)
