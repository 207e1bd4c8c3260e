"""Reflection and transmission of walls, and the permittivity of skin, against other sources.

Slabs: Maxwell's equations at the two faces, as vectors. The incident, reflected, inner and
transmitted plane waves have their electric and magnetic fields written out in x, y and z. The
tangential fields of both kinds must be continuous: four linear equations give all amplitudes with
their signs, and no Fresnel coefficient is used. The figures are over those materials of
ITU-R P.2040-3 that are valid at 12 and 77 GHz.

Skin: published tables of the model of Gabriel et al. (1996). From 10 kHz to 1 MHz, where its slow
terms matter: table 3 of doi:10.1186/s12938-018-0473-9. From 1 GHz: D. Andreuccetti, R. Fossi,
C. Petrucci, "Calculation of the dielectric properties of body tissues", IFAC-CNR, 1997, "SkinDry";
at 60 GHz also T. Wu, T. S. Rappaport, C. M. Collins, "Safe for generations to come", IEEE Microwave
Magazine 16 (2015): 7.98 - j 10.90.
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.scene import MATERIALS, material, reflection, slab
from rtradar.validate.rows import Row, judged, main, reported

THICKNESSES_M = (0.004, 0.0125, 0.1)
SLOW_SKIN = ((10e3, 1133.6), (100e3, 1119.2), (200e3, 1104.8), (400e3, 1076.3), (1e6, 990.76))
SKIN = ((1e9, 40.94, 0.900), (2.45e9, 38.01, 1.464), (10e9, 31.29, 8.014), (60e9, 7.98, 36.40))


def _fields(
    wave: NDArray[np.complex128], eta: complex, polarization: str
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """E, and H times the impedance of air, of a wave exp(-j k0 wave.r); the incidence is in xz."""
    across = np.array([0.0, 1.0, 0.0], dtype=np.complex128)
    # e_TM = e_TE x k has unit length in the sense of v.v = 1; H = k x E in units of air, mu = 1.
    electric = across if polarization == "te" else np.cross(across, wave) / np.sqrt(eta)
    return electric, np.cross(wave, electric)


def _boundary(
    eta: complex, depth: float, cosine: float, polarization: str
) -> tuple[complex, complex]:
    """Reflection and transmission of a slab of k0 d = ``depth``, by continuity at z = 0 and d."""
    sine = np.sqrt(1 - cosine**2)
    inner = np.sqrt(complex(eta - sine**2))
    inner = -inner if inner.imag > 0 else inner
    incident, reflected = np.array([sine, 0, cosine + 0j]), np.array([sine, 0, -cosine + 0j])
    down, up = np.array([sine, 0, inner]), np.array([sine, 0, -inner])
    decay = np.exp(-1j * depth * inner)
    # Inner waves have their amplitude at the face that they leave, the transmitted at the far face.
    waves = (
        (reflected, 1.0, 1.0, 0.0, -1),
        (down, eta, 1.0, decay, 1),
        (up, eta, decay, 1.0, 1),
        (incident, 1.0, 0.0, 1.0, -1),
    )
    unknown = np.zeros((8, 4), dtype=np.complex128)
    known = np.zeros(8, dtype=np.complex128)
    for column, (wave, medium, near, far, sign) in enumerate(waves):
        electric, magnetic = _fields(wave, medium, polarization)
        tangential = np.concatenate([electric[:2], magnetic[:2]])
        unknown[:4, column] = sign * near * tangential
        unknown[4:, column] = sign * far * tangential
    electric, magnetic = _fields(incident, 1.0, polarization)
    known[:4] = np.concatenate([electric[:2], magnetic[:2]])
    solution = np.linalg.lstsq(unknown, known, rcond=None)[0]
    return complex(solution[0]), complex(solution[3])


def _slabs(frequency_hz: float, quick: bool) -> list[Row]:
    cosines = np.cos(np.radians(np.linspace(0, 88, 9 if quick else 45)))
    names = [
        name for name, held in MATERIALS.items() if held.holds(frequency_hz) and not held.conducts
    ]
    off, excess, half_space = 0.0, 0.0, 0.0
    for name in names:
        eta = complex(material(name).eta(frequency_hz))
        for polarization in ("te", "tm"):
            for thickness in THICKNESSES_M:
                ours = slab(eta, thickness, frequency_hz, cosines, polarization)
                depth = 2 * np.pi * frequency_hz / SPEED_OF_LIGHT_MPS * thickness
                theirs = np.array(
                    [_boundary(eta, depth, cosine, polarization) for cosine in cosines]
                ).T
                off = max(off, float(np.abs(np.array(ours) - theirs).max()))
                excess = max(excess, float((np.abs(ours[0]) ** 2 + np.abs(ours[1]) ** 2).max() - 1))
            deep = -complex(np.sqrt(eta)).imag * 2 * np.pi * frequency_hz / SPEED_OF_LIGHT_MPS
            if deep > 0:
                # The slab is so thick that the far face is 40 nepers away.
                thick = slab(eta, 40 / deep, frequency_hz, cosines, polarization)[0]
                half_space = max(
                    half_space, float(np.abs(thick - reflection(eta, cosines, polarization)).max())
                )
    claim = f"slabs of {len(names)} materials, {frequency_hz / 1e9:g} GHz"
    return [
        judged(
            claim,
            "slabs of all materials: reflection and transmission against Maxwell at both faces",
            "",
            off,
            1e-9,
        ),
        judged(
            claim,
            "slabs of all materials: reflected and transmitted power beyond the incident one",
            "",
            excess,
            1e-12,
        ),
        judged(
            claim, "slabs of all materials: thick slab against half-space", "", half_space, 1e-12
        ),
    ]


SAYS = "skin against published tables"


def measure(quick: bool) -> list[Row]:
    """Slabs at 12 and 77 GHz, skin over 1 to 60 GHz."""
    rows = [row for frequency in (12e9, 77e9) for row in _slabs(frequency, quick)]
    for frequency, permittivity in SLOW_SKIN:
        slow = float(material("skin").bands[0].eta(np.array(frequency)).real)
        # The table is rounded to 0.1.
        rows.append(
            judged(
                f"skin at {frequency / 1e3:g} kHz",
                "permittivity",
                "",
                slow,
                0.06,
                reference=permittivity,
                says=SAYS,
            )
        )
    for frequency, permittivity, conductivity in SKIN:
        eta = complex(material("skin").eta(frequency))
        sigma = -eta.imag * 2 * np.pi * frequency * 8.8541878188e-12
        claim = f"skin at {frequency / 1e9:g} GHz"
        # The tables are rounded to three or four digits.
        rows.append(
            judged(
                claim,
                "permittivity",
                "",
                eta.real,
                1e-3 * permittivity,
                reference=permittivity,
                says=SAYS,
            )
        )
        rows.append(
            judged(
                claim,
                "conductivity",
                "S/m",
                sigma,
                1e-3 * conductivity,
                reference=conductivity,
                says=SAYS,
            )
        )
    for frequency in (12e9, 77e9):
        back = 20 * np.log10(abs(complex(reflection(material("skin").eta(frequency), 1.0, "te"))))
        rows.append(
            reported(
                f"skin at {frequency / 1e9:g} GHz",
                "normal reflection below a conductor",
                "dB",
                back,
            )
        )
        for name, thickness in (("plasterboard", 0.0125), ("concrete", 0.2), ("glass", 0.006)):
            passed = slab(material(name).eta(frequency), thickness, frequency, 1.0, "te")
            loss = -20 * np.log10(abs(complex(passed[1])))
            rows.append(
                reported(
                    f"{name}, {thickness * 1e3:g} mm, {frequency / 1e9:g} GHz",
                    "one-way loss",
                    "dB",
                    loss,
                )
            )
    return rows


if __name__ == "__main__":
    sys.exit(main(__doc__.splitlines()[0], measure))
