"""Threads of Dr.Jit, which only grow, and our threads that trace the same rays by one kernel."""

from __future__ import annotations

import os
import subprocess
import sys
import threading

import numpy as np
import pytest

import rtradar as rt
from rtradar.body import Body
from rtradar.scatter import build_model
from rtradar.system.threads import THREADS_VARIABLE, thread_map
from rtradar.trace.backend import Backend, use
from rtradar.trace.rays import Shapes

SMALL = rt.Radar(name="small", tx_y=2, tx_z=0, rx_y=2, rx_z=0, samples_per_chirp=64)


def rays(count: int) -> np.ndarray:
    """Every second one goes away from the sphere."""
    found = np.zeros((7, count), dtype=np.float32)
    found[0], found[3], found[6] = 3.0, np.where(np.arange(count) % 2 == 0, -1.0, 1.0), 9.0
    return found


def test_any_number_of_rays_from_anywhere_in_memory_is_one_kernel_in_all_threads(
    backend: Backend,
) -> None:
    if backend.kind == "scalar":
        pytest.skip("the scalar backend has no kernels")
    import drjit as dr

    sphere, kernels = Shapes(use(backend), sphere={"type": "sphere"}), []

    def trace() -> None:
        for count, first in ((2, 0), (4095, 3), (4096, 0), (4097, 3), (9999, 0)):
            with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
                dr.kernel_history_clear()
                met = sphere.any_met(rays(count + first)[:, first:])
                np.testing.assert_array_equal(met, np.arange(first, count + first) % 2 == 0)
                kernels.extend(
                    entry["hash"]
                    for entry in dr.kernel_history()
                    if entry["type"] == dr.KernelType.JIT
                )

    trace()
    other = threading.Thread(target=trace)
    other.start()
    other.join()
    assert len(kernels) == 10
    assert len(set(kernels)) == 1


@pytest.mark.usefixtures("four_threads")
def test_many_threads_trace_at_once(backend: Backend) -> None:
    sphere = Shapes(use(backend), sphere={"type": "sphere"})
    count = 40 if backend.kind == "scalar" else 4000
    found = thread_map(lambda item: int(sphere.any_met(rays(count + item)).sum()), range(32))
    assert found == [(count + item + 1) // 2 for item in range(32)]


def in_a_new_process(program: str, threads: int) -> list[str]:
    """What that program prints, as words."""
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program],
        env={**os.environ, THREADS_VARIABLE: str(threads)},
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


def test_dr_jit_has_one_thread_until_many_rays_come(backend: Backend) -> None:
    program = f"""
import numpy as np
from rtradar.trace.backend import select, use
from rtradar.trace.tracers import MeshTracer
from rtradar.trace.backend import MANY_RAYS
mi = use(select("{backend.kind}"))
import drjit as dr
surfaces = MeshTracer(mi, np.array([[[1.0, -9.0, -9.0], [1.0, 9.0, -9.0], [1.0, 0.0, 9.0]]]))
for rays in ({"1," if backend.kind == "scalar" else "1, MANY_RAYS - 1, MANY_RAYS, 1"}):
    antennas, points = np.full((rays, 3), (3.0, 0.0, 0.0)), np.full((rays, 3), (1.0, 0.0, 0.0))
    assert surfaces.sees(antennas, points, np.zeros(rays, dtype=np.int64)).all()
    print(dr.thread_count())
"""
    expected = {"llvm": ["1", "1", "3", "3"], "cuda": ["1"] * 4, "scalar": ["1"]}
    assert in_a_new_process(program, threads=3) == expected[backend.kind]


def test_threads_of_who_came_first_are_left_alone(backend: Backend) -> None:
    program = f"""
from rtradar.trace.backend import select, use
from rtradar.trace.backend import MANY_RAYS, grow_for
backend = select("{backend.kind}")
import os
os.environ["DRJIT_LIBLLVM_PATH"] = backend.llvm_path or ""
import drjit
drjit.set_thread_count(4)
mi = use(backend)
grow_for(mi, MANY_RAYS)
print(drjit.thread_count())
"""
    assert in_a_new_process(program, threads=2) == ["4"]


@pytest.mark.usefixtures("four_threads")
def test_physical_optics_is_the_same_with_any_number_of_threads_and_any_blocks(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    body = Body.from_motion(rt.synthetic_motion("kick", seed=0, duration_s=0.25))
    chirps = np.arange(0, int(body.duration_s / SMALL.chirp_interval_s), 29)
    given = {"variant": backend.kind, "facets": 80}
    at_once = build_model("physical-optics", SMALL, body, **given).echoes(chirps).amplitude
    monkeypatch.setenv(THREADS_VARIABLE, "1")
    model = build_model("physical-optics", SMALL, body, **given)
    by_blocks = [
        model.echoes(chirps[first : first + 5]).amplitude for first in range(0, len(chirps), 5)
    ]
    np.testing.assert_array_equal(at_once, np.concatenate(by_blocks, axis=1))
