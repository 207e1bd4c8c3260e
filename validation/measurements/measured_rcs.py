"""Measured cross-sections of an almond of metal beside full wave and every level for meshes.

The almond is that of A. C. Woo et al., IEEE Antennas Propag. Mag. 35, 1993, 9.936 inches long, from
its tip (0 degrees) to its blunt end in the plane across its thin side. The Austin RCS Benchmark
Suite has it measured (J. T. Kelley et al., IEEE Antennas Propag. Mag. 62, 2020; ``meas.*``) and
computed by integral equations (``ref.*``), monostatic, at 3.5, 5.125 and 10.25 GHz, with E across
the thin side (V) and along the wide one (H).

Judged is full wave against the suite's reference, by the mean of the difference in dB, with two
meshes at each frequency. The measurement is reported beside full wave and beside each level that
takes meshes. A second measurement, of an almond twice as large at half the frequency, which the
suite gives for the size of the first, says how far measurements are apart. What the levels leave
out is diffraction at the tip and what creeps around: their differences are real, and not held to a
limit.

Without the folder only both meshes are compared.

    RTRADAR_MEASURED=folder python validation/measurements/measured_rcs.py [--quick] [--json FILE] \
[--figure DIR]
"""

from __future__ import annotations

import os
import sys
import time
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.full_wave import ClosedMesh, ConductingSurface
from rtradar.validate.rows import Row, judged, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from closed_meshes import EllipticBody
from helpers import field_db

Array = NDArray[np.float64]

LENGTH_M = 0.25237
FAR_M = 1e6
LEVELS = ("physical-optics", "rays")  # `reference` is the same as physical optics for one target
NEAR_LARGEST_DB = 25.0
# The suite's reference and this solver agree to 0.1 dB where the meshes are fine; the issue asks
# for 0.3 dB within 25 dB of the largest cross-section, and for all aspects, nulls included, for
# what the third figure of each frequency says.
STRONG_DB = 0.3


@dataclass(frozen=True)
class Band:
    """One frequency: its name in the suite, both meshes, and the limit over all aspects."""

    name: str
    frequency_hz: float
    edges_m: tuple[float, float]
    limit_db: float

    @property
    def claim(self) -> str:
        return f"almond, {self.frequency_hz / 1e9:g} GHz"


BANDS = (
    Band("fx1", 3.5e9, (8.6e-3, 5e-3), 0.5),
    Band("fx2", 5.125e9, (5.8e-3, 4e-3), 0.5),
    Band("fx4", 10.25e9, (3e-3, 2.4e-3), 0.8),
)


def almond() -> EllipticBody:
    """Half-widths of Woo's almond along x, its tip at the larger x."""

    def width(x: Array) -> Array:
        t = np.asarray(x) / LENGTH_M
        blunt = 0.193333 * np.sqrt(np.maximum(1 - (t / 0.416667) ** 2, 0.0))
        tip = 4.83345 * np.maximum(np.sqrt(1 - (t / 2.08335) ** 2) - 0.96, 0.0)
        return np.asarray(LENGTH_M * np.where(t < 0, blunt, tip))

    return EllipticBody(width, -0.416667 * LENGTH_M, 0.583338 * LENGTH_M, 1 / 3)


def radar(aspect_deg: Array) -> Array:
    angle = np.radians(aspect_deg)
    return FAR_M * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)


@dataclass(frozen=True, eq=False)
class Solved:
    """Full wave of one mesh: cross-sections by polarisation, and what they cost."""

    dbsm: dict[str, Array]
    edges: int
    memory_bytes: int
    cpu_s: float


def solve(band: Band, edge_m: float, aspect_deg: Array) -> Solved:
    begun = time.process_time()
    mesh = almond().mesh(edge_m)
    closed = ClosedMesh(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64))
    surface = ConductingSurface(closed, band.frequency_hz)
    places = radar(aspect_deg)
    found = {p: field_db(surface.scattering_length(places, places, p.lower())) for p in "VH"}
    spent = time.process_time() - begun
    return Solved(found, surface.mesh.unknowns, surface.memory_bytes, spent)


def folder() -> Path:
    return Path(os.environ.get("RTRADAR_MEASURED", ""), "rcs")


@cache
def table(kind: str, band: str, polarization: str) -> Array:
    """Aspect [deg] and cross-section [dBsm], (aspect, 2)."""
    file = folder() / f"{kind}_rcs.III.A.s1.{band}.{polarization}.txt"
    return np.asarray(np.loadtxt(file)[:, 2:4])


def given(kind: str, band: Band, polarization: str, aspect_deg: Array) -> Array:
    angle, dbsm = table(kind, band.name, polarization).T
    return np.asarray(np.interp(aspect_deg, angle, dbsm))


def mean_db(one: Array, other: Array, where: Any = slice(None)) -> float:
    return float(np.abs(one - other)[where].mean())


def reference_rows(band: Band, solved: Solved, aspect_deg: Array) -> Iterator[Row]:
    claim = f"{band.claim}, {solved.edges} edges"
    says = "`full-wave` of the almond against the suite's integral equations, mean over "
    for polarization, found in solved.dbsm.items():
        expected = given("ref", band, polarization, aspect_deg)
        strong = expected > expected.max() - NEAR_LARGEST_DB
        yield judged(
            claim, f"{polarization}, mean within 25 dB of the largest", "dB",
            mean_db(found, expected, strong), STRONG_DB, cases=int(strong.sum()),
            says=says + "aspects within 25 dB of the largest",
        )  # fmt: skip
        yield judged(
            claim, f"{polarization}, mean over all aspects", "dB", mean_db(found, expected),
            band.limit_db, cases=len(aspect_deg),
            says=says + f"all aspects, {band.frequency_hz / 1e9:g} GHz",
        )  # fmt: skip


def cost_rows(band: Band, solved: Solved) -> Iterator[Row]:
    claim = f"{band.claim}, {solved.edges} edges"
    yield reported(claim, "CPU time, both polarisations", "s", solved.cpu_s)
    yield reported(claim, "memory of the matrices", "GB", solved.memory_bytes / 1e9)


def of_levels(band: Band, aspect_deg: Array) -> dict[str, dict[str, Array]]:
    """Cross-sections [dBsm] by level and polarisation."""
    mesh, places = almond().mesh(band.edges_m[1]), radar(aspect_deg)
    return {
        level: {
            p: field_db(
                rt.scattering_length(
                    mesh, places, places, band.frequency_hz, level, polarization=p.lower()
                )  # type: ignore[arg-type]
            )
            for p in "VH"
        }
        for level in LEVELS
    }


def measured_rows(
    band: Band, found: dict[str, dict[str, Array]], aspect_deg: Array
) -> Iterator[Row]:
    """Mean difference of the measurement from full wave, from each level, and from another one."""
    for polarization in "VH":
        measured = given("meas.m1", band, polarization, aspect_deg)
        both = {name: dbsm[polarization] for name, dbsm in found.items()}
        both["a second measurement"] = given("meas.m2", band, polarization, aspect_deg)
        offset = float(np.median(measured - both["full-wave"]))
        yield reported(
            band.claim, f"{polarization}, median of the measurement over full wave", "dB", offset
        )
        for name, dbsm in both.items():
            yield reported(
                band.claim, f"{polarization}, {name}: mean from measurement", "dB",
                mean_db(dbsm, measured),
            )  # fmt: skip
        for level in LEVELS:
            yield reported(
                band.claim, f"{polarization}, {level}: mean from full wave", "dB",
                mean_db(both[level], both["full-wave"]),
            )  # fmt: skip


CURVES: dict[str, tuple[Array, dict[str, dict[str, Array]]]] = {}
"""Curves of each band for the figure: aspects, and cross-sections by name and polarisation."""


def band_rows(band: Band) -> Iterator[Row]:
    aspect_deg = np.arange(0.0, 180.5, 0.5)
    solved = [solve(band, edge_m, aspect_deg) for edge_m in band.edges_m]
    found = {"full-wave": solved[-1].dbsm, **of_levels(band, aspect_deg)}
    for one in solved:
        yield from cost_rows(band, one)
    for polarization in "VH":
        change = mean_db(*(one.dbsm[polarization] for one in solved))
        yield reported(band.claim, f"{polarization}, mean difference of both meshes", "dB", change)
    if folder().is_dir():
        for one in solved:
            yield from reference_rows(band, one, aspect_deg)
        yield from measured_rows(band, found, aspect_deg)
    CURVES[band.name] = aspect_deg, found


def quick_rows() -> Iterator[Row]:
    band, aspect_deg = BANDS[0], np.arange(0.0, 180.5, 2.5)
    solved = solve(band, band.edges_m[0], aspect_deg)
    yield from cost_rows(band, solved)
    if folder().is_dir():
        yield from reference_rows(band, solved, aspect_deg)


def measure(quick: bool) -> list[Row]:
    warnings.simplefilter("ignore", rt.ValidityWarning)  # the tip has no radius of curvature
    return list(quick_rows()) if quick else [row for band in BANDS for row in band_rows(band)]


def draw(_: list[Row], path: Path) -> None:
    """Cross-section over aspect: measurement, full wave and levels, at each frequency."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    names = {band.name: band for band in BANDS}
    figure, grid = plt.subplots(
        max(len(CURVES), 1), 2, figsize=(12, 3.2 * max(len(CURVES), 1)), squeeze=False,
        sharex=True, layout="constrained",
    )  # fmt: skip
    for row, (name, (aspect_deg, found)) in zip(grid, CURVES.items(), strict=False):
        for axes, polarization in zip(row, "VH", strict=True):
            # Both levels are nearly one curve.
            for level, style in zip(LEVELS, ("-", "--"), strict=True):
                axes.plot(aspect_deg, found[level][polarization], style, linewidth=1, label=level)
            own = found["full-wave"][polarization]
            axes.plot(aspect_deg, own, "black", linewidth=1.4, label="full-wave")
            if folder().is_dir():
                axes.plot(
                    *table("meas.m1", name, polarization).T, ".", color="tab:red", markersize=2,
                    label="measured",
                )  # fmt: skip
            axes.set_title(f"{names[name].frequency_hz / 1e9:g} GHz, {polarization}", fontsize=9)
            least = np.quantile(own, 0.02) - 6  # a null may reach far down
            axes.set(ylim=(least, own.max() + 4), ylabel="cross-section [dBsm]")
            axes.grid(alpha=0.3)
    for axes in grid[-1]:
        axes.set_xlabel("aspect from the tip [deg]")
    grid[0, 0].legend(fontsize=8)
    figure.savefig(path, dpi=120)
    plt.close(figure)


if __name__ == "__main__":
    sys.exit(main("Measured cross-sections of an almond beside full wave", measure, draw))
