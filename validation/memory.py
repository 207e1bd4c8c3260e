"""Peak memory and seconds a stage of whole runs, each in a process of its own: 3 s and 12 s, both rungs.

Memory is to be below 3 GB at 77 GHz and not to grow with the recording. At 12 GHz the larger of two small numbers is what the
C library keeps of freed memory, which settles only after some seconds of tracing, so there growth is reported. Seconds are
reported too: they are of this machine.

python validation/memory.py [--quick] [--json FILE]
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from rows import Row, judged, main, reported

LIMIT_MB = 3000.0

# Peaks of one and the same run differ by this much from process to process: how far threads get ahead of each other, and
# what the allocator has given back by then. Four times the length, were it held, would be gigabytes of IF samples.
REPEATABILITY = 0.02


def summary(folder: str, radar: str, fidelity: str, duration_s: float) -> dict[str, Any]:
    out = Path(folder, f"{radar}-{fidelity}-{duration_s:g}")
    command = [sys.executable, "-m", "rtradar", "run", "synthetic:walk", "--duration", str(duration_s), "--radar", radar]
    subprocess.run([*command, "--fidelity", fidelity, "--out", str(out)], check=True, stdout=subprocess.DEVNULL)
    found: dict[str, Any] = json.loads((out / "summary.json").read_text())
    return found


def measure(quick: bool) -> list[Row]:
    rows = []
    for radar in ("paper-12ghz",) if quick else ("paper-12ghz", "paper-77ghz"):
        for fidelity in ("analytic", "specular"):
            peak = {}
            for duration_s in (3.0, 12.0):
                with tempfile.TemporaryDirectory() as folder:
                    found = summary(folder, radar, fidelity, duration_s)
                peak[duration_s] = found["peak_memory_mb"]
                claim = f"{radar}, {fidelity}, {duration_s:g} s"
                rows.append(judged(claim, "peak memory", "MB", peak[duration_s], LIMIT_MB))
                rows.append(reported(claim, "wall", "s", found["wall_s"]))
                rows.append(reported(claim, "real-time factor", "1", found["real_time_factor"]))
                for stage, seconds in found["stages"].items():
                    rows.append(reported(claim, f"stage {stage}", "s", seconds))
            growth = (f"{radar}, {fidelity}", "peak memory, 12 s over 3 s", "1", peak[12.0] / peak[3.0])
            rows.append(judged(*growth, 1 + REPEATABILITY) if radar == "paper-77ghz" else reported(*growth))
    return rows


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
