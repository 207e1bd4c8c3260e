"""Arrays that wait in a file: the same rows, no memory, one line where there is no room."""

from __future__ import annotations

import errno
import gc
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.system import row_files
from rtradar.system.row_files import column, file_backed, in_blocks, release_pages

ROWS = np.random.default_rng(0).normal(size=(5000, 7, 4))


def pieces(rows: NDArray[np.float64], size: int) -> list[NDArray[np.float64]]:
    return [rows[first : first + size] for first in range(0, len(rows), size)]


@pytest.mark.parametrize("size", [1, 640, 5000])
@pytest.mark.parametrize("most", [0, 300_000, 10**9])
def test_rows_come_back(monkeypatch: pytest.MonkeyPatch, size: int, most: int) -> None:
    monkeypatch.setattr(row_files, "_MOST_IN_MEMORY", most)
    gc.collect()  # what other tests left
    gc.freeze()  # and what they keep is not searched again
    before = len(row_files._mapped)
    rows = file_backed(pieces(ROWS, size))
    np.testing.assert_array_equal(rows, ROWS)
    assert len(row_files._mapped) - before == (most < ROWS.nbytes)
    assert (rows.flags.writeable) == (most > ROWS.nbytes)
    # What is made of it keeps it, and lets it go.
    part = np.ascontiguousarray(rows[10:20])
    del rows
    gc.collect()
    release_pages(part)
    np.testing.assert_array_equal(part, ROWS[10:20])
    del part
    gc.collect()
    assert len(row_files._mapped) == before


def test_no_rows_keep_their_shape(monkeypatch: pytest.MonkeyPatch) -> None:
    assert file_backed([np.zeros((0, 5))]).shape == (0, 5)
    monkeypatch.setattr(row_files, "_MOST_IN_MEMORY", 0)
    assert file_backed([np.zeros((0, 5)), np.ones((2, 5)), np.zeros((0, 5))]).shape == (2, 5)


def test_arrays_beyond_the_files_stay_in_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(row_files, "_MOST_IN_MEMORY", 0)
    gc.collect()
    monkeypatch.setattr(row_files, "_MOST_FILES", len(row_files._mapped) + 1)
    first, second = file_backed([ROWS]), file_backed(pieces(ROWS, 700))
    assert not first.flags.writeable
    assert second.flags.writeable
    np.testing.assert_array_equal(first, second)


def test_blocks_cover_all_rows() -> None:
    others = np.arange(float(len(ROWS)))
    blocks = list(in_blocks(ROWS, others))
    assert len(blocks) > 1
    np.testing.assert_array_equal(np.concatenate([rows for rows, _ in blocks]), ROWS)
    np.testing.assert_array_equal(np.concatenate([rows for _, rows in blocks]), others)
    np.testing.assert_array_equal(column(ROWS, 3), ROWS[:, 3])
    np.testing.assert_array_equal(column(ROWS, [5, 2]), ROWS[:, [5, 2]])


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_what_waits_in_a_file_is_no_memory() -> None:
    def resident_mb() -> float:
        return (
            int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
        )

    file_backed([np.ones((1, 100))] * 2000)  # what the first of all takes
    before = resident_mb()
    rows = file_backed(np.full((1000, 100), float(number)) for number in range(100))  # 80 MB
    means = [block.mean() for (block,) in in_blocks(rows)]
    first = column(rows, 0)  # 0.8 MB
    assert rows.nbytes == 80_000_000
    assert resident_mb() - before < 10
    assert np.mean(means) == pytest.approx(49.5, rel=0.02)  # blocks are no whole thousands
    assert first[-1] == 99
    assert rows.sum() == 49.5 * 100 * 100_000
    assert resident_mb() - before > 70  # as it would be, were it not let go
    release_pages(rows)
    assert resident_mb() - before < 10


def limited(limit: str, value: int, code: str) -> subprocess.CompletedProcess[str]:
    """Code in a process of its own, in which one resource has a limit."""
    begin = f"""
import resource, numpy as np
from rtradar.system import row_files
from rtradar.system.row_files import file_backed
resource.setrlimit(resource.{limit}, ({value},) * 2)
"""
    return subprocess.run(
        [sys.executable, "-W", "error", "-c", begin + code],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.skipif(sys.platform == "win32", reason="it has no such limits")
@pytest.mark.parametrize("rows", [1, 7, 5000])
def test_a_full_disk_is_one_line(rows: int) -> None:
    # Beyond the limit a write fails as on a full disk, once its signal is let be.
    code = f"""
import signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
try:
    file_backed(np.ones(({rows}, 100)) for _ in range({100_000 // rows}))
except ValueError as error:
    print(error)
"""
    done = limited("RLIMIT_FSIZE", 2_000_000, code)
    assert done.stderr == ""
    assert re.fullmatch(
        r"a long recording, \d+ MB so far, finds no room in \S+ for temporary .*TMPDIR.*\n",
        done.stdout,
    )


@pytest.mark.skipif(sys.platform == "win32", reason="it has no such limits")
def test_without_a_file_more_rows_stay_in_memory() -> None:
    code = """
kept = [file_backed([np.full((200_000,), number)]) for number in range(40)]
right = [rows.mean() == number for number, rows in enumerate(kept)].count(True)
print(right, len(row_files._mapped))
"""
    done = limited("RLIMIT_NOFILE", 20, code)
    assert done.stderr == ""
    right, in_files = map(int, done.stdout.split())
    assert right == 40
    assert 0 < in_files < 20


def test_no_temporary_folder_is_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def nowhere() -> None:
        raise FileNotFoundError(errno.ENOENT, "No usable temporary directory found in ['/tmp']")

    monkeypatch.setattr(row_files.tempfile, "TemporaryFile", nowhere)
    monkeypatch.setattr(row_files.tempfile, "tempdir", None)
    with pytest.raises(
        InputError, match=r"no room in any folder for temporary files [^\n]*TMPDIR[^\n]*$"
    ):
        file_backed([ROWS])
