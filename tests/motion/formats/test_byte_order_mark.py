"""The byte order mark that editors of Windows write before a text is not part of the text."""

from __future__ import annotations

import codecs
from pathlib import Path

import numpy as np
import pytest

import rtradar as rt
from rtradar.errors import InputError
from rtradar.motion.formats.text_file import TextFile
from rtradar.system.checks import read_toml
from rtradar.system.files import read_json

ASF = """:version 1.10
:units
length 0.45
angle deg
:root
order TX TY TZ RX RY RZ
axis XYZ
position 0 0 0
orientation 0 0 0
:bonedata
begin
name thorax
direction 0 1 0
length 2
axis 0 0 0 XYZ
dof rx
end
:hierarchy
begin
root thorax
end
"""
AMC = ":FULLY-SPECIFIED\n:DEGREES\n1\nroot 0 1 0 0 0 0\nthorax 5\n2\nroot 0 1 0 0 0 10\nthorax 6\n"
BVH = """HIERARCHY
ROOT hips
{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  End Site
  {
    OFFSET 0 1 0
  }
}
MOTION
Frames: 2
Frame Time: 0.1
0 1 0 0 0 0
0 1 0 0 0 10
"""
MARK = codecs.BOM_UTF8.decode("latin-1")


def motions(folder: Path, mark: str, comment: str = "") -> list[rt.Motion]:
    for name, text in (("a.asf", ASF), ("a.amc", AMC), ("b.bvh", BVH)):
        (folder / name).write_text(
            mark + (f"# {comment}\n" if name != "b.bvh" else "") + text, encoding="latin-1"
        )
    return [
        rt.load_motion(folder / "a.amc", skeleton=folder / "a.asf"),
        rt.load_motion(folder / "b.bvh", unit_m=1.0),
    ]


def test_a_recording_is_the_same_with_it(tmp_path: Path) -> None:
    for plain, marked in zip(
        motions(tmp_path, ""), motions(tmp_path, MARK, "ÅngströmÀ"), strict=True
    ):
        assert plain.joints == marked.joints
        for field in ("offsets", "root_positions", "rotations"):
            np.testing.assert_array_equal(getattr(plain, field), getattr(marked, field))


def test_a_recording_in_utf_16_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "a.bvh").write_text(BVH, encoding="utf-16")
    with pytest.raises(InputError, match="binary data; expected BVH"):
        rt.load_motion(tmp_path / "a.bvh")


def test_line_ends_may_be_mixed(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(codecs.BOM_UTF8 + b"a\r\nb\rc\n\nd")
    assert list(TextFile(tmp_path / "x", "some")) == ["a\n", "b\n", "c\n", "\n", "d"]


def test_toml_and_json_are_the_same_with_it(tmp_path: Path) -> None:
    for name, text in (("a.toml", 'a = "é"\n'), ("a.json", '{"a": "é"}\n')):
        (tmp_path / name).write_text(text, encoding="utf-8-sig")
    assert read_toml(tmp_path / "a.toml", "some", "give another") == {"a": "é"}
    assert read_json(tmp_path / "a.json") == {"a": "é"}
