"""Ctrl-C and SIGTERM, from outside: the end comes soon, in one line, and nothing is left."""

from __future__ import annotations

import platform
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from rtradar.cli import ending

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")

PIPES: Any = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
SOON_S = 10.0  # validation/robustness/interruptions.py asks 2 s of a quiet machine; tests share one


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "says"),
    [(signal.SIGINT, "stopped by the user"), (signal.SIGTERM, "ended by SIGTERM")],
)
def test_a_run_ends_soon_in_one_line_and_leaves_the_folder_as_it_was(
    tmp_path: Path, number: signal.Signals, says: str
) -> None:
    (tmp_path / "maps.h5").write_text("old")
    command = [sys.executable, "-m", "rtradar", "run", "synthetic:walk", "--fidelity", "analytic"]
    command += ["--overwrite", "--out", str(tmp_path)]
    # What is ignored here would be ignored there.
    handler = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        process = subprocess.Popen(command, **PIPES)
    finally:
        signal.signal(signal.SIGINT, handler)
    while not list(tmp_path.glob(".rtradar-*/maps.h5")):
        assert process.poll() is None
        time.sleep(0.01)
    began = time.monotonic()
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    assert time.monotonic() - began < SOON_S
    assert process.returncode == (130 if number == signal.SIGINT else 1)
    assert said.splitlines()[-1] == f"rtradar: {says}; nothing was left half-written"
    assert "Traceback" not in said
    assert {path.name for path in tmp_path.iterdir()} == {"maps.h5"}
    assert (tmp_path / "maps.h5").read_text() == "old"


def runs(process: int) -> bool:
    """Whether a process exists that has not ended; a zombie has ended."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


CHILD = """
import subprocess, sys, time
from rtradar.cli.ending import end_well
from rtradar.system.files import atomic_file, temporary_folder
end_well(lambda: "two\\nlines")
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
with temporary_folder(inside=sys.argv[1]) as folder, atomic_file(sys.argv[1] + "/new") as file:
    file.write(b"half")
    file.flush()
    print(child.pid, flush=True)
    time.sleep(600)
"""


def test_children_files_and_folders_go_too(tmp_path: Path) -> None:
    process = subprocess.Popen([sys.executable, "-c", CHILD, str(tmp_path)], **PIPES)
    assert process.stdout is not None
    child = int(process.stdout.readline())
    assert len(list(tmp_path.iterdir())) == 2
    time.sleep(0.2)
    process.send_signal(signal.SIGTERM)
    try:
        _, said = process.communicate(timeout=SOON_S)
    finally:
        process.kill()
    assert said == "rtradar: ended by SIGTERM; two lines\n"
    assert list(tmp_path.iterdir()) == []
    assert not runs(child)


FIRST_THREAD_ENDS = """
import ctypes, platform, threading
threading.Thread(target=ctypes.CDLL(None).sleep, args=(600,)).start()
exit_thread = {"x86_64": 60, "aarch64": 93}[platform.machine()]
ctypes.CDLL(None).syscall(exit_thread, 0)
"""


@pytest.mark.skipif(
    not sys.platform.startswith("linux") or platform.machine() not in ("x86_64", "aarch64"),
    reason="Linux's way",
)
def test_a_child_runs_until_its_last_thread_has_ended() -> None:
    child = subprocess.Popen([sys.executable, "-c", FIRST_THREAD_ENDS])
    try:
        while runs(child.pid):
            assert child.poll() is None
            time.sleep(0.01)
        assert child.pid in ending._descendants()
    finally:
        child.kill()
    # Until its exit status is read, the system keeps its number, without threads.
    until = time.monotonic() + 60
    while child.pid in ending._descendants():
        assert time.monotonic() < until
        time.sleep(0.01)
    child.wait()
