"""``rtradar process`` and ``rtradar export``: IF samples from files of others, and for others."""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING

from rtradar.cli.captures import add_amount, add_settings, tell
from rtradar.cli.values import add_command, add_files, add_radar, path, there, whole
from rtradar.errors import InputError
from rtradar.system.files import check_place, write_json

if TYPE_CHECKING:
    from rtradar.cli.values import OneLineParser, Subcommands
    from rtradar.exchange import Dca1000Layout
    from rtradar.radar import Radar


def add(commands: Subcommands) -> None:
    """Add both commands."""
    add_command(
        commands,
        "process",
        "make maps, clouds, pictures and a report of IF samples, measured or simulated",
        _add_process,
        (
            "rtradar process adc_data.bin --radar iwr1443 --out out/measured",
            "rtradar process adc_data.bin --radar profile.cfg --out out/measured",
            "rtradar process out/walk --detector ca-cfar --out out/again     # run with --save-if",
        ),
    )
    add_command(
        commands,
        "export",
        "write IF samples as a radar board records them, for MATLAB, xarray, NumPy or Zarr, "
        "and clouds as PLY or PCD",
        _add_export,
        (
            "rtradar export out/walk --out samples.mat       # of a run with --save-if",
            "rtradar export out/walk --out adc.bin --format dca1000",
            "rtradar export out/walk/cloud_xyz.npz --out cloud.pcd",
        ),
    )


def _add_process(process: OneLineParser) -> None:
    from rtradar.settings import ProcessingOptions
    from rtradar.system.registries import RADARS

    process.option(
        "samples",
        "SAMPLES",
        "a .bin that a DCA1000 recorded, a .npy, .zarr, .nc or .mat file, or the folder of a run "
        "with --save-if",
        type=there,
    )
    add_radar(
        process,
        f"radar: {', '.join(RADARS)}, a TOML file, or a .cfg file of TI's mmWave SDK, which also "
        "says the order of a DCA1000's words (default: the one that the samples name)",
    )
    _add_layout(process)
    add_settings(process, ProcessingOptions.__annotations__)
    add_files(process, out="folder for the results", json="write the summary there too")
    process.flag("--open", "open the page of the results in the browser")
    add_amount(process)
    process.set_defaults(command=_process)


def _add_export(export: OneLineParser) -> None:
    export.option(
        "source",
        "SOURCE",
        "folder that rtradar run --save-if made, or a cloud: .npz, .ply or .pcd",
        type=there,
    )
    export.option(
        "--out",
        "FILE",
        "its suffix gives the format: .mat, .nc, .bin, .npy or .zarr of IF samples; "
        ".ply, .pcd or .npz of a cloud",
        type=path,
        required=True,
    )
    export.add_argument(
        "--format",
        choices=("int16", "dca1000"),
        help="what a .bin file holds: an array (chirp, tx, rx, sample, IQ), or what a DCA1000 "
        "records (default: int16)",
    )
    _add_layout(export)
    add_files(export, json="write there as JSON what was written")
    export.set_defaults(command=_export)


def _add_layout(command: OneLineParser) -> None:
    """Add the order of the words of a DCA1000."""
    command.add_argument(
        "--lanes",
        type=int,
        choices=(2, 4),
        help="LVDS lanes of the chip, for a DCA1000 (default: 4 of xWR12xx, 14xx and 22xx by the "
        "radar's name, else 2)",
    )
    command.flag("--real", "the chip sends real samples, twice as many, to a DCA1000")
    command.flag("--q-first", "the chip sends Q before I to a DCA1000, as the mmWave SDK sets it")
    command.option(
        "--rx-mask",
        "N",
        "bits of the Rx that are on, with 4 lanes (default: the first)",
        type=whole,
    )


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
    said = read_ti_cfg(options.radar, getattr(options, "board", None), preset=Radar.preset)
    if layout is None and not options.samples.with_suffix(".json").exists():
        layout = Dca1000Layout(real=said.real, q_first=said.q_first, rx_mask=said.rx_mask)
    return said.radar, layout


def _process(options: argparse.Namespace) -> int:
    check_place(options.json)
    from rtradar.settings import ProcessingOptions, RunSettings

    given = vars(options)
    settings = {name: given[name] for name in ProcessingOptions.__annotations__ if name in given}
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
    tell(options, found.summary)
    return 0


def _export(options: argparse.Namespace) -> int:
    check_place(options.json)
    if options.format == "int16" and _layout(options) is not None:
        raise InputError("--format int16 is no file of a DCA1000; leave its options out")
    from rtradar.exchange import export

    written = export(options.source, options.out, dca1000=_layout(options))
    if options.json is not None:
        write_json(options.json, written)
    axes, shape = written["axes"], written["shape"]
    if len(axes) == len(shape):
        size = ", ".join(f"{axis} {length}" for axis, length in zip(axes, shape, strict=True))
    else:
        size = f"{shape[0]} points: {', '.join(axes)}"
    print(f"{size}; {written['type']}; see {options.out}")
    return 0
