"""`run`: one recording, one radar, one scene, one model, streamed from motion to point cloud."""

from __future__ import annotations

import dataclasses
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
from rtradar.pipeline.cloud_maker import Clouds
from rtradar.pipeline.output.if_array import if_array
from rtradar.pipeline.output.output_files import RUN_FILES
from rtradar.pipeline.output.summary import cost, plain, summary_of
from rtradar.pipeline.pictures.room_pictures import draw_room_pictures
from rtradar.pipeline.pictures.run_pictures import draw_pictures
from rtradar.pipeline.pictures.snapshots import moments
from rtradar.pipeline.prepare import prepare
from rtradar.pipeline.products import Products
from rtradar.pipeline.received import ReceivedWindow
from rtradar.pipeline.timing import Stages, forget_peak_memory, give_back_memory, keep_memory_low
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
    """What a run gave.

    Parameters
    ----------
    points : (point, 3) float64
        RDT cloud: time [s], range [m], velocity [m/s].
    summary : dict
        All that stands in ``summary.json``.
    survey : LinkBudget
        Echo power of each part over time, and what was hidden.
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
        Recording that is not yet placed: its chosen interval is set before the radar here.
    radar : Radar
        Radar, which the scene puts where it stands.
    scene : Scene, optional
        Free space if left out.
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
        Where something given has no meaning; nothing is written then.
    BackendError
        Where the model traces and no backend of the kind asked for works.
    ExtensionError
        Where something of another package fails.
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
    """Run these settings; see `run`."""
    began, rays_before = time.perf_counter(), rays_traced()
    keep_memory_low()
    forget_peak_memory()
    # The person is placed, and its echoes, the noise and the room's clutter are settled.
    capture = prepare(motion, radar, scene, settings, Stages())
    stages = capture.stages
    give_back_memory()  # what compiling and the pass over the whole recording took
    with atomic_folder(out, RUN_FILES, overwrite=overwrite) as folder:
        # Echoes, IF samples, range spectra, clutter removal, Doppler, detection and angles.
        clouds = _stream(capture, settings, folder)
        give_back_memory()  # the windows are the largest arrays, and pictures need room
        if not len(clouds.rdt.points):
            warnings.warn(
                "nothing was detected: the clouds are empty", ValidityWarning, stacklevel=3
            )
        with stages.time("write"):
            save_cloud_npz(folder / "cloud_rdt.npz", clouds.rdt.points)
            save_ply(folder / "cloud_rdt.ply", clouds.rdt.points)
            save_spatial_npz(folder / "cloud_xyz.npz", clouds.spatial)
        with stages.time("pictures"):
            pictures = draw_pictures(
                folder, capture.radar, clouds, capture.title, spreading=settings.spreading
            )
            if capture.inside:
                pictures |= draw_room_pictures(
                    folder, capture.radar, capture.body, scene, capture.inside, capture.title
                )
        give_back_memory()  # what pictures took, before the view and the report take theirs
        parameters = {
            "motion": motion.name,
            "scene": scene.name,
            **settings.parameters(),
            "duration_s": capture.body.duration_s,
            "radar": dataclasses.asdict(capture.radar),
        }
        summary = summary_of(
            capture, clouds, parameters, settings.seed, cost(capture, time.perf_counter() - began)
        )
        summary["rays_traced"] = rays_traced() - rays_before
        # After the model's account, for looking at it once more is no part of the capture.
        with stages.time("view"):
            save_snapshots(
                folder / "view.npz",
                moments(
                    capture.model,
                    capture.radar,
                    capture.body,
                    scene,
                    capture.windows,
                    capture.n_chirps,
                ),
            )
        with stages.time("report"):
            write_report(
                folder / "report.html",
                body=capture.body,
                radar=capture.radar,
                summary=summary,
                pictures=pictures,
                rdt_points=clouds.rdt.points,
                spatial=clouds.spatial,
            )
        summary |= cost(capture, time.perf_counter() - began) | {"files": RUN_FILES.list_of(folder)}
        text = json.dumps(summary, indent=2, allow_nan=False, default=plain)
        (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    return Result(clouds.rdt.points, json.loads(text), capture.survey, out)


def _stream(capture: Capture, settings: RunSettings, folder: Path) -> Clouds:
    """Stream a capture into ``maps.h5``, and ``if.zarr`` if asked for, and give its clouds."""
    radar, windows = capture.radar, capture.windows
    received = None
    if settings.clutter_removal != "none":
        received = ReceivedWindow(radar, int(windows[len(windows) // 2]))
    products = Products(
        folder / "maps.h5",
        radar,
        detect=capture.detect,
        seed=settings.seed,
        stages=capture.stages,
        title=capture.title,
        removal=capture.removal,
        window_functions=capture.window_functions,
        received=received,
    )
    try:
        kept = if_array(folder / "if.zarr", capture) if settings.save_if else None
        capture.stream(products, kept)
        return products.finish()
    finally:
        products.close()
