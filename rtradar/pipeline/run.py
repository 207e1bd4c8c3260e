"""`run`: one recording, one radar, one scene, one model, streamed from motion to point cloud."""

from __future__ import annotations

import json
import time
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Unpack

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds import save_cloud_npz, save_ply, save_spatial_npz
from rtradar.errors import ValidityWarning
from rtradar.motion import Motion
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.pictures import draw_pictures
from rtradar.pipeline.prepare import prepare
from rtradar.pipeline.processing import CloudMaker, Clouds
from rtradar.pipeline.snapshots import snapshots
from rtradar.pipeline.summary import cost, plain, summary_of
from rtradar.pipeline.timing import forget_peak_memory
from rtradar.pipeline.writer import RUN_FILES, ReceivedFrame, RunWriter, if_array
from rtradar.radar import Radar
from rtradar.report import write_report
from rtradar.report.view.snapshots import save_snapshots
from rtradar.scatter.link_budget import LinkBudget
from rtradar.scene import Scene
from rtradar.settings import RunOptions, RunSettings
from rtradar.system.output_folder import atomic_folder
from rtradar.trace.rays import rays_traced


@dataclass(frozen=True)
class Result:
    """Results of a run.

    Parameters
    ----------
    points : (point, 3) float64
        RDT cloud: time [s], range [m], velocity [m/s].
    summary : dict
        Contents of ``summary.json``.
    survey : LinkBudget
        Echo power of each part over time, and its occluded fraction.
    out : path
        Folder of the files.
    """

    points: NDArray[np.float64]
    summary: dict[str, Any]
    survey: LinkBudget
    out: Path


def run(
    motion: Motion,
    radar: Radar,
    scene: Scene | None = None,
    *,
    out: str | Path,
    overwrite: bool = False,
    **options: Unpack[RunOptions],
) -> Result:
    """Simulate one recording and write maps, clouds, pictures and a summary into a folder.

    Parameters
    ----------
    motion : Motion
        Recording, not yet placed: the run places the chosen interval before the radar.
    radar : Radar
        Radar, which the scene puts at its position.
    scene : Scene, optional
        Walls and furniture around the person; free space if left out.
    out : path
        Folder, which is made if it does not exist. The files of an earlier run that its
        ``summary.json`` lists are replaced or removed; all others stay as they are.
    overwrite : bool
        Whether files that ``out`` holds under names of the new ones are replaced even where no
        ``summary.json`` lists them.
    **options
        Settings, such as ``fidelity``, ``snr_db`` or ``seed``: the fields of `rtradar.RunSettings`.

    Returns
    -------
    Result

    Raises
    ------
    InputError
        If a value is invalid; nothing is written then.
    BackendError
        If the model traces rays and no backend of the requested kind works.
    ExtensionError
        If code of another package fails.
    """
    return simulate(motion, radar, scene or Scene(), RunSettings(**options), Path(out), overwrite)


def simulate(
    motion: Motion,
    radar: Radar,
    scene: Scene,
    settings: RunSettings,
    out: Path,
    overwrite: bool = False,
) -> Result:
    """Run with these settings; see `run`."""
    started, rays_before = time.perf_counter(), rays_traced()
    forget_peak_memory()
    # Place the person, build the echo model, and settle link budget, noise and clutter.
    capture = prepare(motion, radar, scene, settings)
    with atomic_folder(out, RUN_FILES, overwrite=overwrite) as folder:
        # Echoes, IF samples, range spectra, clutter removal, Doppler, detection and angles.
        clouds = _stream(capture, folder)
        points = clouds.rdt.points
        if not len(points):
            warnings.warn(
                "nothing was detected: the clouds are empty", ValidityWarning, stacklevel=3
            )
        with capture.stages.time("write"):
            save_cloud_npz(folder / "cloud_rdt.npz", points)
            save_ply(folder / "cloud_rdt.ply", points)
            save_spatial_npz(folder / "cloud_xyz.npz", clouds.spatial)
        with capture.stages.time("pictures"):
            pictures = draw_pictures(folder, capture, clouds)
        summary = summary_of(capture, clouds, started)
        summary["rays_traced"] = rays_traced() - rays_before
        # Only now, for the echoes that the view asks for do not belong into the model's account.
        with capture.stages.time("view"):
            save_snapshots(folder / "view.npz", snapshots(capture))
        with capture.stages.time("report"):
            write_report(
                folder / "report.html",
                body=capture.body,
                radar=capture.radar,
                summary=summary,
                pictures=pictures,
                rdt_points=points,
                spatial=clouds.spatial,
            )
        summary |= cost(capture, started) | {"files": RUN_FILES.list_of(folder)}
        text = json.dumps(summary, indent=2, allow_nan=False, default=plain)
        (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    return Result(points, json.loads(text), capture.survey, out)


def _stream(capture: Capture, folder: Path) -> Clouds:
    """Stream a capture into ``maps.h5``, and ``if.zarr`` if requested; return its clouds."""
    received = None
    if capture.settings.clutter_removal != "none":
        starts = capture.frame_starts
        received = ReceivedFrame(capture.radar, int(starts[len(starts) // 2]))
    kept = if_array(folder / "if.zarr", capture) if capture.settings.save_if else None
    path = folder / "maps.h5"
    with RunWriter(path, capture.processing, capture.title, received) as writer:
        capture.stream(writer, kept)
        return writer.finish()


def clouds_of(
    motion: Motion, radar: Radar, scene: Scene | None = None, **options: Unpack[RunOptions]
) -> tuple[Clouds, float]:
    """Compute the clouds that `run` gives, without files, pictures and progress bar.

    Parameters
    ----------
    motion, radar, scene
        The same as for `run`.
    **options
        Settings, the fields of `rtradar.RunSettings`; ``variant`` is ``cpu`` if left out.

    Returns
    -------
    clouds : Clouds
        Clouds of a run with these settings. On the CPU they are the same to the byte on every
        machine.
    warmup_s : float
        Time of what a process does once, such as compiling [s].

    Raises
    ------
    InputError, BackendError
        As in `run`.
    """
    options.setdefault("variant", "cpu")  # workers share the cores
    capture = prepare(motion, radar, scene or Scene(), RunSettings(**options))
    maker = CloudMaker(capture.processing)
    capture.stream(maker, progress=False)
    return maker.finish(), capture.warmup_s
