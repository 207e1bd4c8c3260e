"""
Analytic against traced
=======================

The closed form adds up all parts of a body; ray tracing knows which of them another one occludes.
`rt.compare` runs several models on one recording with the same noise and says what differs.
"""

import os
from pathlib import Path

import h5py
import matplotlib.pyplot as plt
import numpy as np

import rtradar as rt

OUT = Path(os.environ.get("RTRADAR_GALLERY_OUT", "out/gallery"))
SECONDS = float(os.environ.get("RTRADAR_GALLERY_S", 3.0))

# %%
# A kick seen from the side: one leg passes before the other, the trunk occludes an arm.
kick, radar = (
    rt.synthetic_motion("kick", seed=0, duration_s=SECONDS),
    rt.Radar.preset("paper-12ghz"),
)
found = rt.compare(
    kick, radar, fidelities=["analytic", "specular"], heading_deg=90, out=OUT / "compare"
)
print(found.table())

# %%
# Each model's run lies in a folder of its name. Power is summed over range and velocity, of all
# channels.
figure, (above, below) = plt.subplots(2, 1, figsize=(8, 6), layout="constrained")
power = {}
for model in ("analytic", "specular"):
    with h5py.File(found.out / model / "maps.h5") as maps:
        power[model] = maps["range_doppler"][:].sum(axis=(1, 2))
        times = maps["time"][:]
strongest = max(one.max() for one in power.values())
for model, one in power.items():
    above.plot(times, 10 * np.log10(one / strongest), label=model)
above.set(
    xlabel="Time [s]", ylabel="Power [dB re maximum]", title="Power of the range-Doppler maps"
)
above.legend()
occluded = found.summary["fidelities"]["specular"]["part_occluded_share"]
below.barh(list(occluded), [100 * fraction for fraction in occluded.values()])
below.set(xlabel="Occluded [% of the part's power]", title="What rays find occluded")
below.tick_params(axis="y", labelsize=6)
figure.savefig(OUT / "5_analytic_and_traced.png")
