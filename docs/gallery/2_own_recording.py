"""
Your own recording
==================

ASF/AMC recordings, as those of HDM05 and CMU, and BVH are read by one function. Where
``RTRADAR_MOCAP`` names a folder with AMC files the first of them is taken; elsewhere this script
says so and writes itself a small one: somebody who waves.
"""

import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import rtradar as rt
from rtradar.body import ellipsoid_meshes
from rtradar.motion import place

OUT = Path(os.environ.get("RTRADAR_GALLERY_OUT", "out/gallery"))
OUT.mkdir(parents=True, exist_ok=True)
SECONDS = float(os.environ.get("RTRADAR_GALLERY_S", 3.0))

# %%
# Bones: name, parent, direction (x to the left, y up, z forward) and length. HDM05 and CMU name
# them so, and have ten more.
MIDDLE = """lowerback root 0 1 0 .12|upperback lowerback 0 1 0 .12
thorax upperback 0 1 0 .12|lowerneck thorax 0 1 0 .1
head lowerneck 0 1 0 .18"""
SIDE = """?hipjoint root @1 -.5 0 .1|?femur ?hipjoint 0 -1 0 .42
?tibia ?femur 0 -1 0 .42|?toes ?tibia 0 -.3 1 .2
?clavicle thorax @1 .4 0 .18|?humerus ?clavicle @.3 -1 0 .28
?wrist ?humerus @.3 -1 0 .25|?fingers ?wrist @.3 -1 0 .16"""


def write_wave(asf: Path, amc: Path) -> None:
    """Somebody stands, and swings the left arm out to the side and back, once a second."""
    text = "\n".join(
        [MIDDLE, SIDE.replace("?", "l").replace("@", ""), SIDE.replace("?", "r").replace("@", "-")]
    )
    bones = [bone.split() for bone in text.replace("|", "\n").split("\n")]
    data = [
        f"begin\nid {number}\nname {name}\ndirection {x} {y} {z}\nlength {length}\naxis 0 0 0 XYZ\n"
        f"{'dof rz' if name == 'lhumerus' else ''}\nend"
        for number, (name, _, x, y, z, length) in enumerate(bones, start=1)
    ]
    # Lengths are inches over this unit: with 0.0254 they are metres.
    root = ":root\norder TX TY TZ RX RY RZ\naxis XYZ\nposition 0 0 0\norientation 0 0 0"
    head = [":version 1.10", ":name waver", ":units\nlength 0.0254\nangle deg", root, ":bonedata"]
    links = [f"{parent} {name}" for name, parent, *_ in bones]
    asf.write_text("\n".join([*head, *data, ":hierarchy", "begin", *links, "end", ""]))
    swings = 45 * (1 - np.cos(2 * np.pi * np.arange(120 * SECONDS + 1) / 120))  # AMC is at 120 Hz
    frames = [
        f"{number}\nroot 0 .95 0 0 0 0\nlhumerus {angle:.3f}"
        for number, angle in enumerate(swings, start=1)
    ]
    amc.write_text("\n".join([":FULLY-SPECIFIED", ":DEGREES", *frames, ""]))


# %%
# Names of recordings begin with that of their skeleton: ``HDM_bd.asf``,
# ``HDM_bd_kickLFront1Reps_001_120.amc``.
recordings = sorted(Path(os.environ.get("RTRADAR_MOCAP", "none")).rglob("*.amc"))
pairs = [
    (amc, asf)
    for amc in recordings
    for asf in amc.parent.glob("*.asf")
    if amc.stem.startswith(asf.stem)
]
if pairs:
    amc, asf = pairs[0]
else:
    print("RTRADAR_MOCAP names no folder with AMC files: a small recording is written instead")
    amc, asf = OUT / "waver.amc", OUT / "waver.asf"
    write_wave(asf, amc)
motion = rt.load_motion(amc, skeleton=asf)

# %%
# A body at any time: 21 ellipsoids. `place` puts the interval before the radar, as `rt.run` does.
length = min(SECONDS, motion.duration_s)
body = rt.Body.from_motion(place(motion, 0.0, length))
figure = plt.figure(figsize=(8, 3.4), layout="constrained")
for column, time in enumerate((0.0, length / 4, length / 2), start=1):
    axes = figure.add_subplot(1, 3, column, projection="3d")
    vertices, faces = ellipsoid_meshes(body.ellipsoids(time), subdivisions=2)
    for part in vertices:
        axes.plot_trisurf(*part.T, triangles=faces, color="steelblue")
    axes.set(
        title=f"{time:.2f} s",
        xlim=(-1, 1),
        ylim=(-1, 1),
        zlim=(0, 2),
        xticks=[],
        yticks=[],
        zticks=[],
    )
    axes.set_box_aspect((1, 1, 1), zoom=1.4)
    axes.view_init(elev=8, azim=190)
figure.suptitle(f"{amc.name}: 21 ellipsoids, in boxes of 2 m")
figure.savefig(OUT / "2_own_recording.png")
