"""Places where files can be, and names of things that are none."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from rtradar.cli import main
from rtradar.errors import InputError
from rtradar.system.files import atomic_file, check_place, write_json

WRITE = """
import sys
from rtradar.system.files import write_json
print('before')
write_json(sys.argv[1], {'a': 1})
print('after')
"""


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="needs /proc")
@pytest.mark.parametrize("kind", ["file", "pipe"])
def test_json_goes_to_the_standard_output_wherever_that_goes(tmp_path: Path, kind: str) -> None:
    stdout, sent = tmp_path / "stdout", tmp_path / "sent"
    stdout.symlink_to("/proc/self/fd/1")  # as /dev/stdout is
    command = [sys.executable, "-c", WRITE, str(stdout)]
    if kind == "pipe":
        told = subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout
    else:
        with sent.open("w") as file:
            subprocess.run(command, stdout=file, check=True)
        told = sent.read_text()
    assert told == 'before\n{\n "a": 1\n}\nafter\n'
    assert stdout.is_symlink()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs POSIX")
def test_what_is_no_file_is_not_replaced_by_one(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "device")
    with (
        pytest.raises(InputError, match=r"cannot write '.*device': .* is no file"),
        atomic_file(tmp_path / "device"),
    ):
        pass
    assert (tmp_path / "device").is_fifo()


@pytest.mark.parametrize(
    ("name", "says"),
    [("nowhere/x.json", "there is no folder"), (".", "is a folder"), ("x" * 300, "too long")],
)
def test_a_place_where_no_json_can_be_is_found_out_before_the_work(
    tmp_path: Path, name: str, says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    # The folder holds no clouds either, which would be reported next.
    empty = str(tmp_path)
    for command in (
        ["doctor"],
        ["view", empty],
        ["evaluate", empty],
        ["export", empty, "--out", "x.npz"],
    ):
        assert main([*command, "--json", str(tmp_path / name)]) == 2
        err = capsys.readouterr().err
        assert err.startswith("rtradar: --json")
        assert says in err
        assert err.count("\n") == 1


def test_links_in_a_circle_are_replaced(tmp_path: Path) -> None:
    link = tmp_path / "x.json"
    link.symlink_to(link)
    check_place(link)
    write_json(link, {"a": 1})
    assert json.loads(link.read_text()) == {"a": 1}
