"""What can be chosen by name: radars, readers, echo models, detectors and scenes.

The code of each is loaded on use, so that a name can be checked, or listed, at no cost.
"""

from __future__ import annotations

from pathlib import Path

from rtradar.system.files import shipped_folder
from rtradar.system.registry import Registry

BOARDS = ("iwr1443", "iwr1843", "awr1843", "awr2243", "iwr6843", "iwr6843aop", "awr2944")
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

READERS = Registry(
    "rtradar.readers",
    "motion reader",
    {
        "amc": "rtradar.motion.formats.acclaim:load_amc",
        "bvh": "rtradar.motion.formats.bvh:load_bvh",
        "c3d": "rtradar.motion.formats.c3d:load_c3d",
        "npz": "rtradar.motion.formats.joints:load_npz",
        "csv": "rtradar.motion.formats.joints:load_csv",
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
        "fresnel": "rtradar.scatter.models.fresnel:Fresnel",
        "physical-optics": "rtradar.scatter.models.physical_optics:PhysicalOptics",
        "rays": "rtradar.scatter.models.rays:Rays",
        "reference": "rtradar.scatter.models.reference:Reference",
        "auto": "rtradar.scatter.models.auto:Auto",
    },
)
"""Every model, cheapest first, the one that chooses among them, and those of other packages."""

DETECTORS = Registry(
    "rtradar.detectors",
    "detector",
    {
        "os-cfar": "rtradar.process.cfar:os_cfar",
        "ca-cfar": "rtradar.process.cfar:ca_cfar",
        "ti-oob": "rtradar.process.ti_oob:ti_oob",
    },
)
"""Functions of power (range, velocity), ``pfa`` and ``looks``, the channels summed in the power; or
of range spectra ``cube``, ``radar`` and ``window_functions``."""


def scene_files() -> dict[str, Path]:
    """Find the scenes that come with rtradar, by name."""
    return {file.stem: file for file in sorted(shipped_folder("scenes").glob("*.toml"))}
