"""Which causes and which tests take the minutes of a test run.

Runs pytest with this file as its plug-in and prints, by cause, the seconds of all workers together
and the processor time of the whole tree of processes: starting and collecting (imports), compiling
by Numba, fixtures, the tests themselves, child processes, and waiting for the last worker. Then the
slowest files, tests and fixtures, and with --imports what `-X importtime` says of a worker's
imports. Nothing here is judged; the targets stand in CONTRIBUTING.md.

With --empty, compiled code begins in an empty folder, as on a new machine; otherwise it is what is
there. Arguments behind `--` go to pytest in place of those of `make test`.

    python validation/cost/minutes_of_tests.py [--empty] [--imports] [-- tests/scatter]
"""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from rtradar.system.clock import Moment

CHECKOUT = Path(__file__).resolve().parents[2]
FOLDER = "RTRADAR_MINUTES_OF_TESTS"
"""Environment variable of the folder into which each worker writes its rows."""


def _cpu() -> tuple[float, float]:
    """Processor time of this process, and of its children that have ended [s]."""
    now = os.times()
    return now.user + now.system, now.children_user + now.children_system


class Recorder:
    """The plug-in: one row a test and phase, with its seconds, processor time and compiling."""

    def __init__(self, folder: Path, worker: str) -> None:
        self._file = (folder / f"{worker}.jsonl").open("w")
        self._collected = False

    def _row(self, **values: Any) -> None:
        self._file.write(json.dumps(values) + "\n")
        self._file.flush()

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        own, children = _cpu()
        self._row(phase="collect", at=time.time(), cpu=own, child_cpu=children, test="", fixture="")

    def _measured(self, phase: str, item: pytest.Item, fixture: str = "") -> Iterator[None]:
        began, (own, children), compiling = time.perf_counter(), _cpu(), Moment.now().warm_up_s
        outcome = yield
        now = _cpu()
        self._row(
            phase=phase,
            test=item.nodeid,
            fixture=fixture,
            wall=time.perf_counter() - began,
            cpu=now[0] - own,
            child_cpu=now[1] - children,
            compiling=Moment.now().warm_up_s - compiling,
            at=time.time(),
        )
        return outcome

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_setup(self, item: pytest.Item) -> Iterator[None]:
        return (yield from self._measured("setup", item))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self, item: pytest.Item) -> Iterator[None]:
        return (yield from self._measured("call", item))

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_teardown(self, item: pytest.Item) -> Iterator[None]:
        return (yield from self._measured("teardown", item))

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: Any, request: Any) -> Iterator[Any]:
        name = f"{fixturedef.baseid}::{fixturedef.argname}"
        return (yield from self._measured("fixture", request.node, name))


def pytest_configure(config: pytest.Config) -> None:
    """Begin to record in a worker, or in the only process where there are no workers."""
    folder = os.environ.get(FOLDER)
    worker = getattr(config, "workerinput", {}).get("workerid")
    alone = not config.getoption("numprocesses", None)
    if folder and (worker or alone):
        config.pluginmanager.register(Recorder(Path(folder), worker or "alone"))


def run(arguments: list[str], empty: bool) -> dict[str, Any]:
    """Run pytest once, and return its rows by worker, its seconds and its processor time."""
    with tempfile.TemporaryDirectory() as temporary:
        rows = Path(temporary) / "rows"
        rows.mkdir()
        paths = [str(Path(__file__).parent), *filter(None, [os.environ.get("PYTHONPATH")])]
        environment = os.environ | {FOLDER: str(rows), "PYTHONPATH": os.pathsep.join(paths)}
        if empty:
            environment |= {"NUMBA_CACHE_DIR": f"{temporary}/numba"}
        command = [sys.executable, "-m", "pytest", "-q", "-p", Path(__file__).stem, *arguments]
        began, before = time.time(), _cpu()[1]
        status = subprocess.run(command, cwd=CHECKOUT, env=environment, check=False).returncode
        ended = time.time()
        found = {
            path.stem: [json.loads(line) for line in path.read_text().splitlines()]
            for path in sorted(rows.iterdir())
        }
    return {
        "command": command[3:],
        "status": status,
        "began": began,
        "wall": ended - began,
        "cpu": _cpu()[1] - before,
        "workers": found,
    }


def causes(found: dict[str, Any]) -> list[tuple[str, float, float]]:
    """Seconds of all workers, and their processor time, by cause."""
    seconds, cpu = Counter[str](), Counter[str]()
    ended = found["began"] + found["wall"]
    for rows in found["workers"].values():
        first, rest = rows[0], rows[1:]
        seconds["start, imports, collection"] += first["at"] - found["began"]
        cpu["start, imports, collection"] += first["cpu"]
        for row in rest:
            if row["phase"] == "fixture":
                continue
            compiling = row["compiling"]
            kind = "tests" if row["phase"] == "call" else "fixtures"
            if row["child_cpu"] > 0.05:
                kind = f"{kind} that start processes"
            seconds[kind] += row["wall"] - compiling
            cpu[kind] += row["cpu"] - compiling
            seconds["compiling in workers"] += compiling
            cpu["compiling in workers"] += compiling
            cpu["child processes"] += row["child_cpu"]
        seconds["waiting for the last worker, ending"] += ended - rows[-1]["at"]
    return [
        (name, seconds[name], cpu[name]) for name in sorted(cpu, key=lambda name: -seconds[name])
    ]


def show(found: dict[str, Any], most: int) -> None:
    """Print the tables."""
    rows = [row for each in found["workers"].values() for row in each[1:]]
    tests = {row["test"] for row in rows if row["phase"] == "call"}
    print(f"\n{' '.join(found['command'])}")
    print(f"{len(tests)} tests, {found['wall']:.0f} s, processor time {found['cpu']:.0f} s")
    print(f"\n{'cause':45s} {'seconds':>8s} {'cpu':>8s}")
    for name, wall, cpu in causes(found):
        print(f"{name:45s} {wall:8.1f} {cpu:8.1f}")
    for title, key, phases in (
        ("file", lambda row: row["test"].split("::")[0], ("setup", "call", "teardown")),
        (
            "test, all its cases",
            lambda row: row["test"].split("[")[0],
            ("setup", "call", "teardown"),
        ),
        ("fixture (with those it asks for)", lambda row: row["fixture"], ("fixture",)),
    ):
        sums: dict[str, list[float]] = defaultdict(lambda: [0.0] * 5)
        for row in rows:
            if row["phase"] in phases:
                add = (1, row["wall"], row["cpu"], row["child_cpu"], row["compiling"])
                sums[key(row)] = [old + new for old, new in zip(sums[key(row)], add, strict=True)]
        print(f"\n{'wall':>7s} {'cpu':>7s} {'child':>7s} {'numba':>7s}  {title}")
        for name, (_, wall, cpu, child, compiling) in sorted(
            sums.items(), key=lambda item: -item[1][1]
        )[:most]:
            print(f"{wall:7.1f} {cpu:7.1f} {child:7.1f} {compiling:7.1f}  {name}")


def show_imports(most: int) -> None:
    """Print what a worker imports before its first test, by package, from `-X importtime`."""
    code = "import pytest; pytest.main(['-q', '--collect-only', '-p', 'no:xdist'])"
    said = subprocess.run(
        [sys.executable, "-X", "importtime", "-c", code],
        cwd=CHECKOUT, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False,
    ).stderr  # fmt: skip
    own: Counter[str] = Counter()
    for match in re.finditer(r"^import time:\s+(\d+) \|\s+\d+ \|\s*(\S+)", said, re.MULTILINE):
        own[match[2].split(".")[0]] += int(match[1])
    print(f"\nimports of one process: {sum(own.values()) / 1e6:.2f} s")
    for name, microseconds in own.most_common(most):
        print(f"{microseconds / 1e6:7.2f}  {name}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--empty", action="store_true", help="begin without compiled code")
    parser.add_argument("--imports", action="store_true", help="show what imports take, too")
    parser.add_argument("--json", type=Path, help="write all rows here")
    parser.add_argument("--show", type=Path, help="show the rows of this file, run nothing")
    parser.add_argument("--most", type=int, default=40, help="rows of each table")
    parser.add_argument("arguments", nargs="*", help="of pytest, behind --")
    options = parser.parse_args()
    if options.show:
        show(json.loads(options.show.read_text()), options.most)
        return 0
    given = options.arguments or ["-n", "auto", "--dist", "worksteal", "-m", "not slow"]
    found = run(given, options.empty)
    if options.json:
        options.json.write_text(json.dumps(found))
    show(found, options.most)
    if options.imports:
        show_imports(options.most)
    return found["status"]


if __name__ == "__main__":
    sys.exit(main())
