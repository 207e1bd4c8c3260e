"""Still picture of ``rtradar view``: the same four views of one snapshot, as a PNG file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize, to_rgba_array
from matplotlib.patches import Patch
from matplotlib.ticker import MultipleLocator
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from numpy.typing import NDArray

from rtradar.report.canvas import VELOCITY_LABEL, add_colour_bar
from rtradar.report.maps import draw_levels
from rtradar.report.run_view import GROUPS, VELOCITY_COLOURS, RunView, group_of_parts
from rtradar.report.three_d import drawn_sphere
from rtradar.system.figure_style import dress, new_figure, save_figure, write_heading
from rtradar.system.files import atomic_file

_HIDDEN = "#8c8c94"
_NAMED = ("person", "part")
"""Quantities whose colours have names, and no colour bar."""

_MOST_COLUMNS = 7
_NOW = "#e0389a"


def draw_still(
    path: str | Path, run_view: RunView, step: int, *, colour: str | None = None
) -> None:
    """Draw body and paths, range-Doppler map, cloud and spectrogram of the snapshot ``step``.

    ``colour`` is the quantity that colours show, one of `COLOURS`, by default that of the view.
    InputError if the PNG file cannot be written.
    """
    # The four views: 3D ones in the left column, maps in the right one.
    figure = new_figure(8.2, width_in=13)
    grid = figure.add_gridspec(2, 2, width_ratios=(1.25, 1), height_ratios=(1.25, 1))
    time = f"{run_view.snapshots.times[step]:.2f} s"
    tints = _tints(run_view, colour or run_view.colour, step)
    views = [
        figure.add_subplot(grid[row, column], projection=None if column else "3d")
        for row, column in np.ndindex(2, 2)
    ]
    _draw_body(views[0], run_view, step, tints)
    _draw_map(views[1], run_view, step, tints)
    _draw_cloud(views[2], run_view, step, tints)
    _draw_spectrogram(views[3], run_view, step)
    write_heading(figure, f"{run_view.heading}, {run_view.subtitle}: {time}")
    _explain(figure, views, tints)
    for view in (views[0], views[2]):
        for artist in (*view.collections, *view.lines):
            # A long 3D box is wider than its axes, whose edge would cut the body. The layout
            # already accounts for the box.
            artist.set_clip_on(False)
            artist.set_in_layout(False)
    with atomic_file(path) as file:
        save_figure(figure, file)


class _Tints(NamedTuple):
    """Colours (rgba) of one step, and what says what they mean: names, or a scale with a label."""

    echoes: NDArray[np.float64]
    parts: NDArray[np.float64]
    cloud: NDArray[np.float64]
    sources: NDArray[np.float64]
    names: Sequence[tuple[str, Any]]
    scale: tuple[ScalarMappable, str] | None = None


def _tints(run_view: RunView, colour: str, step: int) -> _Tints:
    """Return colours by person, part, power or velocity; what is occluded is grey."""
    snapshots = run_view.snapshots
    sources = to_rgba_array(run_view.source_colours)
    if colour in _NAMED:
        if colour == "part":
            names, of_part = list(GROUPS.items()), group_of_parts(snapshots.part_names.tolist())
            of_point = run_view.rdt_group()
        else:
            # A person and an object may have the same name.
            names = list(zip(run_view.source_names, run_view.source_colours, strict=True))
            of_part, of_point = snapshots.part_person.tolist(), run_view.rdt_source
        table = to_rgba_array([tint for _, tint in names])  # the last is that of nobody
        parts = table[of_part]
        return _Tints(parts[snapshots.echo_part], parts, table[of_point], sources, names)
    # A scale of colours: by the power of an echo, or by its range rate.
    if colour == "power":
        label, limits = run_view.power_unit.label("of an echo"), run_view.power_range_db
        values, cloud = run_view.power_db[step], run_view.rdt_power_db
        scale: Any = colormaps["viridis"]
    else:
        label, limits = VELOCITY_LABEL, (-run_view.fastest_mps, run_view.fastest_mps)
        values, cloud = snapshots.velocity_mps[step], run_view.rdt_points[:, 2]
        scale = LinearSegmentedColormap.from_list("rates", list(VELOCITY_COLOURS))
    painted = ScalarMappable(Normalize(*limits), scale.with_extremes(bad=_HIDDEN))
    # Each part has the colour of its strongest direct echo, the last that is set.
    strongest = np.argsort(snapshots.power_m2[step], kind="stable")
    strongest = strongest[snapshots.direct[strongest]]
    strengths = np.full(len(snapshots.part_names), np.nan)
    strengths[snapshots.echo_part[strongest]] = values[strongest]
    echoes, parts, cloud = (
        np.asarray(painted.to_rgba(np.ma.masked_invalid(own))) for own in (values, strengths, cloud)
    )
    return _Tints(echoes, parts, cloud, sources, [], (painted, label))


def _explain(figure: Any, views: list[Any], tints: _Tints) -> None:
    """Add a legend of the colours below the views, or their scale."""
    if tints.scale is None:
        patches = [Patch(color=tint, label=name) for name, tint in tints.names]
        columns = min(len(patches), _MOST_COLUMNS)
        figure.legend(handles=patches, loc="outside lower center", ncols=columns)
        return
    painted, label = tints.scale
    place = {"location": "bottom", "shrink": 0.4, "aspect": 50, "pad": 0.02}
    dress(figure.colorbar(painted, ax=views, label=label, **place).ax, grid=False)


def _draw_body(axes: Any, run_view: RunView, step: int, tints: _Tints) -> None:
    snapshots = run_view.snapshots
    radar = run_view.radar.at(float(snapshots.times[step]))
    vertices, faces = drawn_sphere()
    poses = snapshots.poses[step].astype(np.float64)
    # Each part is a sphere, stretched along its semi-axes.
    for part in np.flatnonzero(snapshots.drawn_parts):
        centre, *semi_axes = poses[part]
        corners = (centre + vertices @ np.array(semi_axes))[faces]
        style = {"facecolors": tints.parts[part, :3], "shade": True, "linewidth": 0}
        axes.add_collection3d(Poly3DCollection(corners, **style))
    moving, of_face = snapshots.mesh_vertices(step), snapshots.mesh_faces[:, 0]
    # Meshes have the colours of the parts of people, or of the object.
    if len(of_face):
        own = snapshots.mesh_part[of_face]
        source = snapshots.mesh_source[snapshots.mesh_of_vertex[of_face]]
        rgba = tints.sources[source]
        rgba[own >= 0] = tints.parts[own[own >= 0]]
        style = {"facecolors": rgba[:, :3], "shade": True, "linewidth": 0}
        axes.add_collection3d(Poly3DCollection(moving[snapshots.mesh_faces], **style))
    # The room: outlines of walls, and furniture that can be seen through.
    outlines = [np.concatenate([corners, corners[:1]]) for corners in snapshots.walls]
    if outlines:
        axes.add_collection3d(Line3DCollection(outlines, colors="dimgrey", linewidths=1.2))
    if len(snapshots.furniture_faces):
        triangles = snapshots.furniture_vertices[snapshots.furniture_faces].astype(np.float64)
        style = {"facecolors": "#b08d57", "alpha": 0.18, "linewidth": 0}
        axes.add_collection3d(Poly3DCollection(triangles, **style))
    # Paths from the radar over all points of reflection and back, direct ones stronger.
    place = np.array(radar.position_m)
    for echo in np.flatnonzero(run_view.seen[step]):
        corners = snapshots.corners[step, echo].astype(np.float64)
        corners = corners[np.isfinite(corners).all(axis=1)]
        if len(corners):
            line = np.concatenate([[place], corners, [place]])
            width, alpha = (1.2, 0.8) if snapshots.direct[echo] else (0.6, 0.35)
            axes.plot(*line.T, color=tints.echoes[echo], linewidth=width, alpha=alpha)
    axes.scatter(*radar.tx.T, color="crimson", marker="s", s=6, label="Tx", depthshade=False)
    axes.scatter(*radar.rx.T, color="royalblue", s=3, label="Rx", depthshade=False)
    # The box holds the body at all times and everything around it, in equal scales.
    centres, walls = snapshots.poses[:, :, 0].reshape(-1, 3), snapshots.walls.reshape(-1, 3)
    furniture = snapshots.furniture_vertices
    everything = np.concatenate([centres, walls, furniture, moving, radar.tx, radar.rx])
    low, high = everything.min(axis=0) - 0.1, everything.max(axis=0) + 0.1
    low[2] = min(low[2], 0.0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    for axis in (axes.xaxis, axes.yaxis, axes.zaxis):
        axis.set_major_locator(MultipleLocator(1.0))
    axes.set_box_aspect(high - low, zoom=1.35)
    axes.view_init(elev=22, azim=-75)
    axes.legend(loc="upper left")
    dress(axes, title="Body and paths")


def _draw_map(axes: Any, run_view: RunView, step: int, tints: _Tints) -> None:
    snapshots = run_view.snapshots
    image = draw_levels(axes, *run_view.range_doppler.drawn(step), cmap="Greys")
    velocity = run_view.shown_velocity()[step]
    # Direct echoes are drawn last, over the ghosts.
    for direct in (False, True):
        own = np.flatnonzero(run_view.seen[step] & (snapshots.direct == direct))
        style: dict[str, Any] = {"marker": "D", "s": 14, "facecolors": "none"}
        style["edgecolors"] = tints.echoes[own]
        if direct:
            style = {"marker": "o", "s": 40, "color": tints.echoes[own], "edgecolors": "white"}
        axes.scatter(velocity[own], snapshots.range_m[step, own], linewidths=0.7, **style)
    across, up = run_view.shown_box()
    axes.set(xlim=across, ylim=up, xlabel=VELOCITY_LABEL, ylabel="Range [m]")
    title = "Range-Doppler map, and where echoes are"
    dress(axes, title=title, grid=False)
    add_colour_bar(image, [axes], run_view.range_doppler.label)


def _draw_cloud(axes: Any, run_view: RunView, step: int, tints: _Tints) -> None:
    points, time = run_view.rdt_points, run_view.snapshots.times[step]
    axes.set(xlabel="Time [s]", ylabel="Range [m]", zlabel=VELOCITY_LABEL)
    dress(axes, title=f"Range-Doppler-time cloud: {len(points)} points")
    axes.set_box_aspect((1.7, 1, 0.9), zoom=1.15)
    if not len(points):
        return
    # Points of the frame now are larger, in a frame of their own.
    own = np.abs(points[:, 0] - time) <= run_view.radar.frame_duration_s / 2
    axes.scatter(*points[~own].T, c=tints.cloud[~own], s=1.5, alpha=0.35, depthshade=False)
    axes.scatter(*points[own].T, c=tints.cloud[own], s=12, depthshade=False)
    (_, r0, v0), (_, r1, v1) = points.min(axis=0), points.max(axis=0)
    axes.plot([time] * 5, [r0, r1, r1, r0, r0], [v0, v0, v1, v1, v0], color=_NOW, linewidth=1.2)


def _draw_spectrogram(axes: Any, run_view: RunView, step: int) -> None:
    axes.set(xlabel="Time [s]", ylabel=VELOCITY_LABEL)
    dress(axes, title="Spectrogram", grid=False)
    if not run_view.spectrogram.level.size:
        style = {"ha": "center", "va": "center", "transform": axes.transAxes}
        axes.text(0.5, 0.5, "The capture is too short for one.", **style)
        return
    image = draw_levels(axes, *run_view.spectrogram.drawn(0))
    axes.axvline(run_view.snapshots.times[step], color=_NOW, linewidth=1.5)
    add_colour_bar(image, [axes], run_view.spectrogram.label)
