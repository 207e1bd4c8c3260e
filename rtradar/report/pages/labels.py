"""Labels of pages, from ``labels.toml``: keys of ``summary.json`` in words, with their units."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.resources import files
from typing import Any

_PREFIXED = {"Hz", "s", "W"}  # shown as 12 GHz or 62.5 µs


@cache
def _words() -> dict[str, dict[str, str]]:
    text = files("rtradar.report.pages").joinpath("labels.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)


def quantities(values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Yield `quantity` of all values except None, mappings and lists of mappings."""
    for name, value in values.items():
        nested = isinstance(value, list) and value and isinstance(value[0], Mapping)
        if value is not None and not isinstance(value, Mapping) and not nested:
            yield quantity(name, value)


def quantity(name: str, value: object) -> tuple[str, str]:
    """Return the label of a key and its value with a unit, such as ("Bandwidth", "4 GHz").

    The unit is that of the key's suffix. The words of a key without a label are its own, such as
    ("Gain of antenna", "3 dB"). The value is a number, a text, a Boolean, a sequence of them, or
    None. Nothing is escaped yet.
    """
    words = name.split("_")
    units = _words()["units"]
    unit = units.get(words[-1], "") if len(words) > 1 else ""
    if unit:
        words = words[:-1]
    acronyms = _words()["acronyms"]
    spoken = " ".join(acronyms.get(word, word) for word in words)
    label = _words()["labels"].get(name, spoken[:1].upper() + spoken[1:])
    return label, with_unit(value, unit)


def stage_label(name: str) -> str:
    """Return what a stage of a run does, such as "Detection"."""
    return _words()["stages"].get(name, name[:1].upper() + name[1:])


def with_unit(value: object, unit: str) -> str:
    """Return a value as text with its unit, such as "62.5 µs" or "(-4, 0, 1) m"."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        return f"({', '.join(with_unit(item, '') for item in value)}){' ' if unit else ''}{unit}"
    if isinstance(value, int) and not unit:
        return grouped(value)
    if isinstance(value, int | float):
        if unit in _PREFIXED and value:
            from matplotlib.ticker import EngFormatter

            return EngFormatter(unit=unit, places=None)(value)
        shown = f"{value:.5g}"
    else:
        shown = str(value)
        if shown not in ("inf", "-inf"):
            unit = ""
    return shown + ("" if unit in ("", "°") else " ") + unit


def signal_to_noise(summary: Mapping[str, Any]) -> str | None:
    """Return the signal-to-noise ratio of one IF sample that a run had, such as "31.6 dB".

    It is None where a summary knows no noise, as of measured samples.
    """
    if "noise_power_m2" not in summary:
        return None
    echo, noise = summary["echo_power_m2"], summary["noise_power_m2"]
    if not echo:
        return "nobody is visible"
    return f"{10 * math.log10(echo / noise):.1f} dB" if noise else "no noise"


def grouped(number: int) -> str:
    """Return a whole number in groups of three digits, from five digits on."""
    return str(number) if abs(number) < 10_000 else f"{number:,}".replace(",", "\u202f")


def minus(text: str) -> str:
    """Return a number in a text with the sign that is as wide as a plus."""
    return text.replace("-", "\N{MINUS SIGN}")
