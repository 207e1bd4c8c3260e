"""Comparison page, ``compare.html``: several models in one file that opens without a network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

from rtradar.report.figures.field_units import FieldUnit
from rtradar.report.pages.sections import mapping_table, picture, table

_PAGE = Template("""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy"
content="default-src 'none'; style-src 'unsafe-inline'; img-src data:">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>$title - rtradar compare</title>
<style>
$style</style>
</head>
<body>
<header>
<p class="kind">rtradar compare</p>
<h1>$title</h1>
<p class="sub">$models</p>
</header>
<main>
<section><h2>What differs</h2>$measures
<p class="note">Differences are to the reference, $reference. Maps are compared in decibels:
range-Doppler in the cells that either model detects, spectrograms in the cells 10 dB above the
median of either. All models have the same noise, sample by sample. Echo power is of one chirp every
10 ms, each from another Tx, which makes it saw.</p></section>
<section id="maps"><h2>Side by side</h2><div class="pictures">$pictures</div></section>
<div class="tables"><section><h2>Seconds a stage</h2>$stages</section>
<section><h2>Mean echo power by part: $unit</h2>$parts</section>
<section><h2>Parameters</h2>$parameters</section></div>
</main>
</body>
</html>
""")


def write_comparison(
    path: Path,
    summary: Mapping[str, Any],
    rows: Sequence[Sequence[str]],
    pictures: Mapping[str, Path],
    unit: FieldUnit,
) -> None:
    """Write a comparison as a page with its table and its pictures.

    Parameters
    ----------
    path : path
        HTML file.
    summary : mapping
        Content of ``compare.json``.
    rows : sequence of sequence of str
        Rows of the table: a heading row, then one row for each measure.
    pictures : mapping of title to path
        PNG files in the order of the page.
    unit : FieldUnit
        Unit of the echo power of parts.
    """
    fidelities = summary["fidelities"]
    names = list(fidelities)
    stages = {stage: None for found in fidelities.values() for stage in found["stages"]}
    parts = list(next(iter(fidelities.values()))["part_power_m2"])
    parameters = {key: value for key, value in summary["parameters"].items() if key != "radar"}
    page = _PAGE.substitute(
        title=escape(str(summary["parameters"]["motion"])),
        models=escape(f"{summary['parameters']['radar']['name']}: {', '.join(names)}"),
        reference=escape(summary["reference"]),
        style=files("rtradar.report").joinpath("page.css").read_text(encoding="utf-8"),
        measures=table(rows[1:], rows[0]),
        pictures="\n".join(picture(title, file) for title, file in pictures.items()),
        stages=table(
            [
                [stage, *(_figure(fidelities[name]["stages"].get(stage)) for name in names)]
                for stage in stages
            ],
            ["", *names],
        ),
        parts=table(
            [
                [part, *(_level(fidelities[name]["part_power_m2"][part], unit) for name in names)]
                for part in parts
            ],
            ["", *names],
        ),
        unit=escape(unit.label()),
        parameters=mapping_table(parameters),
    )
    path.write_text(page, encoding="utf-8", newline="\n")


def _figure(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _level(power: float, unit: FieldUnit) -> str:
    return f"{float(unit.level(power)):.1f}" if power > 0 else "hidden"
