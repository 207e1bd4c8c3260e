"""Which files `run` and `compare` leave in their output folders."""

from __future__ import annotations

from collections.abc import Sequence

from rtradar.system.output_folder import OutputFiles, one_of

_RUN = (
    "maps.h5",
    "cloud_rdt.npz",
    "cloud_rdt.ply",
    "cloud_rdt.png",
    "cloud_xyz.npz",
    "cloud_xyz.png",
    "clutter_removal.png",
    "plan.png",
    "range_angle.png",
    "range_azimuth_walls.png",
    "range_doppler.png",
    "range_time.png",
    "report.html",
    "spectrogram.png",
    "summary.json",
    "view.npz",
)
_COMPARISON = (
    "compare.html",
    "compare.json",
    "compare_cloud.png",
    "compare_parts.png",
    "compare_power.png",
    "compare_range_doppler.png",
    "compare_spectrogram.png",
)

_RUN_FILES = rf"{one_of(_RUN)}|if\.zarr/(zarr\.json|c(/\d+)+)"
_RUN_FOLDERS = r"if\.zarr(/c(/\d+)*)?"

RUN_FILES = OutputFiles("summary.json", _RUN_FILES, _RUN_FOLDERS)
"""Those of `run`."""


def comparison_files(levels: Sequence[str]) -> OutputFiles:
    """Those of `compare`: its own, and in a folder for each level those of its run.

    Parameters
    ----------
    levels : sequence of str
        Names of all fidelity levels that a comparison may have.

    Returns
    -------
    OutputFiles
    """
    any_level = one_of(levels)
    return OutputFiles(
        "compare.json",
        rf"{one_of(_COMPARISON)}|({any_level})/({_RUN_FILES})",
        rf"({any_level})(/({_RUN_FOLDERS}))?",
    )
