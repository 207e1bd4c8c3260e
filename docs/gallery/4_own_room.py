"""
Your own room
=============

A scene is a TOML file, too: walls of ITU-R P.2040 materials, furniture that comes along or any
closed mesh. Walls return what hits them and show the person once more, as a ghost; static clutter
is removed by ``clutter_removal``.
"""

import os
from pathlib import Path

import h5py
import matplotlib.pyplot as plt
import numpy as np

import rtradar as rt

OUT = Path(os.environ.get("RTRADAR_GALLERY_OUT", "out/gallery"))
OUT.mkdir(parents=True, exist_ok=True)
SECONDS = float(os.environ.get("RTRADAR_GALLERY_S", 3.0))

ROOM = """
name = "my room"

[radar]
position_m = [-3, 0, 1.2]

[room]
size_m = [6.0, 4.0, 2.5]
corner_m = [-3.3, -2.0]

[room.walls]
material = "plasterboard"
thickness_m = 0.0125

[room.floor]
material = "wood"
thickness_m = 0.02

[room.ceiling]
material = "concrete"
thickness_m = 0.2

[[furniture]]
name = "table"
mesh = "table"
material = "wood"
position_m = [1.2, 1.2, 0]
"""
(OUT / "my_room.toml").write_text(ROOM)

# %%
# The same walk in free space and in the room, and there with the mean of the chirps taken out. A
# small array is quick. The map sums abs(amplitude)^2 [m^2] over the channels, with the loss 1 / R^4
# in it: taken out, cells read as cross-sections.
radar = rt.Radar(
    name="12 GHz",
    tx_y=2,
    tx_z=2,
    rx_y=4,
    rx_z=4,
    chirp_duration_s=187.5e-6,
    position_m=(-3, 0, 1.2),
)
walk, room = (
    rt.synthetic_motion("walk", seed=0, duration_s=SECONDS),
    rt.Scene.load(OUT / "my_room.toml"),
)
runs = {
    "free space": (rt.Scene(), "none"),
    "my room": (room, "none"),
    "my room, mean removed": (room, "mean"),
}
figure, plots = plt.subplots(1, 3, figsize=(12, 4), sharey=True, layout="constrained")
for axes, (title, (scene, removal)) in zip(plots, runs.items(), strict=True):
    folder = OUT / title.replace(" ", "_").replace(",", "")
    rt.run(walk, radar, scene, clutter_removal=removal, out=folder)
    with h5py.File(folder / "maps.h5") as maps:
        section = (
            maps["range_doppler"][len(maps["time"]) // 2]
            / radar.n_channels
            * maps["range"][:][:, None] ** 4
        )
        power = 10 * np.log10(np.maximum(section, 1e-9))  # the range of the first bin is 0
        image = axes.pcolormesh(
            maps["velocity"][:], maps["range"][:], power, cmap="viridis", vmin=-60, vmax=0
        )
    axes.set(title=title, xlabel="Velocity [m/s] (positive: receding)", ylim=(0, 8))
plots[0].set_ylabel("Range [m]")
figure.colorbar(image, label="RCS, mean of channels [dBsm]")
figure.savefig(OUT / "4_own_room.png")
