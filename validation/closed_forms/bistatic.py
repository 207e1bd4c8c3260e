"""Physical optics at any angle between Tx and Rx, against its integral over a sphere, and Mie.

The integral of the currents 2 n x H over the lit half of a conducting sphere is taken by
Gauss-Legendre and trapezoidal rules, for plane waves. Up to 0.15 rad the level has the reciprocal
form of what both see, whose integral is taken likewise; from 0.25 rad on it has that of the lit
half, and in between one fades into the other, which is not judged. `physical-optics` stands at 10
km, over ellipsoids and over a mesh. How far physical optics and `specular` are from the truth is
reported beside, against miepython, as the ratio of mean powers over 20 degrees.

    python validation/closed_forms/bistatic.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Iterator
from functools import partial
from typing import Literal

import miepython
import numpy as np
import trimesh
from numpy.typing import NDArray

import rtradar as rt
from rtradar.validate import rows
from rtradar.validate.rows import Row, main

Array = NDArray[np.float64]
Polarization = Literal["v", "h"]
judged, reported = (partial(kind, key="bistatic") for kind in (rows.judged, rows.reported))

FREQUENCY_HZ = 14e9
WAVE_NUMBER = 2 * np.pi * FREQUENCY_HZ / 299_792_458.0
FAR_M = 1e4
LIMIT_DB = 0.1
"""That of facets against the closed forms of physical optics, which `facets.py` judges."""

OVER_DEG = 20
UP = np.array([0.0, 0.0, 1.0])


def directions(angles_deg: Array) -> Array:
    """Directions (n, 3) to Rx in the plane z = 0; Tx is in that of 0 degrees."""
    angles = np.radians(angles_deg)
    return np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=1)


def optics_integral(ka: float, to_rx: Array, polarization: Polarization) -> complex:
    """F [m] of physical optics of a sphere, Tx far in the direction of x."""
    to_tx = np.array([1.0, 0.0, 0.0])
    fields = [UP if polarization == "v" else np.cross(way, UP) for way in (to_tx, to_rx)]
    nodes, weights = np.polynomial.legendre.leggauss(max(80, int(6 * ka)))
    cosine, weights = (nodes + 1) / 2, weights / 2
    turns = 2 * np.pi * np.arange(count := max(160, int(12 * ka))) / count
    sine = np.sqrt(1 - cosine**2)
    normals = np.stack(
        [
            np.broadcast_to(cosine[:, None], (len(cosine), count)),
            sine[:, None] * np.cos(turns),
            sine[:, None] * np.sin(turns),
        ],
        axis=-1,
    )
    # What 2 n x H radiates, E along one field for a unit field along the other.
    current = np.cross(normals, np.cross(-to_tx, fields[0]))
    phase = np.exp(1j * ka * (normals @ (to_tx + to_rx)))
    radius = ka / WAVE_NUMBER
    total = np.sum(weights[:, None] * (2 * np.pi / count) * (current @ fields[1]) * phase)
    return complex(1j * WAVE_NUMBER / np.sqrt(np.pi) * radius**2 * total)


def reciprocal_integral(ka: float, to_rx: Array) -> complex:
    """F [m] of the reciprocal form of physical optics, over what Tx and Rx both see of a sphere.

    The edge of what both see crosses the cells of the rule, so there are many.
    """
    both = np.array([1.0, 0.0, 0.0]) + to_rx
    nodes, weights = np.polynomial.legendre.leggauss(600)
    turns = 2 * np.pi * (np.arange(1200) + 0.5) / 1200
    sine = np.sqrt(1 - nodes**2)[:, None]
    x, y = np.broadcast_to(nodes[:, None], (600, 1200)), sine * np.cos(turns)
    seen = (x > 0) & (x * to_rx[0] + y * to_rx[1] > 0)
    along = x * both[0] + y * both[1]
    total = np.sum(weights[:, None] * (2 * np.pi / 1200) * along * np.exp(1j * ka * along) * seen)
    return complex(1j * WAVE_NUMBER / np.sqrt(np.pi) * (ka / WAVE_NUMBER) ** 2 * total / 2)


def by(
    level: str, target: object, to_rx: Array, polarization: Polarization
) -> NDArray[np.complex128]:
    with warnings.catch_warnings():
        # Where optics ends is what this script reports.
        warnings.simplefilter("ignore", rt.ValidityWarning)
        return rt.scattering_length(
            target,
            [FAR_M, 0.0, 0.0],
            FAR_M * to_rx,
            FREQUENCY_HZ,
            fidelity=level,
            polarization=polarization,
        )


def sphere(ka: float) -> rt.Ellipsoids:
    return rt.Ellipsoids([np.zeros(3)], [np.eye(3)], [np.full(3, ka / WAVE_NUMBER)])


def integral_rows(quick: bool) -> Iterator[Row]:
    every = np.arange(0.0, 181.0, 30.0 if quick else 5.0)
    forms = {
        "what both see": every[every <= np.degrees(0.15)],
        "the lit half": every[every >= np.degrees(0.25)],
    }
    for ka in (12.6,) if quick else (5.0, 12.6, 30.0):
        mesh = trimesh.creation.icosphere(5, ka / WAVE_NUMBER)
        for polarization in ("v", "h"):
            for over, angles in forms.items():
                to_rx = directions(angles)
                if over == "the lit half":
                    wanted = np.array([optics_integral(ka, way, polarization) for way in to_rx])
                else:
                    wanted = np.array([reciprocal_integral(ka, way) for way in to_rx])
                for name, target in (("ellipsoid", sphere(ka)), ("mesh of 20480", mesh)):
                    if ka > 12.6 and target is mesh:
                        continue
                    ratio = by("physical-optics", target, to_rx, polarization) / wanted
                    yield judged(
                        f"{name}, ka {ka:g}, {polarization}, {angles[0]:g} to {angles[-1]:g} deg",
                        f"against the integral over {over}, worst",
                        "dB",
                        float(np.abs(20 * np.log10(np.abs(ratio))).max()),
                        LIMIT_DB,
                        says="physical optics of a sphere, Tx and Rx 0 to 180 degrees apart but "
                        "for 9 to 14, where two forms fade, against its integrals",
                        cases=len(angles),
                    )


def mie(ka: float, angles_deg: Array) -> dict[Polarization, Array]:
    """|F| [m] of a conducting sphere by miepython."""
    metal, radius = 1 - 1j * 1e6, ka / WAVE_NUMBER
    scattered = np.cos(np.pi - np.radians(angles_deg))
    across, along = miepython.S1_S2(metal, ka, scattered)
    power = miepython.efficiencies_mx(metal, ka)[2] * np.pi * radius**2
    scale = np.sqrt(power) / abs(miepython.S1_S2(metal, ka, [-1.0])[0][0])
    return {"v": scale * np.abs(across), "h": scale * np.abs(along)}


def mie_rows(quick: bool) -> Iterator[Row]:
    angles = np.arange(0.0, 180.0, 4.0 if quick else 1.0)
    for ka in (12.6,) if quick else (5.0, 12.6, 40.0):
        truth = mie(ka, angles)
        for polarization in ("v", "h"):
            for level in ("physical-optics", "specular"):
                found = np.abs(by(level, sphere(ka), directions(angles), polarization))
                for first in range(0, 180, OVER_DEG):
                    some = (angles >= first) & (angles < first + OVER_DEG)
                    means = [np.mean(field[some] ** 2) for field in (found, truth[polarization])]
                    yield reported(
                        f"{level}, ka {ka:g}, {polarization}, {first} to {first + OVER_DEG} deg",
                        "mean power against miepython",
                        "dB",
                        float(10 * np.log10(means[0] / means[1])),
                    )


def measure(quick: bool) -> list[Row]:
    return [*integral_rows(quick), *mie_rows(quick)]


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
