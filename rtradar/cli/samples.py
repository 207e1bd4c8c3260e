"""``rtradar process`` and ``rtradar export``: IF samples from files of others, and for others."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtradar.cli.captures import tell
from rtradar.cli.values import settings_in
from rtradar.errors import InputError

if TYPE_CHECKING:
    from rtradar.exchange import Dca1000Layout
    from rtradar.radar import Radar


def _layout(options: argparse.Namespace) -> Dca1000Layout | None:
    """Return the order of words that the options ask for, None if they say nothing of it."""
    from rtradar.exchange import Dca1000Layout

    names = [field.name for field in dataclasses.fields(Dca1000Layout)]
    said = {name: getattr(options, name) for name in names}
    given = {
        name: value for name, value in said.items() if value is not None and value is not False
    }
    asked = given or getattr(options, "format", None) == "dca1000"
    file = getattr(options, "samples", None)
    if (
        given
        and file is not None
        and (suffix := Path(file).suffix) in (".npy", ".nc", ".mat", ".zarr")
    ):
        first = "--" + next(iter(given)).replace("_", "-")
        raise InputError(
            f"{first} is of the .bin of a DCA1000, and not of a {suffix}; leave it out"
        )
    return Dca1000Layout(**given) if asked else None


def _radar_and_layout(options: argparse.Namespace) -> tuple[Radar | None, Dca1000Layout | None]:
    """Return the radar, and the order of words by the options, else by the .cfg file.

    Where a JSON file lies beside the samples it says the order, for rtradar wrote both.
    """
    from rtradar.exchange import Dca1000Layout
    from rtradar.radar import Radar
    from rtradar.radar.ti_cfg import read_ti_cfg

    layout = _layout(options)
    if options.radar is None or not options.radar.endswith(".cfg"):
        radar = None if options.radar is None else Radar.load(options.radar, board=options.board)
        return radar, layout
    said = read_ti_cfg(options.radar, getattr(options, "board", None))
    if layout is None and not options.samples.with_suffix(".json").exists():
        layout = Dca1000Layout(real=said.real, q_first=said.q_first, rx_mask=said.rx_mask)
    return said.radar, layout


def process(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar process``."""
    from rtradar.settings import RunSettings

    settings = settings_in(options)
    RunSettings(**settings)  # refuses what is wrong before anything slow is imported
    from rtradar.exchange import open_samples

    samples = open_samples(options.samples, *_radar_and_layout(options))
    if samples.radar is None:
        raise InputError(f"'{options.samples}' does not tell of its radar; name it (--radar)")
    from rtradar.pipeline import process_samples
    from rtradar.pipeline.timing import lines_shown

    with lines_shown():
        found = process_samples(
            samples,
            samples.radar,
            options.out,
            overwrite=options.overwrite,
            unit=samples.unit,
            **settings,
        )
    yield found.summary
    tell(options, found.summary)


def export(options: argparse.Namespace) -> Iterator[Mapping[str, Any]]:
    """Do ``rtradar export``."""
    if options.format == "int16" and _layout(options) is not None:
        raise InputError("--format int16 is no file of a DCA1000; leave its options out")
    from rtradar import exchange

    written = exchange.export(options.source, options.out, dca1000=_layout(options))
    yield written
    axes, shape = written["axes"], written["shape"]
    if len(axes) == len(shape):
        size = ", ".join(f"{axis} {length}" for axis, length in zip(axes, shape, strict=True))
    else:
        size = f"{shape[0]} points: {', '.join(axes)}"
    print(f"{size}; {written['type']}; see {options.out}")
