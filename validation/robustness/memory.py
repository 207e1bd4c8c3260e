"""Peak memory and seconds of the stages of whole runs, and of reading a recording of an hour.

Each run has a process of its own: short ones, long ones, and one whose threads get no processor.
Memory must stay below 3 GB at 77 GHz and must not grow with the recording. Seconds are reported,
because they depend on the machine.

    python validation/robustness/memory.py [--quick] [--json FILE]
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from rtradar.validate.rows import Row, judged, main, reported

LIMIT_MB = 3000.0

# From 1 MB on, a recording waits in a file: it takes at most 2 MB of some 400, as made and as
# placed. If the IF samples were held, it would be gigabytes. How the arrays of two threads share a
# heap is chance, which only adds, so the need of a run is the least of several.
GROWTH = 1.01
RUNS = 3

# Ten times as long: held twice, the recording alone would add 45 MB to some 330, and the link
# budget 9. Only the heap may grow.
LONG_GROWTH = 1.03
SMALL_RADAR = (
    "tx_y = 2\ntx_z = 0\nrx_y = 4\nrx_z = 0\nsamples_per_chirp = 128\nchirp_duration_s = 500e-6\n"
)

# What waits for a thread must hold nothing, or the blocks of the whole capture would pile up.
STARVED_GROWTH = 1.02

# Of some 90 MB, most of which is Python and its packages; an hour of 30 joints takes 400 MB.
READING_GROWTH = 1.05
JOINTS, RATE_HZ = 30, 120


def summary(folder: str, radar: str, fidelity: str, duration_s: float) -> dict[str, Any]:
    out = Path(folder, f"{radar}-{fidelity}-{duration_s:g}")
    command = [
        sys.executable,
        "-m",
        "rtradar",
        "run",
        "synthetic:walk",
        "--duration",
        str(duration_s),
        "--radar",
        radar,
    ]
    subprocess.run(
        [*command, "--fidelity", fidelity, "--out", str(out)], check=True, stdout=subprocess.DEVNULL
    )
    found: dict[str, Any] = json.loads((out / "summary.json").read_text())
    return found


def long_runs(short_s: float, long_s: float) -> list[Row]:
    """A radar of few channels, so that the recording is the largest part of the data."""
    with tempfile.TemporaryDirectory() as folder:
        radar = Path(folder, "small.toml")
        radar.write_text(SMALL_RADAR)
        found = {
            duration_s: summary(folder, str(radar), "analytic", duration_s)
            for duration_s in (short_s, long_s)
        }
    growth = f"peak memory, {long_s:g} s over {short_s:g} s"
    ratio = found[long_s]["peak_memory_mb"] / found[short_s]["peak_memory_mb"]
    return [
        judged(
            "2 x 4 channels, analytic",
            growth,
            "1",
            ratio,
            LONG_GROWTH,
            says=f"a whole run: {growth}",
        ),
        *(
            reported(
                "2 x 4 channels, analytic",
                f"wall a second of radar, {seconds:g} s",
                "s/s",
                one["wall_s"] / one["capture_s"],
            )
            for seconds, one in found.items()
        ),
    ]


def starved(duration_s: float) -> list[Row]:
    """A run whose threads but one never get a processor, the worst that a busy machine can do."""
    peak = {}
    for awake in (True, False):
        with tempfile.TemporaryDirectory() as folder:
            command = [
                sys.executable,
                "-W",
                "ignore",
                "-c",
                STARVED,
                str(int(awake)),
                str(duration_s),
                folder,
            ]
            peak[awake] = float(
                subprocess.run(command, check=True, stdout=subprocess.PIPE, text=True).stdout
            )
    claim = f"paper-12ghz, analytic, {duration_s:g} s"
    growth = "peak memory, one thread awake over all"
    return [
        judged(
            claim,
            growth,
            "1",
            peak[False] / peak[True],
            STARVED_GROWTH,
            says=f"a whole run: {growth}",
        )
    ]


STARVED = """
import sys, threading
import rtradar as rt
from rtradar.motion import synthetic_motion
from rtradar.system.threads import thread_map, thread_count
awake, duration_s, out = int(sys.argv[1]), float(sys.argv[2]), sys.argv[3]
asleep = threading.Event()
if not awake:
    taken = threading.Barrier(thread_count() + 1)
    hold = lambda item: (taken.wait(), asleep.wait())
    threading.Thread(target=thread_map, args=(hold, range(thread_count())), daemon=True).start()
    taken.wait()
try:
    motion, radar = synthetic_motion("walk", duration_s=duration_s), rt.Radar.preset("paper-12ghz")
    result = rt.run(motion, radar, out=out, fidelity="analytic")
finally:
    asleep.set()
print(result.summary["peak_memory_mb"])
"""


def reading(short_s: float, long_s: float) -> list[Row]:
    """A BVH file of one chain of joints, the same pose in every frame."""
    peak, seconds = {}, {}
    for duration_s in (short_s, long_s):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "long.bvh")
            write_bvh(path, round(duration_s * RATE_HZ))
            began = time.perf_counter()
            done = subprocess.run(
                [sys.executable, "-c", READ, str(path)], check=True, capture_output=True, text=True
            )
            seconds[duration_s] = time.perf_counter() - began
        peak[duration_s] = float(done.stdout)
    growth = f"peak memory, {long_s:g} s over {short_s:g} s"
    ratio = peak[long_s] / peak[short_s]
    return [
        judged(
            "reading BVH of 30 joints",
            growth,
            "1",
            ratio,
            READING_GROWTH,
            says=f"reading a recording: {growth}",
        ),
        *(
            reported("reading BVH of 30 joints", f"peak memory, {one:g} s", "MB", peak[one])
            for one in peak
        ),
        *(
            reported("reading BVH of 30 joints", f"seconds, {one:g} s", "s", seconds[one])
            for one in seconds
        ),
    ]


READ = """
import resource, sys
from rtradar.motion import load_motion
load_motion(sys.argv[1], unit_m=0.01)
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
print(peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6)
"""


def write_bvh(path: Path, frames: int) -> None:
    """A chain of joints, each a few degrees from the one before."""
    places, turns = "Xposition Yposition Zposition ", "Zrotation Xrotation Yrotation"
    with path.open("w", encoding="ascii") as file:
        file.write("HIERARCHY\n")
        for joint in range(JOINTS):
            file.write(
                f"{'JOINT' if joint else 'ROOT'} j{joint}\n{{\nOFFSET 0 {-5 * bool(joint)} 0\n"
            )
            file.write(f"CHANNELS {3 if joint else 6} {'' if joint else places}{turns}\n")
        file.write("End Site\n{\nOFFSET 0 -5 0\n}\n" + "}\n" * JOINTS)
        file.write(f"MOTION\nFrames: {frames}\nFrame Time: {1 / RATE_HZ}\n")
        frame = (
            "0.0 100.0 0.0 "
            + " ".join(f"{joint}.25 -{joint}.5 {joint}.75" for joint in range(JOINTS))
            + "\n"
        )
        for _ in range(frames):
            file.write(frame)


def measure(quick: bool) -> list[Row]:
    rows = []
    short_s, long_s = (1.0, 2.0) if quick else (3.0, 12.0)
    for radar in ("paper-12ghz",) if quick else ("paper-12ghz", "paper-77ghz"):
        for fidelity in ("specular",) if quick else ("analytic", "specular"):
            peaks: dict[float, list[float]] = {short_s: [], long_s: []}
            for duration_s in (short_s, long_s) * (2 if quick else RUNS):
                with tempfile.TemporaryDirectory() as folder:
                    found = summary(folder, radar, fidelity, duration_s)
                peaks[duration_s].append(found["peak_memory_mb"])
                claim = f"{radar}, {fidelity}, {duration_s:g} s, run {len(peaks[duration_s])}"
                rows.append(
                    judged(
                        claim,
                        "peak memory",
                        "MB",
                        peaks[duration_s][-1],
                        LIMIT_MB,
                        says="a whole run: peak memory",
                    )
                )
                rows.append(reported(claim, "wall", "s", found["wall_s"]))
                rows.append(reported(claim, "real-time factor", "1", found["real_time_factor"]))
                for stage, seconds in found["stages"].items():
                    rows.append(reported(claim, f"stage {stage}", "s", seconds))
            growth = f"peak memory, {long_s:g} s over {short_s:g} s"
            says, ratio = f"a whole run: {growth}", min(peaks[long_s]) / min(peaks[short_s])
            rows.append(
                judged(
                    f"{radar}, {fidelity}",
                    f"{growth}, the least of each",
                    "1",
                    ratio,
                    GROWTH,
                    says=says,
                )
            )
    rows += long_runs(*((3.0, 15.0) if quick else (30.0, 300.0)))
    rows += starved(1.0 if quick else 3.0)
    rows += reading(*((30.0, 150.0) if quick else (60.0, 3600.0)))
    return rows


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
