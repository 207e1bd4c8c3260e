"""`run`: one recording, one radar, one scene, one rung, streamed from motion to point cloud."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import platform
import time
import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from rtradar.body import Body
from rtradar.clouds import save_cloud_npz, save_ply, save_spatial_npz
from rtradar.echoes import Echoes
from rtradar.errors import InputError, ValidityWarning
from rtradar.motion import Motion, place
from rtradar.pipeline.folder import all_or_nothing
from rtradar.pipeline.indoors import indoors
from rtradar.pipeline.pictures import draw_pictures
from rtradar.pipeline.products import Products
from rtradar.pipeline.received import ReceivedWindow
from rtradar.pipeline.room import RoomIf
from rtradar.pipeline.room_pictures import draw_room_pictures
from rtradar.pipeline.survey import Survey, survey
from rtradar.pipeline.timing import Stages, forget_peak_memory, give_back_memory, keep_memory_low, peak_memory_mb
from rtradar.process import angle_spectra, cell_spectra, measures_angle, os_cfar, range_spectrum
from rtradar.process import clutter_removal as make_removal
from rtradar.radar import Radar
from rtradar.report import write_report
from rtradar.scatter import Accountable, Rung, build_rung
from rtradar.scatter.multipath import Multipath
from rtradar.scene import Scene
from rtradar.signal import Noise, synthesize

_MAX_SNR_DB = 200.0  # more than the samples' float32 can hold beside the echo
_VERSIONS = ("rtradar", "mitsuba", "drjit", "numpy", "scipy", "numba", "scikit-image", "trimesh")


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
    snr_db: float = 20.0,
    pfa: float = 1e-6,
    seed: int = 0,
    variant: str = "auto",
    spreading: bool = True,
    save_if: bool = False,
    noise_power_m2: float | None = None,
    dials: Mapping[str, Any] | None = None,
    clutter_removal: str = "none",
    body_material: str = "perfect-conductor",
    order: int = 1,
    keep_all: bool = False,
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
        Folder; files of the same name in it are replaced, others left alone.
    fidelity : str
        The rung; `rtradar.scatter.RUNGS` has their names.
    start_s, duration_s : float
        Interval of the recording [s]; to its end if no duration is given.
    heading_deg : float
        Turns the person, anticlockwise seen from above, on top of the standard placement.
    snr_db : float
        Power of the person's visible echoes over complex noise power per sample; ``inf`` for no noise.
    pfa : float
        False-alarm rate asked of OS-CFAR in each cell.
    seed : int
        Of noise and of the cloud's sampling.
    variant : {"auto", "llvm", "scalar", "cuda"}
        Mitsuba's backend, for rungs that trace.
    spreading : bool
        Whether amplitudes hold 1 / (R1 R2); off as in the paper.
    save_if : bool
        Whether IF samples are kept, in ``if.zarr``.
    noise_power_m2 : float, optional
        Noise power per sample [m^2], in place of ``snr_db``: for runs that shall share it.
    dials : mapping, optional
        Of the rung, such as ``{"shadow_rays": 256}`` of ``fresnel``; its class documents them.
    clutter_removal : {"none", "mean", "exponential", "mti"}
        What takes static clutter out before Doppler; `rtradar.process.clutter` tells of each.
    body_material : {"perfect-conductor", "skin"}
        Of the person.
    order : int
        Most walls, floors and ceilings on the way of an echo.
    keep_all : bool
        Whether paths, walls and furniture are kept though they stay below the noise.

    Returns
    -------
    Result

    Raises
    ------
    InputError
        Where something given has no meaning; nothing is written then.
    BackendError
        Where the rung traces and no backend of the kind asked for works.
    """
    began = time.perf_counter()
    stages = Stages()
    keep_memory_low()
    forget_peak_memory()
    scene = scene or Scene()
    _check(snr_db, pfa, seed)
    removal = make_removal(clutter_removal, radar)
    walled = bool(scene.walls or scene.furniture)
    with stages.time("motion"):
        radar = scene.place(radar)
        heading = heading_deg + scene.heading_deg
        placed = place(motion, start_s=start_s, duration_s=duration_s, heading_deg=heading)
        body = Body.from_motion(placed.shifted([*scene.person_position_m, 0.0]))
    n_cycles = math.floor(body.duration_s / radar.cycle_duration_s * (1 + 1e-12))
    n_chirps = n_cycles * radar.n_tx
    windows = radar.window_starts(n_chirps)
    if len(windows) == 0:
        raise InputError(
            f"motion {motion.name}: the interval of {body.duration_s:.3f} s holds no whole frame of {radar.frame_duration_s} s "
            f"of radar '{radar.name}'; choose a longer one (--start, --duration)"
        )
    warm = time.perf_counter()
    paths: Multipath | None = None
    rung: Rung
    if walled:
        if dials:
            raise InputError(f"fidelity '{fidelity}' has no dial '{next(iter(dials))}' in scene '{scene.name}'; leave it out")
        paths = Multipath(
            radar, body, scene, variant=variant, spreading=spreading, order=order, fidelity=fidelity, material=body_material
        )
        rung = paths.person
    else:
        of_skin = {} if body_material == "perfect-conductor" else {"material": body_material}
        rung = build_rung(fidelity, radar, body, variant=variant, spreading=spreading, **(dials or {}), **of_skin)
    _warm_up(paths or rung, radar)
    warmup_s = time.perf_counter() - warm
    with warnings.catch_warnings(record=True) as caught, stages.time("survey"):
        warnings.simplefilter("always", ValidityWarning)
        surveyed = survey(rung, radar, body, n_chirps, spreading=spreading)
    for warning in caught:
        warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    noise = Noise.for_snr(surveyed.power, snr_db, seed) if noise_power_m2 is None else Noise(noise_power_m2, seed)
    title = f"{motion.name}, {radar.name}, {fidelity}" + (f", {scene.name}" if walled else "")
    inside = None
    if paths is not None:
        with stages.time("room"):
            inside = indoors(
                paths,
                radar,
                body,
                scene,
                variant=variant,
                order=order,
                seed=seed,
                n_chirps=n_chirps,
                person_power_m2=surveyed.power,
                noise_power_m2=noise.power,
                keep_all=keep_all,
            )
        rung = inside.rung
    received = ReceivedWindow(radar, int(windows[len(windows) // 2])) if clutter_removal != "none" else None
    give_back_memory()  # what compiling and the pass over the whole recording took
    with all_or_nothing(Path(out)) as folder:
        products = Products(
            folder / "maps.h5", radar, pfa=pfa, seed=seed, stages=stages, title=title, removal=removal, received=received
        )
        try:
            kept = _if_array(folder / "if.zarr", radar, n_chirps) if save_if else None
            _stream(radar, rung, inside.room if inside else None, noise, products, stages, n_chirps, kept, title)
            clouds = products.finish()
        finally:
            products.close()
        del products  # its windows are the largest arrays, and pictures need room
        if not len(clouds.rdt.points):
            warnings.warn("nothing was detected: the clouds are empty", ValidityWarning, stacklevel=2)
        with stages.time("write"):
            save_cloud_npz(folder / "cloud_rdt.npz", clouds.rdt.points)
            save_ply(folder / "cloud_rdt.ply", clouds.rdt.points)
            save_spatial_npz(folder / "cloud_xyz.npz", clouds.spatial)
        with stages.time("pictures"):
            pictures = draw_pictures(folder, radar, clouds, title)
            if inside:
                pictures |= draw_room_pictures(folder, radar, body, scene, inside, title)
        capture_s = n_chirps * radar.chirp_duration_s

        def cost() -> dict[str, Any]:
            wall_s = time.perf_counter() - began - warmup_s
            return {
                "stages": stages.rounded(),
                "wall_s": round(wall_s, 4),
                "warmup_s": round(warmup_s, 4),
                "capture_s": capture_s,
                "real_time_factor": round(wall_s / capture_s, 4),
                "peak_memory_mb": round(peak_memory_mb(), 1),
            }

        summary: dict[str, Any] = {
            "parameters": {
                "motion": motion.name,
                "scene": scene.name,
                "fidelity": fidelity,
                "start_s": start_s,
                "duration_s": body.duration_s,
                "heading_deg": heading_deg,
                "snr_db": "inf" if math.isinf(snr_db) else snr_db,
                "pfa": pfa,
                "variant": variant,
                "spreading": spreading,
                "dials": dict(dials or {}),
                "clutter_removal": clutter_removal,
                "body_material": body_material,
                "order": order,
                "keep_all": keep_all,
                "radar": dataclasses.asdict(radar),
            },
            "seed": seed,
            "versions": {"python": platform.python_version(), **_versions()},
            "fidelity": fidelity,
            "variant": rung.variant,
            **cost(),
            "windows": len(windows),
            "chirps": n_chirps,
            "detections": clouds.rdt.n_voxels,
            "rdt_triangles": clouds.rdt.n_triangles,
            "rdt_points": len(clouds.rdt.points),
            "xyz_points": len(clouds.spatial.points),
            "xyz_points_found": clouds.n_spatial,
            "echo_power_m2": surveyed.power if surveyed.visible else 0.0,
            "part_power_m2": surveyed.part_power,
            "noise_power_m2": noise.power,
            "limits": _limits(surveyed, [str(warning.message) for warning in caught]),
            **({"modelled": rung.account()} if isinstance(rung, Accountable) else {}),
            **({"room": inside.account} if inside else {}),
        }
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
        text = json.dumps(summary | cost(), indent=2, allow_nan=False)
        (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    return Result(clouds.rdt.points, json.loads(text), surveyed, Path(out))


def _stream(
    radar: Radar,
    rung: Rung,
    room: RoomIf | None,
    noise: Noise,
    products: Products,
    stages: Stages,
    n_chirps: int,
    kept: Any,
    title: str,
) -> None:
    """Echoes a hop of the windows at a time, and from them IF samples, noise and range spectra by smaller pieces."""
    block = math.ceil(radar.frame_hop_s / radar.cycle_duration_s) * radar.n_tx
    piece = products.piece if kept is None else block  # which is a chunk of the array

    def spectra(echoes: Echoes, first: int) -> NDArray[np.complex64]:
        with stages.time("signal"):
            samples = synthesize(echoes, radar, radar.chirp_times(len(echoes.tx), first), dtype=np.complex64)
        if room is not None:
            with stages.time("clutter"):
                room.add(samples, np.arange(first, first + len(samples)))
        with stages.time("noise"):
            noise.add(samples, radar, first)
        if kept is not None:
            with stages.time("write"):
                kept[first : first + len(samples)] = samples
        with stages.time("range"):
            return range_spectrum(samples, radar)

    def take(chirps: NDArray[np.int64]) -> None:
        with stages.time("scatter"):
            echoes = rung.echoes(chirps)
        for begin in range(0, len(chirps), piece):
            products.take(spectra(_chirps_of(echoes, begin, begin + piece), int(chirps[begin])), int(chirps[begin]))

    # In functions, for what a loop leaves bound would still be held while the next block is made.
    for first in tqdm(range(0, n_chirps, block), desc=title, unit="block", disable=None):
        take(np.arange(first, min(first + block, n_chirps)))


def _chirps_of(echoes: Echoes, begin: int, end: int) -> Echoes:
    """Those of some chirps of the block."""
    chirps = slice(begin, end)
    return dataclasses.replace(echoes, length=echoes.length[chirps], amplitude=echoes.amplitude[:, chirps], tx=echoes.tx[chirps])


def _check(snr_db: float, pfa: float, seed: int) -> None:
    if not (-_MAX_SNR_DB <= snr_db <= _MAX_SNR_DB or snr_db == math.inf):
        raise InputError(f"snr_db = {snr_db}; it must lie within +-{_MAX_SNR_DB:g} dB, or be inf for no noise (--snr-db)")
    if not 0 < pfa < 1:
        raise InputError(f"pfa = {pfa}; a false-alarm rate lies between 0 and 1, both excluded (--pfa)")
    if seed < 0:
        raise InputError(f"seed = {seed}; it must be a whole number, at least 0 (--seed)")


def _warm_up(rung: Rung, radar: Radar) -> None:
    """Compile, or load from disk, all that is compiled on first use, so that times are of the work."""
    # A slice of more, as in the stream: code is compiled for how arrays lie in memory.
    echoes = _chirps_of(rung.echoes(np.arange(2 * radar.n_tx)), 0, radar.n_tx)
    synthesize(echoes, radar, radar.chirp_times(radar.n_tx), dtype=np.complex64)
    os_cfar(np.ones((16, 16), dtype=np.float32), looks=radar.n_channels)
    if measures_angle(radar):
        cycle = np.zeros((1, radar.n_tx, radar.n_rx, radar.samples_per_chirp), dtype=np.complex64)
        angle_spectra(cell_spectra(cycle, radar, [0], [0]), radar, [0.0], [0.0])


def _if_array(path: Path, radar: Radar, n_chirps: int) -> Any:
    import zarr

    block = math.ceil(radar.frame_hop_s / radar.cycle_duration_s) * radar.n_tx
    shape = (n_chirps, radar.n_rx, radar.samples_per_chirp)
    array = zarr.create_array(
        path, shape=shape, chunks=(block, *shape[1:]), dtype="complex64", dimension_names=("chirp", "rx", "sample")
    )
    array.attrs.update({"units": "m", "chirp_duration_s": radar.chirp_duration_s, "sample_rate_hz": radar.sample_rate_hz})
    return array


def _limits(surveyed: Survey, warned: list[str]) -> list[dict[str, Any]]:
    limits: list[dict[str, Any]] = [dataclasses.asdict(limit) for limit in surveyed.limits]
    if not surveyed.visible:
        limits += [{"name": "nobody_visible", "share": 0.0, "message": message} for message in warned]
    return limits


def _versions() -> dict[str, str]:
    found = {}
    for name in _VERSIONS:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "not installed"
    return found | {"cores": str(os.cpu_count())}
