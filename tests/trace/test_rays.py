"""Rays in numbers of any kind, met by one kernel."""

from __future__ import annotations

import numpy as np
import pytest

from rtradar.trace.backends.backend import Backend, use
from rtradar.trace.rays import rays_of
from rtradar.trace.unit_sphere import UnitSphere


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
    starts, ways, reach = (
        np.arange(15.0).reshape(5, 3),
        -np.arange(15.0).reshape(5, 3),
        np.arange(5.0),
    )
    ray = rays_of(mi, starts, ways, reach)
    np.testing.assert_array_equal(ray.o.numpy().T, starts)
    np.testing.assert_array_equal(ray.d.numpy().T, ways)
    np.testing.assert_array_equal(ray.maxt.numpy(), reach)
    assert np.all(rays_of(mi, starts, ways).maxt.numpy() > 1e30)
