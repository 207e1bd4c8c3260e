"""Plug-in of pytest for `mutation.py`: what each test calls, its time, and whether it is slow.

Only calls are traced, not lines, and not while Numba compiles, so a run is hardly slower. Functions
that Numba compiled are not seen.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType

import pytest
from numba.core import event

ROOT = str(Path.cwd()) + os.sep
# Cases of kernels call what cannot be traced.
TRACED = tuple(f"{ROOT}{name}{os.sep}" for name in ("rtradar", "tests/kernels/references"))
_seen: set[CodeType] = set()
_found: dict[str, dict[str, object]] = {}


def _called(frame: FrameType, event: str, argument: object) -> None:
    _seen.add(frame.f_code)


class _WhileCompiling(event.Listener):
    """Pauses tracing while Numba compiles: of its millions of calls none is rtradar's."""

    def on_start(self, _: event.Event) -> None:
        sys.settrace(None)

    def on_end(self, _: event.Event) -> None:
        sys.settrace(_called if threading.gettrace() else None)


event.register("numba:compile", _WhileCompiling())


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    _seen.clear()
    threading.settrace(_called)
    sys.settrace(_called)
    yield
    sys.settrace(None)
    threading.settrace(None)
    names = {
        f"{code.co_filename.removeprefix(ROOT).removeprefix('rtradar/')}::{code.co_qualname}"
        for code in _seen
        if code.co_filename.startswith(TRACED)
    }
    _found.setdefault(item.nodeid, {})["slow"] = item.get_closest_marker("slow") is not None
    _found[item.nodeid]["calls"] = sorted(name.replace(".<locals>", "") for name in names)


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    about = _found.setdefault(report.nodeid, {})
    about["seconds"] = float(about.get("seconds", 0.0)) + report.duration
    if report.when == "call":
        about["outcome"] = report.outcome


def pytest_sessionfinish() -> None:
    Path(os.environ["MUTATION_TRACE"]).write_text(json.dumps(_found))
