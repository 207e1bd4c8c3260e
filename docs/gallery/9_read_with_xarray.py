"""
Read the cube with xarray
=========================

``maps.h5`` is NetCDF-4 with named axes and units, which xarray opens as it is. With ``save_if`` the
IF samples are kept, too, in ``if.zarr``, chirp by chirp in TDM order; a few lines make them the
cube of a frame.
"""

import os
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
import zarr

import rtradar as rt

OUT = Path(os.environ.get("RTRADAR_GALLERY_OUT", "out/gallery"))
SECONDS = min(1.0, float(os.environ.get("RTRADAR_GALLERY_S", 1.0)))
radar = rt.Radar.preset("paper-12ghz")
rt.run(
    rt.synthetic_motion("punch", seed=0, duration_s=SECONDS), radar, save_if=True, out=OUT / "cube"
)

# %%
# The IF samples (chirp, rx, sample), cut into TDM cycles: (cycle, tx, rx, sample), with the time of
# each cycle's first chirp.
stored = zarr.open_array(OUT / "cube" / "if.zarr", mode="r")
cycles = stored.shape[0] // radar.n_tx
cube = xr.DataArray(
    stored[: cycles * radar.n_tx].reshape(cycles, radar.n_tx, *stored.shape[1:]),
    dims=("cycle", "tx", "rx", "sample"),
    coords={"cycle": radar.chirp_times(cycles * radar.n_tx)[:: radar.n_tx]},
    attrs={"units": "m"},
)
print(cube.sizes)

# %%
# A range profile over time of one channel by NumPy's own FFT, beside the map that the run made of
# all channels.
profile = np.abs(np.fft.fft(cube.isel(tx=0, rx=0) * np.hanning(cube.sizes["sample"]))) ** 2
figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
left.pcolormesh(radar.range_m, cube.cycle, 10 * np.log10(profile), cmap="viridis")
left.set(xlim=(2, 6), xlabel="Range [m]", ylabel="Time [s]", title="One channel, from if.zarr")
with xr.open_dataset(OUT / "cube" / "maps.h5", engine="h5netcdf") as maps:
    strongest = maps.range_doppler.sum("range").idxmax("velocity")
    print(f"velocity of the most power, window by window: {np.round(strongest.values, 2)} m/s")
    (10 * np.log10(maps.range_doppler.sel(time=SECONDS / 2, method="nearest"))).plot(
        ax=right, x="velocity", y="range"
    )
right.set(ylim=(2, 6), title="All channels, from maps.h5")
figure.savefig(OUT / "9_read_with_xarray.png")
