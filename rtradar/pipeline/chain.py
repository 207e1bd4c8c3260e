"""`run`: one recording, one radar, one scene, one rung, streamed from motion to point cloud."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import platform
import time
import warnings
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from rtradar.body import Body
from rtradar.clouds import RdtCloud, RdtCloudResult, save_cloud_npz, save_ply
from rtradar.errors import InputError, ValidityWarning
from rtradar.motion import Motion, place
from rtradar.pipeline.folder import all_or_nothing
from rtradar.pipeline.store import MapStore
from rtradar.pipeline.survey import Survey, survey
from rtradar.pipeline.timing import Stages, forget_peak_memory, peak_memory_mb
from rtradar.process import SlidingWindows, os_cfar, power_map, range_spectrum
from rtradar.radar import Radar
from rtradar.report import draw_range_doppler, draw_range_time, draw_rdt_cloud
from rtradar.scatter import Rung, build_rung
from rtradar.scene import Scene
from rtradar.signal import Noise, synthesize

CLOUD_POINTS = 3000
"""Points in the RDT cloud (paper, section 3.2.4)."""

_MAX_SNR_DB = 200.0  # more than the samples' float32 can hold beside the echo
_RANGE_TIME_STEP_S = 5e-3
_PICTURE_ROWS = 1500
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
    out : path
        Folder of the files.
    """

    points: NDArray[np.float64]
    summary: dict[str, Any]
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
    forget_peak_memory()
    scene = scene or Scene()
    _check(snr_db, pfa, seed)
    with stages.time("motion"):
        placed = place(motion, start_s=start_s, duration_s=duration_s, heading_deg=heading_deg)
        body = Body.from_motion(placed)
    n_cycles = math.floor(body.duration_s / radar.cycle_duration_s * (1 + 1e-12))
    n_chirps = n_cycles * radar.n_tx
    windows = radar.window_starts(n_chirps)
    if len(windows) == 0:
        raise InputError(
            f"motion {motion.name}: the interval of {body.duration_s:.3f} s holds no whole frame of {radar.frame_duration_s} s "
            f"of radar '{radar.name}'; choose a longer one (--start, --duration)"
        )
    warm = time.perf_counter()
    rung = build_rung(fidelity, radar, body, variant=variant, spreading=spreading)
    _warm_up(rung, radar)
    warmup_s = time.perf_counter() - warm
    with warnings.catch_warnings(record=True) as caught, stages.time("survey"):
        warnings.simplefilter("always", ValidityWarning)
        surveyed = survey(rung, radar, body, n_chirps, spreading=spreading)
    for warning in caught:
        warnings.warn_explicit(warning.message, warning.category, warning.filename, warning.lineno)
    noise = Noise.for_snr(surveyed.power, snr_db, seed)
    with all_or_nothing(Path(out)) as folder:
        chain = _Chain(
            folder, radar, rung, noise, stages, n_chirps, pfa, seed, save_if, title=f"{motion.name}, {radar.name}, {fidelity}"
        )
        cloud = chain.stream()
        capture_s = n_chirps * radar.chirp_duration_s
        wall_s = time.perf_counter() - began - warmup_s
        summary = {
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
                "radar": dataclasses.asdict(radar),
            },
            "seed": seed,
            "versions": {"python": platform.python_version(), **_versions()},
            "fidelity": fidelity,
            "variant": rung.variant,
            "stages": {name: round(seconds, 4) for name, seconds in stages.seconds.items()},
            "wall_s": round(wall_s, 4),
            "warmup_s": round(warmup_s, 4),
            "capture_s": capture_s,
            "real_time_factor": round(wall_s / capture_s, 4),
            "peak_memory_mb": round(peak_memory_mb(), 1),
            "windows": len(windows),
            "chirps": n_chirps,
            "detections": cloud.n_voxels,
            "rdt_triangles": cloud.n_triangles,
            "rdt_points": len(cloud.points),
            "echo_power_m2": surveyed.power if surveyed.visible else 0.0,
            "part_power_m2": surveyed.part_power,
            "noise_power_m2": noise.power,
            "limits": _limits(surveyed, [str(warning.message) for warning in caught]),
        }
        text = json.dumps(summary, indent=2, allow_nan=False)
        (folder / "summary.json").write_text(text + "\n", encoding="utf-8")
    return Result(cloud.points, json.loads(text), Path(out))


class _Chain:
    """Signal to cloud for one capture, block by block."""

    def __init__(
        self,
        folder: Path,
        radar: Radar,
        rung: Rung,
        noise: Noise,
        stages: Stages,
        n_chirps: int,
        pfa: float,
        seed: int,
        save_if: bool,
        title: str,
    ) -> None:
        self._folder, self._radar, self._rung, self._noise, self._stages = folder, radar, rung, noise, stages
        self._n_chirps, self._pfa, self._title = n_chirps, pfa, title
        self._windows = SlidingWindows(radar)
        self._cloud = RdtCloud(radar, CLOUD_POINTS, seed)
        self._busiest: tuple[int, float, NDArray[Any], NDArray[Any]] | None = None
        self._if = _if_array(folder / "if.zarr", radar, n_chirps) if save_if else None

    def stream(self) -> RdtCloudResult:
        """All blocks, then files and pictures."""
        radar = self._radar
        block = math.ceil(radar.frame_hop_s / radar.cycle_duration_s) * radar.n_tx
        fixed = {"range": radar.range_m, "velocity": radar.velocity_mps(radar.cycles_per_frame)}
        path = self._folder / "maps.h5"
        with MapStore(path, fixed, {"title": self._title}) as store:
            for first in tqdm(range(0, self._n_chirps, block), desc=self._title, unit="block", disable=None):
                samples = self._samples(np.arange(first, min(first + block, self._n_chirps)))
                if self._if is not None:
                    with self._stages.time("write"):
                        self._if[first : first + len(samples)] = samples
                with self._stages.time("range"):
                    spectra = range_spectrum(samples, radar)
                self._range_time(store, spectra, first)
                for _, start, cube in self._windows.push(spectra):
                    self._window(store, start, cube)
        with self._stages.time("cloud"):
            cloud = self._cloud.finish()
        if not len(cloud.points):
            warnings.warn("nothing was detected: the RDT cloud is empty", ValidityWarning, stacklevel=3)
        with self._stages.time("write"):
            save_cloud_npz(self._folder / "cloud_rdt.npz", cloud.points)
            save_ply(self._folder / "cloud_rdt.ply", cloud.points)
        with self._stages.time("pictures"):
            self._draw(path, cloud)
        return cloud

    def _samples(self, chirps: NDArray[np.int64]) -> NDArray[np.complex64]:
        with self._stages.time("scatter"):
            echoes = self._rung.echoes(chirps)
        with self._stages.time("signal"):
            times = self._radar.chirp_times(len(chirps), int(chirps[0]))
            samples = synthesize(echoes, self._radar, times, dtype=np.complex64)
        with self._stages.time("noise"):
            self._noise.add(samples, self._radar, int(chirps[0]))
        return samples

    def _range_time(self, store: MapStore, spectra: NDArray[np.complex64], first: int) -> None:
        rows = max(1, round(_RANGE_TIME_STEP_S / self._radar.cycle_duration_s)) * self._radar.n_tx
        with self._stages.time("range"):
            for begin in range(0, len(spectra), rows):
                part = spectra[begin : begin + rows]
                power = (part.real**2 + part.imag**2).mean(axis=(0, 1))
                store.append("slow_time", (first + begin + len(part) / 2) * self._radar.chirp_duration_s, range_time=power)

    def _window(self, store: MapStore, start: int, cube: NDArray[np.complex64]) -> None:
        radar = self._radar
        with self._stages.time("doppler"):
            power = power_map(cube, radar)
        with self._stages.time("cfar"):
            mask = os_cfar(power, pfa=self._pfa, looks=radar.n_channels)
        middle = float(radar.window_times(np.array([start]))[0])
        with self._stages.time("cloud"):
            self._cloud.push(mask, middle)
        with self._stages.time("write"):
            store.append("time", middle, range_doppler=power, detections=mask)
        count = int(mask.sum())
        if self._busiest is None or count > self._busiest[0]:
            self._busiest = (count, middle, power, mask)

    def _draw(self, maps: Path, cloud: RdtCloudResult) -> None:
        import h5py

        with h5py.File(maps) as file:
            slow_time = file["slow_time"][:]
            every = math.ceil(len(slow_time) / _PICTURE_ROWS)
            power = file["range_time"][::every]
        draw_range_time(self._folder / "range_time.png", power, slow_time[::every], self._radar, self._title)
        if self._busiest is not None:
            _, middle, busiest, mask = self._busiest
            title = f"{self._title}, window at {middle:.2f} s"
            draw_range_doppler(self._folder / "range_doppler.png", busiest, mask, self._radar, title)
        draw_rdt_cloud(self._folder / "cloud_rdt.png", cloud.points, self._title)


def _check(snr_db: float, pfa: float, seed: int) -> None:
    if not (-_MAX_SNR_DB <= snr_db <= _MAX_SNR_DB or snr_db == math.inf):
        raise InputError(f"snr_db = {snr_db}; it must lie within +-{_MAX_SNR_DB:g} dB, or be inf for no noise (--snr-db)")
    if not 0 < pfa < 1:
        raise InputError(f"pfa = {pfa}; a false-alarm rate lies between 0 and 1, both excluded (--pfa)")
    if seed < 0:
        raise InputError(f"seed = {seed}; it must be a whole number, at least 0 (--seed)")


def _warm_up(rung: Rung, radar: Radar) -> None:
    """Compile, or load from disk, all that is compiled on first use, so that times are of the work."""
    synthesize(rung.echoes(np.arange(radar.n_tx)), radar, radar.chirp_times(radar.n_tx), dtype=np.complex64)
    os_cfar(np.ones((16, 16), dtype=np.float32), looks=radar.n_channels)


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
