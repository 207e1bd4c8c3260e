"""The process that imports rtradar stays as it was, and its workers work."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

RUN = """
import ctypes, os, sys
from numba import types
from numba.core.registry import cpu_target

of_the_library = []
look_up = ctypes.CDLL.__getattr__
ctypes.CDLL.__getattr__ = lambda self, name: of_the_library.append(name) or look_up(self, name)
table, environment = cpu_target.target_context.cached_internal_func, dict(os.environ)
before = dict(table)

import rtradar as rt

def run(fidelity, **options):
    motion = rt.synthetic_motion("walk", seed=0, duration_s=0.15)
    radar = rt.Radar.preset("paper-12ghz")
    return rt.run(motion, radar, fidelity=fidelity, snr_db=20, **options).points.sum()
"""

LOOKS = (
    RUN
    + """
for fidelity in "analytic", "specular":
    run(fidelity, out=f"{sys.argv[1]}/{fidelity}")
assert cpu_target.target_context.cached_internal_func is table
assert type(table) is dict
for (code, signature, *_) in table.keys() - before.keys():  # what Numba keeps of itself for all
    assert not any(isinstance(kind, (types.Float, types.Complex)) for kind in signature.args), code
environment.setdefault("KMP_DUPLICATE_LIB_OK", "True")  # threadpoolctl sets it
os.environ.setdefault("KMP_DUPLICATE_LIB_OK", "True")
assert os.environ == environment, set(os.environ.items()) ^ set(environment.items())
assert "mallopt" not in of_the_library
"""
)

DATA_LOADER = (
    RUN
    + """
from torch.utils.data import DataLoader
here = [run("specular"), run("analytic")][1]
there = list(DataLoader([0] * 4, num_workers=2, collate_fn=lambda _: run("analytic")))
assert there == [here] * 4
"""
)

DASK = """
from distributed import Client, LocalCluster
from host import run

if __name__ == "__main__":
    here = run("specular")
    with LocalCluster(n_workers=2, dashboard_address=None) as cluster, Client(cluster) as client:
        there = client.gather(client.map(run, ["specular"] * 4, pure=False))
    assert there == [here] * 4
"""


def python(folder: Path, script: str) -> None:
    """Run a script in a process that must end well, and in time."""
    (folder / "host.py").write_text(RUN)
    (folder / "script.py").write_text(script)
    command = [sys.executable, "-W", "ignore", str(folder / "script.py"), str(folder)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_tables_environment_and_allocator_are_as_before(tmp_path: Path) -> None:
    python(tmp_path, LOOKS)


@pytest.mark.slow
@pytest.mark.parametrize("script", [DATA_LOADER, DASK], ids=["torch", "dask"])
def test_after_a_run_workers_work(tmp_path: Path, script: str) -> None:
    python(tmp_path, script)
