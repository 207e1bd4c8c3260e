"""Many items at once that trace in between: the same rays, the same kernel, and Dr.Jit's threads as they were."""

from __future__ import annotations

import threading

import numpy as np
import pytest

import rtradar as rt
from rtradar.body import Body
from rtradar.scatter import build_rung
from rtradar.threads import THREADS_VARIABLE
from rtradar.trace.backend import Backend, use
from rtradar.trace.side_by_side import in_tracing_threads
from rtradar.trace.unit_sphere import UnitSphere


def rays(count: int) -> np.ndarray:
    """Every second one goes away from the sphere."""
    found = np.zeros((7, count), dtype=np.float32)
    found[0], found[3], found[6] = 3.0, np.where(np.arange(count) % 2 == 0, -1.0, 1.0), 9.0
    return found


def test_a_kernel_serves_all_threads(backend: Backend) -> None:
    if backend.kind == "scalar":
        pytest.skip("the scalar backend has no kernels")
    import drjit as dr

    sphere = UnitSphere(use(backend))
    sphere.meets(rays(10))
    kernels = []

    def trace() -> None:
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
            dr.kernel_history_clear()
            np.testing.assert_array_equal(sphere.meets(rays(5000)), np.arange(5000) % 2 == 0)
            kernels.extend(entry for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT)

    other = threading.Thread(target=trace)
    other.start()
    other.join()
    assert [entry["cache_hit"] for entry in kernels] == [1]


@pytest.mark.usefixtures("four_threads")
def test_many_threads_trace_at_once(backend: Backend) -> None:
    sphere = UnitSphere(use(backend))
    count = 40 if backend.kind == "scalar" else 4000
    found = in_tracing_threads(lambda item: int(sphere.meets(rays(count + item)).sum()), range(32))
    assert found == [(count + item + 1) // 2 for item in range(32)]


@pytest.mark.usefixtures("four_threads")
def test_dr_jit_has_its_threads_back_also_after_an_error(backend: Backend) -> None:
    use(backend)
    import drjit as dr

    before = dr.thread_count()

    def fail(item: int) -> None:
        assert dr.thread_count() == 1
        in_tracing_threads(str, range(3))
        assert dr.thread_count() == 1
        raise ValueError(f"item {item}")

    dr.set_thread_count(3)
    try:
        with pytest.raises(ValueError, match="item 0"):
            in_tracing_threads(fail, range(9))
        assert dr.thread_count() == 3
    finally:
        dr.set_thread_count(before)


@pytest.mark.usefixtures("four_threads")
def test_physical_optics_is_the_same_with_any_number_of_threads_and_any_blocks(
    backend: Backend, monkeypatch: pytest.MonkeyPatch
) -> None:
    radar = rt.Radar(name="small", tx_y=2, tx_z=0, rx_y=2, rx_z=0, samples_per_chirp=64)
    body = Body.from_motion(rt.synthetic_motion("kick", seed=0, duration_s=0.25))
    chirps = np.arange(0, int(body.duration_s / radar.chirp_interval_s), 29)
    given = {"variant": backend.kind, "facets": 80}
    at_once = build_rung("physical-optics", radar, body, **given).echoes(chirps).amplitude
    monkeypatch.setenv(THREADS_VARIABLE, "1")
    rung = build_rung("physical-optics", radar, body, **given)
    by_blocks = [rung.echoes(chirps[first : first + 5]).amplitude for first in range(0, len(chirps), 5)]
    np.testing.assert_array_equal(at_once, np.concatenate(by_blocks, axis=1))
