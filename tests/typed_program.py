"""What a user may type: `test_types` checks its types as strictly as mypy can; it never runs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import xarray as xr
from matplotlib.axes import Axes

import rtradar as rt

motion = rt.load_motion("walk.amc", skeleton="walk.asf")
motion = rt.synthetic_motion("walk", seed=0)
radar = rt.Radar.preset("paper-12ghz")
scene = rt.Scene.load("free-space")
result = rt.run(motion, radar, scene, fidelity="specular", snr_db=20, seed=0, out="out/walk")
result = rt.run(
    motion, radar, scene, fidelity="specular", start_s=0.5, duration_s=1, snr_db="physical"
)

maps: xr.Dataset = result.maps
points: npt.NDArray[np.float64] = result.points
places: npt.NDArray[np.float64] = result.spatial.points
detections = int(result.summary["detections"])
folder: Path | None = result.out
if result.link_budget is not None:
    print(result.link_budget.power)
axes: Axes = result.plot.range_doppler(time_s=1.2)
axes = result.plot.range_doppler(ax=axes)
axes = result.plot.spectrogram()
axes = result.plot.range_time()
axes = result.plot.rdt()
axes = result.plot.spatial()
result.view().save("view.html")

capture = rt.simulate(motion, radar, scene, fidelity="physical-optics", snr_db=float("inf"))
samples: xr.DataArray = capture.samples
for block in capture.blocks():
    print(block.shape)
result = rt.process_samples(samples, radar, out=None, clutter_removal="mean", pfa=1e-4)
result = rt.process_samples(capture.blocks(), radar)
cube: npt.NDArray[np.complex64] = samples.values
result = rt.process_samples(cube, radar, "out/samples")
result = rt.process_samples(cube.astype(np.complex128), radar)

section = rt.rcs.ellipsoid(0.1, 0.2, 0.3, np.linspace(0, np.pi, 5), 0.0)
sphere = rt.rcs.sphere(0.1, 12e9, method="mie")
mask = rt.process.os_cfar(
    np.abs(cube[:, 0]), guard=2, train=4, quantile=0.75, pfa=1e-6, looks=1, scale=None
)
mask = rt.process.ca_cfar(np.abs(cube[:, 0]), guard=2, train=4, pfa=1e-6, looks=1, scale=None)
scale: float = rt.process.os_scale(24, 0.75, 1e-6)
target = rt.Ellipsoids(np.zeros((1, 3)), np.eye(3)[None], np.full((1, 3), 0.1))
length = rt.scattering_length(
    target, [[4.0, 0, 0]], [[4.0, 0, 0]], 12e9, fidelity="specular", polarization="v"
)
echoes = rt.Echoes(
    length=np.ones((1, 8, 1)),
    amplitude=np.ones((1, 1, 8, 1), complex),
    frequency=np.array([14e9]),
    tx=np.zeros(1, int),
    part=np.zeros(1, int),
    bounces=np.ones(1, int),
)
times = radar.chirp_times(1)
x = rt.signal.synthesize(echoes, radar, times)
spectra = rt.process.range_doppler(x, radar)
print(spectra.values.shape, spectra.range_m, spectra.velocity, radar.tx, radar.rx)
azimuth, elevation = rt.process.angle(x, radar, 4.0, 1.0, focus=True)
drawn: tuple[Axes, Axes, Axes] = radar.plot(), scene.plot(), motion.plot()
comparison = rt.compare(
    motion, radar, scene, out="out/compare", fidelities=["analytic", "specular"]
)
print(comparison.table())

# What does not exist is refused; an ignored error that is none would be one.
print(rt.simulat)  # type: ignore[attr-defined]
rt.run(motion, radar, fidelty="specular")  # type: ignore[call-overload]
rt.simulate(motion, radar, pfa=1e-4)  # type: ignore[call-arg]
rt.process_samples("x", radar)  # type: ignore[arg-type]
result.plot.nothing()  # type: ignore[attr-defined]
