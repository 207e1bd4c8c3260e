"""
Two people
==========

Several people in one scene hide one another, and each detection says who returned it.
"""

import os
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import rtradar as rt

OUT = Path(os.environ.get("RTRADAR_GALLERY_OUT", "out/gallery"))
OUT.mkdir(parents=True, exist_ok=True)
SECONDS = float(os.environ.get("RTRADAR_GALLERY_S", 3.0))

# %%
# A `Person` has a motion, a place (the mean of the walk) and a heading. The paths of these two
# cross, and one is there before the other. On the command line the same is ``rtradar run
# synthetic:walk synthetic:walk --at 0,0,60 --at 0.9,0,-60 --out out/two``, and a scene file
# has a table ``[[people]]`` for each.
radar = replace(
    rt.Radar.preset("paper-12ghz"), name="12 GHz", tx_y=2, tx_z=2, chirp_duration_s=125e-6
)
people = [
    rt.Person(rt.synthetic_motion("walk", seed=0, duration_s=SECONDS), (0.0, 0.0), 60),
    rt.Person(rt.synthetic_motion("walk", seed=1, duration_s=SECONDS), (0.9, 0.0), -60),
]
result = rt.run(people, radar, fidelity="specular", snr_db=20)
for person in result.summary["people"]:
    print(f"{person['name']}: SNR {person['snr_db']:.1f} dB")

# %%
# From above: where both walked, and the points of the spatial cloud in the colour of the person who
# returned most of their cell. ``source`` is -1 for what is of nobody, such as noise. On the right
# the ranges of all points over time, with those of the hips, which the maps hold as the truth.
maps, cloud = result.maps, result.spatial.strongest()
distance = np.linalg.norm(maps["person_position"] - np.array(radar.position_m), axis=2)
point_range = np.linalg.norm(cloud.points - radar.position_m, axis=1)
figure, (plan, ranges) = plt.subplots(1, 2, figsize=(10, 4.5), layout="constrained")
for index, name in enumerate(maps["person"].values):
    own, colour = cloud.source == index, f"C{index}"
    plan.scatter(*cloud.points[own, :2].T, s=2, alpha=0.15, color=colour)
    track = maps["person_position"][:, index]
    plan.plot(track[:, 0], track[:, 1], color="white", linewidth=4)
    plan.plot(track[:, 0], track[:, 1], color=colour, label=name)
    plan.plot(*track[0, :2], "o", color=colour, markeredgecolor="white", markersize=9)
    ranges.scatter(cloud.time[own], point_range[own], s=3, alpha=0.3, color=colour)
    ranges.plot(maps["time"], distance[:, index], color="white", linewidth=4)
    ranges.plot(maps["time"], distance[:, index], color=colour, label=name)
plan.set(xlabel="x [m]", ylabel="y [m]", title="From above; dots are where they begin")
plan.set(xlim=(-3, 3), ylim=(-3, 3), aspect="equal")
plan.legend()
ranges.set(xlabel="Time [s]", ylabel="Range [m]", title="Points, and the hips of both")
figure.savefig(OUT / "4_two_people.png")
