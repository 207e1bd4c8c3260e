"""The paper's method in plain NumPy, which lies with the validation scripts: timed in a process of its own, in one thread."""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass

from rtradar.bench.runs import RunError
from rtradar.bench.times import Spread, by_stage
from rtradar.system.files import temporary_folder
from rtradar.validate import validation_folder

IF_STAGE = "echoes and IF"
"""Its stage that our ``scatter`` and ``signal`` stand against."""

_QUICK_CYCLES = 12


@dataclass(frozen=True)
class Baseline:
    """What it takes for one frame.

    Parameters
    ----------
    stages : dict of str to Spread
        Seconds by stage.
    total : Spread
        [s].
    cycles, cycles_per_frame : int
        TDM cycles that were synthesised, and those that a frame has; times are scaled to the frame.
    """

    stages: dict[str, Spread]
    total: Spread
    cycles: int
    cycles_per_frame: int


def measure_baseline(radar: str, repeats: int, *, quick: bool) -> Baseline | None:
    """Time some frames; None where the validation scripts are not there.

    Parameters
    ----------
    radar : str
        Preset or TOML file.
    repeats : int
        Frames.
    quick : bool
        Whether a part of each frame will do.

    Raises
    ------
    RunError
        Where the script fails.
    """
    script = validation_folder() / "other_methods" / "paper_numpy.py"
    if not script.is_file():
        return None
    with temporary_folder() as folder:
        written = folder / "frames.json"
        command = [
            sys.executable,
            str(script),
            "--radar",
            radar,
            "--repeats",
            str(repeats),
            "--json",
            str(written),
        ]
        command += ["--cycles", str(_QUICK_CYCLES)] if quick else []
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RunError(
                f"bench: {script.name}: {(done.stderr.strip().splitlines() or ['failed'])[-1]}"
            )
        found = json.loads(written.read_text(encoding="utf-8"))
    frames = found["frames"]
    total = Spread.of([sum(frame.values()) for frame in frames])
    return Baseline(by_stage(frames), total, found["cycles"], found["cycles_per_frame"])
