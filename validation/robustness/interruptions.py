"""Commands that are interrupted or killed at several moments: the files, the time, the message.

Ctrl-C (SIGINT to the whole group, as from a terminal), SIGTERM and SIGKILL come at each stage of
``run``, ``compare``, ``dataset build``, ``train``, ``export`` and ``view``, some with an output
folder that holds an older result of the same command. Claimed is that every file is as it was
before or as an undisturbed command leaves it. After Ctrl-C and SIGTERM there are no other files,
the command ends within 2 s, with status 130 and 1 respectively, one line and no traceback, and no
process is left. No command notices SIGKILL: after it the folder of a run holds old files or new
ones. If the kill came between the renames of its files it holds both, its list says so, and a
command that reads it refuses it in one line. A command that only reads changes nothing, and the
next run removes what is neither. With --quick each stage gets one of the three in turn.

    python validation/robustness/interruptions.py [--quick] [--json FILE] [--figure DIR]
"""

from __future__ import annotations

import contextlib
import itertools
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import psutil
from campaign_kills import HALVES, RADAR

from rtradar.validate.rows import Row, judged, main

SAYS = "an interrupted command: "
SIGNALS = "SIGINT", "SIGTERM", "SIGKILL"
STATUS = {"SIGINT": 130, "SIGTERM": 1}
PATIENCE_S = 300.0
SPEC = f"""
[windows]
duration_s = 0.5
[each]
radar = ["small.toml"]
fidelity = ["analytic"]
{HALVES}
"""


@dataclass(frozen=True)
class Stage:
    """Progress of a command at which it is disturbed.

    ``sign`` shows it from outside: the command ``hears`` signals, ``loads`` a library of that name,
    or ``compiles`` or ``writes`` a file of that name, in the folder of compiled code or in its own.
    The signal comes ``delay_s`` later.
    """

    name: str
    sign: str
    delay_s: float = 0.0


@dataclass(frozen=True)
class Case:
    """A command, whose output folder is written {out}, and the stages at which it is disturbed."""

    name: str
    words: tuple[str, ...]
    stages: tuple[Stage, ...]
    cold: bool = False  # with an empty cache of compiled code
    single: bool = False  # each file is whole on its own, and they need not belong together
    anew: bool = True  # into an empty folder, not over older files


def cases(work: Path, quick: bool) -> list[Case]:
    walk = ("run", "synthetic:walk", "--duration", "0.5", "--save-if", "--pictures")
    walk += ("--out", "{out}")
    run = Case(
        "run",
        walk,
        (
            Stage("imports", "hears", 0.1),
            Stage("warm-up", "loads llvmlite", 0.1),
            Stage("scatter", "writes .rtradar-*/maps.h5", 0.3),
            Stage("pictures", "writes .rtradar-*/*.png", 0.1),
            Stage("report", "writes .rtradar-*/report.html"),
        ),
        anew=False,
    )
    compiles = Case(
        "run, nothing compiled yet",
        (*walk, "--fidelity", "physical-optics"),
        (
            Stage("compiling", "compiles numba/**/*.nbc"),
            Stage("compiling on", "compiles numba/**/*.nbc", 5.0),
        ),
        cold=True,
    )
    traces = Case(
        "run in a room",
        (*walk, "--scene", "living-room"),
        (
            Stage("loading", "loads mitsuba"),
            Stage("tracing", "compiles drjit/*"),
            Stage("tracing on", "compiles drjit/*", 2.0),
        ),
        cold=True,
    )
    compare = Case(
        "compare",
        (
            "compare",
            "synthetic:kick",
            "--duration",
            "0.5",
            "--fidelities",
            "analytic,specular",
            "--out",
            "{out}",
        ),
        (
            Stage("first model", "writes .rtradar-*/analytic/.rtradar-*/maps.h5", 0.2),
            Stage("second model", "writes .rtradar-*/specular/.rtradar-*/maps.h5", 0.2),
        ),
        anew=False,
    )
    build = Case(
        "dataset build",
        ("dataset", "build", str(work / "set.toml"), "--workers", "2", "--out", "{out}"),
        (
            Stage("cluster starts", "writes collection.json", 0.8),
            Stage("samples", "writes [!.]*.npz", 0.1),
        ),
        single=True,
    )
    train = Case(
        "train",
        (
            "train",
            str(work / "clouds"),
            "--points",
            "64",
            "--folds",
            "2",
            "--epochs",
            "4000",
            "--out",
            "{out}",
        ),
        (
            Stage("first epochs", "writes plan.json", 2.0),
            Stage("past a checkpoint", "writes training-01/checkpoint.pt", 0.5),
        ),
        single=True,
    )
    export = Case(
        "export",
        ("export", str(work / "before-run"), "--out", "{out}/samples.nc"),
        (Stage("samples", "writes .samples.nc.*"),),
        single=True,
        anew=False,
    )
    view = Case(
        "view",
        (
            "view",
            str(work / "before-run"),
            "--out",
            "{out}/view.html",
            "--still",
            "{out}/still.png",
        ),
        (
            Stage("loading", "hears", 0.5),
            Stage("page", "writes .view.html.*"),
            Stage("still", "writes view.html"),
        ),
        single=True,
        anew=False,
    )
    return [run, build] if quick else [run, compiles, traces, compare, build, train, export, view]


def start(case: Case, out: Path, work: Path) -> subprocess.Popen[str]:
    environment = dict(os.environ)
    if case.cold:
        shutil.rmtree(work / "cold", ignore_errors=True)
        environment |= {
            f"{name.upper()}_CACHE_DIR": str(work / "cold" / name) for name in ("numba", "drjit")
        }
    out.mkdir(exist_ok=True)
    command = [sys.executable, "-m", "rtradar", *(word.format(out=out) for word in case.words)]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen(command, env=environment, start_new_session=True, **pipes)


def contents(folder: Path) -> dict[str, int]:
    """All files, with the time at which each was written."""
    return {
        str(path.relative_to(folder)): path.stat().st_mtime_ns
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


def wait_for(
    sign: str, out: Path, work: Path, since: float, process: subprocess.Popen[str]
) -> bool:
    """Wait for the sign; return whether the process still runs."""
    kind, _, name = sign.partition(" ")
    running = psutil.Process(process.pid)
    while process.poll() is None:
        with contextlib.suppress(psutil.Error, OSError):  # it ended, or a file vanished, meanwhile
            # A second thread waits for signals as soon as rtradar, and not Python, handles them.
            if kind == "hears" and running.num_threads() > 1:
                return True
            if kind == "loads" and any(name in part.path for part in running.memory_maps()):
                return True
            folder = {"compiles": work / "cold", "writes": out}.get(kind)
            if folder is not None and any(
                path.stat().st_mtime >= since for path in folder.glob(name)
            ):
                return True
        time.sleep(0.005)
    return False


def disturb(case: Case, stage: Stage, name: str, before: Path, work: Path) -> tuple[str, list[Row]]:
    """Disturb one command once; return its line of the table and its rows."""
    out = work / "out"
    shutil.rmtree(out, ignore_errors=True)
    if before.exists():
        shutil.copytree(before, out)
    old = contents(out) if out.exists() else {}
    since = time.time()
    process = start(case, out, work)
    alive = wait_for(stage.sign, out, work, since, process)
    time.sleep(stage.delay_s)
    claim = f"{case.name}, {stage.name}: {name}"
    if not alive or process.poll() is not None:
        process.communicate()
        return f"{case.name:26} {stage.name:18} {name:8} it had ended before", []
    children = psutil.Process(process.pid).children(recursive=True)
    began = time.monotonic()
    if name == "SIGINT":
        os.killpg(process.pid, signal.SIGINT)
    else:
        process.send_signal(getattr(signal, name))
    try:
        _, said = process.communicate(timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        _, said = process.communicate()
    seconds = time.monotonic() - began
    _, orphans = psutil.wait_procs(children, timeout=10)
    after = contents(out) if out.exists() else {}
    left = tally(old, after)
    hidden, lost, changed, new = compared(old, after)
    touched, refused = 0, False
    if name == "SIGKILL" and not case.single:
        look = [
            sys.executable,
            "-m",
            "rtradar",
            "export",
            str(out),
            "--out",
            str(work / "samples.mat"),
        ]
        looked = subprocess.run(
            look, capture_output=True, check=False, timeout=PATIENCE_S, text=True
        )
        refused = (
            looked.returncode == 2
            and "holds files of two runs" in looked.stderr
            and looked.stderr.count("\n") == 1
        )
        touched = len(set((contents(out) if out.exists() else {}).items()) ^ set(after.items()))
        _, said_again = start(case, out, work).communicate(timeout=PATIENCE_S)
        if said_again:
            print(said_again)
        hidden = compared(old, contents(out))[0]
        left += f"{', refused by a reader' if refused else ''}, then {tally(old, contents(out))}"
    lines = [line for line in said.replace("\r", "\n").splitlines() if line.startswith("rtradar: ")]
    ended = f"{seconds:5.2f} s  status {process.returncode:3d}  {left}; {len(orphans)} processes"
    row = f"{case.name:26} {stage.name:18} {name:8} {ended}"
    found = [
        judged(claim, "old files lost", "1", len(lost), 0, says=SAYS + "old files lost"),
        judged(claim, "processes left", "1", len(orphans), 0, says=SAYS + "processes left"),
    ]
    if not case.single:
        mixed = len(changed) + len(new) if len(changed) < len(old) and not refused else 0
        found.append(
            judged(
                claim,
                "old and new files mixed",
                "1",
                mixed,
                0,
                says=SAYS + "old and new files mixed, not refused",
            )
        )
    if name == "SIGKILL" and not case.single:
        found.append(
            judged(
                claim,
                "files that a reader changed",
                "1",
                touched,
                0,
                says=SAYS + "files that a reader changed",
            )
        )
    if name != "SIGKILL":
        found += [
            judged(claim, "end", "s", seconds, 2.0, says=SAYS + "seconds until it has ended"),
            judged(
                claim,
                "exit status",
                "1",
                process.returncode,
                0,
                reference=STATUS[name],
                says=SAYS + "exit status (error against 130 after Ctrl-C, 1 after SIGTERM)",
            ),
            judged(
                claim,
                "lines printed, less one",
                "1",
                len(lines),
                0,
                reference=1,
                says=SAYS + "lines other than one",
            ),
            judged(claim, "tracebacks", "1", said.count("Traceback"), 0, says=SAYS + "tracebacks"),
        ]
    if not (name == "SIGKILL" and case.single):
        found.append(
            judged(
                claim, "unfinished files", "1", len(hidden), 0, says=SAYS + "unfinished files left"
            )
        )
    return row, found


def compared(
    old: dict[str, int], after: dict[str, int]
) -> tuple[list[str], list[str], list[str], list[str]]:
    """Files that are unfinished, and of the others those lost, rewritten, and new."""
    hidden = [path for path in after if any(part.startswith(".") for part in Path(path).parts)]
    lost = [path for path in old if path not in after]
    changed = [path for path in after if path in old and after[path] != old[path]]
    new = [path for path in after if path not in old and path not in hidden]
    return hidden, lost, changed, new


def tally(old: dict[str, int], after: dict[str, int]) -> str:
    """Numbers of files by their kind, in words."""
    hidden, lost, changed, new = compared(old, after)
    kept = len(old) - len(lost) - len(changed)
    return f"{kept} old, {len(changed) + len(new)} new, {len(hidden)} unfinished"


def measure(quick: bool) -> list[Row]:
    found: list[Row] = []
    in_turn = itertools.cycle(SIGNALS)
    signal.signal(
        signal.SIGINT, signal.default_int_handler
    )  # a command started with "&" would pass on that it ignores the signal
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        (work / "small.toml").write_text(RADAR)
        (work / "set.toml").write_text(SPEC.format(half=6))
        build = [
            sys.executable,
            "-m",
            "rtradar",
            "dataset",
            "build",
            str(work / "set.toml"),
            "--workers",
            "1",
        ]
        subprocess.run([*build, "--out", str(work / "clouds")], check=True, capture_output=True)
        (work / "set.toml").write_text(SPEC.format(half=200))
        for case in cases(work, quick):
            before = work / f"before-{case.name.replace(' ', '-')}"
            if not case.anew:
                process = start(case, before, work)
                _, said = process.communicate(timeout=PATIENCE_S)
                if process.returncode:
                    raise SystemExit(said)
            for stage in case.stages:
                for name in [next(in_turn)] if quick else SIGNALS:
                    row, rows = disturb(case, stage, name, before, work)
                    print(row, flush=True)
                    found += rows
    return found


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
