"""Figures of the page that simulated captures give.

The four activities before the paper's radar are its pictures 4, 5 and 8 to 12; CFAR on one channel
and on all its pictures 6 and 7 and its table 3. Then follow time and memory, and what becomes of
the paper's chirps at 60 and 77 GHz.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray
from skimage.measure import marching_cubes

from rtradar.bench.runs import measure_baseline
from rtradar.clouds.rdt import RdtCloud
from rtradar.clouds.spatial import SpatialCloud
from rtradar.errors import InputError
from rtradar.paper.formulas import slow_chirps
from rtradar.paper.items import ACTIVITIES, Sources
from rtradar.pipeline import Result, run, simulate
from rtradar.process import ca_cfar, os_cfar, power_map, range_spectrum
from rtradar.radar import Radar
from rtradar.report.canvas import VELOCITY_LABEL, add_colour_bar, few_ticks
from rtradar.report.maps import bin_edges, draw_levels
from rtradar.system.figure_style import DIVERGING, LIGHT, dress, new_figure, save_figure
from rtradar.validate import choose, claims, run_claim, validation_folder

Results = Mapping[str, Result]

_WIDTH_IN, _HEIGHT_IN = 9.0, 7.4
_BELOW_DB = 40.0
_TRIANGLES = 30_000


def activity_figures(sources: Sources) -> dict[str, Any]:
    """Simulate the four activities by `specular`, draw them, and measure their clouds.

    Parameters
    ----------
    sources : Sources
        Who moves, and the folder of the pictures.

    Returns
    -------
    dict
        Figures by their names.
    """
    radar = Radar.preset("paper-12ghz")
    # All four activities are run; the pictures show different maps of them.
    results: dict[str, Result] = {}
    cpu_s = []
    for name, activity in ACTIVITIES.items():
        motion = sources.motion(name)
        duration_s = min(activity.shown_s, motion.duration_s)
        began_s = time.process_time()
        results[name] = run(motion, radar, duration_s=duration_s)
        cpu_s.append(time.process_time() - began_s)
    flat: dict[str, Callable[[Result, Axes], Any]] = {
        "figure-4": lambda result, axes: result.plot.range_time(axes),
        "figure-5": lambda result, axes: result.plot.range_doppler(ax=axes),
        "figure-8": lambda result, axes: result.plot.spectrogram(axes),
    }
    solid = {
        "figure-10": _draw_first_points,
        "figure-11": _draw_surface,
        "figure-12": lambda result, axes: result.plot.rdt(axes),
    }
    for name, draw in (flat | solid).items():
        _side_by_side(sources, name, results, draw, projection="3d" if name in solid else None)
    _draw_angles_in_metres(sources, results["jumping_jack"])
    # The first run also compiles what all of them need.
    return {"who": sources.named, "ours_cpu_s": max(cpu_s[1:])} | _findings(results)


def _side_by_side(
    sources: Sources,
    name: str,
    results: Results,
    draw: Callable[[Result, Any], Any],
    projection: str | None,
) -> None:
    """Draw all activities in one picture, each with its name alone as its title."""
    figure = new_figure(_HEIGHT_IN, width_in=_WIDTH_IN)
    panels = figure.subplots(2, 2, subplot_kw={"projection": projection})
    for (activity, result), axes in zip(results.items(), panels.flat, strict=True):
        draw(result, axes)
        _dressed(axes, ACTIVITIES[activity].title, grid=projection is not None)
    save_figure(figure, sources.out / f"{name}.png")


def _dressed(axes: Any, title: str, *, grid: bool) -> None:
    """Give a panel its name in the place of all other texts."""
    for text in list(axes.texts):
        text.remove()
    dress(axes, title=title, grid=grid)


def _draw_first_points(result: Result, axes: Any) -> None:
    """Draw the spatial cloud of the first frame."""
    cloud = result.spatial.strongest()
    first = _of_first_frame(cloud, result)
    fastest = float(np.abs(cloud.velocity[first]).max(initial=0.1))
    style: dict[str, Any] = {"cmap": DIVERGING, "vmin": -fastest, "vmax": fastest, "s": 6}
    dots = axes.scatter(*cloud.points[first].T, c=cloud.velocity[first], **style)
    middle = np.median(cloud.points[first], axis=0) if first.any() else np.zeros(3)
    sides = [(middle[axis] - 0.8, middle[axis] + 0.8) for axis in range(2)]
    axes.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    axes.set(xlim=sides[0], ylim=sides[1], zlim=(0, 2.2))
    axes.set_box_aspect((1, 1, 1.4), zoom=0.9)
    few_ticks(axes, 4)
    add_colour_bar(dots, [axes], "Velocity [m/s]", shrink=0.7, pad=0.14)


def _of_first_frame(cloud: SpatialCloud, result: Result) -> NDArray[np.bool_]:
    return np.asarray(cloud.time == result.maps["time"].values[0])


def _draw_surface(result: Result, axes: Any) -> None:
    """Draw the isosurface of the detections over time, range and velocity."""
    # Padding closes the surface where the detections reach the edge of the maps. Indices then
    # become seconds, metres, and metres per second.
    detected = np.pad(result.maps["detections"].values > 0, 1)
    places, faces, _, _ = marching_cubes(detected.astype(np.float32), 0.5)
    axis = [result.maps[name].values for name in ("time", "range", "velocity")]
    steps = [values[1] - values[0] for values in axis]
    places = np.array([values[0] for values in axis]) + (places - 1) * steps
    # A false alarm far away would leave the body in a corner.
    low, high = np.quantile(places, (0.002, 0.998), axis=0)
    corners = places[faces]
    corners = corners[((corners >= low) & (corners <= high)).all(axis=(1, 2))]
    shown = corners[:: -(-len(corners) // _TRIANGLES)]
    axes.add_collection3d(
        Poly3DCollection(shown, facecolor=LIGHT.cycle[0], alpha=0.5, linewidths=0)
    )
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set(xlabel="Time [s]", ylabel="Range [m]", zlabel="Velocity [m/s]")
    axes.set_box_aspect((1.6, 1, 1), zoom=0.9)
    few_ticks(axes, 4)


def _draw_angles_in_metres(sources: Sources, result: Result) -> None:
    """Draw power of the first frame from above and from the side, in metres from the radar."""
    figure = new_figure(4.2, width_in=_WIDTH_IN)
    for axes, name, label in zip(
        figure.subplots(1, 2), ("azimuth", "elevation"), ("Y [m]", "Z [m]"), strict=True
    ):
        # Cells of range and angle are drawn in metres along and across the boresight.
        power = result.maps[f"range_{name}"].values[0]
        distance = _edges(result.maps["range"].values)[:, None]
        angle = _edges(result.maps[name].values)
        level = 10 * np.log10(np.maximum(power / power.max(), 1e-30))
        across = "X [m]" if name == "azimuth" else "D [m]"
        picture = axes.pcolormesh(
            distance * np.cos(angle),
            distance * np.sin(angle),
            np.maximum(level, -_BELOW_DB),
            rasterized=True,
        )
        axes.set(xlabel=across, ylabel=label, xlim=(2.5, 5.5), ylim=(-2, 2), aspect="equal")
        dress(axes, title=f"Range and {name}", grid=False)
        add_colour_bar(picture, [axes], "Power [dB re maximum]", extend="min")
    save_figure(figure, sources.out / "figure-9.png")


def _edges(centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the edges between even centres, one more than these."""
    return np.linspace(*bin_edges(centres), len(centres) + 1)


def _findings(results: Results) -> dict[str, Any]:
    """Measure clouds, times and parts of the body."""
    found: dict[str, Any] = {}
    for activity, result in results.items():
        speed = np.abs(result.points[:, 2])
        found |= {
            f"{activity}_fastest": float(np.quantile(speed, 0.99)),
            f"{activity}_points": result.summary["rdt_triangles"],
            f"{activity}_first": int(_of_first_frame(result.spatial, result).sum()),
        }
        # These points would alias with the same chirps at 60 and 77 GHz, which have these
        # unambiguous velocities.
        for name, limit_mps in (("60", 1.61), ("77", 1.27)):
            found[f"{activity}_beyond_{name}"] = 100 * float(np.mean(speed > limit_mps))
    jack = results["jumping_jack"]
    found["triangles_25"], found["triangles_75"] = (_triangles(jack, every) for every in (1, 3))
    found["slices_25"], found["slices_75"] = (len(jack.maps["time"][::every]) for every in (1, 3))
    for name in ("azimuth", "elevation"):
        found[f"{name}_deg"] = _strongest_deg(jack, name)
    # Here is by how much the power of the whole body falls if one part is left out, from the mean
    # power of each part.
    of_parts = [list(result.summary["part_power_m2"].values()) for result in results.values()]
    power = np.mean(of_parts, axis=0)
    change_db = 10 * np.log10(1 - power / power.sum())
    found["part_least_db"], found["part_most_db"] = float(-change_db.max()), float(-change_db.min())
    times = [result.summary for result in results.values()]
    found["ours_s"] = max(one["wall_s"] for one in times)
    found["ours_capture_s"] = max(one["capture_s"] for one in times)
    found["ours_mb"] = max(one["peak_memory_mb"] for one in times)
    found["lengths"] = ", ".join(
        f"{one.title.lower()} {one.class_s:.1f} s" for one in ACTIVITIES.values()
    )
    return found


def _triangles(result: Result, every: int) -> int:
    """Count the triangles of the isosurface of every so many slices."""
    cloud = RdtCloud(result.radar)
    for frame in range(0, len(result.maps["time"]), every):
        mask = result.maps["detections"].values[frame] > 0
        cloud.push(mask, float(result.maps["time"].values[frame]))
    return cloud.finish().n_triangles


def _strongest_deg(result: Result, name: str) -> float:
    """Find the angle of most power in the first frame [degree]."""
    power = result.maps[f"range_{name}"].values[0].sum(axis=0)
    return float(np.degrees(result.maps[name].values[power.argmax()]))


_SCHEMES = ("SISO-CA", "SISO-OS", "MIMO-CA", "MIMO-OS")
_RULES = {"true": "noise-free map", "rule": "paper's rule", "coded": "paper as coded"}


def detection_figures(sources: Sources) -> dict[str, Any]:
    """Detect a jumping jack on one channel and on all, and score the detectors by `table3.py`.

    Parameters
    ----------
    sources : Sources
        Who moves, and the folder of the pictures.

    Returns
    -------
    dict
        Figures by their names.
    """
    # One frame is detected on one channel and on the sum of all channels.
    radar = Radar.preset("paper-12ghz")
    duration_s = radar.frame_duration_s + radar.cycle_duration_s
    capture = simulate(sources.motion("jumping_jack"), radar, duration_s=duration_s)
    samples = capture.samples.values[: radar.chirps_per_frame]
    shape = -1, radar.n_tx, radar.n_rx, radar.samples_per_chirp
    cube = range_spectrum(samples, radar).reshape(shape)
    found: dict[str, Any] = {}
    for name, kind, looks in (("figure-6", "one", 1), ("figure-7", "all", radar.n_channels)):
        power = power_map(cube, radar, channel=0) if looks == 1 else power_map(cube, radar)
        masks = {"CA": ca_cfar(power, looks=looks), "OS": os_cfar(power, looks=looks)}
        found |= {f"ca_{kind}": int(masks["CA"].sum()), f"os_{kind}": int(masks["OS"].sum())}
        _draw(sources, name, power, masks, radar)
    return found | _table3(quick=sources.quick)


def _draw(
    sources: Sources,
    name: str,
    power: NDArray[np.floating[Any]],
    masks: dict[str, NDArray[np.bool_]],
    radar: Radar,
) -> None:
    """Draw a map once for each detector, with its detections."""
    figure = new_figure(4.0, width_in=9.0)
    panels = figure.subplots(1, 2, sharey=True)
    level = 10 * np.log10(power / power.max())
    velocity = radar.velocity_mps(radar.cycles_per_frame)
    for axes, (law, mask) in zip(panels, masks.items(), strict=True):
        image = draw_levels(axes, level, velocity, radar.range_m)
        rows, columns = np.nonzero(mask)
        colour = LIGHT.detection
        axes.scatter(velocity[columns], radar.range_m[rows], s=5, color=colour)
        axes.set(xlabel=VELOCITY_LABEL, ylabel="Range [m]", ylim=(2.5, 6.0))
        dress(axes, title=f"{law}-CFAR, {len(rows)} detections", grid=False)
    add_colour_bar(image, list(panels), "Power [dB re maximum]")
    save_figure(figure, sources.out / f"{name}.png")


def _table3(*, quick: bool) -> dict[str, Any]:
    """Run the script of table 3; precision and missing rate by rule of truth, in words."""
    ((claim, _),) = choose(claims(validation_folder()), "table3")
    outcome = run_claim(claim, quick=quick)
    if outcome.trouble:
        raise RuntimeError(f"{claim.script.name} {outcome.trouble}")
    together = "one of four" if quick else "all four"
    rows = {(row.claim, row.quantity): row.ours for row in outcome.rows}
    found: dict[str, Any] = {"table3_frames": together}
    for key, rule in _RULES.items():
        cells = []
        for scheme in _SCHEMES:
            where = f"{together}, {rule}"
            missed = rows[where, f"{scheme} missing rate"]
            # Where nothing is detected there is no precision.
            right = rows.get((where, f"{scheme} precision"))
            cells.append(f"{scheme} {'-' if right is None else f'{right:.1f}'} / {missed:.1f}")
        found[f"table3_{key}"] = "; ".join(cells)
    return found


_QUICK_S = 1.0


def cost_figures(sources: Sources) -> dict[str, Any]:
    """Time the paper's method and ours, take memory at 77 GHz, and draw what its chirps alias.

    Parameters
    ----------
    sources : Sources
        Who moves, and the folder of the pictures.

    Returns
    -------
    dict
        Figures by their names.
    """
    baseline = measure_baseline("paper-12ghz", 1, quick=True)
    if baseline is None:
        raise InputError("there is no paper_numpy.py to time; use a checkout, or install again")
    frame_s = baseline["total"]["median"]
    motion = sources.motion("jumping_jack")
    activity = ACTIVITIES["jumping_jack"]
    longest_s = min(activity.shown_s, motion.duration_s)
    duration_s = min(_QUICK_S, longest_s) if sources.quick else longest_s
    summary = run(motion, Radar.preset("paper-77ghz"), duration_s=duration_s).summary
    # These pictures show what the same chirps alias at higher carriers.
    figure = new_figure(3.8, width_in=9.0)
    for axes, name in zip(figure.subplots(1, 2), ("60", "77"), strict=True):
        radar = slow_chirps(name)
        aliased = run(motion, radar, fidelity="analytic", duration_s=longest_s)
        aliased.plot.spectrogram(axes)
        _dressed(axes, f"{activity.title}, {radar.name}", grid=False)
    save_figure(figure, sources.out / "number-60-77ghz.png")
    return {
        "machine": f"{os.cpu_count()} cores, {platform.machine()}",
        "numpy_frame_s": frame_s,
        "numpy_sample_min": frame_s * 117 / 60,
        "s_77": summary["wall_s"],
        "capture_77": summary["capture_s"],
        "mb_77": summary["peak_memory_mb"],
    }
