"""Materials of rooms and people: complex relative permittivity over frequency.

Each material names the source of its figures and the frequencies for which they are given. A new
material is a row of ``materials.toml``, if the Recommendation has it, or is made by
`own_material`, which is what a table ``[materials.NAME]`` of a scene file does.

References
----------
ITU-R P.2040-3 (08/2023), "Effects of building materials and structures on radiowave propagation
above about 100 MHz", table 3: eps_r = a f^b and sigma = c f^d [S/m] with f in GHz.

S. Gabriel, R. W. Lau and C. Gabriel, "The dielectric properties of biological tissues: III.
Parametric models for the dielectric spectrum of tissues", Phys. Med. Biol. 41 (1996) 2271-2293:
four Cole-Cole terms.
"""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import inf, isfinite, pi
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.errors import InputError
from rtradar.system.checks import brief
from rtradar.system.fields import Limits, checked, read_value

VACUUM_PERMITTIVITY_FPM = 8.8541878188e-12
"""Permittivity of vacuum [F/m], CODATA 2022.

P.2040-3 rounds 1e-9 / (2 pi eps_0) = 17.975 to 17.98."""


_Frequency = Annotated[float, Limits(1e6, 1e12)]
_Power = Annotated[float, Limits(-10, 10)]


@dataclass(frozen=True)
class PowerLaw:
    """Permittivity a f^b and conductivity c f^d [S/m], f in GHz: a row of ITU-R P.2040-3, table 3.

    The limits of the measured band belong to it.
    """

    low_hz: _Frequency
    high_hz: _Frequency
    a: Annotated[float, Limits(0, 1e4)]
    b: _Power = 0.0
    c: Annotated[float, Limits(0, 1e9)] = 0.0
    d: _Power = 0.0

    def eta(self, frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Complex relative permittivity, exp(+j omega t): the imaginary part is never positive."""
        # Lossy conduction is the imaginary part, sigma over omega eps_0.
        ghz = frequency_hz / 1e9
        conductivity = self.c * ghz**self.d
        loss = conductivity / (2 * pi * frequency_hz * VACUUM_PERMITTIVITY_FPM)
        return np.asarray(self.a * ghz**self.b - 1j * loss)


@dataclass(frozen=True)
class ColeCole:
    """Sum of Cole-Cole relaxations and an ionic ``conductivity`` [S/m].

    The relative permittivity is ``infinite`` far above all relaxations; each of ``terms`` has its
    step of permittivity, its relaxation time [s] and its broadening alpha. The limits of the band
    belong to it.
    """

    low_hz: float
    high_hz: float
    infinite: float
    terms: tuple[tuple[float, float, float], ...]
    conductivity: float

    def eta(self, frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Complex relative permittivity, exp(+j omega t): the imaginary part is never positive."""
        omega = 2 * pi * frequency_hz
        eta = self.infinite + self.conductivity / (1j * omega * VACUUM_PERMITTIVITY_FPM)
        for step, time, alpha in self.terms:
            eta = eta + step / (1 + (1j * omega * time) ** (1 - alpha))
        return np.asarray(eta)


@dataclass(frozen=True)
class Conductor:
    """Perfect conductor: the permittivity is -j infinity, which `reflection` and `slab` know."""

    low_hz: float = 0.0
    high_hz: float = inf

    def eta(self, frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Complex relative permittivity, minus j infinity."""
        return np.full(frequency_hz.shape, complex(0.0, -inf))


Band = PowerLaw | ColeCole | Conductor


@dataclass(frozen=True, kw_only=True)
class Material:
    """Material of a wall, a piece of furniture or a person.

    Parameters
    ----------
    name : str
        Name of the material in scene files.
    source : str
        Publication that gives the figures.
    bands : tuple of PowerLaw, ColeCole or Conductor
        Laws over frequency, one or more; the first whose band holds a frequency is used.
    """

    name: str
    source: str
    bands: tuple[Band, ...]

    @property
    def conducts(self) -> bool:
        """Whether a sheet of it needs no thickness: its conductivity is 1e6 S/m or more."""
        return all(
            isinstance(band, Conductor) or (isinstance(band, PowerLaw) and band.c >= 1e6)
            for band in self.bands
        )

    def holds(self, frequency_hz: ArrayLike) -> NDArray[np.bool_]:
        """Tell whether the figures are given at some frequencies.

        Parameters
        ----------
        frequency_hz : (...) array_like
            Frequencies [Hz].

        Returns
        -------
        (...) bool
        """
        frequency = np.asarray(frequency_hz, dtype=np.float64)
        inside = [_inside(band, frequency) for band in self.bands]
        return np.asarray(np.any(inside, axis=0) & np.isfinite(frequency) & (frequency > 0))

    def eta(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Compute the complex relative permittivity eps_r - j sigma / (omega eps_0).

        The time factor is exp(+j omega t).

        Parameters
        ----------
        frequency_hz : (...) float
            Frequencies [Hz].

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
        if (outside := frequency[~self.holds(frequency)]).size:
            self._refuse(float(outside[0]))
        eta = np.empty(frequency.shape, dtype=np.complex128)
        # The first band that holds a frequency counts, so it is written last.
        for band in reversed(self.bands):
            inside = _inside(band, frequency)
            eta[inside] = band.eta(frequency[inside])
        return eta

    def _refuse(self, frequency_hz: float) -> None:
        limits = " and ".join(
            f"{band.low_hz / 1e9:g} to {band.high_hz / 1e9:g} GHz" for band in self.bands
        )
        others = sorted(name for name, other in MATERIALS.items() if other.holds(frequency_hz))
        raise InputError(
            f"material '{self.name}' at {frequency_hz / 1e9:g} GHz: {self.source} gives it for "
            f"{limits}; known there: {', '.join(others) or 'none'}; or give one of your own, "
            "with its source"
        )


def _inside(band: Band, frequency_hz: NDArray[np.float64]) -> NDArray[np.bool_]:
    return np.asarray((frequency_hz >= band.low_hz) & (frequency_hz <= band.high_hz))


ITU = "ITU-R P.2040-3"

# Dry skin: of the four terms of the paper the last two have a step of zero.
_SKIN = ColeCole(1e9, 100e9, 4.0, ((32.0, 7.234e-12, 0.0), (1100.0, 32.481e-9, 0.20)), 0.0002)


_OTHERS = (
    Material(name="skin", source="dry skin of Gabriel et al. 1996", bands=(_SKIN,)),
    Material(
        name="perfect-conductor", source="the limit of infinite conductivity", bands=(Conductor(),)
    ),
)


def _of_table_3() -> Iterator[Material]:
    table = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    for name, rows in table.items():
        laws = tuple(PowerLaw(low * 1e9, high * 1e9, *rest) for low, high, *rest in rows)
        yield Material(name=name, source=ITU, bands=laws)


MATERIALS: Mapping[str, Material] = MappingProxyType(
    {known.name: known for known in (*_of_table_3(), *_OTHERS)}
)
"""Materials by their names. ``metal`` is that of the Recommendation, with 1e7 S/m; the body of the
paper is a ``perfect-conductor``."""


def material(name: str, known: Mapping[str, Material] = MATERIALS) -> Material:
    """Find the material of a name.

    Parameters
    ----------
    name : str
        One of those that are known.
    known : mapping of str to Material
        Materials by their names: `MATERIALS`, or those and others of one's own.

    Returns
    -------
    Material

    Raises
    ------
    InputError
        Where there is no such material.
    """
    if not isinstance(name, str) or name not in known:
        raise InputError(
            f"material = {brief(name)} is unknown; allowed: {', '.join(sorted(known))}, or in a "
            "scene file a table [materials.NAME] of your own"
        )
    return known[name]


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
    """Make a material from constants: permittivity a f^b, conductivity c f^d [S/m], f in GHz.

    Parameters
    ----------
    name : str
        Name of the material, none of `MATERIALS`.
    source : str
        Publication or measurement that gives the constants; it must not be empty.
    low_hz, high_hz : float
        Limits of the frequencies for which the constants hold [Hz].
    a, b, c, d : float
        Constants of the power laws, defined as in ITU-R P.2040-3.

    Returns
    -------
    Material

    Raises
    ------
    InputError
        Where a value has no physical meaning, or the source is not named.
    """
    where = f"material {brief(name)}"
    read_value(str, f"{where}: ", "its name", name)
    if name in MATERIALS:
        raise InputError(
            f"{where}: that name belongs to {MATERIALS[name].source}; choose another for your "
            "own figures"
        )
    read_value(str, f"{where}: ", "source", source)
    given = {"low_hz": low_hz, "high_hz": high_hz, "a": a, "b": b, "c": c, "d": d}
    law = PowerLaw(**checked(PowerLaw, f"{where}: ", given))
    if law.low_hz > law.high_hz:
        raise InputError(f"{where}: high_hz = {brief(high_hz)}; it must be low_hz or more")
    # A power law is monotonic, so its ends suffice.
    ends = law.eta(np.array([law.low_hz, law.high_hz]))
    if not all(value.real >= 1.0 and isfinite(abs(value)) for value in ends):
        raise InputError(
            f"{where}: a = {brief(a)}, b = {brief(b)} give a permittivity of {ends[0].real:.3g} to "
            f"{ends[1].real:.3g}; it must be 1 or more"
        )
    return Material(name=name, source=str(source), bands=(law,))
