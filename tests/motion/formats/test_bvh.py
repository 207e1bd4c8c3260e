from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from rtradar.errors import InputError
from rtradar.motion import Motion, load_motion

BVH = """HIERARCHY
ROOT hip
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  JOINT knee
  {
    OFFSET 0 -50 0
    CHANNELS 3 Yrotation Zrotation Xrotation
    End Site
    {
      OFFSET 0 -50 0
    }
  }
}
MOTION
Frames: 2
Frame Time: .0333333
0 100 0 0 0 0 0 0 0
10 100 20 0 90 0 0 90 0
"""

CARRIED = """HIERARCHY
ROOT world
{
  OFFSET 0 0 0
  CHANNELS 3 Zrotation Xrotation Yrotation
  JOINT hip
  {
    OFFSET 0 100 0
    CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
    JOINT knee
    {
      OFFSET 0 -50 0
      CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
      End Site
      {
        OFFSET 0 -50 0
      }
    }
    JOINT chest
    {
      OFFSET 0 30 0
    }
  }
}
MOTION
Frames:\t2
Frame Time:\t0.00833333
0 0 0  0 100 0 0 0 0  0 -40 0 0 0 0
0 0 90  5 100 0 0 0 0  0 -40 0 0 0 0
"""


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "leg.bvh"
    path.write_text(text)
    return path


def test_poses_by_hand(tmp_path: Path) -> None:
    motion = load_motion(write(tmp_path, BVH))
    assert motion.rate_hz == 30.0
    assert motion.joints == ("hip", "knee", "knee_end")
    np.testing.assert_allclose(
        motion.positions[0], [[0, 0, 1.0], [0, 0, 0.5], [0, 0, 0]], atol=1e-12
    )
    # The hip turns by 90 about x: down (-y) becomes -z. The knee's channels are Y, Z, X: Z by 90
    # first takes -y to +x, which the hip's turn leaves alone. World is (z, x, y) of mocap.
    np.testing.assert_allclose(
        motion.positions[1], [[0.2, 0.1, 1], [-0.3, 0.1, 1], [-0.3, 0.6, 1]], atol=1e-12
    )


@pytest.mark.parametrize("name", ["root", "End", "Root Motion", "Joint"])
def test_a_joint_may_have_the_name_of_a_key(tmp_path: Path, name: str) -> None:
    usual = load_motion(write(tmp_path, CARRIED))
    named = load_motion(write(tmp_path, CARRIED.replace("ROOT world", f"ROOT {name}")))
    np.testing.assert_array_equal(named.root_positions, usual.root_positions)
    named = load_motion(write(tmp_path, CARRIED.replace("JOINT chest", f"JOINT {name}")))
    assert name.split()[-1] in named.joints or name in named.joints


def test_carrying_joint_becomes_root_and_positions_replace_offsets(tmp_path: Path) -> None:
    motion = load_motion(write(tmp_path, CARRIED))
    assert motion.joints == ("hip", "knee", "knee_end", "chest")
    assert motion.rate_hz == 120.0
    np.testing.assert_allclose(
        motion.positions[0], [[0, 0, 1.0], [0, 0, 0.6], [0, 0, 0.1], [0, 0, 1.3]], atol=1e-12
    )
    # The world joint turns by 90 about y, x to -z: the hip at mocap (5, 100, 0) stands at (0, 100,
    # -5).
    np.testing.assert_allclose(motion.positions[1, 0], [-0.05, 0, 1.0], atol=1e-12)


@pytest.mark.parametrize("unit_m", [1.0, 0.01, 0.001, 0.0254, 0.0254 / 0.45])
def test_unit_is_found(tmp_path: Path, unit_m: float) -> None:
    text = BVH.replace("-50", repr(-0.5 / unit_m))
    motion = load_motion(write(tmp_path, text))
    np.testing.assert_allclose(np.linalg.norm(motion.offsets[1:], axis=1), 0.5, rtol=1e-12)
    assert np.linalg.norm(
        load_motion(write(tmp_path, text), unit_m=2.0).offsets[1]
    ) == pytest.approx(1.0 / unit_m)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("HIERARCHY", "HIER", ["line 1", "not a BVH"]),
        ("JOINT knee", "JOINT hip", ["line 6", "'hip'"]),
        ("CHANNELS 3", "CHANNELS 4", ["line 9", "CHANNELS"]),
        (
            "Yrotation Zrotation Xrotation\n    End",
            "Yrotation Zrotation Yrotation\n    End",
            ["line 9", "different"],
        ),
        ("OFFSET 0 0 0", "OFFSET 0 0", ["line 4", "three"]),
        ("  }\n}\nMOTION", "  }\nMOTION", ["MOTION", "brace"]),
        ("}\nMOTION", "}\n}\nMOTION", ["brace too many"]),
        ("Frames: 2", "Frames: 3", ["2 frames", "promises 3", "cut off"]),
        ("Frame Time: .0333333", "Frame Time: 0", ["line 18", "positive"]),
        (
            "10 100 20 0 90 0 0 90 0",
            "10 100 20 0 90 0 0 90",
            ["line 20", "frame 2", "8 values", "9 channels"],
        ),
        ("10 100 20", "10 nan 20", ["line 20", "finite"]),
        ("10 100 20", "10 x 20", ["line 20", "'x'"]),
        ("-50", "-5000", ["--unit"]),
        (BVH[BVH.index("MOTION") :], "", ["cut off"]),
    ],
)
def test_bad_bvh_says_where(tmp_path: Path, old: str, new: str, words: list[str]) -> None:
    assert old in BVH
    path = write(tmp_path, BVH.replace(old, new))
    with pytest.raises(InputError) as caught:
        load_motion(path)
    message = str(caught.value)
    assert "leg.bvh" in message
    assert "\n" not in message
    for word in words:
        assert word in message, message


def test_stretching_bone_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"leg.bvh, line 10: bone to 'knee' stretches by 5.0 cm"):
        load_motion(
            write(tmp_path, CARRIED.replace("5 100 0 0 0 0  0 -40 0", "5 100 0 0 0 0  0 -50 0"))
        )


def test_skeleton_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="BVH files take no skeleton"):
        load_motion(write(tmp_path, BVH), tmp_path / "x.asf")


@pytest.mark.parametrize("frames", [2, 4, 5, 11])
def test_bvh_in_pieces(
    tmp_path: Path,
    in_pieces: Callable[[], None],
    same: Callable[[Motion, Motion], None],
    frames: int,
) -> None:
    head = CARRIED[: CARRIED.index("Frames:")]
    rows = [
        f"0 0 {10 * k}  {k} 100 0 {20 * k} 0 0  0 -40 {0.01 * k} 0 {3 * k} 0" for k in range(frames)
    ]
    path = tmp_path / "long.bvh"
    path.write_text(head + f"Frames: {frames}\nFrame Time: 0.01\n" + "\n".join(rows))
    whole = load_motion(path)
    assert len(whole.root_positions) == frames
    in_pieces()
    same(load_motion(path), whole)
    path.write_text(head + f"Frames: {frames + 1}\nFrame Time: 0.01\n" + "\n".join(rows))
    with pytest.raises(InputError, match=f"{frames} frames where the header promises {frames + 1}"):
        load_motion(path)
