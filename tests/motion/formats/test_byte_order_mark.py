"""Texts as programs write them: a byte order mark is no part of them, and line ends are mixed."""

from __future__ import annotations

import codecs
from pathlib import Path

import numpy as np
import pytest

from rtradar.errors import InputError
from rtradar.motion import load_motion
from rtradar.motion.formats.text_file import TextFile
from rtradar.system.checks import read_toml
from rtradar.system.files import read_json

BVH = """HIERARCHY
ROOT hips { OFFSET 0 0 0 CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
End Site { OFFSET 0 1 0 } }
MOTION
Frames: 1
Frame Time: 0.1
0 1 0 0 0 10
"""
COMMENT = "# \u00c5ngstr\u00f6m\n".encode("latin-1")


def test_a_recording_is_the_same_with_it(tmp_path: Path, asf_files: tuple[Path, Path]) -> None:
    bvh = tmp_path / "b.bvh"
    bvh.write_text(BVH)
    plain = load_motion(*asf_files), load_motion(bvh, unit_m=1.0)
    for path in (*asf_files, bvh):
        comment = b"" if path == bvh else COMMENT
        path.write_bytes(codecs.BOM_UTF8 + comment + path.read_bytes())
    marked = load_motion(*asf_files), load_motion(bvh, unit_m=1.0)
    for one, other in zip(plain, marked, strict=True):
        assert one.joints == other.joints
        for field in ("offsets", "root_positions", "rotations"):
            np.testing.assert_array_equal(getattr(one, field), getattr(other, field))


def test_a_recording_in_utf_16_is_no_text(tmp_path: Path) -> None:
    (tmp_path / "a.bvh").write_text(BVH, encoding="utf-16")
    with pytest.raises(InputError, match="binary data; expected BVH"):
        load_motion(tmp_path / "a.bvh")


def test_line_ends_may_be_mixed(tmp_path: Path) -> None:
    (tmp_path / "x").write_bytes(codecs.BOM_UTF8 + b"a\r\nb\rc\n\nd")
    assert list(TextFile(tmp_path / "x", "some")) == ["a\n", "b\n", "c\n", "\n", "d"]


def test_toml_and_json_are_the_same_with_it(tmp_path: Path) -> None:
    for name, text in (("a.toml", 'a = "\u00e9"\n'), ("a.json", '{"a": "\u00e9"}\n')):
        (tmp_path / name).write_text(text, encoding="utf-8-sig")
    assert read_toml(tmp_path / "a.toml", "some", "give another") == {"a": "\u00e9"}
    assert read_json(tmp_path / "a.json") == {"a": "\u00e9"}
