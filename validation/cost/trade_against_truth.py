"""Speed against accuracy with full wave as the truth: single parts of a body, and two parts.

Single parts are the five of ``levels_against_full_wave.py``, alone, at 12 GHz; two parts are its
spheres of 5 cm, 2 and 10 cm from each other, at 40 to 90 degrees off their axis. The error is the
complex difference to ``full-wave``, rms over rms, V and H, the root mean square over cases. The
cost is the CPU time of the same calls of `scattering_length` over that of `analytic` in the same
run; each runs once before, so that nothing is compiled, and the least of several counts.

    python validation/cost/trade_against_truth.py [--figure FILE]
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import rtradar as rt

sys.path.append(str(Path(__file__).resolve().parents[1] / "other_methods"))

from levels_against_full_wave import ASPECTS_DEG, PAIR_ASPECTS_DEG, antennas, field, parts

Complex = NDArray[np.complex128]
Case = Callable[..., Complex]

FREQUENCY_HZ, SPHERE_M, TIMES = 12e9, 0.05, 3
SETTINGS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("analytic", {}),
    ("specular", {}),
    ("specular", {"terms": 2}),
    ("specular", {"bounces": 2}),
    ("specular", {"bounces": 2, "terms": 2}),
    ("specular", {"visibility": "gradual"}),
    ("specular", {"visibility": "gradual", "bounces": 2}),
    ("physical-optics", {}),
    ("physical-optics", {"bounces": 2}),
    ("rays", {}),
    ("full-wave", {}),
)


class Outcome(NamedTuple):
    """Error [%] and CPU time [s] of single parts, and of pairs."""

    name: str
    parts: float
    parts_s: float
    pairs: float
    pairs_s: float


WORDS = {"bounces": "two bounces", "terms": "two terms", "visibility": "gradual visibility"}


def cases_of_parts() -> list[Case]:
    at = antennas(ASPECTS_DEG)
    return [
        lambda level, target=target, polarization=polarization, **options: field(
            target, at, FREQUENCY_HZ, level, polarization, **options
        )
        for target, polarization in product(parts().values(), ("v", "h"))
    ]


def cases_of_pairs() -> list[Case]:
    at = antennas(tuple(angle for angle in PAIR_ASPECTS_DEG if angle >= 40))
    found: list[Case] = []
    for gap, polarization in product((0.02, 0.10), ("v", "h")):
        apart = SPHERE_M + gap / 2
        centres, axes = [[0.0, 0.0, -apart], [0.0, 0.0, apart]], np.full((2, 3), SPHERE_M)
        pair = rt.Ellipsoids(centres, [np.eye(3)] * 2, axes)
        found.append(
            lambda level, pair=pair, polarization=polarization, **options: field(
                pair, at, FREQUENCY_HZ, level, polarization, **options
            )
        )
    return found


def measured(
    cases: list[Case], truth: list[Complex], level: str, options: dict[str, Any]
) -> tuple[float, float]:
    """Error [%] of all cases, and the least CPU time that they take [s]."""
    error, seconds = 0.0, np.inf
    for _ in range(1 if level == "full-wave" else 1 + TIMES):
        began = time.process_time()
        fields = [case(level, **options) for case in cases]
        seconds = min(seconds, time.process_time() - began)
        pairs = zip(fields, truth, strict=True)
        relative = [np.linalg.norm(own - true) / np.linalg.norm(true) for own, true in pairs]
        error = 100 * float(np.sqrt(np.mean(np.square(relative))))
    return error, seconds


def measure() -> list[Outcome]:
    sets = cases_of_parts(), cases_of_pairs()
    truths = [[case("full-wave") for case in cases] for cases in sets]
    found = []
    for level, options in SETTINGS:
        name = ", ".join([level, *(WORDS[option] for option in options)])
        of_sets = [
            measured(cases, truth, level, options)
            for cases, truth in zip(sets, truths, strict=True)
        ]
        found.append(Outcome(name, *of_sets[0], *of_sets[1]))
        print(found[-1], file=sys.stderr, flush=True)
    return found


def table(found: list[Outcome]) -> str:
    lines = ["| level | single parts | cost | two parts | cost |", "|---|---|---|---|---|"]
    for one in found:
        cells = [f"`{one.name.split(',')[0]}`{one.name[len(one.name.split(',')[0]) :]}"]
        for error, seconds, least in (
            (one.parts, one.parts_s, found[0].parts_s),
            (one.pairs, one.pairs_s, found[0].pairs_s),
        ):
            exact = one.name == "full-wave"
            cells += ["(truth)" if exact else f"{error:.1f} %", f"{seconds / least:.2g}"]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def draw(found: list[Outcome], path: Path) -> None:
    from matplotlib.ticker import FuncFormatter, NullFormatter

    from rtradar.system.figure_style import LIGHT, dress, new_figure, save_figure

    figure = new_figure(3.8)
    panels = figure.subplots(1, 2, sharey=True)
    levels = list(dict.fromkeys(one.name.split(",")[0] for one in found))
    for axes, title, errors, seconds in (
        (panels[0], "Single parts", [one.parts for one in found], [one.parts_s for one in found]),
        (panels[1], "Two parts", [one.pairs for one in found], [one.pairs_s for one in found]),
    ):
        for one, error, spent in zip(found, errors, seconds, strict=True):
            level, *more = one.name.split(", ")
            colour = LIGHT.cycle[levels.index(level)]
            marker = {"color": colour, "markersize": 9, "alpha": 0.85}
            shape = "os^D"[("two bounces" in more) + 2 * ("two terms" in more)]
            shape = "P" if "gradual visibility" in more else shape
            axes.semilogx(spent / seconds[0], error, shape, label=one.name, **marker)
        axes.set(xlabel="CPU time over that of analytic", ylim=(-1, 35), xlim=(0.5, 2e4))
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axes.xaxis.set_minor_formatter(NullFormatter())
        dress(axes, title=title)
    panels[0].set_ylabel("Complex error against full wave [%]")
    panels[0].legend(fontsize=8, loc="upper right")
    save_figure(figure, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw error over cost there")
    options = parser.parse_args()
    found = measure()
    print(table(found))
    if options.figure:
        draw(found, options.figure)


if __name__ == "__main__":
    main()
