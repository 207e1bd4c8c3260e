"""What can be chosen by name: radars, readers, echo models, detectors and scenes.

The code of each is loaded on use, so that a name can be checked, or listed, at no cost.
"""

from __future__ import annotations

import os
from pathlib import Path

from rtradar.errors import InputError
from rtradar.system.checks import Table, brief, check_path, read_toml
from rtradar.system.files import shipped_folder, special_kind
from rtradar.system.registry import Registry

BOARDS = (
    "iwr1443", "iwr1642", "awr1642", "iwr1843", "awr1843", "awr2243", "iwr6843", "iwr6843ods",
    "iwr6843aop", "iwrl6432", "awr2944",
)  # fmt: skip
"""Radars that are boards of Texas Instruments."""

RADARS = Registry(
    "rtradar.radars",
    "radar",
    {
        "paper-12ghz": "rtradar.radar.presets:paper_12ghz",
        "paper-77ghz": "rtradar.radar.presets:paper_77ghz",
        **{name: f"rtradar.radar.presets:{name}" for name in (*BOARDS, "radhar", "mars")},
    },
)
"""Radars that have a name: each is made by a function without arguments."""

OR_RADAR_FILE = ", or the path of a TOML or .cfg file"
"""What else than a name says which radar is meant."""

READERS = Registry(
    "rtradar.readers",
    "motion reader",
    {
        "amc": "rtradar.motion.formats.acclaim:load_amc",
        "bvh": "rtradar.motion.formats.bvh:load_bvh",
        "c3d": "rtradar.motion.formats.c3d:load_c3d",
        "npz": "rtradar.motion.formats.joints:load_npz",
        "csv": "rtradar.motion.formats.joints:load_csv",
        "trc": "rtradar.motion.formats.c3d:load_trc",
        "motion": "rtradar.motion.formats.saved:load_saved",
    },
)
"""Readers of motion files, by the ending of the file without the dot."""

MODELS = Registry(
    "rtradar.models",
    "fidelity",
    {
        "analytic-paper": "rtradar.scatter.models.analytic:AnalyticPaper",
        "analytic": "rtradar.scatter.models.analytic:Analytic",
        "specular": "rtradar.scatter.models.specular:Specular",
        "physical-optics": "rtradar.scatter.models.physical_optics:PhysicalOptics",
        "rays": "rtradar.scatter.models.rays:Rays",
        "reference": "rtradar.scatter.models.reference:Reference",
        "auto": "rtradar.scatter.models.auto:Auto",
    },
    gone={
        "fresnel": "take 'specular' with visibility = 'gradual' (--model-option "
        "visibility=gradual), or 'physical-optics'",
    },
)
"""Every model, cheapest first, the one that chooses among them, and those of other packages."""

ACTIVITY_NAMES = (
    "walk", "kick", "punch", "jumping_jack", "stand", "sit", "bend", "squat", "wave", "jump",
    "fall", "walk_in_place", "boxing",
)  # fmt: skip
"""What synthetic actors can do; `rtradar.motion.ACTIVITIES` says how."""

DETECTORS = Registry(
    "rtradar.detectors",
    "detector",
    {
        "os-cfar": "rtradar.process.cfar:os_cfar",
        "ca-cfar": "rtradar.process.cfar:ca_cfar",
        "ti-oob": "rtradar.process.detectors:ti_oob",
    },
)
"""Functions of power (range, velocity), ``pfa`` and ``looks``, the channels summed in the power; or
of range spectra ``cube``, ``radar`` and ``window_functions``."""


RANDOM_SCENE = "random:"
"""What names of rooms begin with that are drawn by the seed after it."""


def scene_files() -> dict[str, Path]:
    """Find the scenes that come with rtradar, by name."""
    return {file.stem: file for file in sorted(shipped_folder("scenes").glob("*.toml"))}


def radar_table(source: str | Path) -> Table | None:
    """Return the table of a radar's TOML file; None for a name, and for a .cfg file.

    Raises
    ------
    InputError
        Where the file cannot be read or is not TOML, or no radar has the name.
    """
    path, name = check_path("radar", source, or_name=True), str(source)
    if path.suffix == ".toml" and name not in RADARS:
        return read_toml(path, "radar", f"give a TOML file or one of: {', '.join(RADARS)}")
    if path.suffix != ".cfg":
        RADARS.check(name, instead=OR_RADAR_FILE)
    return None


def scene_table(source: str | Path) -> tuple[Path, Table]:
    """Return the TOML file of a scene, given by its path or a name, and the file's table.

    Of ``random:SEED`` the table has the key ``random``.

    Raises
    ------
    InputError
        Where the file cannot be read or is not TOML, or no scene has the name.
    """
    path, known = check_path("scene", source, or_name=True), scene_files()
    if (seed := str(source).removeprefix(RANDOM_SCENE)) != str(source):
        if not (seed.isascii() and seed.isdecimal()):
            raise InputError(f"scene {brief(str(source))}: give a seed, as in {RANDOM_SCENE}7")
        return path, {"random": {"seed": int(seed)}}
    if path.suffix != ".toml":
        if str(source) not in known:
            raise InputError(
                f"scene {brief(str(source))} is unknown; allowed: {', '.join(known)}, "
                f"{RANDOM_SCENE}SEED, or the path of a TOML file"
            )
        path = known[str(source)]
    return path, read_toml(path, "scene", "give a TOML file or the name of a scene")


def check_activity(asked: str) -> None:
    """Raise InputError where no synthetic actor does what is asked for, traits as text left out."""
    activity = asked.partition(",")[0] if isinstance(asked, str) else brief(asked)
    if activity not in ACTIVITY_NAMES:
        raise InputError(f"unknown activity {activity!r}; allowed are {', '.join(ACTIVITY_NAMES)}")


def reader_of(path: str | Path, skeleton: str | Path | None = None) -> str:
    """Return the name of the reader of a motion file, which is there.

    Raises
    ------
    InputError
        Where no reader takes such a file, or it is no file, or none without a ``skeleton``.
    """
    file = check_path("recording", path)
    name = file.suffix.lower().removeprefix(".")
    if name == "asf" and name not in READERS:
        raise InputError(
            f"{file}: a skeleton without its motion; give the .amc, and this as --skeleton"
        )
    if name not in READERS and file.is_dir():
        raise InputError(f"{file}: a folder, not a motion file; name one of its files")
    if name not in READERS:
        known = ", ".join(f".{known}" for known in READERS)
        raise InputError(
            f"{file}: unknown kind of motion file {file.suffix!r}; allowed are {known} (an .amc "
            "with its .asf)"
        )
    # Readers of other packages may take folders, and names of what is no file; none may wait.
    if kind := special_kind(file):
        raise InputError(f"{file}: it is {kind}, not a motion file; check the path")
    # A skeleton is read before its recording.
    if name in READERS.built_in and skeleton is None and not os.path.lexists(file):
        raise InputError(
            f"{file}: cannot read this {name.upper()} file (No such file or directory); check the "
            "path"
        )
    return name
