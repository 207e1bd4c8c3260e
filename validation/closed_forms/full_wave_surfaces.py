"""`full-wave` of closed meshes against Mie's series and against the modes of a spheroid.

Spheres, bistatic, in both polarisations, at resonances of the inside too. The flat triangles have
the volume of the sphere. The error falls with the square of their edges, so that two meshes give
the limit (L. F. Richardson, 1911); that is judged, and either mesh reported. So is that of a limb
of the body at 5 GHz, which is held against ``BodiesOfRevolution``: it has neither triangles nor
these integrals.

    python validation/closed_forms/full_wave_surfaces.py [--quick] [--json FILE]
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

os.environ["MIEPYTHON_USE_JIT"] = "1"  # read when it is imported

import miepython
import numpy as np
from numpy.typing import NDArray

from rtradar.full_wave import BodiesOfRevolution, ClosedMesh, ConductingSurface, Spheroid
from rtradar.validate import rows
from rtradar.validate.rows import Row, main

sys.path.append(str(Path(__file__).resolve().parents[1]))

from closed_meshes import geodesic_sphere, limit, spheroid
from helpers import field_db

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
judged, reported = (
    partial(kind, key="full-wave-surfaces") for kind in (rows.judged, rows.reported)
)

FREQUENCY_HZ = 5e9
K = 2 * np.pi * FREQUENCY_HZ / 299_792_458.0
FAR_M = 1e6
NEAR_LARGEST_DB = 20.0

# ka, divisions of both meshes, whose edges are about a tenth and a fourteenth of a wavelength, and
# what the issue asks for [dB]. What it is to judge differs from it by 0.1 dB and more.
SPHERES = (
    (2.7437, (6, 8), 0.02),  # a resonance of the inside, TM11
    (4.4934, (9, 12), 0.02),  # TE11
    (6.0, (12, 16), 0.02),
    (12.6, (20, 28), 0.05),
)
QUICK_SPHERES = ((2.7437, (6, 8), 0.02), (3.0, (6, 8), 0.02))

LIMB_M = (0.13, 0.04)  # half-length and radius, those of a forearm
LIMB_EDGES_M = (6e-3, 4.5e-3)  # a tenth of a wavelength and less
LIMB_DB = 0.1


def closed(mesh: Any) -> ClosedMesh:
    return ClosedMesh(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64))


def mie(ka: float, angle: Array) -> tuple[Array, Array]:
    """Magnitude of the scattering length [m] across and in the plane of scattering.

    The angle is that of scattering. With the norm ``qsca`` the mean square of both amplitudes,
    over all directions and times 4 pi, is the efficiency of scattering.
    """
    metal = 1 - 1j * max(1e6, 1e8 / ka)
    series = miepython.S1_S2(metal, ka, np.cos(angle), norm="qsca")
    across, within = (2 * np.pi * ka / K * np.abs(amplitude) for amplitude in series)
    return across, within


def bistatic(ka: float, divisions: int, angle: Array) -> tuple[list[Complex], int]:
    """Fields in both polarisations, V across the plane of scattering, and the number of edges."""
    mesh = closed(geodesic_sphere(ka / K, divisions))
    surface = ConductingSurface(mesh, FREQUENCY_HZ)
    assert surface.mesh is mesh  # flat triangles that are divided leave the sphere
    tx = np.tile([FAR_M, 0.0, 0.0], (len(angle), 1))
    rx = -FAR_M * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    fields = [surface.scattering_length(tx, rx, p) for p in ("v", "h")]
    return fields, mesh.unknowns


def worst_db(field: Complex, reference: Array) -> float:
    """Worst difference within 20 dB of the largest field."""
    strong = reference > reference.max() * 10 ** (-NEAR_LARGEST_DB / 20)
    return float(np.abs(field_db(field / reference))[strong].max())


def sphere_rows(ka: float, divisions: tuple[int, int], limit_db: float) -> Iterator[Row]:
    angle = np.radians(np.linspace(0, 180, 61))
    expected, fields, squares = mie(ka, angle), [], []
    claim = f"sphere by surfaces, ka {ka:.4g}"
    for count in divisions:
        begun = time.process_time()
        found, edges = bistatic(ka, count, angle)
        spent = time.process_time() - begun
        fields.append(found)
        squares.append(1 / edges)  # as the square of the length of edges
        error = max(map(worst_db, found, expected))
        yield reported(claim, f"worst, one mesh of {edges} edges", "dB", error)
        yield reported(claim, f"CPU time, {edges} edges", "s", spent)
    limits = [limit(coarse, fine, squares) for coarse, fine in zip(*fields, strict=True)]
    says = "`full-wave` of closed meshes: conducting spheres against miepython, bistatic, V and H, "
    says += f"within 20 dB of the largest field, limit of two meshes, ka {ka:.4g}"
    error = max(map(worst_db, limits, expected))
    yield judged(
        claim, "worst, limit of both", "dB", error, limit_db, says=says, cases=2 * len(angle)
    )


def limb_rows() -> Iterator[Row]:
    """A limb by modes and by surfaces, monostatic from its end to its side, 4 m away."""
    half_length, radius = LIMB_M
    angle = np.radians(np.linspace(0, 90, 19))
    radar = 4 * np.stack([np.cos(angle), 0.6 * np.sin(angle), 0.8 * np.sin(angle)], axis=1)
    along_x = np.eye(3)[:, [1, 2, 0]]
    modes = BodiesOfRevolution((Spheroid(radius, half_length),), FREQUENCY_HZ, frame=along_x)
    expected = {p: modes.scattering_length(radar, radar, p) for p in ("v", "h")}
    says = "`full-wave` of a limb at 5 GHz, limit of two meshes against modes, within 20 dB of the "
    says += "largest field"
    fields: dict[str, list[Complex]] = {"v": [], "h": []}
    squares = []
    for edge_m in LIMB_EDGES_M:
        mesh = closed(spheroid(*LIMB_M).mesh(edge_m))
        surface = ConductingSurface(mesh, FREQUENCY_HZ)
        assert surface.mesh is mesh
        squares.append(1 / mesh.unknowns)
        for polarization, field in expected.items():
            found = surface.scattering_length(radar, radar, polarization)
            fields[polarization].append(found)
            claim = f"limb at 5 GHz, {polarization.upper()}, {mesh.unknowns} edges"
            apart = float(np.abs(found - field).max() / np.abs(field).max())
            yield reported(claim, "worst complex difference, of the largest field", "", apart)
            yield reported(claim, "worst, one mesh", "dB", worst_db(found, np.abs(field)))
    for polarization, (coarse, fine) in fields.items():
        error = worst_db(limit(coarse, fine, squares), np.abs(expected[polarization]))
        yield judged(
            f"limb at 5 GHz, {polarization.upper()}", "surfaces against modes, limit of both", "dB",
            error, LIMB_DB, says=says, cases=len(angle),
        )  # fmt: skip


def measure(quick: bool) -> list[Row]:
    spheres = QUICK_SPHERES if quick else SPHERES
    return [*(row for sphere in spheres for row in sphere_rows(*sphere)), *limb_rows()]


if __name__ == "__main__":
    sys.exit(main("Full wave of closed meshes against Mie's series and against modes", measure))
