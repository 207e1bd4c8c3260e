from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from rtradar.errors import InputError, ValidityWarning
from rtradar.motion import load_motion

UNIT = 0.0254 / 0.45


def test_poses_by_hand(asf_files: tuple[Path, Path]) -> None:
    motion = load_motion(*asf_files)
    assert motion.joints == ("root", "first", "second")
    assert motion.rate_hz == 120.0
    assert motion.duration_s == pytest.approx(1 / 120)
    # Mocap (x, y, z) is world (z, x, y). Frame 1: root (1, 2, 3), first 10 up, second 5 along x.
    mocap = np.array([[1, 2, 3], [1, 12, 3], [6, 12, 3]])
    np.testing.assert_allclose(motion.positions[0], UNIT * mocap[:, [2, 0, 1]], atol=1e-12)
    # Frame 2: the root turns x to -z, `first` by 450 = 90 degrees about z (y to -x), so `first`
    # points to +z and `second`, turned by 90 about its own x axis C x = y: x to -z; then by
    # `first`: -z; then by the root: -x.
    mocap = np.array([[1, 2, 3], [1, 2, 13], [-4, 2, 13]])
    np.testing.assert_allclose(motion.positions[1], UNIT * mocap[:, [2, 0, 1]], atol=1e-12)


def test_radians_are_read(asf_files: tuple[Path, Path]) -> None:
    amc, asf = asf_files
    expected = load_motion(amc, asf).positions
    text = amc.read_text("latin-1").replace(":DEGREES", ":RADIANS")
    for word in ("450", "90"):
        text = text.replace(f" {word}", f" {float(np.deg2rad(float(word)))!r}")
    amc.write_text(text, "latin-1")
    np.testing.assert_allclose(load_motion(amc, asf).positions, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("first 0 0 450", "third 0 0 450", ["two.amc, line 10", "'third'", "not in the skeleton"]),
        ("first 0 0 450", "first 0 0", ["two.amc, line 10", "2 values"]),
        ("first 0 0 450", "first 0 0 nan", ["two.amc, line 10", "finite"]),
        ("first 0 0 450", "first 0 0 1e999", ["two.amc, line 10", "finite"]),
        ("first 0 0 450", "first 0 0 4x", ["two.amc, line 10", "'4x'", "not a number"]),
        ("first 0 0 450\n", "first 0 0 0\nfirst 0 0 0\n", ["two.amc, line 11", "twice"]),
        ("second 90\n", "", ["two.amc", "frame 2 lacks 1 bones (second)", "cut off"]),
        ("\n2\n", "\n3\n", ["two.amc, line 8", "frame 3 follows frame 1", "consecutive"]),
        (
            "\n1\nroot 1 2 3 0 0 0",
            "\nroot 1 2 3 0 0 0",
            ["two.amc, line 4", "before the first frame"],
        ),
    ],
)
def test_bad_amc_says_where(
    asf_files: tuple[Path, Path], old: str, new: str, words: list[str]
) -> None:
    amc, asf = asf_files
    text = amc.read_bytes().decode("latin-1").replace("\r\n", "\n")
    assert old in text
    amc.write_bytes(text.replace(old, new).encode("latin-1"))
    _fails(words, amc, asf)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("name second", "name first", ["two.asf, line 24", "twice"]),
        (
            "length 10\n",
            "length 10\n    name third\n",
            ["two.asf, line 19", "'first' gets a second name"],
        ),
        ("first second", "first third", ["two.asf, line 33", "'third'"]),
        ("    first second\n", "", ["two.asf, line 22", "'second'", "does not hang"]),
        ("dof rx\n", "dof l\n", ["two.asf, line 28", "only rx, ry, rz"]),
        ("length 5", "length -5", ["two.asf, line 26", "negative"]),
        ("length 0.45", "length 0", ["two.asf, line 6", "positive"]),
        ("axis 0 0 90 XYZ", "axis 0 0 90 XYY", ["two.asf, line 27", "permutation"]),
        ("order TX", "order tx TX", ["two.asf", "each once and all of them"]),
        ("name second\n", "", ["two.asf", "a bone without a name ends here"]),
        (":hierarchy", ":nothing", ["two.asf", "cut off"]),
    ],
)
def test_bad_asf_says_where(
    asf_files: tuple[Path, Path], old: str, new: str, words: list[str]
) -> None:
    amc, asf = asf_files
    text = asf.read_bytes().decode("latin-1").replace("\r\n", "\n")
    assert old in text
    asf.write_bytes(text.replace(old, new).encode("latin-1"))
    _fails(words, amc, asf)


def test_files_that_are_none(asf_files: tuple[Path, Path], tmp_path: Path) -> None:
    amc, asf = asf_files
    _fails(["needs its skeleton"], amc, None)
    _fails(["cannot read", "missing.asf"], amc, tmp_path / "missing.asf")
    _fails(["cannot read", "missing.amc"], tmp_path / "missing.amc", asf)
    _fails(["cannot read", "C3D"], tmp_path / "x.c3d", None)
    _fails(["'.txt'", ".amc", ".bvh", ".c3d"], tmp_path / "x.txt", None)
    (tmp_path / "folder.amc").mkdir()
    _fails(["directory"], tmp_path / "folder.amc", asf)
    (tmp_path / "empty.amc").write_bytes(b" \n")
    _fails(["empty"], tmp_path / "empty.amc", asf)
    (tmp_path / "binary.amc").write_bytes(bytes(range(256)))
    _fails(["binary"], tmp_path / "binary.amc", asf)


def test_any_cut_of_a_file_is_refused_or_whole(asf_files: tuple[Path, Path]) -> None:
    amc, asf = asf_files
    data = amc.read_bytes()
    whole = 0
    for end in range(len(data)):
        amc.write_bytes(data[:end])
        try:
            motion = load_motion(amc, asf)
        except InputError as error:
            assert "\n" not in str(error)  # noqa: PT017
        else:
            whole += 1
            assert len(motion.root_positions) in (1, 2)
    # Whole: after frame 1 (its last line with or without its end, and nothing of the next), and in
    # the last number.
    assert whole <= 6


def _fails(words: list[str], path: Path, skeleton: Path | None) -> None:
    with pytest.raises(InputError) as caught:
        load_motion(path, skeleton)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message, message


def test_the_skeleton_of_another_person_is_warned_of(asf_files: tuple[Path, Path]) -> None:
    amc, asf = asf_files
    walk = amc.with_name("02_01.amc")
    walk.write_bytes(amc.read_bytes())
    other, own = asf.with_name("35.asf"), asf.with_name("02.asf")
    other.write_bytes(asf.read_bytes())
    load_motion(walk, skeleton=other)  # nothing tells whose it is
    own.write_bytes(asf.read_bytes())
    load_motion(walk, skeleton=own)
    with pytest.warns(ValidityWarning, match=r"beside it is 02\.asf"):
        load_motion(walk, skeleton=other)
