"""
First run
=========

A synthetic person walks before the paper's 12 GHz radar for three seconds; out come maps, clouds, a
page and a summary.
"""

import os
from pathlib import Path

import matplotlib.pyplot as plt

import rtradar as rt

OUT = Path(os.environ.get("RTRADAR_GALLERY_OUT", "out/gallery"))
SECONDS = float(os.environ.get("RTRADAR_GALLERY_S", 3.0))

# %%
# A motion, a radar, an echo model: that is all a run needs. ``report.html`` in its folder opens
# offline.
motion = rt.synthetic_motion("walk", seed=0, duration_s=SECONDS)
radar = rt.Radar.preset("paper-12ghz")
result = rt.run(motion, radar, fidelity="specular", snr_db=20, seed=0, out=OUT / "first_run")
print(
    f"{result.summary['detections']} detections, "
    f"{result.summary['wall_s']:.1f} s for {result.summary['capture_s']:.1f} s"
)

# %%
# The range-Doppler-time (RDT) cloud is a plain array (point, 3): time [s], range [m], velocity
# [m/s].
time, distance, velocity = result.points.T
figure = plt.figure(figsize=(7, 5), layout="constrained")
axes = figure.add_subplot(projection="3d")
axes.scatter(time, distance, velocity, c=velocity, s=3, cmap="coolwarm", vmin=-5, vmax=5)
axes.set(
    xlabel="Time [s]",
    ylabel="Range [m]",
    zlabel="Velocity [m/s] (positive: receding)",
    title="A walk towards the radar",
)
figure.savefig(OUT / "1_first_run.png")
