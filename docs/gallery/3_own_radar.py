"""
Your own radar
==============

A radar is a TOML file. This one follows an evaluation board with Texas Instruments' IWR6843, a 60
to 64 GHz sensor.

From the data sheet of the IWR6843 (SWRS219): 60 to 64 GHz, sweeps of up to 4 GHz, 3 Tx and 4 Rx, up
to 12.5 million complex samples a second. From the guide to the boards (SWRU546): Rx half a
wavelength apart, the two Tx of the horizontal line two wavelengths. The third Tx, raised by half a
wavelength, makes no line of its own and is left out. The chirps are our choice: within these
limits, and as `rt.Radar` has it without a pause between them.
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

IWR6843 = """
name = "IWR6843, horizontal line"
start_frequency_hz = 60.1e9
bandwidth_hz = 3.8e9
chirp_duration_s = 60e-6
samples_per_chirp = 256
frame_duration_s = 0.06
tx_y = 2
tx_z = 0
rx_y = 4
rx_z = 0
tx_spacing_wavelengths = 2.0
rx_spacing_wavelengths = 0.5
position_m = [-3, 0, 1.2]
"""
(OUT / "iwr6843.toml").write_text(IWR6843)

# %%
# What it can measure follows from the file.
radar = rt.Radar.load(OUT / "iwr6843.toml")
print(
    f"range to {radar.max_range_m:.1f} m in steps of {100 * radar.range_bin_m:.1f} cm, "
    f"{radar.n_channels} channels"
)
print(f"velocity to {radar.max_velocity_mps:.1f} m/s in steps of {radar.velocity_bin_mps:.3f} m/s")
print(
    f"beam {radar.angle_resolution_deg:.0f} degrees wide, "
    f"{radar.sample_rate_hz / 1e6:.1f} million samples a second"
)

# %%
# The spectrogram of a kick, relative to its strongest value: maps hold abs(amplitude)^2 [m^2] with
# the loss over distance in it.
kick = rt.synthetic_motion("kick", seed=1, duration_s=SECONDS)
rt.run(kick, radar, out=OUT / "own_radar")
figure, axes = plt.subplots(figsize=(8, 4), layout="constrained")
with h5py.File(OUT / "own_radar" / "maps.h5") as maps:
    power = 10 * np.log10(maps["spectrogram"][:].T)
    power -= power.max()
    image = axes.pcolormesh(
        maps["spectrogram_time"][:], maps["spectrogram_velocity"][:], power, cmap="magma"
    )
image.set_clim(np.median(power), power.max())
axes.set(
    xlabel="Time [s]",
    ylabel="Velocity [m/s] (positive: receding)",
    title=f"A kick before the {radar.name}",
)
figure.colorbar(image, label="Power [dB re maximum]")
figure.savefig(OUT / "3_own_radar.png")
