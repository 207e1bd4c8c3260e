"""Nothing is compiled again once a model has done its first frame."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import rtradar as rt
from rtradar.body import Body
from rtradar.motion import place
from rtradar.scatter import build_model
from rtradar.system.threads import THREADS_VARIABLE
from rtradar.trace.backend import Backend

# Frames a quarter as long as those of the preset, each of which still spans a keyframe.
RADAR = dataclasses.replace(
    rt.Radar.preset("paper-12ghz"), frame_duration_s=0.025, tx_y=2, tx_z=1, rx_y=2, rx_z=2
)


@pytest.mark.parametrize("fidelity", ["specular", "physical-optics"])
def test_a_second_frame_compiles_no_kernel(
    backend: Backend, fidelity: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    if backend.kind == "scalar":
        pytest.skip("the scalar backend has no kernels")
    # Dr.Jit remembers the kernels of those threads alone in which that was asked for.
    monkeypatch.setenv(THREADS_VARIABLE, "1")
    import drjit as dr

    body = Body.from_motion(
        place(rt.synthetic_motion("walk", seed=0, duration_s=0.7), heading_deg=70.0)
    )
    model = build_model(fidelity, RADAR, body, variant=backend.kind)
    frame = 3 * RADAR.chirps_per_frame
    model.echoes(np.arange(frame))
    with dr.scoped_set_flag(dr.JitFlag.KernelHistory):
        dr.kernel_history_clear()
        model.echoes(np.arange(frame, 2 * frame))
        kernels = [entry for entry in dr.kernel_history() if entry["type"] == dr.KernelType.JIT]
    assert len(kernels) > 0
    assert [entry["hash"] for entry in kernels if not entry["cache_hit"]] == []
