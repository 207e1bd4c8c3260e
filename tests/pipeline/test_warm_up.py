"""First use: who compiles what, and that nobody is left behind."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from rtradar.pipeline import warm_up
from rtradar.pipeline.warm_up import processing_compiled_beside
from rtradar.system.threads import THREADS_VARIABLE

FIRST_USE = """
import rtradar as rt
from rtradar.kernels.prime_factor_dft import _transform
from rtradar.kernels.scatter.specular_point import solve
from rtradar.kernels.tone_sum import add_tones
motion, radar = rt.synthetic_motion("walk", seed=0, duration_s=0.15), rt.Radar.preset("paper-12ghz")
rt.run(motion, radar, fidelity="analytic", snr_db=20)
for function in add_tones, _transform, solve:
    assert len(function.signatures) == 1
    print(sum(function.stats.cache_hits.values()), sum(function.stats.cache_misses.values()))
"""


@pytest.mark.slow
def test_on_first_use_another_process_compiles_the_processing(tmp_path: Path) -> None:
    environment = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "TMPDIR": str(tmp_path),
        THREADS_VARIABLE: "2",
    }
    command = [sys.executable, "-W", "ignore", "-c", FIRST_USE]
    said = subprocess.run(
        command, env=environment, capture_output=True, text=True, check=True
    ).stdout
    assert said.splitlines()[-3:] == [
        "1 0",
        "1 0",
        "0 1",
    ]  # found on disk, found on disk, compiled here


@pytest.fixture
def others(monkeypatch: pytest.MonkeyPatch) -> list[subprocess.Popen[bytes]]:
    """Processes that are started, as on first use and with cores to spare."""
    started: list[subprocess.Popen[bytes]] = []

    class Noted(subprocess.Popen):  # type: ignore[type-arg]
        def __init__(self, words: list[str], **options: Any) -> None:
            super().__init__([sys.executable, "-c", "import time; time.sleep(60)"], **options)
            started.append(self)

    monkeypatch.setattr(subprocess, "Popen", Noted)
    monkeypatch.setattr(warm_up, "is_on_disk", lambda _: False)
    monkeypatch.setenv(THREADS_VARIABLE, "2")
    return started


def test_an_error_leaves_no_process_behind(others: list[subprocess.Popen[bytes]]) -> None:
    with pytest.raises(KeyboardInterrupt), processing_compiled_beside():
        raise KeyboardInterrupt
    (other,) = others
    assert other.returncode not in (None, 0)


def test_standard_input_is_open_as_long_as_the_first_process_is_there(
    others: list[subprocess.Popen[bytes]],
) -> None:
    with processing_compiled_beside():
        (other,) = others
        assert other.stdin is not None
        assert not other.stdin.closed
        other.kill()


def test_it_ends_with_standard_input(tmp_path: Path) -> None:
    words = (
        "from rtradar.pipeline.warm_up import *; import time\n"
        "end_with_the_other_process(); time.sleep(60)"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    ended = subprocess.run(
        [sys.executable, "-c", words], env=environment, stdin=subprocess.DEVNULL, check=False
    )
    assert ended.returncode == 1


def test_one_that_takes_too_long_is_not_waited_for(
    others: list[subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(warm_up, "_MAX_S", 0.01)
    with processing_compiled_beside():
        pass
    (other,) = others
    assert other.returncode not in (None, 0)


@pytest.mark.parametrize("executable", ["/opt/blender/blender", "", None])
def test_another_program_is_not_started_again(
    others: list[subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch, executable: str | None
) -> None:
    monkeypatch.setattr(sys, "executable", executable)
    with processing_compiled_beside():
        pass
    assert others == []


def test_one_core_is_not_shared(
    others: list[subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(THREADS_VARIABLE, "1")
    with processing_compiled_beside():
        pass
    assert others == []


def test_nothing_is_compiled_twice(
    others: list[subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(warm_up, "is_on_disk", lambda _: True)
    with processing_compiled_beside():
        pass
    assert others == []
