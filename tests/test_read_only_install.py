"""Where neither the package nor a home can be written, all commands work, with a line of advice."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import rtradar

Command = Callable[..., subprocess.CompletedProcess[str]]

COMPILES_TWO = """
import multiprocessing
from rtradar.cli import main
from rtradar.kernels.jit import _increment, check_cache, compiled

def work():
    increment = compiled()(_increment)
    print(increment(1), increment(2.0), sum(increment.stats.cache_hits.values()), flush=True)

if __name__ == "__main__":
    main(["--version"])  # from here on warnings are shown as commands show them
    check_cache()
    work()
    worker = multiprocessing.get_context("spawn").Process(target=work)
    worker.start()
    worker.join()
"""


@pytest.fixture
def read_only(tmp_path: Path) -> Command:
    """Python from a copy of the package, by a user who may write to his working folder alone."""
    install, work = tmp_path / "install", tmp_path / "work"
    package = Path(rtradar.__file__).parent
    shutil.copytree(package, install / package.name, ignore=shutil.ignore_patterns("__pycache__"))
    for folder in ("radars", "scenes", "meshes"):
        there = package.parent / folder
        if there.is_dir():
            shutil.copytree(there, install / folder)
    work.mkdir()
    (work / "compiles_two.py").write_text(COMPILES_TWO)
    home = install / "home"
    home.mkdir()
    for folder in [install, *(path for path in install.rglob("*") if path.is_dir())]:
        folder.chmod(0o555)
    (work / "compiles_two.py").chmod(0o444)
    # Root may write everywhere, unless he gives up this right.
    right = "-dac_override,-dac_read_search"
    is_root = os.name == "posix" and os.geteuid() == 0
    without = ["setpriv", f"--bounding-set={right}", f"--inh-caps={right}"] if is_root else []
    write = [sys.executable, "-c", f"open({str(home / 'x')!r}, 'w')"]
    try:
        held = subprocess.run([*without, *write], capture_output=True, text=True)
    except OSError:
        pytest.skip("there is no setpriv here")
    if "PermissionError" not in held.stderr:
        pytest.skip("nothing keeps this user from writing")
    caches = ("XDG_", "NUMBA_", "MPL", "DRJIT_CACHE")
    environment = {key: own for key, own in os.environ.items() if not key.startswith(caches)}
    environment |= {"HOME": str(home), "TMPDIR": str(work), "PYTHONPATH": str(install)}
    environment["PYTHONDONTWRITEBYTECODE"] = "1"

    def run(*words: str, **more: str) -> subprocess.CompletedProcess[str]:
        (work / "__pycache__").mkdir(exist_ok=True)
        (work / "__pycache__").chmod(0o555)
        own = {"cwd": work, "env": {**environment, **more}, "check": False}
        command = [*without, sys.executable, *words]
        return subprocess.run(command, capture_output=True, text=True, **own)

    return run


@pytest.mark.slow
def test_compiling_without_a_cache_is_told_once(read_only: Command) -> None:
    done = read_only("compiles_two.py")
    assert done.stdout.splitlines()[-2:] == ["2 3.0 0", "2 3.0 0"]
    (line,) = done.stderr.splitlines()
    said = "rtradar: warning: compiled code is not kept (no folder for it can be written)"
    assert line.startswith(said)
    assert "NUMBA_CACHE_DIR" in line


@pytest.mark.slow
def test_a_folder_that_is_named_serves(read_only: Command, tmp_path: Path) -> None:
    done = read_only("compiles_two.py", NUMBA_CACHE_DIR=str(tmp_path / "work" / "cache"))
    assert (done.stdout.splitlines()[-2:], done.stderr) == (["2 3.0 0", "2 3.0 2"], "")


def test_commands_import_all_that_they_need(read_only: Command) -> None:
    done = read_only("-m", "rtradar", "view", "nothing")
    assert done.returncode == 2
    (line,) = done.stderr.splitlines()
    assert line.startswith("rtradar view: argument DIR: there is no 'nothing'")
    assert read_only("-m", "rtradar", "--help").returncode == 0


@pytest.mark.slow
def test_a_run_a_view_and_the_doctor(read_only: Command) -> None:
    words = ["run", "synthetic:walk", "--duration", "0.15", "--fidelity", "analytic"]
    done = read_only("-m", "rtradar", *words, "--out", "out")
    assert done.returncode == 0
    (line,) = done.stderr.splitlines()
    assert "NUMBA_CACHE_DIR" in line
    done = read_only("-m", "rtradar", "view", "out", "--no-browser")
    assert (done.returncode, done.stderr) == (0, "")
    done = read_only("-m", "rtradar", "doctor")
    assert (done.returncode, done.stderr) == (0, "")
    assert "Compiled  not kept: no folder for it can be written" in done.stdout
    assert "NUMBA_CACHE_DIR" in done.stdout
