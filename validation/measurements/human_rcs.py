"""Cross-section of people by aspect beside the human of 3GPP TR 38.901 (release 19, 7.9.2).

Adults (1.75 m) and children (1.1 m) stand, walk and hold their arms out. Each is seen from 36
aspects, level with the middle of the body, at 12, 24, 60 and 77 GHz. Reported are the mean of the
cross-section in square metres over aspects and frequencies, the standard deviation of its
decibels, and how far lobes rise: means over 30 degrees ahead, behind, to both sides.

The report's human has a mean of -1.37 dBsm and a standard deviation of 3.94 dB if the aspect is
ignored; with the aspect it has two lobes, ahead and behind, of 2.14 dBsm, which fall by
12 (angle / 216.65 deg)^2 dB to the sides, and by at most 7.7 dB: at 90 degrees by 2.1 dB. Its adult
fills 0.5 x 0.5 x 1.75 m, its child 0.2 x 0.3 x 1.0 m, with one cross-section for both.

Modelled is a conductor, by `specular` on ellipsoids, at eight frequencies over 1 GHz, so that the
interference of body parts is averaged. Skin returns less than a conductor: the mean with the
reflection of dry skin (Gabriel et al. 1996) at normal incidence is beside it. Clothes are not
modelled. Reflection from convex surfaces keeps the polarisation, so that these levels have no
cross-polar echo and say nothing of the report's XPR of 19.81 dB, which comes of edges, folds and
double reflections. Where `anny` is at hand, the human mesh stands beside ellipsoids, by
`physical-optics` at 12 GHz. All this is reported, not judged: the report gives one law for people
of all sizes and clothes, and no band in which its mean is sure.

    python validation/measurements/human_rcs.py [--quick] [--json FILE] [--figure DIR]
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body import Body
from rtradar.motion import place
from rtradar.scene import material
from rtradar.validate.rows import Row, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import power_db

Array = NDArray[np.float64]

MEAN_DBSM, SPREAD_DB = -1.37, 3.94  # TR 38.901, whatever the aspect
LOBE_DBSM, WIDTH_DEG, LARGEST_FALL_DB = 2.14, 216.65, 7.7  # and by aspect, in azimuth
BANDS_HZ = (12e9, 24e9, 60e9, 77e9)
HEIGHTS_M = {"adult": 1.75, "child": 1.1}
POSTURES = ("stand", "walk", "arms out")
ASPECTS = 36
DISTANCE_M = 10.0


@dataclass(frozen=True)
class Case:
    """Somebody in a posture, at one band."""

    who: str
    posture: str
    band_hz: float

    def __str__(self) -> str:
        return f"{self.who}, {self.posture}, {self.band_hz / 1e9:g} GHz"


def report_dbsm(aspect_deg: Array) -> Array:
    """Cross-section of the report's human by aspect, 0 ahead [dBsm]."""
    away = np.minimum(np.abs(aspect_deg) % 180, 180 - np.abs(aspect_deg) % 180)
    return LOBE_DBSM - np.minimum(12 * (away / WIDTH_DEG) ** 2, LARGEST_FALL_DB)


@lru_cache(maxsize=8)
def person(who: str, posture: str) -> tuple[rt.Person, float]:
    """Somebody at the origin, who faces -x, and the time of the posture [s]."""
    activity = {"arms out": "jumping_jack"}.get(posture, posture)
    motion = rt.synthetic_motion(activity, seed=0, height_m=HEIGHTS_M[who], duration_s=2.0)
    if posture != "arms out":
        return rt.Person(motion), 0.5
    height = [
        motion.positions[:, motion.joints.index(name), 2] for name in ("l_wrist", "l_shoulder")
    ]
    return rt.Person(motion), float(motion.frame_times[np.abs(height[0] - height[1]).argmin()])


def antennas(middle: Array, aspects_deg: Array) -> Array:
    """Places (aspect, 3) about a middle, of which the first is ahead of who faces -x [m]."""
    angle = np.radians(180 + aspects_deg)
    away = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    return np.asarray(middle + DISTANCE_M * away)


def aspects(count: int) -> Array:
    return np.arange(count) * 360.0 / count


def by_aspect(case: Case, count: int) -> Array:
    """Cross-sections (aspect, frequency) of a conductor of ellipsoids [m^2]."""
    who, time_s = person(case.who, case.posture)
    target = Body.from_motion(place(who.motion)).ellipsoids(time_s)
    frequencies = case.band_hz + np.linspace(-0.5e9, 0.5e9, 8)
    places = antennas(target.centres.mean(axis=0), aspects(count)).repeat(len(frequencies), axis=0)
    waves = np.tile(frequencies, count)
    return over_range(target, target.centres.mean(axis=0), places, waves, "specular").reshape(
        count, -1
    )


def over_range(target: object, middle: Array, places: Array, waves: Array, level: str) -> Array:
    """Cross-section about the middle of a target, not about the origin [m^2]."""
    length = rt.scattering_length(target, places, places, waves, level)  # type: ignore[arg-type]
    spreading = DISTANCE_M**2 / np.sum(places**2, axis=1)
    return np.abs(length * spreading) ** 2


def of_mesh(count: int) -> Array:
    """Cross-sections (aspect,) of the human mesh of a standing adult at 12 GHz [m^2]."""
    who, time_s = person("adult", "stand")
    mesh = who.trimesh(time_s, 1)
    middle = np.asarray(mesh.bounds.mean(axis=0))
    places = antennas(middle, aspects(count))
    return over_range(mesh, middle, places, np.full(count, BANDS_HZ[0]), "physical-optics")


def skin_db(frequency_hz: float) -> float:
    """Power that dry skin reflects at normal incidence, over a conductor [dB]."""
    root = np.sqrt(material("skin").eta(np.array([frequency_hz])))
    return float(power_db(np.abs((1 - root) / (1 + root)) ** 2)[0])


def rows_of(claim: str, rcs: Array) -> Iterator[Row]:
    """Mean, spread and lobes of cross-sections (aspect, frequency)."""
    yield reported(claim, "mean", "dBsm", power_db(rcs.mean()), reference=MEAN_DBSM)
    yield reported(claim, "standard deviation", "dB", power_db(rcs).std(), reference=SPREAD_DB)
    angles = aspects(len(rcs))
    for name, at in (("ahead", 0), ("behind", 180), ("left", 90), ("right", 270)):
        near = np.abs((angles - at + 180) % 360 - 180) <= 15
        expected = float(report_dbsm(np.array([float(at)]))[0])
        yield reported(claim, name, "dBsm", power_db(rcs[near].mean()), reference=expected)


def measure(quick: bool) -> list[Row]:
    warnings.simplefilter("ignore", rt.ValidityWarning)
    count, bands = (12, BANDS_HZ[:1]) if quick else (ASPECTS, BANDS_HZ)
    found, means = list[Row](), dict[str, list[float]]()
    for who in HEIGHTS_M:
        for posture in POSTURES[:1] if quick else POSTURES:
            for band in bands:
                case = Case(who, posture, band)
                rcs = by_aspect(case, count)
                found += rows_of(str(case), rcs)
                mean, skin = power_db(rcs.mean()), skin_db(band)
                means.setdefault(f"{who}, conductor", []).append(mean)
                means.setdefault(f"{who}, skin", []).append(mean + skin)
    for name, own in means.items():
        mean = float(np.mean(own))
        found.append(reported(f"{name}, all cases", "mean", "dBsm", mean, reference=MEAN_DBSM))
    if not quick and find_spec("anny") is not None:
        found += rows_of("adult, stand, 12 GHz, human mesh", of_mesh(ASPECTS)[:, None])
    return found


def figure(_: list[Row], path: Path) -> None:
    """Cross-sections of a standing adult by aspect, at all bands, in polar axes."""
    from matplotlib.figure import Figure

    drawn = Figure(figsize=(10, 6.4), layout="constrained")
    for column, who in enumerate(HEIGHTS_M, start=1):
        axes = drawn.add_subplot(1, 2, column, projection="polar")
        angle = np.radians(np.append(aspects(ASPECTS), 360.0))
        for band in BANDS_HZ:
            rcs = power_db(by_aspect(Case(who, "stand", band), ASPECTS).mean(axis=1))
            axes.plot(angle, np.append(rcs, rcs[0]), label=f"{band / 1e9:g} GHz")
        fine = np.linspace(0, 360, 361)
        axes.plot(np.radians(fine), report_dbsm(fine), "k--", label="TR 38.901")
        axes.set_theta_zero_location("N")
        axes.set_rlim(-25, 10)
        axes.set_title(
            f"{who}, standing, conductor:\ncross-section [dBsm] by aspect, 0 ahead", fontsize=11
        )
    lines, names = axes.get_legend_handles_labels()
    drawn.legend(lines, names, loc="outside lower center", ncols=len(lines))
    drawn.savefig(path, dpi=80)


if __name__ == "__main__":
    sys.exit(main("Cross-sections of people beside TR 38.901", measure, figure))
