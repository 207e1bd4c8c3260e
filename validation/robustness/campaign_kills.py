"""Data sets that are killed while they are built: no sample is lost, made twice, or different.

Five things happen to a build: a worker is killed by signal 9; the whole build is; the scheduler of
a cluster is; the disk is full (a tmpfs of a few samples where one can be mounted, else a limit on
the size of files); and a sample is cut short. After each the same command runs again, and the
result is compared with an undisturbed build, byte by byte. Last, the throughput of two workers is
measured against that of one.

    python validation/robustness/campaign_kills.py [--quick] [--json FILE]
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import psutil

from rtradar.clouds.sample_files import INDEX, MADE_FROM, is_whole
from rtradar.validate.rows import Row, judged, main, reported

RADAR = """
tx_y = 2
tx_z = 0
rx_y = 4
rx_z = 0
chirp_duration_s = 250e-6
samples_per_chirp = 128
frame_duration_s = 0.05
"""
HALVES = """
[[synthetic]]
label = "walk"
count = {half}
[[synthetic]]
label = "kick"
count = {half}
"""
SPEC = f"""
[windows]
duration_s = {{seconds}}
[each]
radar = ["{{radar}}"]
fidelity = ["{{fidelity}}"]
[drawn]
snr_db = [15, 25]
heading_deg = [-30, 30]
{HALVES}
"""
RTRADAR = [sys.executable, "-m", "rtradar", "dataset", "build"]
ONE_WORKER = ("--workers", "1")  # is enough to continue a build
UNDISTURBED = "undisturbed"
PATIENCE_S = 600.0
SAMPLE_BYTES = 60_000  # fewer than any sample has


class Trial:
    """A data set that is built again and again, each time in a folder of its own, and disturbed."""

    def __init__(self, work: Path, samples: int, seconds: float, fidelity: str) -> None:
        self.work, self.samples = work, samples
        (work / "small.toml").write_text(RADAR)
        self.spec = work / "set.toml"
        self.spec.write_text(
            SPEC.format(seconds=seconds, radar="small.toml", fidelity=fidelity, half=samples // 2)
        )
        self.undisturbed: dict[str, bytes] = {}

    def start(self, out: Path, *options: str) -> subprocess.Popen[str]:
        command = [*RTRADAR, str(self.spec), "--out", str(out), *(options or ("--workers", "2"))]
        return subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )

    def finish(self, out: Path, *options: str) -> tuple[int, str, dict[str, float]]:
        """Run a whole build; return its exit status, its text on stderr, and its report."""
        report = self.work / "report.json"
        report.unlink(missing_ok=True)
        process = self.start(out, *(options or ("--workers", "2")), "--json", str(report))
        _, said = process.communicate(timeout=PATIENCE_S)
        return process.returncode, said, json.loads(report.read_text()) if report.exists() else {}

    def wait_for(self, out: Path, count: int, process: subprocess.Popen[str]) -> set[str]:
        """Wait until some samples exist, and return their names."""
        while process.poll() is None:
            there = {path.name for path in out.glob("[!.]*.npz")}
            if len(there) >= count:
                return there
            time.sleep(0.01)
        raise SystemExit(
            f"the build ended before it could be disturbed: {process.communicate()[1]}"
        )

    def rows(self, claim: str, out: Path, stamps: dict[str, int], made: float) -> list[Row]:
        """Rows of a disturbed build that was continued; ``stamps`` are of the earlier samples."""
        found = contents(out)
        lost = [name for name in self.undisturbed if name not in found]
        differs = [name for name in found if found[name] != self.undisturbed.get(name)]
        again = [name for name, stamp in stamps.items() if (out / name).stat().st_mtime_ns != stamp]
        wrong = abs(made - (self.samples - len(stamps)))
        says = "a data set killed while it is built, and continued: "
        return [
            judged(
                claim,
                "samples lost",
                "1",
                len(lost),
                0,
                says=says + "samples lost",
                cases=self.samples,
            ),
            judged(
                claim,
                "files that differ from an undisturbed build",
                "1",
                len(differs),
                0,
                says=says + "files that differ",
            ),
            judged(
                claim,
                "whole samples made twice",
                "1",
                len(again) + wrong,
                0,
                says=says + "whole samples made twice",
            ),
            reported(claim, "samples that existed when it continued", "1", len(stamps)),
        ]


def contents(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in folder.iterdir()}


def whole(out: Path) -> dict[str, int]:
    """Samples that exist and are whole, with the time at which they were written."""
    return {path.name: path.stat().st_mtime_ns for path in out.glob("[!.]*.npz") if is_whole(path)}


def one_line(claim: str, said: str, status: int, expected: int) -> list[Row]:
    lines = [line for line in said.splitlines() if line.strip()]
    return [
        judged(
            claim,
            "lines on stderr other than one",
            "1",
            abs(len(lines) - 1),
            0,
            says="a build that fails prints one line",
        ),
        judged(
            claim,
            "exit status",
            "1",
            status,
            0,
            reference=expected,
            says="a build that fails: exit status",
        ),
    ]


def workers_of(process: subprocess.Popen[str]) -> list[psutil.Process]:
    children = psutil.Process(process.pid).children(recursive=True)
    return [child for child in children if any("spawn_main" in word for word in child.cmdline())]


def worker_killed(trial: Trial, out: Path) -> list[Row]:
    process = trial.start(out)
    trial.wait_for(out, 2, process)
    workers_of(process)[0].send_signal(signal.SIGKILL)
    process.communicate(timeout=PATIENCE_S)
    claim = "a worker killed by signal 9"
    status = judged(
        claim,
        "exit status of the same run",
        "1",
        process.returncode,
        0,
        says="a build that loses a worker ends well",
    )
    stamps = whole(out)
    return [status, *trial.rows(claim, out, stamps, trial.finish(out, *ONE_WORKER)[2]["made"])]


def build_killed(trial: Trial, out: Path) -> list[Row]:
    process = trial.start(out)
    trial.wait_for(out, 3, process)
    children = psutil.Process(process.pid).children(recursive=True)
    process.kill()
    process.communicate()
    _, alive = psutil.wait_procs(children, timeout=60)
    stamps = whole(out)
    claim = "the build with its scheduler killed by signal 9"
    orphans = judged(
        claim,
        "processes left after a minute",
        "1",
        len(alive),
        0,
        says="a build that is killed leaves no process",
    )
    return [orphans, *trial.rows(claim, out, stamps, trial.finish(out, *ONE_WORKER)[2]["made"])]


def scheduler_killed(trial: Trial, out: Path) -> list[Row]:
    address = trial.work / "scheduler.json"
    tools = [sys.executable, "-m"]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    options = [
        "--host",
        "127.0.0.1",
        "--port",
        "0",
        "--no-dashboard",
        "--scheduler-file",
        str(address),
    ]
    scheduler = subprocess.Popen([*tools, "distributed.cli.dask_scheduler", *options], **quiet)
    worker = subprocess.Popen(
        [
            *tools,
            "distributed.cli.dask_worker",
            "--scheduler-file",
            str(address),
            "--nthreads",
            "1",
            "--no-dashboard",
        ],
        **quiet,
    )
    claim = "a scheduler of its own killed by signal 9"
    try:
        while not address.exists():
            time.sleep(0.05)
        process = trial.start(out, "--scheduler", json.loads(address.read_text())["address"])
        trial.wait_for(out, 3, process)
        scheduler.kill()
        _, said = process.communicate(timeout=PATIENCE_S)
    finally:
        for other in (scheduler, worker):
            other.terminate()
            try:
                other.wait(60)
            except subprocess.TimeoutExpired:
                other.kill()
    stamps = whole(out)
    return [
        *one_line(claim, said, process.returncode, 1),
        *trial.rows(claim, out, stamps, trial.finish(out, *ONE_WORKER)[2]["made"]),
    ]


@contextmanager
def little_room(out: Path, size: int) -> Iterator[tuple[str, Callable[[], None]]]:
    """Make room for ``size`` bytes: yield a folder, the kind of limit, and a call that lifts it."""
    out.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(out)],
        capture_output=True,
        check=False,
    )
    if mounted.returncode == 0:
        more = ["mount", "-o", "remount,size=64m", str(out)]
        try:
            yield "a full disk (tmpfs)", lambda: subprocess.run(more, check=True) and None
        finally:
            subprocess.run(["umount", "-l", str(out)], check=True)
    else:
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(
            resource.RLIMIT_FSIZE, (SAMPLE_BYTES, before[1])
        )  # of this process and those it starts
        try:
            yield (
                "files may not grow (RLIMIT_FSIZE)",
                lambda: resource.setrlimit(resource.RLIMIT_FSIZE, before),
            )
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)


def disk_full(trial: Trial, out: Path) -> list[Row]:
    size = sum(len(content) for content in trial.undisturbed.values())
    with little_room(out, size // 3) as (claim, give_more):
        status, said, _ = trial.finish(out)
        left = [path.name for path in out.iterdir() if path.suffix == ".part"]
        spoiled = [path.name for path in out.glob("*.npz") if not is_whole(path)]
        stamps = whole(out)
        give_more()
        rows = (
            trial.rows(claim, out, stamps, trial.finish(out, *ONE_WORKER)[2]["made"])
            if not (left or spoiled)
            else []
        )
    half = judged(
        claim,
        "files half-written",
        "1",
        len(left) + len(spoiled),
        0,
        says="a full disk: files half-written",
    )
    return [half, *one_line(claim, said, status, 2), *rows]


def sample_cut(trial: Trial, out: Path) -> list[Row]:
    shutil.copytree(trial.work / UNDISTURBED, out)
    victims = sorted(out.glob("*.npz"))[:2]
    victims[0].write_bytes(victims[0].read_bytes()[:1000])
    content = bytearray(victims[1].read_bytes())
    content[len(content) // 2] ^= 1
    victims[1].write_bytes(content)
    stamps = whole(out)
    claim = "a sample cut short and one of a flipped bit"
    report = trial.finish(out, *ONE_WORKER)[2]
    found = judged(
        claim,
        "damaged samples found",
        "1",
        report["damaged"],
        0,
        reference=2,
        says="damaged samples are found",
    )
    return [found, *trial.rows(claim, out, stamps, report["made"])]


def throughput(work: Path, samples: int, seconds: float) -> list[Row]:
    """Samples per second at 12 GHz with all channels, once every worker has made its first."""
    spec = work / "speed.toml"
    spec.write_text(
        SPEC.format(seconds=seconds, radar="paper-12ghz", fidelity="specular", half=samples // 2)
    )
    rates = {}
    for name, workers, threads in (
        ("one worker of one thread", 1, {"RTRADAR_THREADS": "1"}),
        ("one worker", 1, {}),
        ("two workers of one thread", 2, {"RTRADAR_THREADS": "1"}),
    ):
        out = work / name.replace(" ", "-")
        command = [*RTRADAR, str(spec), "--out", str(out), "--workers", str(workers)]
        subprocess.run(
            command, env={**os.environ, **threads}, check=True, stdout=subprocess.DEVNULL
        )
        times = sorted(path.stat().st_mtime for path in out.glob("*.npz"))
        rates[name] = (len(times) - workers) / (times[-1] - times[workers - 1])
    claim = f"{samples} samples of {seconds:g} s, paper-12ghz, specular"
    rows = [reported(claim, name, "1/s", rate) for name, rate in rates.items()]
    two = rates["two workers of one thread"]
    rows.append(
        reported(
            claim,
            "two workers over one, one thread each",
            "1",
            two / rates["one worker of one thread"],
        )
    )
    rows.append(
        reported(claim, "two workers over one that has all cores", "1", two / rates["one worker"])
    )
    return rows


def measure(quick: bool) -> list[Row]:
    found = []
    with tempfile.TemporaryDirectory() as folder:
        work = Path(folder)
        size = (
            {"samples": 12, "seconds": 0.5, "fidelity": "analytic"}
            if quick
            else {"samples": 40, "seconds": 1.0, "fidelity": "specular"}
        )
        trial = Trial(work, **size)
        reference = work / UNDISTURBED
        trial.finish(reference)
        trial.undisturbed = contents(reference)
        # The index, and what the data set was made from.
        kinds = {name.rpartition(".")[2] for name in (*trial.undisturbed, INDEX, MADE_FROM)}
        found.append(
            judged(
                "an undisturbed build",
                "files",
                "1",
                len(trial.undisturbed),
                0,
                reference=trial.samples + 2,
            )
        )
        found.append(
            judged("an undisturbed build", "kinds of files", "1", len(kinds), 0, reference=3)
        )
        for disturb in (worker_killed, build_killed, scheduler_killed, disk_full, sample_cut):
            found += disturb(trial, work / disturb.__name__)
        if not quick:
            found += throughput(work, samples=16, seconds=1.0)
    return found


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
