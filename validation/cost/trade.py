"""Speed against accuracy: the cost of every model and option, and its distance from `reference`.

The error is that of ``whole_bodies.py``: the received spectrum H(f, t) of the corner channels over
one frame of 100 ms, rms over rms, and the power of that frame. The cost is the time of echoes and
IF samples of that frame, all channels, over that of `analytic` in the same run; each first runs a
little, so that nothing is compiled, and the best of several counts. `rays` and `reference`, which
take minutes for a frame, are timed on a part of it: `rays` on one Tx over the time between two
keyframes, `reference` on two TDM cycles.

Results go to ``--json FILE`` at once, and those in the file are not measured again: to continue
after an interruption, or to add a line to `MODELS` or `OPTIONS`, run the script again with the same
file. ``--costs`` measures all costs anew, and keeps the errors.

    python validation/cost/trade.py --json FILE [--figure FILE] [--costs] [--quick]
"""

from __future__ import annotations

import argparse
import itertools
import json
import sys
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.scatter import EchoModel, build_model
from rtradar.scatter.models.rays import ANCHOR_S

sys.path.append(str(Path(__file__).resolve().parents[1] / "other_methods"))

from whole_bodies import FRAMES, PRESETS, Scene

CHEAPEST = "analytic"  # all costs are relative to it
# In the order of the table; `reference` has a cost and no error.
MODELS = (
    "analytic-paper",
    "analytic",
    "specular",
    "physical-optics",
    "rays",
    "reference",
)
SLOW = ("rays", "reference")  # minutes for a frame: after all others


BY_SIZE = "by size"  # what a part takes at this wavelength


@dataclass(frozen=True)
class ModelOption:
    """Values of one option, from cheap to expensive, for each radar; the default is among them."""

    fidelity: str
    name: str
    values: dict[str, tuple[float | str, ...]]
    default: dict[str, float | str]
    style: str  # of its line in the figure


def said(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:g}"


def for_both(values: Any) -> dict[str, Any]:
    return dict.fromkeys(PRESETS, values)


OPTIONS = (
    ModelOption("specular", "visibility", for_both(("sharp", "gradual")), for_both("sharp"), "-"),
    ModelOption(
        "physical-optics", "anchor_s", for_both((40e-3, 20e-3, 10e-3, 5e-3)), for_both(10e-3), "--"
    ),
    ModelOption(
        "physical-optics",
        "facets",
        {
            "paper-12ghz": (320, 1280, BY_SIZE, 5120, 20480),
            "paper-77ghz": (1280, 5120, BY_SIZE, 20480),
        },
        for_both(BY_SIZE),
        "-",
    ),
    ModelOption(
        "rays",
        "rays_per_wavelength",
        {"paper-12ghz": (1.0, 2.0, 3.0), "paper-77ghz": (3.0,)},
        for_both(3.0),
        "-",
    ),
)
COLOURS = {
    "analytic-paper": "tab:gray",
    "analytic": "tab:orange",
    "specular": "tab:green",
    "physical-optics": "tab:red",
    "rays": "tab:purple",
    "reference": "0.5",
}
MARKERS = {"walk": "o", "kick": "^", "punch": "s", "jumping_jack": "D"}


@dataclass(frozen=True)
class Setting:
    """A model with its default options, or with one of them changed."""

    fidelity: str
    option: str = ""
    value: float | str = 0.0

    @property
    def options(self) -> dict[str, Any]:
        return {self.option: self.value} if self.option else {}

    @property
    def label(self) -> str:
        return f"{self.fidelity} {self.option}={said(self.value)}" if self.option else self.fidelity


@dataclass
class Point:
    """Result of one setting on one activity."""

    preset: str
    activity: str
    setting: str
    error: float  # rms over rms; 0 for the reference
    power_db: float
    seconds: float = 0.0  # of one frame
    cost: float = 0.0  # over that of `analytic`


def settings_of(option: ModelOption, preset: str) -> list[tuple[float | str, Setting]]:
    """Settings along an option, each with its value; the default value is the model as it is."""

    def at(value: float | str) -> Setting:
        return (
            Setting(option.fidelity)
            if value == option.default[preset]
            else Setting(option.fidelity, option.name, value)
        )

    return [(value, at(value)) for value in option.values[preset]]


def settings(preset: str, quick: bool) -> list[Setting]:
    """Each once, `analytic` first."""
    found = [Setting(CHEAPEST), *(Setting(fidelity) for fidelity in MODELS)]
    found += (
        []
        if quick
        else [setting for option in OPTIONS for _, setting in settings_of(option, preset)]
    )
    return list(dict.fromkeys(found))


# -- cost ------------------------------------------------------------------------------------------


def seconds(model: EchoModel, radar: rt.Radar, first: int) -> float:
    """Time of echoes and IF samples of the frame that begins at this chirp [s]."""
    step, end = 33 * radar.n_tx, first + radar.chirps_per_frame
    return sum(
        timed(model, radar, np.arange(begin, min(begin + step, end)))
        for begin in range(first, end, step)
    )


def timed(model: EchoModel, radar: rt.Radar, chirps: NDArray[np.int64]) -> float:
    began = time.perf_counter()
    at = (chirps + 0.5) * radar.chirp_duration_s
    rt.signal.synthesize(model.echoes(chirps), radar, at, dtype=np.complex64)
    return time.perf_counter() - began


def seconds_of(scene: Scene, setting: Setting) -> float:
    """Time of a frame by a new model that has traced nothing yet; of slow ones, from a part [s]."""
    radar, first = scene.radar, scene.first_chirp
    model = build_model(setting.fidelity, radar, scene.body, **setting.options)
    if setting.fidelity == "reference":
        chirps = np.arange(first, first + 2 * radar.n_tx)
        timed(model, radar, chirps)
        return timed(model, radar, chirps + len(chirps)) * radar.cycles_per_frame / 2
    if setting.fidelity == "rays":
        # One Tx, from one keyframe to the next.
        step = round(ANCHOR_S / radar.chirp_duration_s)
        begin = -(-first // step) * step
        before, chirps = (np.arange(at, at + step) for at in (begin, begin + step))
        timed(model, radar, before[before % radar.n_tx == 0])
        return (
            timed(model, radar, chirps[chirps % radar.n_tx == 0])
            * radar.n_tx
            * radar.chirps_per_frame
            / step
        )
    return seconds(model, radar, first)


def best_seconds(scene: Scene, setting: Setting) -> float:
    """The best of several runs: of many where a run is short, of one where it is long."""
    found = [seconds_of(scene, setting)]
    began = time.perf_counter()
    while len(found) < 5 and time.perf_counter() - began < 4:
        found.append(seconds_of(scene, setting))
    return min(found)


def warm_up(scene: Scene, fidelity: str) -> None:
    """Compile what the model compiles."""
    if fidelity in SLOW:
        return  # it is compiled by its first run
    chirps = np.arange(scene.first_chirp, scene.first_chirp + scene.radar.n_tx)
    model = build_model(fidelity, scene.radar, scene.body)
    rt.signal.synthesize(
        model.echoes(chirps), scene.radar, scene.radar.chirp_times(len(chirps)), dtype=np.complex64
    )


# -- all of it -------------------------------------------------------------------------------------


def read(path: Path | None) -> dict[tuple[str, str, str], Point]:
    if path is None or not path.exists():
        return {}
    points = [Point(**fields) for fields in json.loads(path.read_text())["points"]]
    return {(point.preset, point.activity, point.setting): point for point in points}


def write(path: Path | None, points: dict[tuple[str, str, str], Point]) -> None:
    if path is not None:
        path.write_text(
            json.dumps({"points": [asdict(point) for point in points.values()]}, indent=1) + "\n"
        )


def measure_points(
    scene: Scene, wanted: Sequence[Setting], points: dict[tuple[str, str, str], Point]
) -> Iterator[Point]:
    """Measure what is missing, one setting after the other."""
    base = None
    for setting in wanted:
        key = scene.preset, scene.activity, setting.label
        point = points.get(key)
        if point is not None and point.cost > 0:
            continue
        if point is None:
            exact = setting.fidelity == "reference"
            error, power_db = (
                (0.0, 0.0)
                if exact
                else scene.compared(scene.spectrum(setting.fidelity, **setting.options))
            )
            point = points[key] = Point(*key, error, power_db)
        if base is None:
            # In this run, however little is left to measure.
            warm_up(scene, CHEAPEST)
            base = best_seconds(scene, Setting(CHEAPEST))
        warm_up(scene, setting.fidelity)
        point.seconds = best_seconds(scene, setting)
        point.cost = 1.0 if setting == Setting(CHEAPEST) else point.seconds / base
        yield point


# -- table and figure ------------------------------------------------------------------------------


def span(values: Sequence[float], form: str) -> str:
    """Least and largest value, or one where they look alike."""
    least, most = format(min(values), form), format(max(values), form)
    return least if least == most else f"{least} to {most}"


def figures(points: list[Point]) -> str:
    if not points:
        return " | | "
    most = max(abs(point.power_db) for point in points)
    costs = [float(f"{point.cost:.2g}") for point in points]
    cost = span(costs, ".0f" if max(costs) >= 10 else ".2g")
    if all(point.error == 0 for point in points):
        return f"- | - | {cost}"
    errors = [100 * point.error for point in points]
    return f"{span(errors, '.0f' if max(errors) >= 10 else '.1f')} % | {most:.2f} dB | {cost}"


def table(points: dict[tuple[str, str, str], Point]) -> str:
    """Table for docs/choosing-a-level.md: a line for each model, then one for each setting."""
    lines = [
        "| model | "
        + " | ".join(f"{name[6:8]} GHz: complex error | frame power | cost" for name in PRESETS)
        + " |"
    ]
    lines.append("|---" * (1 + 3 * len(PRESETS)) + "|")

    def line(name: str, labels: dict[str, str]) -> None:
        own = [
            [
                point
                for (of, _, label), point in points.items()
                if (of, label) == (each, labels.get(each))
            ]
            for each in PRESETS
        ]
        if any(own):
            lines.append(f"| {name} | " + " | ".join(figures(each) for each in own) + " |")

    for fidelity in MODELS:
        line(f"`{fidelity}`", dict.fromkeys(PRESETS, fidelity))
    for option in OPTIONS:
        at = {
            (value, each): setting
            for each in PRESETS
            for value, setting in settings_of(option, each)
        }
        for value in dict.fromkeys(value for value, _ in at):
            labels = {each: at[value, each].label for each in PRESETS if (value, each) in at}
            line(f"`{option.fidelity}`, {option.name} {said(value)}", labels)
    return "\n".join(lines)


def draw(points: dict[tuple[str, str, str], Point], path: Path) -> None:
    """Complex error over cost: a colour for each model, a marker for each activity."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.lines import Line2D

    figure, panels = plt.subplots(
        1, len(PRESETS), figsize=(11, 5), sharex=True, sharey=True, layout="constrained"
    )
    for axes, preset in zip(panels, PRESETS, strict=True):
        for (of, activity, _), point in points.items():
            fidelity, _, changed = point.setting.partition(" ")
            if of == preset and point.error > 0:
                style: dict[str, Any] = (
                    {"s": 14, "alpha": 0.6}
                    if changed
                    else {"s": 42, "edgecolors": "black", "linewidths": 0.6}
                )
                axes.scatter(
                    point.cost,
                    100 * point.error,
                    color=COLOURS[fidelity],
                    marker=MARKERS[activity],
                    zorder=3,
                    **style,
                )
        for option in OPTIONS:
            for activity in FRAMES:
                along = [
                    (value, points.get((preset, activity, each.label)))
                    for value, each in settings_of(option, preset)
                ]
                found = [(value, point) for value, point in along if point is not None]
                x, y = [point.cost for _, point in found], [100 * point.error for _, point in found]
                axes.plot(
                    x,
                    y,
                    option.style,
                    color=COLOURS[option.fidelity],
                    linewidth=0.8,
                    alpha=0.6,
                    zorder=2,
                )
                # The ends of the option, each once.
                if activity == "walk" and len(found) > 1:
                    for value, point in (found[0], found[-1]):
                        ms = isinstance(value, float) and option.name == "anchor_s"
                        text = f"{1e3 * value:g} ms" if ms else said(value)
                        place = (point.cost, 100 * point.error)
                        axes.annotate(
                            text,
                            place,
                            (4, 4),
                            textcoords="offset points",
                            fontsize=6.5,
                            color=COLOURS[option.fidelity],
                        )
        dearest = [
            point.cost
            for (of, _, name), point in points.items()
            if (of, name) == (preset, "reference")
        ]
        if dearest:
            axes.axvline(
                float(np.median(dearest)), color=COLOURS["reference"], linestyle=":", linewidth=1.5
            )
        axes.set(xscale="log", yscale="log", xlabel="cost of a 100 ms frame [times analytic]")
        axes.set_title(f"{preset[6:8]} GHz", fontsize=10)
        axes.grid(which="both", alpha=0.2)
    panels[0].set_ylabel("error of H(f, t) against reference, rms [%]")
    seen = {point.setting.partition(" ")[0] for point in points.values() if point.error > 0}
    keys = [
        Line2D([], [], color=colour, marker="o", linestyle="", label=name)
        for name, colour in COLOURS.items()
        if name in seen
    ]
    keys.append(
        Line2D(
            [],
            [],
            color=COLOURS["reference"],
            linestyle=":",
            label="reference: no error, this cost",
        )
    )
    keys += [
        Line2D([], [], color="black", marker=mark, linestyle="", label=name)
        for name, mark in MARKERS.items()
    ]
    keys += [
        Line2D(
            [],
            [],
            color=COLOURS[option.fidelity],
            linestyle=option.style,
            label=f"{option.fidelity}: {option.name}",
        )
        for option in OPTIONS
    ]
    figure.legend(handles=keys, loc="outside right upper", fontsize=7)
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--json", type=Path, help="file of the results; those in it are not measured again"
    )
    parser.add_argument(
        "--figure", type=Path, metavar="FILE", help="draw error over cost to this PNG file"
    )
    parser.add_argument("--costs", action="store_true", help="measure the cost of all points anew")
    parser.add_argument(
        "--quick", action="store_true", help="one activity at 12 GHz, without options"
    )
    options = parser.parse_args()
    began = time.perf_counter()
    points = read(options.json)
    if options.costs:
        for point in points.values():
            point.seconds = point.cost = 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rt.ValidityWarning)
        scenes = [Scene(*each) for each in itertools.product(PRESETS, FRAMES)][
            : 1 if options.quick else None
        ]
        for slow, scene in itertools.product((False, True), scenes):
            wanted = [
                each
                for each in settings(scene.preset, options.quick)
                if (each.fidelity in SLOW) == slow
            ]
            for point in measure_points(scene, wanted, points):
                write(options.json, points)
                print(
                    f"{time.perf_counter() - began:6.0f} s  {scene.preset}  {scene.activity:<13} "
                    f"{point.setting:<36} {100 * point.error:7.2f} %  {point.power_db:+6.2f} dB  "
                    f"{point.seconds:9.3g} s  {point.cost:7.3g}",
                    flush=True,
                )
    print(table(points))
    print(f"\n{time.perf_counter() - began:.0f} s in all")
    if options.figure:
        draw(points, options.figure)
    return 0


if __name__ == "__main__":
    sys.exit(main())
