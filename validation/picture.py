"""Picture of the README: a synthetic walk, its ellipsoids before the radar, and its maps.

python validation/picture.py [--out validation/picture.png]
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import xarray
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

import rtradar as rt
from rtradar.body import Body, Ellipsoids
from rtradar.body.body import ellipsoid_meshes
from rtradar.motion import place
from rtradar.report.figures.canvas import VELOCITY_LABEL, field_unit

MOMENT_S = 1.3
LOW, HIGH = -65.0, -5.0  # colours of the maps [dBsm]


def draw_body(axes: Any, body: Body, radar: rt.Radar, time_s: float) -> None:
    poses = body.at(np.array([time_s]))
    vertices, faces = ellipsoid_meshes(
        Ellipsoids(poses.centres[0], poses.frames[0], poses.semi_axes), subdivisions=2
    )
    for part in vertices:
        triangles = part[faces]
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        lit = 0.55 + 0.45 * normals @ [-0.6, -0.5, 0.6] / np.linalg.norm(normals, axis=1)
        colours = np.column_stack([0.35 * lit, 0.55 * lit, 0.75 * lit, np.ones(len(lit))])
        axes.add_collection3d(
            Poly3DCollection(triangles, facecolors=np.clip(colours, 0, 1), linewidths=0)
        )
    axes.scatter(*radar.tx.T, s=8, color="crimson", label=f"{len(radar.tx)} Tx")
    axes.scatter(*radar.rx.T, s=2, color="black", label=f"{len(radar.rx)} Rx")
    axes.set(
        xlim=(-4.2, 0.8),
        ylim=(-1, 1.4),
        zlim=(0, 1.9),
        xlabel="x [m]",
        ylabel="y [m]",
        zlabel="z [m]",
    )
    axes.set(yticks=(-1, 0, 1), zticks=(0, 1))
    axes.set_box_aspect((5.0, 2.4, 1.9), zoom=1.3)
    axes.view_init(elev=14, azim=-72)
    axes.legend(loc="upper left", fontsize=8)
    axes.set_title(f"21 ellipsoids and the radar, {time_s:.2f} s")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path(__file__).with_name("picture.png"))
    options = parser.parse_args()
    motion, radar = (
        rt.synthetic_motion("walk", seed=0, duration_s=3.0),
        rt.Radar.preset("paper-12ghz"),
    )
    figure = Figure(figsize=(13, 8), dpi=75, layout="constrained")
    grid = figure.add_gridspec(2, 3)
    draw_body(
        figure.add_subplot(grid[0, 0], projection="3d"),
        Body.from_motion(place(motion)),
        radar,
        MOMENT_S,
    )
    with tempfile.TemporaryDirectory() as folder:
        for column, fidelity in enumerate(("analytic", "specular"), start=1):
            result = rt.run(motion, radar, out=Path(folder, fidelity), fidelity=fidelity)
            with xarray.open_dataset(Path(folder, fidelity, "maps.h5"), engine="h5netcdf") as maps:
                axes = figure.add_subplot(grid[0, column])
                near = maps.range_doppler.sel(time=MOMENT_S, method="nearest").sel(
                    range=slice(2, 7)
                )
                unit = field_unit(radar, range_m=near.range.values[:, None])
                level = unit.level(near.values / radar.n_channels)
                image = axes.pcolormesh(
                    maps.velocity,
                    near.range,
                    level,
                    cmap="viridis",
                    vmin=LOW,
                    vmax=HIGH,
                    rasterized=True,
                )
                axes.set(
                    xlabel=VELOCITY_LABEL, ylabel="Range [m]", title=f"{fidelity}, {MOMENT_S:.2f} s"
                )
                if fidelity == "specular":
                    figure.colorbar(image, label=unit.label("mean of channels"))
                    axes = figure.add_subplot(grid[1, 0])
                    near = maps.range_time.sel(range=slice(2, 7))
                    level = field_unit(radar, range_m=near.range.values).level(near.values)
                    image = axes.pcolormesh(
                        maps.slow_time, near.range, level.T, cmap="viridis", rasterized=True
                    )
                    image.set_clim(float(np.median(level)) - 3, None)
                    axes.set(
                        xlabel="Time [s]", ylabel="Range [m]", title="specular, range over time"
                    )
                    figure.colorbar(image, label=unit.label("mean of channels"))
            axes = figure.add_subplot(grid[1, column], projection="3d")
            time, distance, velocity = result.points.T
            axes.scatter(
                time, distance, velocity, c=velocity, s=3, cmap="coolwarm", vmin=-5, vmax=5
            )
            axes.set(
                xlabel="Time [s]",
                ylabel="Range [m]",
                zlabel=VELOCITY_LABEL,
                title=f"{fidelity}, RDT cloud",
            )
            axes.set_box_aspect((1.5, 1, 1))
    figure.savefig(options.out)
    print(options.out)


if __name__ == "__main__":
    main()
