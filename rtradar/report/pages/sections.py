"""HTML fragments of pages: tables, bars, boxes and pictures. All given texts are escaped."""

from __future__ import annotations

import base64
import struct
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from matplotlib.ticker import EngFormatter

from rtradar.errors import InputError
from rtradar.radar import Radar

_UNITS = {
    "hz": "Hz",
    "s": "s",
    "m": "m",
    "m2": "m²",
    "mps": "m/s",
    "db": "dB",
    "deg": "°",
    "mb": "MB",
    "wavelengths": "wavelengths at the start of the sweep",
}
_ACRONYMS = {"pfa": "Pfa", "rdt": "RDT", "rx": "Rx", "snr": "SNR", "tx": "Tx"}
_PREFIXED = {"Hz", "s"}  # shown as 12 GHz or 62.5 µs
_PNG = b"\x89PNG\r\n\x1a\n"


def quantity(name: str, value: object) -> tuple[str, str]:
    """Format a name with a unit suffix and its value, such as ("chirp duration", "62.5 µs").

    Parameters
    ----------
    name : str
        Name whose last word may be a unit, as in ``chirp_duration_s``.
    value : object
        Number, text, Boolean, sequence of them, or None.

    Returns
    -------
    label, text : str
        Texts that are not escaped yet.
    """
    words = name.split("_")
    unit = _UNITS.get(words[-1], "") if len(words) > 1 else ""
    if unit:
        words = words[:-1]
    return " ".join(_ACRONYMS.get(word, word) for word in words), _text(value, unit)


def _text(value: object, unit: str) -> str:
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        return f"({', '.join(_text(item, '') for item in value)}){' ' if unit else ''}{unit}"
    if isinstance(value, int) and not unit:
        return str(value)
    if isinstance(value, int | float):
        if unit in _PREFIXED and value:
            return EngFormatter(unit=unit, places=None)(value)
        shown = f"{value:.5g}"
    else:
        shown = str(value)
        if not shown.lstrip("-").isalnum() or not unit:
            unit = ""
    return shown + ("" if unit in ("", "°") else " ") + unit


def table(rows: Iterable[Sequence[str]], head: Sequence[str] = ()) -> str:
    """Make an HTML table of plain texts; the first column names the row."""
    top = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in head)
    body = "".join(
        f'<tr><th scope="row">{escape(row[0])}</th>'
        + "".join(f"<td>{escape(cell)}</td>" for cell in row[1:])
        + "</tr>"
        for row in rows
    )
    return (
        "<table>"
        + (f"<thead><tr>{top}</tr></thead>" if head else "")
        + f"<tbody>{body}</tbody></table>"
    )


def mapping_table(values: Mapping[str, Any]) -> str:
    """Make a table of all values except mappings and lists of mappings."""
    return table(
        quantity(name, value)
        for name, value in values.items()
        if not isinstance(value, Mapping)
        and not (isinstance(value, list) and value and isinstance(value[0], Mapping))
    )


def limits_table(radar: Radar) -> str:
    """Make the paper's Table 2, the measurement limits, for this radar at its centre frequency."""
    rows = (
        ("r_max", "Maximum detectable range", f"{radar.max_range_m:.3f} m"),
        (
            "r_dis",
            "Minimum distinguishable distance, one range bin",
            f"{100 * radar.range_bin_m:.3f} cm",
        ),
        ("v_max", "Maximum unambiguous velocity", f"±{radar.max_velocity_mps:.3f} m/s"),
        (
            "v_dis",
            "Minimum distinguishable velocity, one Doppler bin",
            f"{radar.velocity_bin_mps:.4f} m/s",
        ),
        ("A_range", "Unambiguous azimuth and elevation", f"±{radar.max_angle_deg:.1f}°"),
        (
            "A_dis",
            "Beam width, -3 dB, uniform line, far field",
            f"{radar.angle_resolution_deg:.2f}°",
        ),
        ("λ", "Wavelength at the centre of the sweep", f"{1000 * radar.wavelength_m:.3f} mm"),
        ("T_cycle", "One turn through all Tx", _text(radar.cycle_duration_s, "s")),
        ("N_cycle", "Cycles in one frame", str(radar.cycles_per_frame)),
        (
            "N_virtual",
            "Virtual channels, Tx by Rx",
            f"{radar.n_tx} × {radar.n_rx} = {radar.n_channels}",
        ),
    )
    return table(rows, ("", "Limit", "Value"))


def stages_table(seconds: Mapping[str, float]) -> str:
    """Make a table of the time of each stage, with bars relative to the slowest one."""
    longest = max(seconds.values(), default=0.0) or 1.0
    total = sum(seconds.values()) or 1.0
    rows = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td>{value:.3f} s</td><td>{value / total:.0%}</td>'
        f'<td class="bar"><span style="width:{100 * value / longest:.1f}%"></span></td></tr>'
        for name, value in seconds.items()
    )
    return f'<table class="stages"><tbody>{rows}</tbody></table>'


def limits_box(limits: Sequence[Mapping[str, Any]]) -> str:
    """Make a box that lists where a model came near the end of its validity, or that none did."""
    if not limits:
        text = "Nothing came near the end of a model's validity."
        return f'<aside class="box fine"><p>{text}</p></aside>'
    items = []
    for limit in limits:
        share = float(limit.get("share", 0.0))
        message = f"{share:.1%} of the {limit['message']}" if share > 0 else str(limit["message"])
        items.append(f"<li>{escape(message)} <code>{escape(str(limit['name']))}</code></li>")
    return (
        f'<aside class="box warn"><h2>Limits of this result</h2><ul>{"".join(items)}</ul></aside>'
    )


def tiles(values: Iterable[tuple[str, str]]) -> str:
    """Make a row of large figures from pairs (value, caption)."""
    return (
        '<div class="tiles">'
        + "".join(f"<div><b>{escape(v)}</b><span>{escape(n)}</span></div>" for v, n in values)
        + "</div>"
    )


def picture(title: str, path: Path) -> str:
    """Embed a PNG file with its caption.

    Raises
    ------
    InputError
        If the file is missing or is not a PNG file.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"report: picture '{path}': {error.strerror}; give the path of a PNG file"
        ) from None
    if data[:8] != _PNG or len(data) < 24:
        raise InputError(f"report: picture '{path}' is no PNG file; only PNG is embedded")
    width, height = struct.unpack(">II", data[16:24])
    text = escape(title)
    return (
        f'<figure><img alt="{text}" width="{width}" height="{height}" '
        f'src="data:image/png;base64,{base64.b64encode(data).decode()}">'
        f"<figcaption>{text}</figcaption></figure>"
    )
