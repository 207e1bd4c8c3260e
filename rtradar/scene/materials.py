"""Materials of rooms and of people: complex relative permittivity over frequency, each with its source and its limits.

References
----------
ITU-R P.2040-3 (08/2023), "Effects of building materials and structures on radiowave propagation above about 100 MHz",
table 3: eps_r = a f^b and sigma = c f^d [S/m] with f in GHz.

S. Gabriel, R. W. Lau and C. Gabriel, "The dielectric properties of biological tissues: III. Parametric models for the
dielectric spectrum of tissues", Phys. Med. Biol. 41 (1996) 2271-2293: four Cole-Cole terms.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import isfinite
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.scene.permittivity import ColeCole, Conductor, PowerLaw
from rtradar.system.checks import check_number, check_text, shown


@dataclass(frozen=True, kw_only=True)
class Material:
    """What a wall, a piece of furniture or a person is made of.

    Parameters
    ----------
    name : str
        As scene files call it.
    source : str
        Where the figures come from.
    bands : tuple of PowerLaw, ColeCole or Conductor
        One or more; the first that holds a frequency is taken.
    """

    name: str
    source: str
    bands: tuple[PowerLaw | ColeCole | Conductor, ...]

    @property
    def conducts(self) -> bool:
        """Whether it reflects so well that a sheet of it needs no thickness: sigma of 1e6 S/m or more."""
        return all(
            isinstance(band, Conductor) or (isinstance(band, PowerLaw) and band.c >= 1e6)
            for band in self.bands
        )

    def holds(self, frequency_hz: ArrayLike) -> NDArray[np.bool_]:
        """Whether its figures are given at these frequencies [Hz], of any shape.

        Parameters
        ----------
        frequency_hz : (...) array_like
            [Hz].

        Returns
        -------
        (...) bool
        """
        frequency = np.asarray(frequency_hz, dtype=np.float64)
        inside = [(frequency >= band.low_hz) & (frequency <= band.high_hz) for band in self.bands]
        return np.asarray(np.any(inside, axis=0) & np.isfinite(frequency) & (frequency > 0))

    def eta(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Complex relative permittivity eps_r - j sigma / (omega eps_0), exp(+j omega t).

        Parameters
        ----------
        frequency_hz : (...) float
            [Hz]

        Returns
        -------
        (...) complex128
            The imaginary part is never positive; -j infinity is a perfect conductor.

        Raises
        ------
        InputError
            At frequencies for which the source gives nothing.
        """
        frequency = np.asarray(frequency_hz, dtype=np.float64)
        held = self.holds(frequency)
        if not held.all():
            self._refuse(float(frequency[~held].flat[0]))
        eta = np.empty(frequency.shape, dtype=np.complex128)
        for band in reversed(self.bands):
            inside = (frequency >= band.low_hz) & (frequency <= band.high_hz)
            eta[inside] = band.eta(frequency[inside])
        return eta

    def _refuse(self, frequency_hz: float) -> None:
        limits = " and ".join(
            f"{band.low_hz / 1e9:g} to {band.high_hz / 1e9:g} GHz" for band in self.bands
        )
        others = ", ".join(
            sorted(name for name, other in MATERIALS.items() if other.holds(frequency_hz))
        )
        raise InputError(
            f"material '{self.name}' at {frequency_hz / 1e9:g} GHz: {self.source} gives it for {limits}; known there: "
            f"{others or 'none'}; or give one of your own, with its source"
        )


ITU = "ITU-R P.2040-3"

_TABLE_3: dict[str, tuple[tuple[float, float, float, float, float, float], ...]] = {
    # name: (from GHz, to GHz, a, b, c, d)
    "vacuum": ((0.001, 100.0, 1.0, 0.0, 0.0, 0.0),),
    "concrete": ((1.0, 100.0, 5.24, 0.0, 0.0462, 0.7822),),
    "brick": ((1.0, 40.0, 3.91, 0.0, 0.0238, 0.16),),
    "plasterboard": ((1.0, 100.0, 2.73, 0.0, 0.0085, 0.9395),),
    "wood": ((0.001, 100.0, 1.99, 0.0, 0.0047, 1.0718),),
    "glass": ((0.1, 100.0, 6.31, 0.0, 0.0036, 1.3394), (220.0, 450.0, 5.79, 0.0, 0.0004, 1.658)),
    "ceiling-board": (
        (1.0, 100.0, 1.48, 0.0, 0.0011, 1.0750),
        (220.0, 450.0, 1.52, 0.0, 0.0029, 1.029),
    ),
    "chipboard": ((1.0, 100.0, 2.58, 0.0, 0.0217, 0.7800),),
    "plywood": ((1.0, 40.0, 2.71, 0.0, 0.33, 0.0),),
    "marble": ((1.0, 60.0, 7.074, 0.0, 0.0055, 0.9262),),
    "floorboard": ((50.0, 100.0, 3.66, 0.0, 0.0044, 1.3515),),
    "metal": ((1.0, 100.0, 1.0, 0.0, 1e7, 0.0),),
    "very-dry-ground": ((1.0, 10.0, 3.0, 0.0, 0.00015, 2.52),),
    "medium-dry-ground": ((1.0, 10.0, 15.0, -0.1, 0.035, 1.63),),
    "wet-ground": ((1.0, 10.0, 30.0, -0.4, 0.15, 1.30),),
}

# Dry skin: of the four terms of the paper the last two have a step of zero.
_SKIN = ColeCole(1e9, 100e9, 4.0, ((32.0, 7.234e-12, 0.0), (1100.0, 32.481e-9, 0.20)), 0.0002)


def _known() -> dict[str, Material]:
    found = [
        Material(
            name=name,
            source=ITU,
            bands=tuple(PowerLaw(low * 1e9, high * 1e9, *rest) for low, high, *rest in rows),
        )
        for name, rows in _TABLE_3.items()
    ]
    found.append(Material(name="skin", source="dry skin of Gabriel et al. 1996", bands=(_SKIN,)))
    found.append(
        Material(
            name="perfect-conductor",
            source="the limit of infinite conductivity",
            bands=(Conductor(),),
        )
    )
    return {material.name: material for material in found}


MATERIALS: Mapping[str, Material] = MappingProxyType(_known())
"""Those known by name. ``metal`` is that of the Recommendation, 1e7 S/m; the body of the paper is ``perfect-conductor``."""


def material(name: str) -> Material:
    """The material of that name among `MATERIALS`.

    Parameters
    ----------
    name : str

    Returns
    -------
    Material

    Raises
    ------
    InputError
        Where there is none.
    """
    if not isinstance(name, str) or name not in MATERIALS:
        raise InputError(
            f"material {shown(name)} is unknown; allowed: {', '.join(sorted(MATERIALS))}"
        )
    return MATERIALS[name]


def own_material(
    name: str,
    *,
    source: object,
    low_hz: object,
    high_hz: object,
    a: object,
    b: object = 0.0,
    c: object = 0.0,
    d: object = 0.0,
) -> Material:
    """A material by constants of one's own: permittivity a f^b and conductivity c f^d [S/m], f in GHz.

    Parameters
    ----------
    name : str
        Must not be one of `MATERIALS`.
    source : str
        Where the constants come from: never empty.
    low_hz, high_hz : float
        Between which frequencies they hold [Hz].
    a, b, c, d : float
        As in ITU-R P.2040-3.

    Returns
    -------
    Material

    Raises
    ------
    InputError
        Where a value has no physical meaning, or the source is not named.
    """
    where = f"material {shown(name)}"
    check_text(where, "its name", name)
    if name in MATERIALS:
        raise InputError(
            f"{where}: that name belongs to {MATERIALS[name].source}; choose another for your own figures"
        )
    check_text(where, "source", source)
    low = check_number(where, "low_hz", low_hz, 1e6, 1e12)
    high = check_number(where, "high_hz", high_hz, low, 1e12)
    constants = [
        check_number(where, key, value, least, most)
        for key, value, least, most in (
            ("a", a, 0.0, 1e4),
            ("b", b, -10.0, 10.0),
            ("c", c, 0.0, 1e9),
            ("d", d, -10.0, 10.0),
        )
    ]
    law = PowerLaw(low, high, *constants)
    # A power law is monotonic, so its ends tell.
    ends = law.eta(np.array([low, high]))
    if not all(value.real >= 1.0 and isfinite(abs(value)) for value in ends):
        raise InputError(
            f"{where}: a = {shown(a)}, b = {shown(b)} give a permittivity of {ends[0].real:.3g} to {ends[1].real:.3g}; "
            "it must be 1 or more"
        )
    return Material(name=name, source=str(source), bands=(law,))
