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
from rtradar.trace.backends.backend import available

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


RUNS = """
import json, sys
from rtradar.cli import main
for words in json.loads(sys.argv[1]):
    assert main(words) == 0, words
"""


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Runs of each fidelity level by one thread and by three, a process for each number."""
    folder = tmp_path_factory.mktemp("runs")
    radar = folder / "small.toml"
    radar.write_text(RADAR)
    traced = ["--variant", "llvm"] if "llvm" in available() else ["--variant", "scalar"]
    for threads in (1, 3):
        commands = [
            ["run", "synthetic:kick", "--duration", "0.2", "--radar", str(radar)]
            + ["--fidelity", fidelity, "--out", str(folder / fidelity / str(threads))]
            + ["--no-pictures"]
            + (traced if fidelity != "analytic" else [])
            for fidelity in ("analytic", "specular", "auto")
        ]
        environment = os.environ | thread_environment(threads)
        words = [sys.executable, "-c", RUNS, json.dumps(commands)]
        done = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("fidelity", ["analytic", "specular", "auto"])
def test_one_thread_and_three_give_the_same_bits(runs: Path, fidelity: str) -> None:
    one, three = (bits(runs / fidelity / threads) for threads in ("1", "3"))
    assert len(one) > 10
    assert [name for name in one if one[name] != three.get(name)] == []


ADD_TONES = """
import hashlib, numpy as np, rtradar as rt
from rtradar.signal import synthesize
radar = rt.Radar(tx_y=1, tx_z=0, rx_y=4, rx_z=0, samples_per_chirp=128)
draw = np.random.default_rng(0)
length, amplitude = draw.uniform(6, 9, (4, 4, 20)), draw.normal(size=(1, 4, 4, 20)) + 0j
one, tx = np.ones(20, dtype=int), np.zeros(4, dtype=int)
echoes = rt.Echoes(
    length=length, amplitude=amplitude, frequency=np.array([14e9]), tx=tx, part=one, bounces=one
)
samples = synthesize(echoes, radar, np.arange(4.0), dtype=np.complex64)
print(hashlib.sha256(samples.tobytes()).hexdigest())
"""


@pytest.mark.slow
def test_what_is_just_compiled_gives_the_bits_of_what_was_compiled_before(tmp_path: Path) -> None:
    """A compiled function may link another's code or a copy of it, which may round otherwise."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    command = [sys.executable, "-W", "ignore", "-c", ADD_TONES]
    first, second = (
        subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    )
    assert list(tmp_path.rglob("*.nbc"))
    assert first == second


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
