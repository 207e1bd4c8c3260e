"""Ten runs of several features at once: do they give what another checkout gives, and in what time?

    python validation/cost/combined_runs.py CHECKOUT [--duration 0.1] [--only WORD] [--json FILE]

CHECKOUT is a folder with another version of the sources, such as `git worktree add` makes. Both use
the packages of this Python. Six rooms, a mesh body, a moving radar, Doppler division, a receiver,
two people and a fan come together in ways that no other script has; each run is made once by both
versions, one after the other, after one that is not counted. The table has the largest difference
of each run's maps over the peak of the map (`same_maps.py`), and the CPU time of both. Nothing is
judged here: each difference needs its reason.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
from contextlib import redirect_stdout
from dataclasses import dataclass
from pathlib import Path

from same_maps import largest_difference
from speed_since import RUN, children_s

CHECKOUT = Path(__file__).resolve().parents[2]

FAN = """
[[objects]]
name = "fan"
mesh = "fan"
material = "metal"
position_m = [0.6, 0.9, 1.2]
yaw_deg = 60
motion = {kind = "turning", axis = [1, 0, 0], rate_hz = 2}
"""
MESH_BODY = """
[[people]]
motion = "synthetic:walk"
body = "mesh"
material = "skin"
"""
RECEIVER = """
transmit_power_dbm = 12
noise_figure_db = 14

[receiver]
phase_noise_hz = [1e5, 1e6]
phase_noise_dbc_hz = [-85, -95]
iq_gain_db = 0.3
adc_bits = 12
adc_full_scale_dbm = -25
leakage_db = -45
"""
DIVISION = 'multiplexing = "ddm"\nchannels = "all"\n'
MOVING = "path_times_s = [0, 10]\npath_m = [[0, 0, 0], [1, 0.2, 0]]\n"
BOARD = 'base = "iwr6843"\n'


@dataclass(frozen=True)
class Case:
    """A run: motions, a shipped scene with tables behind it, a radar's table, and flags."""

    motions: tuple[str, ...]
    scene: str
    flags: tuple[str, ...]
    more: str = ""
    radar: str = ""


CASES = {
    "living-room, two people, fan": Case(
        ("synthetic:walk", "synthetic:kick"),
        "living-room",
        ("--at", "0,0.4,30", "--at", "-1,-0.9", "--fidelity", "specular"),
        FAN,
    ),
    "living-room, board, receiver, mean removed": Case(
        ("synthetic:walk",),
        "living-room",
        ("--fidelity", "specular", "--snr-db", "physical", "--clutter-removal", "mean"),
        "",
        BOARD + RECEIVER,
    ),
    "bedroom, mesh body, skin": Case(
        (), "bedroom", ("--fidelity", "physical-optics"), MESH_BODY, BOARD
    ),
    "bathroom, Doppler division, two people": Case(
        ("synthetic:walk", "synthetic:stand"),
        "bathroom",
        ("--at", "0.3,0.3", "--at", "-0.8,-0.3", "--fidelity", "specular"),
        "",
        DIVISION,
    ),
    "corridor, moving radar": Case(
        ("synthetic:walk",), "corridor", ("--fidelity", "analytic"), "", BOARD + MOVING
    ),
    "doorway, physical optics, skin": Case(
        ("synthetic:walk",),
        "doorway",
        ("--fidelity", "physical-optics", "--body-material", "skin"),
        "",
        BOARD,
    ),
    "behind plasterboard, two people, breathing": Case(
        ("synthetic:walk", "synthetic:stand"),
        "behind-plasterboard",
        ("--at", "0.3,0.6", "--at", "0,-0.6", "--breathing", "5,0.3", "--fidelity", "analytic"),
        "",
        BOARD,
    ),
    "free space, moving radar, two people, receiver": Case(
        ("synthetic:walk", "synthetic:kick"),
        "free-space",
        ("--at", "0,0.8", "--at", "-1,-0.5", "--fidelity", "specular", "--snr-db", "physical"),
        "",
        BOARD + MOVING + RECEIVER,
    ),
    "fan beside a mesh body, Doppler division": Case(
        (), "fan-beside-person", ("--fidelity", "physical-optics"), MESH_BODY, DIVISION
    ),
    "swinging door, two people, auto": Case(
        ("synthetic:walk", "synthetic:punch"),
        "swinging-door",
        ("--at", "0,0.5", "--at", "-1,-0.7", "--fidelity", "auto"),
    ),
}


def words_of(case: Case, folder: Path, duration_s: float) -> list[str]:
    """Write the scene and the radar of a case, and return the words of its command."""
    scene, radar = folder / "scene.toml", folder / "radar.toml"
    scene.write_text((CHECKOUT / "scenes" / f"{case.scene}.toml").read_text() + case.more)
    radar.write_text(case.radar)
    words = [*case.motions, "--scene", str(scene), "--radar", str(radar), *case.flags]
    return [*words, "--start", "0.2", "--duration", str(duration_s), "--quiet"]


def run(checkout: Path, words: list[str], out: Path) -> float:
    """Run a checkout, and return the CPU time of the process and of all that it starts [s]."""
    before = children_s()
    command = [sys.executable, "-P", "-c", RUN, str(checkout), "run", *words, "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=out.parent, check=False)
    if done.returncode:
        raise RuntimeError(f"{checkout}: {done.stderr.strip().splitlines()[-1]}")
    return children_s() - before


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("checkout", type=Path)
    parser.add_argument("--duration", type=float, default=0.1, help="of each run [s]")
    parser.add_argument("--only", default="", help="cases whose name has this word")
    parser.add_argument("--json", type=Path, help="file for the table")
    options = parser.parse_args()
    before = options.checkout.resolve()
    table = {}
    print(f"{'':48} difference  CPU before, after [s]")
    for name, case in CASES.items():
        if options.only not in name:
            continue
        with tempfile.TemporaryDirectory() as at, open(os.devnull, "w") as nowhere:
            folder = Path(at)
            words = words_of(case, folder, options.duration)
            try:
                for version, out in ((before, "warm-1"), (CHECKOUT, "warm-2")):
                    run(version, words, folder / out)
                cost = [run(before, words, folder / "1"), run(CHECKOUT, words, folder / "2")]
            except RuntimeError as error:
                print(f"{name:48} {error}")
                table[name] = {"error": str(error)}
                continue
            with redirect_stdout(nowhere):
                difference = largest_difference(folder / "1", folder / "2")
        print(f"{name:48} {difference:10.1e}  {cost[0]:.1f}, {cost[1]:.1f}", flush=True)
        table[name] = {"difference": difference, "cpu_s": cost}
    if options.json:
        options.json.write_text(json.dumps(table, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
