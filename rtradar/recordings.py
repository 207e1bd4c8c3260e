"""What a user may say of a recording of motion whose file does not say it, or says it wrongly."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from rtradar.errors import InputError
from rtradar.system.checks import brief, check_number

UNITS_M: Mapping[str, float] = {
    "m": 1.0,
    "cmu": 0.0254 / 0.45,
    "in": 0.0254,
    "cm": 0.01,
    "mm": 0.001,
}
"""Length units of motion files [m]; ``cmu`` is the unit of the CMU database, 0.45 of which are an
inch."""

UPWARD = ("x", "y", "z", "-x", "-y", "-z")
"""Axes of a file that may be up."""

SYNTHETIC = "synthetic:"
"""How the name of a synthetic motion begins."""

ACTOR_S = 3.0
"""How long a synthetic actor moves that is given by name alone [s]."""

SAID = ("up", "unit", "rate_hz")
"""Keys of what may be said, in TOML as in Python."""


class Finding(NamedTuple):
    """What was found of a recording, or assumed: its name, value and words for people."""

    name: str
    value: float | str
    text: str


class Source(NamedTuple):
    """What a motion was made from.

    ``keys`` are those of a person in a run file that make it again, with absolute paths; ``files``
    are the SHA-256 digests of the files that were read, by their paths.
    """

    keys: Mapping[str, Any]
    files: Mapping[str, str]


def rate_of(rate_hz: float) -> Finding:
    """Say the frames a second of a file."""
    return Finding("rate_hz", rate_hz, f"rate: {rate_hz:g} frames a second")


def tall(stature_m: float) -> Finding:
    """Say the stature of a person [m]."""
    return Finding("stature_m", round(stature_m, 3), f"stature: {stature_m:.2f} m")


def check_up(where: str, value: object) -> str | None:
    """Return the axis that is up; None where it is to be found."""
    if value is None or value == "auto":
        return None
    if value not in UPWARD:
        raise InputError(f"{where}: up = {brief(value)}; it must be one of {', '.join(UPWARD)}")
    return str(value)


def check_unit(where: str, value: object) -> float | None:
    """Return the length unit [m], given by its name or its metres; None where it is to be found."""
    if value is None or value == "auto":
        return None
    # A text is the name of a unit, or its metres as the command line gives them.
    if isinstance(value, str):
        if value in UNITS_M:
            return UNITS_M[value]
        try:
            value = float(value)
        except ValueError:
            raise InputError(
                f"{where}: unit = {brief(value)}; it must be one of {', '.join(UNITS_M)}, or the "
                "metres of a unit"
            ) from None
    return check_number(where, "unit", value, 1e-6, 1e3)


def check_rate(where: str, value: object) -> float | None:
    """Return the frames a second [Hz]; None where the file says them."""
    return None if value is None else check_number(where, "rate_hz", value, 1.0, 100_000.0)


def said_of(where: str, table: Mapping[str, object]) -> dict[str, Any]:
    """Return the keyword arguments of `load_motion` in a table of TOML, checked."""
    for key, check in (("up", check_up), ("unit", check_unit), ("rate_hz", check_rate)):
        check(where, table.get(key))
    return {key: table[key] for key in SAID if key in table}
