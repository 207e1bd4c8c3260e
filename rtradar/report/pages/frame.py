"""Page frame: a page with style, data and scripts in one file that makes no requests."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable, Sequence
from contextlib import suppress
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

from rtradar.system.files import atomic_file, open_regular

_PAGE = Template("""<!doctype html>
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
$top
<noscript><p class="box warn">The views that move need JavaScript; all else on this page does
without.</p></noscript>
$body</main>
<script type="application/json" id="report-data">$data</script>
<script>$library</script>
<script>$script</script>
</body>
</html>
""")

# Placeholder of a large part; no text on a page contains it.
_LATER = "\0later\0"


def player(more: str = "") -> str:
    """Make the HTML of the time controls of a figure, with ``more`` beside them."""
    return f"""<div class="player" id="player"><button type="button" id="play">Play</button>
<input type="range" id="moment" min="0" value="0" step="1" aria-label="Moment of the recording">
<output id="clock" for="moment"></output>
<label>Speed <select id="speed"><option value="0.1">× 0.1</option>
<option value="0.25">× 0.25</option><option value="0.5">× 0.5</option>
<option value="1" selected>× 1</option></select></label>{more}</div>"""


def write_page(
    path: str | Path,
    *,
    kind: str,
    heading: str,
    subtitle: str,
    top: str,
    body: Iterable[str],
    data: object,
    scripts: Sequence[str],
) -> None:
    """Write a page that includes plotly.js (about 5 MB) and whose policy forbids any request.

    Parameters
    ----------
    path : path
        HTML file.
    kind, heading, subtitle : str
        Plain texts, which are escaped here.
    top : str
        HTML of the top of the page.
    body : iterable of str
        HTML in parts that are written one by one, so that memory does not grow with the pictures.
    data : object
        Data for JSON, which scripts find in the element ``report-data``.
    scripts : sequence of str
        Script files of this package, which are run as one, in this order.

    Raises
    ------
    InputError
        If the file cannot be written. An existing file is then unchanged.
    """
    # As bytes, because text with letters beyond Latin takes twice the memory.
    library = files("plotly").joinpath("package_data/plotly.min.js").read_bytes()
    script = (
        "(() => {\n" + '"use strict";\n' + "".join(_asset(name) for name in scripts) + "})();\n"
    ).encode()
    page = _PAGE.substitute(
        policy=_policy((library, script)),
        title=escape(f"{heading} - rtradar"),
        kind=escape(kind),
        heading=escape(heading),
        subtitle=escape(subtitle),
        style=_asset("page.css"),
        top=top,
        body=_LATER,
        data=_LATER,
        library=_LATER,
        script=_LATER,
    )
    before, *after = (piece.encode() for piece in page.split(_LATER))
    large = ((piece.encode() for piece in body), (_json(data).encode(),), (library,), (script,))
    with atomic_file(path) as file:
        file.write(before)
        for pieces, text in zip(large, after, strict=True):
            file.writelines(pieces)
            file.write(text)


def is_page(path: Path) -> bool:
    """Return whether a regular file exists at this path and was written by `write_page`."""
    with suppress(OSError), open_regular(path) as file:
        return b'<meta name="generator" content="rtradar">' in file.read(4096)
    return False


def _asset(name: str) -> str:
    return files("rtradar.report").joinpath(name).read_text(encoding="utf-8")


def _policy(scripts: Iterable[bytes]) -> str:
    """Content security policy that allows these scripts and embedded pictures only."""
    hashes = " ".join(
        f"'sha256-{base64.b64encode(hashlib.sha256(text).digest()).decode()}'" for text in scripts
    )
    # Plotly writes style rules of its own, and pictures for download are blobs.
    sources = f"script-src {hashes}; style-src 'unsafe-inline'; img-src data: blob:"
    return f"default-src 'none'; {sources}; base-uri 'none'; form-action 'none'"


def _json(data: object) -> str:
    """Encode as JSON without any <, so that no text can end the element."""
    return json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
