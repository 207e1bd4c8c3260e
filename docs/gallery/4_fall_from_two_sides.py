"""
A fall, seen from the ceiling and from a wall
=============================================

Falls are the commonest job of these radars. The same fall before two of them: `iwr6843ods` beneath
the ceiling, which looks straight down (``pitch_deg=-90``), and on a wall, tilted by 15 degrees.
Points of the spatial cloud are in the world, whichever way a radar looks.
"""

import os
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import rtradar as rt

OUT = Path(os.environ.get("RTRADAR_GALLERY_OUT", "out/gallery"))
SECONDS = float(os.environ.get("RTRADAR_GALLERY_S", 6.0))

# %%
# Somebody gets up, stands, falls and lies. The true height of the head is that of the recording,
# with the person where the run puts them; points are of all parts, of which the head is the highest
# while the person stands.
fall = rt.synthetic_motion("fall", seed=3, duration_s=SECONDS)
times = np.arange(0, fall.duration_s, 0.02)
placed = rt.motion.place(fall)
head = placed.at(times)[0][:, placed.joints.index("head"), 2]
board = rt.Radar.preset("iwr6843ods")
radars = {
    "ceiling": replace(board, position_m=(0.0, 0.0, 2.6), pitch_deg=-90.0),
    "wall": replace(board, position_m=(-3.0, 0.0, 1.8), pitch_deg=-15.0),
}
figure, panels = plt.subplots(1, 2, figsize=(10, 4), sharey=True, layout="constrained")
for axes, (where, radar) in zip(panels, radars.items(), strict=True):
    cloud = rt.run(fall, radar, fidelity="specular", snr_db=20).spatial
    shown = axes.scatter(cloud.time, cloud.points[:, 2], s=3, c=cloud.velocity, cmap="coolwarm")
    axes.plot(times, head, color="black", label="head, true")
    axes.set(xlabel="Time [s]", title=f"Radar at the {where}", ylim=(-0.5, 2.6))
    axes.legend()
panels[0].set_ylabel("Height of points [m]")
figure.colorbar(shown, label="Range rate [m/s], positive: receding")
OUT.mkdir(parents=True, exist_ok=True)
figure.savefig(OUT / "4_fall_from_two_sides.png")
