"""Comparison page, ``compare.html``: several models in one file that opens without a network."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path
from string import Template
from typing import Any

from rtradar.report.figures.canvas import FieldUnit
from rtradar.report.pages.html import Titles, mapping_table, picture, table, write_page

_DIFFERENCES = Template("""<section><h2>What differs</h2>$measures
<p class="note">Differences are to the reference, $reference. Maps are compared in decibels:
range-Doppler in the cells that either model detects, spectrograms in the cells 10 dB above the
median of either. All models have the same noise, sample by sample. Echo power is of one chirp every
10 ms, each from another Tx, which makes it saw.</p></section>""")
_TABLES = Template("""<div class="tables"><section><h2>Seconds a stage</h2>$stages</section>
<section><h2>Mean echo power by part: $unit</h2>$parts</section>
<section><h2>Parameters</h2>$parameters</section></div>
""")


def write_comparison(
    path: Path,
    summary: Mapping[str, Any],
    rows: Sequence[Sequence[str]],
    pictures: Mapping[str, Path],
    unit: FieldUnit,
) -> None:
    """Write a comparison as a page with its table and its pictures.

    ``summary`` is the content of ``compare.json``; ``rows`` are a heading row and one row for each
    measure; ``pictures`` are PNG files by their titles; ``unit`` is that of the power of parts.
    """
    models = summary["fidelities"]
    stages = {stage: None for found in models.values() for stage in found["stages"]}
    parts = next(iter(models.values()))["part_power_m2"]
    parameters = {key: value for key, value in summary["parameters"].items() if key != "radar"}
    columns = ["", *models]
    times = [
        [stage, *(_seconds(model["stages"].get(stage)) for model in models.values())]
        for stage in stages
    ]
    levels = [
        [part, *(_level(model["part_power_m2"][part], unit) for model in models.values())]
        for part in parts
    ]
    subtitle = f"{summary['parameters']['radar']['name']}: {', '.join(models)}"
    shown = "\n".join(picture(title, file) for title, file in pictures.items())
    figures = f'<div class="pictures">{shown}</div>'
    tables = _TABLES.substitute(
        stages=table(times, columns),
        parts=table(levels, columns),
        unit=escape(unit.label()),
        parameters=mapping_table(parameters),
    )
    write_page(
        path,
        Titles("rtradar compare", str(summary["parameters"]["motion"]), subtitle),
        _DIFFERENCES.substitute(
            measures=table(rows[1:], rows[0]), reference=escape(summary["reference"])
        ),
        (f'<section id="maps"><h2>Side by side</h2>{figures}</section>', tables),
    )


def _seconds(value: float | None) -> str:
    return "-" if value is None else f"{value:.3f}"


def _level(power: float, unit: FieldUnit) -> str:
    return f"{float(unit.level(power)):.1f}" if power > 0 else "hidden"
