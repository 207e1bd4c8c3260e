"""Rays in numbers of any kind, met by one kernel."""

from __future__ import annotations

import numpy as np
import pytest

from rtradar.trace.backends.backend import Backend, use
from rtradar.trace.body_tracer import UnitSphere
from rtradar.trace.rays import rays_of


def test_any_number_of_rays_from_anywhere_in_memory_is_one_kernel(backend: Backend) -> None:
    if backend.kind == "scalar":
        pytest.skip("the scalar backend has no kernels")
    import drjit as dr

    sphere = UnitSphere(use(backend))
    hashes = set()
    for count in (2, 4095, 4096, 4097, 4112, 9999):
        for first in (0, 3):
            rays = np.zeros((7, count + first), dtype=np.float32)[:, first:]
            rays[0], rays[3], rays[6] = 3.0, np.where(np.arange(count) % 2 == 0, -1.0, 1.0), 9.0
            with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
                dr.kernel_history_clear()
                np.testing.assert_array_equal(sphere.meets(rays), rays[3] < 0)
                hashes |= {
                    entry["hash"]
                    for entry in dr.kernel_history()
                    if entry["type"] == dr.KernelType.JIT
                }
    assert len(hashes) == 1


def test_rays_begin_lead_and_end_where_they_are_told(backend: Backend) -> None:
    if backend.kind == "scalar":
        pytest.skip("the scalar backend takes rays one by one")
    mi = use(backend)
    rows = np.arange(35.0).reshape(7, 5)
    ray = rays_of(mi, rows)
    np.testing.assert_array_equal(ray.o.numpy(), rows[:3])
    np.testing.assert_array_equal(ray.d.numpy(), rows[3:6])
    np.testing.assert_array_equal(ray.maxt.numpy(), rows[6])
    assert np.all(rays_of(mi, rows[:6]).maxt.numpy() > 1e30)
