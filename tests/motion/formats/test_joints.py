"""Joint positions that cameras and body models give, read as motions."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rtradar.errors import InputError
from rtradar.motion import Motion, load_motion
from rtradar.motion.skeleton import NODE_PARENTS, NODES, to_nodes

RATE_HZ = 60.0

KINECT_V1 = {
    "HipCenter": "root",
    "Spine": "lowerback",
    "ShoulderCenter": "thorax",
    "Head": "head",
    **{
        f"{joint}{side}": f"{side[0].lower()}_{node}"
        for side in ("Left", "Right")
        for joint, node in (
            ("Hip", "hip"),
            ("Knee", "knee"),
            ("Ankle", "ankle"),
            ("Foot", "toe"),
            ("Shoulder", "shoulder"),
            ("Elbow", "elbow"),
            ("Wrist", "wrist"),
            ("Hand", "hand"),
        )
    },
}
HUMANML3D = {
    "pelvis": "root",
    "spine1": "lowerback",
    "spine2": "upperback",
    "spine3": "thorax",
    "neck": "neck",
    "head": "head",
    **{
        f"{side}_{joint}": f"{side[0]}_{node}"
        for side in ("left", "right")
        for joint, node in (
            ("hip", "hip"),
            ("knee", "knee"),
            ("ankle", "ankle"),
            ("foot", "toe"),
            ("shoulder", "shoulder"),
            ("elbow", "elbow"),
            ("wrist", "wrist"),
        )
    },
}
LIMBS = [
    NODES.index(f"{side}_{node}")
    for side in "lr"
    for node in ("hip", "knee", "ankle", "shoulder", "elbow", "wrist")
]


@pytest.fixture(scope="session")
def recorded() -> Path:
    """Folder of joint positions of real people."""
    named = os.environ.get("RTRADAR_JOINTS")
    if not named:
        pytest.skip("RTRADAR_JOINTS is not set: it names the folder of joint positions")
    return Path(named)


def person(seconds: float = 2.0, rate_hz: float = RATE_HZ) -> np.ndarray:
    """Nodes (frame, node, 3) of one who looks along +x, walks that way and swings the right arm."""
    stands = {
        "root": (0.0, 0.0, 0.95),
        "lowerback": (0.0, 0.0, 1.07),
        "upperback": (0.0, 0.0, 1.19),
        "thorax": (0.0, 0.0, 1.31),
        "neck": (0.0, 0.0, 1.42),
        "head": (0.0, 0.0, 1.63),
        "hip": (0.0, 0.1, 0.88),
        "knee": (0.0, 0.1, 0.48),
        "ankle": (0.0, 0.1, 0.08),
        "toe": (0.17, 0.1, 0.02),
        "shoulder": (0.0, 0.2, 1.4),
        "elbow": (0.0, 0.2, 1.1),
        "wrist": (0.0, 0.2, 0.85),
        "hand": (0.0, 0.2, 0.75),
    }
    time = np.arange(round(seconds * rate_hz) + 1) / rate_hz
    nodes = np.empty((len(time), len(NODES), 3))
    for k, node in enumerate(NODES):
        side = {"l_": 1, "r_": -1}.get(node[:2], 0)
        x, y, z = stands[node[2:] if side else node]
        nodes[:, k] = (x, side * y, z)
    arm = [NODES.index(f"r_{node}") for node in ("elbow", "wrist", "hand")]
    shoulder = nodes[:, [NODES.index("r_shoulder")]]
    hangs = shoulder[..., 2] - nodes[:, arm, 2]
    angle = np.sin(2 * np.pi * time)[:, None]
    nodes[:, arm, 0] = hangs * np.sin(angle)
    nodes[:, arm, 2] = shoulder[..., 2] - hangs * np.cos(angle)
    nodes[..., 0] += 1.1 * time[:, None]
    return nodes


def write(
    path: Path, nodes: np.ndarray, kind: dict[str, str] = HUMANML3D, /, **changes: Any
) -> Path:
    """Joint positions with y up; what is given as None is left out."""
    places = nodes[:, [NODES.index(node) for node in kind.values()]][..., [1, 2, 0]]
    arrays = {"positions": places, "joints": np.array(list(kind)), "up": "y", "rate_hz": RATE_HZ}
    arrays |= changes
    np.savez(path, **{name: value for name, value in arrays.items() if value is not None})
    return path


@pytest.mark.parametrize("joints", [HUMANML3D, KINECT_V1])
def test_nodes_stand_where_the_joints_are(tmp_path: Path, joints: dict[str, str]) -> None:
    nodes = person()
    motion = load_motion(write(tmp_path / "walk.npz", nodes, joints))
    assert motion.joints == NODES
    assert motion.rate_hz == 120
    assert to_nodes(motion) is motion
    # The floor is found from the toes, and the swing at 1 Hz loses (1/8)^4 of its 0.55 m.
    np.testing.assert_allclose(motion.positions[::2][:, LIMBS], nodes[:, LIMBS], atol=3e-3)
    assert motion.girth * 1.75 == pytest.approx(1.63, abs=0.02)  # the height of the head's top


@pytest.mark.parametrize("up", ["x", "-z", None])
def test_any_axis_may_be_up_and_left_stays_left(tmp_path: Path, up: str | None) -> None:
    axes = np.roll(np.eye(3), "xyz".index(up[-1]) - 2 if up else 2, axis=0)
    axes = axes @ np.diag([1.0, -1.0, -1.0]) if up and up[0] == "-" else axes
    nodes = person()
    places = nodes[:, [NODES.index(node) for node in HUMANML3D.values()]] @ axes.T + [3.0, 2.0, 1.0]
    motion = load_motion(write(tmp_path / "walk.npz", nodes, positions=places, up=up))
    ours = motion.positions[::2]
    assert abs(np.quantile(ours[..., 2].min(axis=1), 0.1) - 0.02) < 0.01
    left = ours[:, NODES.index("l_hip")] - ours[:, NODES.index("r_hip")]
    ahead = ours[:, NODES.index("l_toe")] - ours[:, NODES.index("l_ankle")]
    assert (np.cross(ahead, left)[:, 2] > 0).all()
    turned = ours[:, LIMBS] - ours[:, :1]
    np.testing.assert_allclose(
        np.linalg.norm(turned, axis=2), np.linalg.norm(nodes[:, LIMBS] - nodes[:, :1], axis=2)
    )


def test_a_table_says_the_same_as_an_archive(tmp_path: Path) -> None:
    nodes = person(0.5)
    names = [f"{joint}_{axis}" for joint in HUMANML3D for axis in "xyz"]
    places = nodes[:, [NODES.index(node) for node in HUMANML3D.values()]].reshape(len(nodes), -1)
    lines = [",".join(["time_s", *names, "up"])]
    for k, row in enumerate(places):
        cells = [repr(float(value)) for value in row]
        if k == 7:
            cells[9] = ""
        lines.append(",".join([repr(k / RATE_HZ), *cells, "z"]))
    (tmp_path / "walk.csv").write_text("\n".join(lines) + "\n")
    places = places.copy()
    places[7, 9:12] = np.nan
    archive = write(
        tmp_path / "walk.npz",
        nodes,
        positions=places.reshape(len(nodes), -1, 3),
        up="z",
        rate_hz=None,
        time_s=np.arange(len(nodes)) / RATE_HZ,
    )
    table, other = load_motion(tmp_path / "walk.csv"), load_motion(archive)
    np.testing.assert_allclose(table.positions, other.positions, atol=1e-12)


def test_gaps_and_uneven_times_are_bridged(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    every = person(4.0, 240.0)
    kept = np.sort(rng.choice(len(every), len(every) // 8, replace=False))
    kept[0] = 0
    nodes, times = every[kept].copy(), kept / 240.0
    wrist = NODES.index("r_wrist")
    nodes[60:63, wrist] = 0.0  # what software writes for a joint that it does not see
    nodes[80:82] = np.nan
    motion = load_motion(write(tmp_path / "x.npz", nodes, rate_hz=None, time_s=times))
    assert motion.rate_hz == 120
    lost = slice(int(times[58] * 120), int(times[83] * 120))
    known = person(4.0, 120.0)[: len(motion.positions)]
    np.testing.assert_allclose(motion.positions[lost, wrist], known[lost, wrist], atol=0.01)


def test_a_long_gap_leaves_the_longer_part(tmp_path: Path) -> None:
    nodes = person(4.0)
    nodes[70:100, NODES.index("l_knee")] = np.nan
    nodes[-1] = 0.0
    motion = load_motion(write(tmp_path / "x.npz", nodes))
    assert motion.duration_s == pytest.approx((len(nodes) - 2 - 100) / RATE_HZ)


def test_a_joint_that_a_camera_loses_for_a_moment_is_bridged(tmp_path: Path) -> None:
    nodes = person(rate_hz=30.0)
    clean = load_motion(write(tmp_path / "clean.npz", nodes, KINECT_V1, rate_hz=30.0))
    wrist, hand = NODES.index("r_wrist"), NODES.index("r_hand")
    nodes[20:23, [wrist, hand]] = nodes[20:23, [NODES.index("l_wrist")]]
    motion = load_motion(write(tmp_path / "lost.npz", nodes, KINECT_V1, rate_hz=30.0))
    np.testing.assert_allclose(motion.positions[:, wrist], clean.positions[:, wrist], atol=0.03)


def test_low_pass_of_a_camera_leaves_half_at_its_cut_off(tmp_path: Path) -> None:
    nodes = person(8.0)
    time = np.arange(len(nodes)) / RATE_HZ
    nodes[..., 2] += 0.02 * np.sin(2 * np.pi * 8.0 * time)[:, None]
    motion = load_motion(write(tmp_path / "x.npz", nodes, KINECT_V1))
    root = motion.positions[240:721, 0, 2]
    swing = np.exp(-2j * np.pi * 8.0 * np.arange(480) / 120)
    assert abs(2 * np.mean(root[:480] * swing)) == pytest.approx(0.01, rel=0.05)


def test_bones_are_rigid_and_hands_that_vanish_keep_their_direction(tmp_path: Path) -> None:
    nodes = person() + np.random.default_rng(1).normal(0, 0.01, person().shape)
    nodes[10:40, NODES.index("l_hand")] = nodes[10:40, NODES.index("l_wrist")]
    motion = load_motion(write(tmp_path / "x.npz", nodes, KINECT_V1))
    lengths = np.linalg.norm(motion.positions - motion.positions[:, NODE_PARENTS], axis=2)[:, 1:]
    np.testing.assert_allclose(lengths, np.broadcast_to(lengths[0], lengths.shape))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"positions": None}, "positions is missing"),
        ({"rate_hz": None}, "rate_hz or time_s is missing"),
        ({"rate_hz": 0.0}, "rate_hz = 0.0; it must be a number from 1 to 100000"),
        ({"up": "w"}, "up is 'w'; it must be one of x, y, z"),
        (
            {"positions": np.zeros((9, 20))},
            r"shape \(9, 20\); it must be real numbers of shape \(frame, joint, 3\)",
        ),
        ({"positions": np.full((9, 20, 3), "a")}, "positions is <U1"),
        ({"joints": np.array(["hip"])}, r"must be names of shape \(20\)"),
        ({"joints": np.array([f"tail{k}" for k in range(20)])}, "tail0, tail1, .*in no set"),
        ({"joints": np.array([*list(HUMANML3D)[:-1], "paw"])}, "right_?wrist of SMPL.* missing"),
        ({"joints": np.array([*list(HUMANML3D)[:-1], "head"])}, "joint 'head' is there twice"),
        ({"time_s": np.zeros(121)}, "time_s is 0 in frame 2, after 0; times must ascend"),
        ({"time_s": np.zeros(7)}, r"time_s is float64 of shape \(7,\)"),
        ({"positions": np.full((121, 20, 3), np.nan)}, "is never seen"),
        ({"positions": np.full((121, 20, 3), np.inf)}, "beyond 1e.09; what is not seen is NaN"),
        ({"positions": np.zeros((3, 20, 3))}, "at least 5 frames"),
    ],
)
def test_what_cannot_be_used_is_refused_in_one_line(
    tmp_path: Path, changes: dict[str, Any], said: str
) -> None:
    path = write(tmp_path / "x.npz", person(), **changes)
    with pytest.raises(InputError) as caught:
        load_motion(path)
    assert re.search(said, str(caught.value)), caught.value
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_too_many_gaps_lying_people_and_millimetres_are_refused(tmp_path: Path) -> None:
    nodes = person()
    nodes[::20, NODES.index("l_knee")] = np.nan
    nodes[21:100, NODES.index("l_knee")] = np.nan
    with pytest.raises(InputError, match=r"too much is not seen"):
        load_motion(write(tmp_path / "gaps.npz", nodes))
    half = 0.5**0.5
    lies = person() @ np.array([[half, 0, half], [0, 1, 0], [-half, 0, half]])
    with pytest.raises(InputError, match="up is unknown"):
        load_motion(write(tmp_path / "lies.npz", lies, up=None))
    motion = load_motion(write(tmp_path / "mm.npz", person() * 1000))
    assert ("unit_m", 0.001) in [one[:2] for one in motion.findings]
    np.testing.assert_allclose(motion.positions[::2][:, LIMBS], person()[:, LIMBS], atol=3e-3)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,tail\n0,1\n", "line 1: column 'tail' is not understood"),
        ("time_s,a_x,a_y\n0,1,2\n", "line 1: joint 'a' has no column for z"),
        ("a_x,a_x\n0,1\n", "line 1: column 'a_x' is there twice"),
        ("time_s,a_x,a_y,a_z\n0,1,2\n", "line 2: 3 cells where the header has 4"),
        ("time_s,a_x,a_y,a_z\n0,1,2,b\n", "line 2: 'b' is not a number"),
        ("time_s,a_x,a_y,a_z\n0,1,2,inf\n", "line 2: 'inf': values must be finite"),
        ("time_s,a_x,a_y,a_z\n", "0 frames of 1 joints"),
        ("", "empty"),
    ],
)
def test_a_wrong_table_is_refused_by_its_line(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "x.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        load_motion(path)


def test_what_is_no_archive_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "x.npz"
    path.write_bytes(b"not an archive")
    with pytest.raises(InputError, match="not an archive of NumPy, or a damaged one"):
        load_motion(path)


def node(motion: Motion, name: str) -> np.ndarray:
    return motion.positions[:, NODES.index(name)]


@pytest.mark.parametrize("kind", ["mhad", "kinder_gator", "gait"])
def test_recordings_are_people(recorded: Path, kind: str) -> None:
    for path in sorted((recorded / kind).glob("*.npz"))[::60]:
        motion = load_motion(path)
        assert motion.joints == NODES
        child = path.name.startswith("children")
        assert (1.0 if child else 1.4) < motion.girth * 1.75 < (1.4 if child else 1.95)
        lowest = np.median(motion.positions[..., 2].min(axis=1))
        assert -0.01 < lowest < 0.1
        toes = node(motion, "l_toe") - node(motion, "l_ankle")
        toes += node(motion, "r_toe") - node(motion, "r_ankle")
        left = np.cross([0.0, 0.0, 1.0], toes)
        to_left = np.sum(left * (node(motion, "l_hip") - node(motion, "r_hip")), axis=1)
        assert np.median(to_left) > 0
