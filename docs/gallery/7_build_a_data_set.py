"""
Build a data set
================

A TOML file says what a data set shall hold; ``rtradar dataset build`` makes what is missing of it,
on all cores, and may be stopped at any time. The page on data sets lists all keys.
"""

import os
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt

from rtradar.clouds import Collection

OUT = Path(os.environ.get("RTRADAR_GALLERY_OUT", "out/gallery"))
OUT.mkdir(parents=True, exist_ok=True)
SECONDS = min(1.6, float(os.environ.get("RTRADAR_GALLERY_S", 1.6)))

SPEC = f"""
seed = 0
[windows]
duration_s = {SECONDS}
[each]
fidelity = ["analytic"]
[drawn]
heading_deg = [-30.0, 30.0]
snr_db = [15.0, 25.0]
[[synthetic]]
label = "walk"
count = 4
subjects = 4
[[synthetic]]
label = "punch"
count = 4
subjects = 4
"""
(OUT / "small.toml").write_text(SPEC)

# %%
# On a command line: rtradar dataset build small.toml --out small
subprocess.run(
    [
        sys.executable,
        "-m",
        "rtradar",
        "dataset",
        "build",
        OUT / "small.toml",
        "--out",
        OUT / "small",
    ],
    check=True,
)

# %%
# Clouds are read when they are asked for, with their label and all that they follow from.
clouds = Collection(OUT / "small")
figure = plt.figure(figsize=(10, 5), layout="constrained")
for place in range(len(clouds)):
    cloud = clouds[place]
    axes = figure.add_subplot(2, 4, place + 1, projection="3d")
    axes.scatter(*cloud.points.T, c=cloud.points[:, 2], s=1, cmap="coolwarm", vmin=-5, vmax=5)
    axes.set_title(f"{cloud.label}, {cloud.provenance['subject']}", fontsize=9)
    axes.tick_params(labelsize=6)
figure.suptitle("Time [s], range [m], velocity [m/s] (positive: receding)")
figure.savefig(OUT / "7_build_a_data_set.png")
