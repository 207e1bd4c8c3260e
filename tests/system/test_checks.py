"""What counts as a number, and what is no table of a TOML file."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import rtradar as rt
from rtradar.campaign.spec_file import read_spec
from rtradar.system.checks import is_real, is_whole


@pytest.mark.parametrize("number", [3, 0, -(10**30), np.int8(3), np.uint64(3)])
def test_whole_numbers_of_python_and_numpy_are_real_too(number: object) -> None:
    assert is_whole(number)
    assert is_real(number)


@pytest.mark.parametrize(
    "number", [3.0, float("nan"), np.float32(3), np.float64(3), np.longdouble(3)]
)
def test_floats_are_real_and_not_whole(number: object) -> None:
    assert is_real(number)
    assert not is_whole(number)


@pytest.mark.parametrize(
    "thing", [True, np.True_, None, "3", 3j, np.complex64(3), np.array(3), [3], Fraction(1, 2)]
)
def test_nothing_else_is_a_number(thing: object) -> None:
    assert not is_real(thing)
    assert not is_whole(thing)


NO_TOML = b"name = ", b"a = 6\na = 7", b"\0", b"\xff\xfe", b'a = "\xe9"', b"[a", b"12"
READERS: dict[str, Any] = {"radar": rt.Radar.load, "scene": rt.Scene.load, "data set": read_spec}


@pytest.mark.parametrize("kind", READERS)
@pytest.mark.parametrize(
    ("text", "says"),
    [
        (None, "No such file"),
        *((text, "is not TOML: ") for text in NO_TOML),
        (b"#" * 1_000_001, "larger than 1 MB"),
        (b"nam = 1", "unknown key 'nam'"),
        (b"[seeed]\ntx_y = 1", "unknown key 'seeed'"),
    ],
)
def test_a_file_that_is_no_table_is_told_in_one_line(
    kind: str, text: bytes | None, says: str, tmp_path: Path
) -> None:
    file = tmp_path / "mine.toml"
    if text is not None:
        file.write_bytes(text)
    with pytest.raises(rt.InputError) as caught:
        READERS[kind](file)
    lines = getattr(caught.value, "lines", None) or [str(caught.value)]
    assert any(says in line for line in lines)
    assert all("mine.toml'" in line and "\n" not in line for line in lines)


@pytest.mark.parametrize("kind", READERS)
def test_a_folder_is_no_file(kind: str, tmp_path: Path) -> None:
    (tmp_path / "folder.toml").mkdir()
    with pytest.raises(rt.InputError, match=r"folder\.toml'"):
        READERS[kind](tmp_path / "folder.toml")
