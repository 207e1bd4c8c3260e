"""JSON is written whole, also to a pipe, and read from anywhere; temporary folders disappear."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

from rtradar.errors import InputError
from rtradar.system.files import read_json, temporary_folder, write_json

CONTENT = {"speed": [1, 2.5], "name": "walk"}
TEXT = '{\n "speed": [\n  1,\n  2.5\n ],\n "name": "walk"\n}\n'


def test_json_reads_back(tmp_path: Path) -> None:
    path = tmp_path / "told.json"
    path.write_text("before")
    write_json(path, CONTENT)
    assert path.read_text() == TEXT
    assert read_json(path) == CONTENT
    assert [file.name for file in tmp_path.iterdir()] == ["told.json"]


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX pipes")
def test_json_goes_down_a_pipe_which_stays_one(tmp_path: Path) -> None:
    path = tmp_path / "pipe"
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        write_json(path, CONTENT)
        assert os.read(reader, 1000).decode() == TEXT
    finally:
        os.close(reader)
    assert path.is_fifo()


def test_what_is_no_number_is_not_written(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="JSON compliant"):
        write_json(tmp_path / "told.json", {"speed": float("nan")})
    assert not list(tmp_path.iterdir())


def test_a_place_that_cannot_be_written_is_told_with_its_option(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"cannot write '.*told\.json': .*; give .* \(--json\)$"):
        write_json(tmp_path / "none" / "told.json", CONTENT)


def test_json_of_anybody_has_a_size_and_a_depth(tmp_path: Path) -> None:
    path = tmp_path / "told.json"
    path.write_text(TEXT)
    os.truncate(path, 10**8 + 1)  # takes no room on the disk
    with pytest.raises(ValueError, match="more than 100 MB"):
        read_json(path)
    path.write_text("[" * 200_000)
    with pytest.raises(ValueError, match="nested too deep"):
        read_json(path)


def test_a_temporary_folder_is_gone_at_the_end(tmp_path: Path) -> None:
    with temporary_folder("mine-", inside=tmp_path) as folder:
        (folder / "file").touch()
        assert folder.parent == tmp_path
        assert folder.name.startswith("mine-")
    assert not list(tmp_path.iterdir())
