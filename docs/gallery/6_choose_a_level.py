"""
Choose a fidelity level
=======================

The echo models trade accuracy for time. Here one pose of a kick, seen from the side, meets each of
them; its error is set against what it costs. The page "Choosing a fidelity level" has the same for
whole runs, both radars and all activities.
"""

import os
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import rtradar as rt
from rtradar.motion import place

OUT = Path(os.environ.get("RTRADAR_GALLERY_OUT", "out/gallery"))
OUT.mkdir(parents=True, exist_ok=True)

# %%
# `rt.scattering_length` takes ellipsoids (or a mesh) and any antennas: here one Tx, and Rx along 1
# m of a line.
kick = place(rt.synthetic_motion("kick", seed=0, duration_s=2.0), heading_deg=70)
pose = rt.Body.from_motion(kick).ellipsoids(1.0)
rx = np.stack([np.full(48, -4.0), np.linspace(0.5, 1.5, 48), np.full(48, 1.0)], axis=1)
tx = np.broadcast_to([-4.0, 1.0, 1.0], rx.shape)
judge = rt.scattering_length(pose, tx, rx, 14e9, "reference", facets=20480)

# %%
# Every model once to compile what it needs, and once to be timed.
models = {
    "analytic": ("analytic", {}),
    "specular": ("specular", {}),
    "specular, gradual": ("specular", {"visibility": "gradual"}),
    "physical-optics, 1280 facets": ("physical-optics", {"facets": 1280}),
    "physical-optics, 5120 facets": ("physical-optics", {"facets": 5120}),
}
figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
for name, (fidelity, model_options) in models.items():
    rt.scattering_length(pose, tx, rx, 14e9, fidelity, **model_options)
    began = time.perf_counter()
    found = rt.scattering_length(pose, tx, rx, 14e9, fidelity, **model_options)
    cost = time.perf_counter() - began
    error = 100 * np.sqrt(np.mean(np.abs(found - judge) ** 2) / np.mean(np.abs(judge) ** 2))
    print(f"{name:30s} {error:6.1f} %  {1000 * cost:8.1f} ms")
    axes.plot(cost, error, "o", markersize=9, label=name)
axes.set(
    xscale="log", yscale="log", xlabel="Time of 48 Tx-Rx pairs [s]", ylabel="Field, rms error [%]"
)
axes.set_title("21 ellipsoids at 14 GHz, against 20 480 facets a part")
axes.grid(alpha=0.3, which="both")
axes.legend()
figure.savefig(OUT / "6_choose_a_level.png")
