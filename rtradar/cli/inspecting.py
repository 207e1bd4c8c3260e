"""``rtradar inspect``: what a file means, as it would be read, before anything is simulated."""

from __future__ import annotations

import argparse
import dataclasses
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rtradar.system.checks import read_toml
from rtradar.system.registries import READERS

_OF_RADARS = ("range_bin_m", "max_range_m", "velocity_bin_mps", "max_velocity_mps", "n_tx", "n_rx")


def inspect(options: argparse.Namespace) -> Mapping[str, Any]:
    """Do ``rtradar inspect``."""
    file = Path(options.file)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        kind, found, text = _look(file, options)
    said = [str(warning.message) for warning in caught]
    print("\n".join([text, *(f"warning: {line}" for line in said)]))
    return {"file": str(file), "kind": kind, **found, "warnings": said}


def _look(file: Path, options: argparse.Namespace) -> tuple[str, dict[str, Any], str]:
    """Return the kind of a file, values of what was found, and text about it."""
    suffix = file.suffix.lower()
    if suffix in (".cfg", ".toml"):
        return _described(file, options)
    if suffix.removeprefix(".") not in READERS:
        from rtradar.exchange import IF_FORMATS

        if suffix in IF_FORMATS:
            return _samples(file, options)
    return _motion(file, options)


def _described(file: Path, options: argparse.Namespace) -> tuple[str, dict[str, Any], str]:
    """Look at a radar or a scene, of which a radar has fields beside its name."""
    from rtradar.radar import Radar

    fields = {field.name for field in dataclasses.fields(Radar)} - {"name"} | {"base", "board"}
    if file.suffix.lower() == ".cfg" or fields & read_toml(file, "file", "check the path").keys():
        radar = Radar.load(file, board=options.board)
        values = {name: getattr(radar, name) for name in _OF_RADARS}
        return "radar", {"name": radar.name, **values}, repr(radar)
    from rtradar.scene import Scene

    scene = Scene.load(file)
    counts = {n: len(getattr(scene, n)) for n in ("walls", "furniture", "objects", "people")}
    return "scene", {"name": scene.name, **counts}, repr(scene)


def _samples(file: Path, options: argparse.Namespace) -> tuple[str, dict[str, Any], str]:
    from rtradar.exchange import open_samples
    from rtradar.radar import Radar

    given = None if options.radar is None else Radar.load(options.radar, board=options.board)
    samples = open_samples(file, given)
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
        file, options.skeleton, up=options.up, unit=options.unit, rate_hz=options.rate
    )
    to_nodes(motion)  # which names a joint that lacks
    found: dict[str, Any] = {one.name: one.value for one in motion.findings}
    found |= {"frames": len(motion.root_positions), "duration_s": motion.duration_s}
    found["joints"] = list(motion.joints)
    lines = [f"  {one.text}" for one in motion.findings]
    return "motion", found, "\n".join([repr(motion).rstrip(), *lines])
