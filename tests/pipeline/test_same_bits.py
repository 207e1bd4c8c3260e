"""The same seed gives the same bits, with any number of threads, compiled now or before."""

from __future__ import annotations

import ast
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

import rtradar
from rtradar.system.threads import thread_environment
from rtradar.trace.backend import available

RADAR = """
tx_y = 2
tx_z = 2
rx_y = 4
rx_z = 4
chirp_duration_s = 125e-6
samples_per_chirp = 128
frame_duration_s = 0.05
"""


def bits(folder: Path) -> dict[str, bytes]:
    """Every map and cloud as bytes."""
    found = {}
    with h5py.File(folder / "maps.h5") as maps:
        # Texts are given as objects, whose bytes are where they lie.
        truth = {f"truth/{name}": data for name, data in maps["truth"].items()}
        stored = {name: data for name, data in maps.items() if name != "truth"} | truth
        values = {name: data[()] for name, data in stored.items()}
        found |= {
            name: repr(own.tolist()).encode() if own.dtype.kind == "O" else own.tobytes()
            for name, own in values.items()
        }
    for name in ("cloud_rdt.npz", "cloud_xyz.npz"):
        with np.load(folder / name) as cloud:
            found |= {f"{name} {key}": cloud[key].tobytes() for key in cloud.files}
    return found


CASES = {
    "analytic": ["--fidelity", "analytic"],
    "specular": ["--fidelity", "specular"],
    "physical-optics": ["--fidelity", "physical-optics"],
    "room": ["--fidelity", "specular", "--scene", "living-room", "--clutter-removal", "mean"],
    "auto": ["--fidelity", "auto"],
}

RUNS = """
import json, sys
import numba, numpy as np
from rtradar.cli import main
commands, after_others = json.loads(sys.argv[1])
if after_others:  # code of the same process that takes liberties with floating point
    host = numba.njit(fastmath=True)(lambda a, b: abs(a * b / a) + abs(np.exp(a) * b**2))
    host(1j, 2j), host(np.complex64(1j), np.complex64(2j))
for words in commands:
    assert main(words) == 0, words
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs of several levels and of a room, a process for each of three ways to them.

    One compiles them in turn with one thread, one loads that code with three, and one compiles
    them in the opposite order with three, after functions of somebody else.
    """
    folder = tmp_path_factory.mktemp("runs")
    radar = folder / "small.toml"
    radar.write_text(RADAR)
    traced = ["--variant", "llvm"] if "llvm" in available() else ["--variant", "scalar"]
    for way, cache, threads in (("compiled", 1, 1), ("loaded", 1, 3), ("reversed", 2, 3)):
        commands = [
            ["run", "synthetic:kick", "--duration", "0.2", "--radar", str(radar), *words]
            + ["--out", str(folder / case / way)]
            + (traced if case != "analytic" else [])
            for case, words in CASES.items()
        ]
        backwards = way == "reversed"
        given = json.dumps([commands[::-1] if backwards else commands, backwards])
        environment = os.environ | thread_environment(threads)
        environment |= {"NUMBA_CACHE_DIR": str(folder / f"cache{cache}")}
        words = [sys.executable, "-c", RUNS, given]
        done = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("way", ["loaded", "reversed"])
def test_threads_disk_and_what_came_before_change_no_bit(runs: Path, case: str, way: str) -> None:
    one, other = (bits(runs / case / by) for by in ("compiled", way))
    assert len(one) > 10
    assert [name for name in one if one[name] != other.get(name)] == []


@pytest.mark.slow
def test_compiling_is_warm_up_wherever_it_falls(runs: Path) -> None:
    first, again = (
        json.loads((runs / "analytic" / way / "summary.json").read_text())
        for way in ("compiled", "loaded")
    )
    assert first["warmup_s"] > 3 * again["warmup_s"]
    # Without compiling, which takes much longer than this small run.
    assert sum(first["stages"].values()) <= first["wall_s"] < first["warmup_s"]


def compiled_functions() -> dict[tuple[Path, str], tuple[set[str], bool]]:
    """By file and name: what each compiled function calls, and whether it is always inlined."""
    found = {}
    for path in sorted(Path(rtradar.__file__).parent.rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            made = (
                [ast.unparse(one) for one in node.decorator_list]
                if isinstance(node, ast.FunctionDef)
                else []
            )
            if any(words.startswith(("compiled(", "inlined(", "njit(")) for words in made):
                calls = {
                    call.func.id
                    for call in ast.walk(node)
                    if isinstance(call, ast.Call) and isinstance(call.func, ast.Name)
                }
                found[path, node.name] = (
                    calls,
                    made[0].startswith("inlined(") or "inline=" in made[0],
                )
    return found


def test_compiled_functions_take_in_those_they_call() -> None:
    functions = compiled_functions()
    assert len(functions) > 50
    linked = [
        f"{path.name}: {name}"
        for (path, name), (_, inlined) in functions.items()
        for (other, _), (calls, _) in functions.items()
        if name in calls
        and not inlined
        and (other == path or re.search(rf"import .*\b{name}\b", other.read_text("utf-8")))
    ]
    assert linked == []
