"""HTML of pages: the frame of a page that makes no requests, and tables, boxes and pictures in it.

All given texts are escaped.
"""

from __future__ import annotations

import base64
import hashlib
import json
import struct
import zlib
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any, NamedTuple

from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.report.pages.labels import quantity, stage_label, with_unit
from rtradar.scatter.validity import WARN_FRACTION
from rtradar.system.files import atomic_file, open_regular

_HEAD = Template("""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="$policy">
<meta name="generator" content="rtradar">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>$title</title>
<style>
$style</style>
</head>
<body>
<header>
<p class="kind">$kind</p>
<h1>$heading</h1>
<p class="sub">$subtitle</p>
</header>
<main>
""")
_NO_SCRIPT = """
<noscript><p class="box warn">The views that move need JavaScript; all else on this page does
without.</p></noscript>
"""
_LONG = 16
_AT_ONCE = 1 << 18  # bytes
_GZIP = 31  # zlib's number for it
_PNG = b"\x89PNG\r\n\x1a\n"


class Titles(NamedTuple):
    """Plain texts at the top of a page."""

    kind: str
    heading: str
    subtitle: str


def player(more: str = "") -> str:
    """Make the HTML of the time controls of a figure, with ``more`` beside them."""
    return f"""<div class="player" id="player"><button type="button" id="play">Play</button>
<input type="range" id="moment" min="0" value="0" step="1" aria-label="Time in the recording">
<output id="clock" for="moment"></output>
<label>Speed <select id="speed"><option value="0.1">× 0.1</option>
<option value="0.25">× 0.25</option><option value="0.5">× 0.5</option>
<option value="1" selected>× 1</option></select></label>{more}</div>"""


def write_page(
    path: str | Path,
    titles: Titles,
    top: str,
    body: Iterable[str],
    *,
    data: object = None,
    scripts: Sequence[str] = (),
) -> None:
    """Write a page whose policy forbids any request.

    The HTML of ``body`` is written part by part, so that memory does not grow with the pictures.
    Pages with ``scripts``, files of this package that are run as one, include plotly.js, compressed
    (2.3 MB), and ``data`` as JSON in the element ``report-data``. InputError if the file cannot be
    written; an existing file is then unchanged.
    """
    plotly, code, allowed = b"", b"", []
    if scripts:
        plotly, digest = _plotly()
        text = "".join(map(_asset, scripts))
        code = f'(() => {{\n"use strict";\n{text}}})();\n'.encode()
        allowed = [digest, _text_of(hashlib.sha256(code))]
    head = _HEAD.substitute(
        policy=_policy(allowed),
        title=escape(f"{titles.heading} - {titles.kind.split()[0]}"),
        style=_asset("page.css"),
        **{name: escape(value) for name, value in titles._asdict().items()},
    )
    with atomic_file(path) as file:
        file.write((head + top + (_NO_SCRIPT if scripts else "\n")).encode())
        file.writelines(part.encode() for part in body)
        file.write(b"</main>\n")
        if scripts:
            # Without any <, so that no text can end the element.
            content = json.dumps(data, allow_nan=False, separators=(",", ":"))
            file.write(b'<script type="application/json" id="report-data">')
            for first in range(0, len(content), _AT_ONCE):
                part = content[first : first + _AT_ONCE]
                file.write(part.replace("<", "\\u003c").encode())
            file.write(b"</script>\n")
            file.writelines(
                (b'<script type="application/gzip" id="plotly">', plotly, b"</script>\n")
            )
            file.writelines((b"<script>", code, b"</script>\n"))
        file.write(b"</body>\n</html>\n")


def is_page(path: Path) -> bool:
    """Return whether a regular file exists at this path and was written by `write_page`."""
    with suppress(OSError), open_regular(path) as file:
        return b'<meta name="generator" content="rtradar">' in file.read(4096)
    return False


def _asset(name: str) -> str:
    return files("rtradar.report").joinpath(name).read_text(encoding="utf-8")


def _plotly() -> tuple[bytes, str]:
    """Return plotly.js, compressed and in base64, and the digest of what it is unpacked to."""
    digest, packer, packed = hashlib.sha256(), zlib.compressobj(1, wbits=_GZIP), []
    with files("plotly").joinpath("package_data/plotly.min.js").open("rb") as file:
        while part := file.read(_AT_ONCE):
            digest.update(part)
            packed.append(packer.compress(part))
    return base64.b64encode(b"".join(packed) + packer.flush()), _text_of(digest)


def _text_of(digest: Any) -> str:
    return base64.b64encode(digest.digest()).decode()


def _policy(digests: Iterable[str]) -> str:
    """Content security policy that allows scripts of these digests and embedded pictures only."""
    none, hashes = "'none'", " ".join(f"'sha256-{digest}'" for digest in digests)
    # Plotly writes style rules of its own, and pictures for download are blobs.
    sources = f"script-src {hashes or none}; style-src 'unsafe-inline'; img-src data: blob:"
    return f"default-src {none}; {sources}; base-uri {none}; form-action {none}"


def table(rows: Iterable[Sequence[str]], head: Sequence[str] = ()) -> str:
    """Make an HTML table of plain texts; the first column names the row."""
    top = "".join(f'<th scope="col">{escape(cell)}</th>' for cell in head)
    head_row = f"<thead><tr>{top}</tr></thead>" if head else ""
    body = ""
    for name, *values in rows:
        cells = "".join(f"<td{_wraps(cell)}>{escape(cell)}</td>" for cell in values)
        body += f'<tr><th scope="row">{escape(name)}</th>{cells}</tr>'
    return f"<table>{head_row}<tbody>{body}</tbody></table>"


def _wraps(cell: str) -> str:
    """Return the class of a cell that may be broken, which a number and its unit are not."""
    return ' class="long"' if len(cell) > _LONG else ""


def mapping_table(values: Mapping[str, Any]) -> str:
    """Make a table of all values except None, mappings and lists of mappings."""
    return table(
        quantity(name, value)
        for name, value in values.items()
        if value is not None
        and not isinstance(value, Mapping)
        and not (isinstance(value, list) and value and isinstance(value[0], Mapping))
    )


def limits_table(radar: Radar) -> str:
    """Make the paper's Table 2, the measurement limits, for this radar at its centre frequency."""
    bin_cm, bin_mps = f"{100 * radar.range_bin_m:.3f} cm", f"{radar.velocity_bin_mps:.4f} m/s"
    turn, beam = with_unit(radar.cycle_duration_s, "s"), f"{radar.angle_resolution_deg:.2f}°"
    channels = f"{radar.n_tx} × {radar.n_rx} = {radar.n_channels}"
    rows = (
        ("r_max", "Maximum detectable range", f"{radar.max_range_m:.3f} m"),
        ("r_dis", "Minimum distinguishable distance, one range bin", bin_cm),
        ("v_max", "Maximum unambiguous velocity", f"±{radar.max_velocity_mps:.3f} m/s"),
        ("v_dis", "Minimum distinguishable velocity, one Doppler bin", bin_mps),
        ("A_range", "Unambiguous azimuth and elevation", f"±{radar.max_angle_deg:.1f}°"),
        ("A_dis", "Beam width, -3 dB, uniform line, far field", beam),
        ("λ", "Wavelength at the centre of the sweep", f"{1000 * radar.wavelength_m:.3f} mm"),
        ("T_cycle", "One turn through all Tx", turn),
        ("N_cycle", "Cycles in one frame", str(radar.cycles_per_frame)),
        ("N_virtual", "Virtual channels, Tx by Rx", channels),
    )
    return table(rows, ("", "Limit", "Value"))


def stages_table(seconds: Mapping[str, float]) -> str:
    """Make a table of the time of each stage, with bars relative to the slowest one."""
    longest = max(seconds.values(), default=0.0) or 1.0
    total = sum(seconds.values()) or 1.0
    rows = "".join(
        f'<tr><th scope="row">{escape(stage_label(name))}</th><td>{value:.3f} s</td>'
        f"<td>{value / total:.0%}</td>"
        f'<td class="bar"><span style="width:{100 * value / longest:.1f}%"></span></td></tr>'
        for name, value in seconds.items()
    )
    return f'<table class="stages"><tbody>{rows}</tbody></table>'


def grade(limit: Mapping[str, Any]) -> str:
    """Return "warning" for a limit that may change what a reader concludes, or else "note".

    A limit that concerns at most 5 % of the echo power changes it by at most 0.2 dB: a note. One
    of 0, as where nobody is visible, concerns everything, and one of None is not known.
    """
    share = limit.get("share", 0.0)
    return "note" if share is None or 0 < share <= WARN_FRACTION else "warning"


def limits_list(limits: Sequence[Mapping[str, Any]]) -> str:
    """Make a list of where a model came near the end of its validity, warnings first."""
    if not limits:
        return '<p class="note">Nothing came near the end of a model\'s validity.</p>'
    items = []
    for limit in sorted(limits, key=lambda limit: -"note warning".index(grade(limit))):
        share, message = float(limit.get("share") or 0.0), str(limit["message"])
        if share > 0:
            message = f"{share:.1%} of the {message}"
        kind = grade(limit)
        items.append(f'<li class="{kind}"><b>{kind.capitalize()}</b> {escape(message)}.</li>')
    return f'<ul class="limits">{"".join(items)}</ul>'


def contents(links: Mapping[str, str]) -> str:
    """Make the list of contents of a page from the titles of its sections by their identifiers."""
    items = "".join(f'<li><a href="#{name}">{escape(t)}</a></li>' for name, t in links.items())
    return f'<nav aria-label="Contents"><ul>{items}</ul></nav>'


def tiles(values: Iterable[tuple[str, str]]) -> str:
    """Make a row of large figures from pairs (value, caption)."""
    cells = (f"<div><b>{escape(v)}</b><span>{escape(n)}</span></div>" for v, n in values)
    return f'<div class="tiles">{"".join(cells)}</div>'


def picture(title: str, path: Path) -> str:
    """Embed a PNG file with its caption, broad ones as such; InputError if it is no PNG file."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"report: picture '{path}': {error.strerror}; give the path of a PNG file"
        ) from None
    if data[:8] != _PNG or len(data) < 24:
        raise InputError(f"report: picture '{path}' is no PNG file; only PNG is embedded")
    width, height = struct.unpack(">II", data[16:24])
    text, shape = escape(title), ' class="broad"' if width > 1.9 * height else ""
    return (
        f'<figure{shape}><img alt="{text}" width="{width}" height="{height}" '
        f'src="data:image/png;base64,{base64.b64encode(data).decode()}">'
        f"<figcaption>{text}</figcaption></figure>"
    )
