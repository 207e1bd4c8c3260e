"""`run`: one recording, one radar, one scene, one model, streamed from motion to point cloud."""

from __future__ import annotations

import dataclasses
import json
import math
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds import save_cloud_npz, save_ply, save_spatial_npz
from rtradar.errors import ValidityWarning
from rtradar.motion import Motion
from rtradar.pipeline.output.if_array import if_array
from rtradar.pipeline.output.output_files import RUN_FILES
from rtradar.pipeline.output.summary import cost, plain, summary_of
from rtradar.pipeline.pictures.room_pictures import draw_room_pictures
from rtradar.pipeline.pictures.run_pictures import draw_pictures
from rtradar.pipeline.pictures.snapshots import moments
from rtradar.pipeline.prepare import prepare
from rtradar.pipeline.products import Products
from rtradar.pipeline.received import ReceivedWindow
from rtradar.pipeline.survey import Survey
from rtradar.pipeline.timing import Stages, forget_peak_memory, give_back_memory, keep_memory_low
from rtradar.process import build_detector
from rtradar.process import clutter_removal as make_removal
from rtradar.radar import Radar
from rtradar.report import write_report
from rtradar.report.view.snapshots import save_moments
from rtradar.scene import Scene
from rtradar.system.output_folder import atomic_folder


@dataclass(frozen=True)
class Result:
    """What a run gave.

    Parameters
    ----------
    points : (point, 3) float64
        RDT cloud: time [s], range [m], velocity [m/s].
    summary : dict
        All that stands in ``summary.json``.
    survey : Survey
        Echo power of each part over time, and what was hidden.
    out : path
        Folder of the files.
    """

    points: NDArray[np.float64]
    summary: dict[str, Any]
    survey: Survey
    out: Path


def run(
    motion: Motion,
    radar: Radar,
    scene: Scene | None = None,
    *,
    out: str | Path,
    fidelity: str = "specular",
    start_s: float = 0.0,
    duration_s: float | None = None,
    heading_deg: float = 0.0,
    snr_db: float | Literal["physical"] = 20.0,
    pfa: float = 1e-6,
    seed: int = 0,
    variant: str = "auto",
    spreading: bool = True,
    save_if: bool = False,
    noise_power_m2: float | None = None,
    model_options: Mapping[str, Any] | None = None,
    clutter_removal: str = "none",
    body_material: str = "perfect-conductor",
    order: int = 1,
    keep_all: bool = False,
    detector: str = "os-cfar",
    overwrite: bool = False,
) -> Result:
    """Simulate one recording and write maps, clouds, pictures and a summary into a folder.

    Parameters
    ----------
    motion : Motion
        Not yet placed: the chosen interval is set before the radar here.
    radar : Radar
    scene : Scene, optional
        Free space if left out.
    out : path
        Folder, which is made if it is not there. The files of an earlier run that its ``summary.json`` lists are replaced or
        removed; all others stay as they are.
    fidelity : str
        The model; `rtradar.scatter.MODELS` has their names.
    start_s, duration_s : float
        Interval of the recording [s]; to its end if no duration is given.
    heading_deg : float
        Turns the person, anticlockwise seen from above, on top of the standard placement.
    snr_db : float or "physical"
        Power of the person's visible echoes over complex noise power per sample; ``inf`` for no noise; ``physical`` for the noise
        that follows from the radar's transmit power, gains and noise figure.
    pfa : float
        False-alarm rate asked of the detector in each cell.
    seed : int
        Of noise and of the cloud's sampling.
    variant : {"auto", "cpu", "llvm", "scalar", "cuda"}
        Mitsuba's backend, for models that trace rays. ``auto`` and ``cpu`` take llvm, or scalar where that does not
        work; ``cuda`` traces the rays on a GPU.
    spreading : bool
        Whether amplitudes hold 1 / (R1 R2); off as in the paper.
    save_if : bool
        Whether IF samples are kept, in ``if.zarr``.
    noise_power_m2 : float, optional
        Noise power per sample [m^2], in place of ``snr_db``: for runs that shall share it.
    model_options : mapping, optional
        Of the model, such as ``{"shadow_rays": 256}`` of ``fresnel``; its class documents them.
    clutter_removal : {"none", "mean", "exponential", "mti"}
        What takes static clutter out before Doppler; `rtradar.process.clutter` tells of each.
    body_material : {"perfect-conductor", "skin"}
        Of the person.
    order : int
        Most walls, floors and ceilings on the way of an echo.
    keep_all : bool
        Whether paths, walls and furniture are kept though they stay below the noise.
    detector : str
        What marks the cells of a map; `rtradar.process.DETECTORS` has the names.
    overwrite : bool
        Whether files that ``out`` holds under names of the new ones are replaced even where no ``summary.json`` lists them.

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
    began = time.perf_counter()
    stages = Stages()
    keep_memory_low()
    forget_peak_memory()
    scene = scene or Scene()
    removal = make_removal(clutter_removal, radar)
    detect = build_detector(detector, pfa=pfa, looks=radar.n_channels)
    capture = prepare(
        motion,
        radar,
        scene,
        stages=stages,
        fidelity=fidelity,
        start_s=start_s,
        duration_s=duration_s,
        heading_deg=heading_deg,
        snr_db=snr_db,
        pfa=pfa,
        seed=seed,
        variant=variant,
        spreading=spreading,
        noise_power_m2=noise_power_m2,
        model_options=model_options,
        body_material=body_material,
        order=order,
        keep_all=keep_all,
    )
    radar, body, inside = capture.radar, capture.body, capture.inside
    windows, n_chirps, warmup_s, title = (
        capture.windows,
        capture.n_chirps,
        capture.warmup_s,
        capture.title,
    )
    received = (
        ReceivedWindow(radar, int(windows[len(windows) // 2]))
        if clutter_removal != "none"
        else None
    )
    give_back_memory()  # what compiling and the pass over the whole recording took
    with atomic_folder(Path(out), RUN_FILES, overwrite=overwrite) as folder:
        products = Products(
            folder / "maps.h5",
            radar,
            detect=detect,
            seed=seed,
            stages=stages,
            title=title,
            removal=removal,
            received=received,
        )
        try:
            kept = if_array(folder / "if.zarr", capture) if save_if else None
            capture.stream(products, kept)
            clouds = products.finish()
        finally:
            products.close()
        del products  # its windows are the largest arrays, and pictures need room
        give_back_memory()
        if not len(clouds.rdt.points):
            warnings.warn(
                "nothing was detected: the clouds are empty", ValidityWarning, stacklevel=2
            )
        with stages.time("write"):
            save_cloud_npz(folder / "cloud_rdt.npz", clouds.rdt.points)
            save_ply(folder / "cloud_rdt.ply", clouds.rdt.points)
            save_spatial_npz(folder / "cloud_xyz.npz", clouds.spatial)
        with stages.time("pictures"):
            pictures = draw_pictures(folder, radar, clouds, title, spreading=spreading)
            if inside:
                pictures |= draw_room_pictures(folder, radar, body, scene, inside, title)
        give_back_memory()  # what pictures took, before the view and the report take theirs

        def spent() -> dict[str, Any]:
            return cost(
                stages,
                time.perf_counter() - began - warmup_s,
                warmup_s,
                n_chirps * radar.chirp_interval_s,
            )

        parameters = {
            "motion": motion.name,
            "scene": scene.name,
            "fidelity": fidelity,
            "start_s": start_s,
            "duration_s": body.duration_s,
            "heading_deg": heading_deg,
            "snr_db": "inf" if snr_db == math.inf else snr_db,
            "pfa": pfa,
            "variant": variant,
            "spreading": spreading,
            "dials": dict(model_options or {}),
            "clutter_removal": clutter_removal,
            "body_material": body_material,
            "order": order,
            "keep_all": keep_all,
            "save_if": save_if,
            "detector": detector,
            "radar": dataclasses.asdict(radar),
        }
        summary = summary_of(capture, clouds, parameters, seed, spent())
        # After the model has given its account, for looking at it once more is no part of the capture.
        with stages.time("view"):
            save_moments(
                folder / "view.npz", moments(capture.model, radar, body, scene, windows, n_chirps)
            )
        with stages.time("report"):
            write_report(
                folder / "report.html",
                body=body,
                radar=radar,
                summary=summary,
                pictures=pictures,
                rdt_points=clouds.rdt.points,
                spatial=clouds.spatial,
            )
        files = {"files": RUN_FILES.list_of(folder)}
        text = json.dumps(summary | spent() | files, indent=2, allow_nan=False, default=plain)
        (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    return Result(clouds.rdt.points, json.loads(text), capture.survey, Path(out))
