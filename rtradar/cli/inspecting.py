"""``rtradar inspect``: what a file means, as it would be read, before anything is simulated."""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtradar.cli.values import add_command, add_files, add_reading, path
from rtradar.system.checks import read_toml
from rtradar.system.files import check_place, write_json

if TYPE_CHECKING:
    from rtradar.cli.values import OneLineParser, Subcommands

_SAMPLES = (".bin", ".npy", ".zarr", ".nc", ".mat")
_OF_SCENES = ("room", "walls", "furniture", "objects", "people", "person_position_m")
"""Keys of TOML files that tell a scene from a radar."""


def add(commands: Subcommands) -> None:
    """Add the command."""
    add_command(
        commands,
        "inspect",
        "say what a recording, a radar, a scene or IF samples mean: unit, axis, rate, sizes",
        _add_inspect,
        (
            "rtradar inspect walk.bvh",
            "rtradar inspect walk.amc --skeleton walk.asf --json walk.json",
            "rtradar inspect profile.cfg",
        ),
    )


def _add_inspect(command: OneLineParser) -> None:
    command.option(
        "file", "FILE", "a recording, a radar (TOML or .cfg), a scene (TOML) or IF samples"
    )
    command.option("--skeleton", "ASF", "the .asf file that an .amc recording needs", type=path)
    add_reading(command)
    add_files(command, json="write what was found there as JSON")
    command.set_defaults(command=_inspect)


def _inspect(options: argparse.Namespace) -> int:
    check_place(options.json)
    file = Path(options.file)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        kind, found, text = _look(file, options)
    said = [str(warning.message) for warning in caught]
    print("\n".join([text, *(f"warning: {line}" for line in said)]))
    if options.json is not None:
        write_json(options.json, {"file": str(file), "kind": kind, **found, "warnings": said})
    return 0


def _look(file: Path, options: argparse.Namespace) -> tuple[str, dict[str, Any], str]:
    """Return the kind of a file, values of what was found, and text about it."""
    suffix = file.suffix.lower()
    if suffix in _SAMPLES:
        return _samples(file)
    if suffix == ".cfg" or (suffix == ".toml" and not _is_scene(file)):
        from rtradar.radar import Radar

        radar = Radar.load(file)
        names = (
            "range_bin_m",
            "max_range_m",
            "velocity_bin_mps",
            "max_velocity_mps",
            "n_tx",
            "n_rx",
        )
        return "radar", {"name": radar.name} | {n: getattr(radar, n) for n in names}, repr(radar)
    if suffix == ".toml":
        from rtradar.scene import Scene

        scene = Scene.load(file)
        counts = {n: len(getattr(scene, n)) for n in ("walls", "furniture", "objects", "people")}
        return "scene", {"name": scene.name, **counts}, repr(scene)
    return _motion(file, options)


def _is_scene(file: Path) -> bool:
    return any(key in read_toml(file, "file", "give a TOML file") for key in _OF_SCENES)


def _samples(file: Path) -> tuple[str, dict[str, Any], str]:
    from rtradar.exchange import open_samples

    samples = open_samples(file)
    chirps, rx, of_chirp = samples.shape
    radar = None if samples.radar is None else samples.radar.name
    tx = "" if samples.tx_per_cycle is None else f", {samples.tx_per_cycle} Tx a cycle"
    whose = "which does not tell of its radar (--radar)" if radar is None else f"of radar {radar}"
    text = f"IF samples {whose}: {chirps} chirps, {rx} Rx, {of_chirp} samples a chirp{tx}"
    found = {"radar": radar, "chirps": chirps, "rx": rx, "samples_per_chirp": of_chirp}
    return "samples", found | {"tx_per_cycle": samples.tx_per_cycle, "unit": samples.unit}, text


def _motion(file: Path, options: argparse.Namespace) -> tuple[str, dict[str, Any], str]:
    from rtradar.motion import load_motion
    from rtradar.motion.skeleton import to_nodes

    motion = load_motion(
        file, options.skeleton, up=options.up or "auto", unit=options.unit, rate_hz=options.rate
    )
    to_nodes(motion)  # which names a joint that lacks
    found: dict[str, Any] = {one.name: one.value for one in motion.findings}
    found |= {"frames": len(motion.root_positions), "duration_s": motion.duration_s}
    found["joints"] = list(motion.joints)
    lines = [f"  {one.text}" for one in motion.findings]
    return "motion", found, "\n".join([repr(motion).rstrip(), *lines])
