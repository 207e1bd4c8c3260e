"""Seconds and memory of a run."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest

from rtradar.pipeline.timing import Stages, forget_peak_memory, peak_memory_mb
from rtradar.system import clock
from rtradar.system.clock import warming_up


def test_stages_add_up_by_name_also_after_an_error() -> None:
    stages = Stages()
    with stages.time("first"):
        pass
    once = stages.seconds["first"]
    with pytest.raises(ValueError, match="stop"), stages.time("first"):
        raise ValueError("stop")
    with stages.time("second"):
        pass
    assert list(stages.seconds) == ["first", "second"]
    assert stages.seconds["first"] > once >= 0


def test_warming_up_is_the_time_of_no_stage(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [0.0]
    monkeypatch.setattr(clock, "time", SimpleNamespace(perf_counter=lambda: now_s[0]))
    stages = Stages()
    with stages.time("a stage"):
        now_s[0] += 1.0
        with warming_up():
            now_s[0] += 2.0
        now_s[0] += 4.0
    with warming_up(), stages.time("another"):
        now_s[0] += 8.0
    assert stages.seconds == {"a stage": 5.0, "another": 0.0}


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux can forget a peak")
def test_a_peak_is_seen_and_forgotten() -> None:
    forget_peak_memory()  # that of whatever this process has tested before
    before = peak_memory_mb()
    big = np.ones(40_000_000)  # 320 MB
    with_it = peak_memory_mb()
    del big
    assert with_it > before + 200  # what was free before may be used again
    assert peak_memory_mb() >= with_it - 1
    forget_peak_memory()
    assert peak_memory_mb() < with_it - 200
