"""Pages in one file that make no request: templates, filled in, with their style and scripts.

The templates, ``pages/*.html``, are those of Jinja, which escapes all given texts.
"""

from __future__ import annotations

import base64
import gzip
import hashlib
import json
import math
import struct
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtradar.cards import quantity as with_prefix
from rtradar.errors import InputError
from rtradar.scatter.validity import WARN_FRACTION
from rtradar.system.files import atomic_file, open_regular
from rtradar.system.templates import templates

if TYPE_CHECKING:
    from jinja2 import Environment

_AT_ONCE = 1 << 18  # bytes
_PNG = b"\x89PNG\r\n\x1a\n"


@cache
def _environment() -> Environment:
    found = templates(Path(__file__).with_name("pages"), escaped=True)
    shown = (grouped, minus, quantities, stage_label, with_unit)
    found.filters |= {one.__name__: one for one in (*shown, grade)}
    found.globals |= {"png": _png}
    return found


def write_page(
    path: str | Path,
    template: str,
    values: Mapping[str, Any],
    *,
    data: object = None,
    scripts: Sequence[str] = (),
) -> None:
    """Write a template, filled in with ``values``, as a page whose policy forbids any request.

    The page is written part by part, so that memory does not grow with the pictures. Pages with
    ``scripts``, files of this package that are run as one, include plotly.js, compressed (2.0 MB),
    and ``data`` as JSON in the element ``report-data``. InputError if the file cannot be written;
    an existing file is then unchanged.
    """
    given: dict[str, Any] = {"style": _asset("page.css"), "code": "", "digests": []}
    if scripts:
        # The policy of the page runs scripts of these digests alone: the library and its own code.
        given["plotly"], digest = _plotly()
        given["code"] = f'(() => {{\n"use strict";\n{"".join(map(_asset, scripts))}}})();\n'
        own = _text_of(hashlib.sha256(given["code"].encode()))
        given |= {"data": _json_parts(data), "digests": [digest, own]}
    with atomic_file(path) as file:
        parts = _environment().get_template(template).generate(**given, **values)
        file.writelines(part.encode() for part in parts)


def is_page(path: Path) -> bool:
    """Return whether a regular file exists at this path and was written by `write_page`."""
    with suppress(OSError), open_regular(path) as file:
        return b'<meta name="generator" content="rtradar">' in file.read(4096)
    return False


def _asset(name: str) -> str:
    return files("rtradar.report").joinpath(name).read_text(encoding="utf-8")


def _json_parts(data: object) -> Iterator[str]:
    """Yield JSON without any <, so that no text can end the element."""
    content = json.dumps(data, allow_nan=False, separators=(",", ":"))
    for first in range(0, len(content), _AT_ONCE):
        yield content[first : first + _AT_ONCE].replace("<", "\\u003c")


def _plotly() -> tuple[str, str]:
    """Return plotly.js, compressed and in base64, and the digest of what it is unpacked to."""
    packed = files("rtradar.report").joinpath("plotly.min.js.gz").read_bytes()
    return base64.b64encode(packed).decode(), _text_of(hashlib.sha256(gzip.decompress(packed)))


def _text_of(digest: Any) -> str:
    return base64.b64encode(digest.digest()).decode()


def _png(path: Path) -> dict[str, Any]:
    """Return the size of a PNG file and its content in base64; InputError if it is none."""
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise InputError(
            f"report: picture '{path}': {error.strerror}; give the path of a PNG file"
        ) from None
    if data[:8] != _PNG or len(data) < 24:
        raise InputError(f"report: picture '{path}' is no PNG file; only PNG is embedded")
    width, height = struct.unpack(">II", data[16:24])
    return {"width": width, "height": height, "content": base64.b64encode(data).decode()}


def grade(limit: Mapping[str, Any]) -> str:
    """Return "warning" for a limit that may change what a reader concludes, or else "note".

    A limit that concerns at most 5 % of the echo power changes it by at most 0.2 dB: a note. One
    of 0, as where nobody is visible, concerns everything, and one of None is not known.
    """
    share = limit.get("share", 0.0)
    return "note" if share is None or 0 < share <= WARN_FRACTION else "warning"


@dataclass(frozen=True, repr=False)
class InlinePage:
    """A page that makes no request; a notebook shows it in a frame of its own.

    Parameters
    ----------
    html : str
        The whole page.
    height_px : int
        Height of the frame [pixel].
    """

    html: str
    height_px: int = 900

    def save(self, path: str | Path) -> None:
        """Write the page into a file, which any browser opens.

        Parameters
        ----------
        path : path
            File that is written.

        Raises
        ------
        InputError
            If the file cannot be written; an existing file is then unchanged.
        """
        with atomic_file(path) as file:
            file.write(self.html.encode())

    def __repr__(self) -> str:
        return f"InlinePage of {len(self.html) / 1e6:.1f} MB; save(path) writes it"

    def _repr_html_(self) -> str:
        return _environment().get_template("frame.html").render(page=self)


# -- labels, from ``labels.toml``: keys of ``summary.json`` in words, with their units -------------


_PREFIXED = {"Hz", "s", "W"}  # shown as 12 GHz or 62.5 µs


@cache
def _words() -> dict[str, dict[str, str]]:
    return tomllib.loads(_asset("labels.toml"))


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
    # A suffix such as `_hz` is the unit, and is no word of the label.
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
            return with_prefix(value, unit, digits=6)
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
