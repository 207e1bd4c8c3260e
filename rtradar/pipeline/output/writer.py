"""Files that a run writes while it streams: the maps, and the IF samples if they are kept.

Maps are HDF5 files that grow step by step, with their axes: netCDF-4 to those who read them so.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import h5py
import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.body import Body
from rtradar.clouds import SpatialCloud, save_cloud_npz, save_ply, save_spatial_npz
from rtradar.clouds.sample_files import TABLES, Array
from rtradar.errors import InputError, ValidityWarning
from rtradar.exchange.recording import new_store
from rtradar.motion.skeleton import NODES
from rtradar.pipeline.output.truth import (
    EchoTable,
    Parts,
    parts_of,
    truth_of,
    truth_of_parts,
)
from rtradar.pipeline.processing import (
    RANGE_TIME_S,
    CloudMaker,
    Clouds,
    Processing,
    block_chirps,
    frame_angles,
)
from rtradar.pipeline.sources import Sources
from rtradar.process import (
    SlidingRangeTime,
    angle_grid,
    measured_angles,
    power_map,
    range_azimuth,
    range_elevation,
)
from rtradar.radar import Radar
from rtradar.signal.multiplexing import chirps_together
from rtradar.system.hdf5 import LastingFile, netcdf_array
from rtradar.system.output_folder import OutputFiles, one_of

if TYPE_CHECKING:
    import xarray as xr

_FILES = (
    *("maps.h5", "cloud_rdt.npz", "cloud_rdt.ply", "cloud_rdt.png", "cloud_xyz.npz"),
    *("cloud_xyz.png", "clutter_removal.png", "plan.png", "range_angle.png"),
    *("range_azimuth_walls.png", "range_doppler.png", "range_time.png", "report.html"),
    *("run.toml", "spectrogram.png", "summary.json", "view.npz"),
)
_RUN_FILES = rf"{one_of(_FILES)}|person-\d+\.motion|if\.zarr/(zarr\.json|c(/\d+)+)"
_RUN_FOLDERS = r"if\.zarr(/c(/\d+)*)?"

RUN_FILES = OutputFiles("summary.json", _RUN_FILES, _RUN_FOLDERS)
"""Files of `run`."""


def files_of_pictures(names: Iterable[str]) -> list[str]:
    """Return PNG files and the PDF files of the same names."""
    return [file for name in names for file in (name, name.replace(".png", ".pdf"))]


def files_of_runs(listing: str, own: Sequence[str], folders: Sequence[str]) -> OutputFiles:
    """Return the files of a command that has some of its ``own``, and a run in each folder."""
    runs = one_of(folders)
    return OutputFiles(
        listing, rf"{one_of(own)}|({runs})/({_RUN_FILES})", rf"({runs})(/({_RUN_FOLDERS}))?"
    )


def axes_of(processing: Processing) -> dict[str, NDArray[np.float64]]:
    """Return the axes of maps beside those of time; angles that are not measured have none."""
    radar = processing.radar
    axes = {
        "range": radar.range_m,
        "velocity": radar.velocity_mps(radar.cycles_per_frame),
        "spectrogram_velocity": radar.velocity_mps(processing.window_cycles),
    }
    return axes | {name: angle_grid(radar) for name in measured_angles(radar)}


class RunWriter(AbstractContextManager["RunWriter"]):
    """Makes maps and clouds from the range spectra of one capture, and writes the maps to ``file``.

    A path, whose file is replaced, or an open file may be given. Where a ``table`` of echoes is
    known, cells have their source, and what is true of each part is written too. If clutter is
    removed, the map of the middle one of ``frame_starts``, first cycles of the frames, is also kept
    as it was before; of none if they are left out. So that memory stays low, `push` takes at most
    ``max_chirps`` chirps.
    """

    def __init__(
        self,
        file: Path | BinaryIO,
        processing: Processing,
        title: str,
        frame_starts: Sequence[int] | NDArray[np.int64] = (),
        table: EchoTable | None = None,
    ) -> None:
        self._processing, self._table = processing, table
        radar, removal = processing.radar, processing.removal
        self._clouds = CloudMaker(processing, None if table is None else Sources(table).of_cells)
        self._spectrogram = processing.spectrogram()
        self._range_time = SlidingRangeTime(radar, removal, step_s=RANGE_TIME_S)
        self.max_chirps = self._clouds.max_chirps
        self._angle_names = measured_angles(radar)
        # Each kind of map has frames of its own length, over which clutter is removed.
        removed = {
            "time": removal.description(radar.cycles_per_frame),
            "slow_time": removal.description(self._range_time.window_cycles),
            "spectrogram_time": removal.description(processing.window_cycles),
        }
        # The middle frame is kept as received only where something is removed from it.
        self._received: list[NDArray[np.complexfloating]] = []
        self._kept_cycle = None
        if len(frame_starts) and removed["time"] != "none":
            self._kept_cycle = int(frame_starts[len(frame_starts) // 2])
        said = {"title": title} | ({"gaps": text} if (text := radar.gaps_text) else {})
        parts = None if table is None else parts_of(table.capture)
        self._store = MapStore(file, axes_of(processing), said, removed, processing.unit, parts)

    def __exit__(self, *_: object) -> None:
        self._store.close()

    def push(self, spectra: NDArray[np.complex64], first: int) -> None:
        """Process the next chirps, (chirp, rx, range) of whole TDM cycles from ``first`` on.

        A block that is cut after a multiple of ``max_chirps`` chirps gives the same as the whole.
        """
        stages, store = self._processing.stages, self._store
        # Before clutter is removed, because that frame is wanted with its clutter.
        if self._kept_cycle is not None:
            self._keep_received(spectra, first, self._kept_cycle)
        spectra = self._clouds.without_clutter(spectra, first)
        # Maps over slow time and the spectrogram are made of the stream itself.
        with stages.time("range"):
            power, times = self._range_time.push(spectra, first)
        with stages.time("spectrogram"):
            columns = self._spectrogram.push(spectra)
        with stages.time("write"):
            store.extend("slow_time", times, range_time=power)
            store.extend("spectrogram_time", columns.time, spectrogram=columns.power)
        # Frames that end with this block give the range-Doppler maps, and from these everything
        # else.
        for frame in self._clouds.frames(spectra):
            maps = {"range_doppler": frame.power, "detections": frame.mask}
            if frame.sources is not None:
                maps["source"] = np.full(frame.mask.shape, -1, dtype=np.int16)
                maps["source"][frame.mask] = frame.sources.source
            with stages.time("angle"):
                if frame.angles:
                    maps |= self._angle_maps(frame.angles)
            with stages.time("write"):
                added = {name: values[None] for name, values in maps.items()}
                store.extend("time", [frame.middle_s], **added)
            if self._table is not None:
                with stages.time("sources"):
                    of_parts = truth_of_parts(self._table, frame.start_cycle, frame.middle_s)
                truth = {f"{_TRUTH}/{name}": values[None] for name, values in of_parts.items()}
                store.extend(f"{_TRUTH}/time", [frame.middle_s], **truth)

    def _angle_maps(self, angles: Any) -> dict[str, NDArray[Any]]:
        makers = {"azimuth": range_azimuth, "elevation": range_elevation}
        radar = self._processing.radar
        return {f"range_{name}": makers[name](angles, radar) for name in self._angle_names}

    def _keep_received(
        self, spectra: NDArray[np.complexfloating], first: int, start_cycle: int
    ) -> None:
        """Collect the range spectra of the frame that is kept, and once it is whole, its maps."""
        radar, windows = self._processing.radar, self._processing.window_functions
        # Where the frame begins and ends in this block; it may reach over several.
        begin = start_cycle * radar.n_tx - first
        end = begin + radar.chirps_per_frame
        if end <= 0 or begin >= len(spectra):
            return
        # A copy, because the next block comes in the same array.
        self._received.append(spectra[max(begin, 0) : end].copy())
        if end > len(spectra):
            return
        # The frame is whole: the same maps as of any other, but with the clutter in it.
        shape = radar.cycles_per_frame, radar.n_tx, *spectra.shape[1:]
        cube, self._received = np.concatenate(self._received).reshape(shape), []
        with self._processing.stages.time("received"):
            power = power_map(cube, radar, window_functions=windows)
            mask, _ = self._processing.detect(power, cube)
            kept = {"range_doppler_received": power, "detections_received": mask}
            if "azimuth" in self._angle_names:
                angles = frame_angles(cube, mask, radar, windows)
                kept["range_azimuth_received"] = range_azimuth(angles, radar)
            self._store.put(float(radar.window_times(np.array([start_cycle]))[0]), **kept)

    def finish(self) -> Clouds:
        """Write what is buffered, close the file and return the clouds.

        Where echoes are known, place, speed and joints of their people are written too.
        """
        power, times = self._range_time.finish()
        self._store.extend("slow_time", times, range_time=power)
        if self._table is not None:
            self._store.put_truth(self._table.capture.body)
        self._store.close()
        clouds = self._clouds.finish()
        if not len(clouds.rdt.points):
            text = "nothing was detected: the clouds are empty"
            warnings.warn(text, ValidityWarning, stacklevel=5)
        return clouds


def write_clouds(folder: Path, points: NDArray[np.float64], spatial: SpatialCloud) -> None:
    """Write the files of both clouds."""
    save_cloud_npz(folder / "cloud_rdt.npz", points)
    save_ply(folder / "cloud_rdt.ply", points)
    save_spatial_npz(folder / "cloud_xyz.npz", spatial)


def if_array(path: Path, radar: Radar, n_chirps: int) -> Any:
    """Make a new Zarr array (chirp, rx, sample) for all IF samples, described by attributes."""
    together = chirps_together(radar)
    shape = (n_chirps // together, radar.n_rx, radar.samples_per_chirp)
    described = ("multiplexing", "chirp_duration_s", "sample_rate_hz")
    attributes = {name: getattr(radar, name) for name in described}
    return new_store(path, shape, block_chirps(radar) // together, attributes)


# -- the file of the maps -------------------------------------------------------------------------

_TRUTH = "truth"
_GROWING = ("time", "slow_time", "spectrogram_time")
_MOST_WAITING = 2_000_000  # bytes of maps that are not yet written
_STEPS_A_CHUNK = (1024, 64)  # time steps written together, of axes and of rows; 1 of maps


class MapStore:
    """HDF5 file of maps that grow along their first axis; an existing file is replaced.

    The file is a path, or an object such as `io.BytesIO`, which is left open.
    ``fixed`` are the axes (n,) of known values, such as ``range``. Maps with another axis that does
    not grow are left out: a radar without a z-line has no elevation. ``clutter_removal`` says, by
    growing axis, how static clutter was removed from the maps along it; ``none`` if left out. It
    becomes an attribute of their datasets, and ``attributes`` become attributes of the file.
    Samples have the ``unit``, and powers have its square. With ``parts`` there is a group
    ``truth``, and without them there is no map ``source``.
    """

    def __init__(
        self,
        file: Path | BinaryIO,
        fixed: Mapping[str, NDArray[np.float64]],
        attributes: Mapping[str, Any],
        clutter_removal: Mapping[str, str] | None = None,
        unit: str = "m",
        parts: Parts | None = None,
    ) -> None:
        # The newest format indexes growing data in constant memory.
        self._owned, self._unit = isinstance(file, Path), unit
        self._raw = LastingFile(file.open("w+b") if isinstance(file, Path) else file)
        self._file = h5py.File(self._raw, "w", libver="latest")
        # HDF5 takes as long to find an array as to write a step, and an open one holds memory.
        self._dtypes: dict[str, np.dtype[Any]] = {}
        self._waiting: dict[str, list[NDArray[Any]]] = {}
        self._waiting_bytes = 0
        # Axes that grow have no values yet, the others have all of theirs.
        self._file.attrs.update(attributes)
        for name in _GROWING:
            self._growing(name, TABLES["axes"][name])
        for name, values in fixed.items():
            self._make(name, TABLES["axes"][name], data=values)
        # Maps are made if all of their axes but the growing one are known.
        said = {"gaps": attributes["gaps"]} if "gaps" in attributes else {}
        for name, kind in TABLES["maps"].items():
            unknown = name == "source" and parts is None
            if unknown or any(axis not in fixed for axis in kind.dims[1:]):
                continue
            removal = (clutter_removal or {}).get(kind.dims[0], "none")
            shape = tuple(len(fixed[axis]) for axis in kind.dims[1:])
            self._growing(name, kind, shape, clutter_removal=removal, **said)
        if parts is not None:
            # A group with axes of its own.
            self._growing(f"{_TRUTH}/time", TABLES["axes"]["time"])
            self._make(f"{_TRUTH}/part", TABLES["names"]["part"], data=list(parts.names))
            for name, kind in TABLES["parts"].items():
                self._growing(f"{_TRUTH}/{name}", kind, (len(parts.names),))
            self._make(f"{_TRUTH}/person", TABLES["owners"]["person"], data=parts.person)

    def _growing(self, name: str, kind: Array, shape: tuple[int, ...] = (), **said: object) -> None:
        """Make an array of no steps of this shape yet."""
        steps = _STEPS_A_CHUNK[len(shape)] if len(shape) < 2 else 1
        # A chunk holds one map, or many steps of an axis or of a row.
        chunk = steps, *(size or 1 for size in shape)  # HDF5 has no chunks of nothing
        options: dict[str, Any] = {"maxshape": (None, *(size or None for size in shape))}
        # HDF5 would cache up to 8 MB of each map; only an unfinished chunk needs it.
        chunk_bytes = math.prod(chunk) * np.dtype(kind.dtype).itemsize
        options |= {"chunks": chunk, "rdcc_nbytes": 0 if steps == 1 else chunk_bytes}
        # Masks and sources are the same nearly everywhere: the fastest compression shrinks them
        # most.
        if kind.sparse:
            options |= {"compression": "gzip", "compression_opts": 1, "shuffle": True}
        self._make(name, kind, said, shape=(0, *shape), **options)

    def _make(self, name: str, kind: Array, said: Any = (), **options: Any) -> None:
        """Make an array with its unit, its meaning and what is ``said``, and its axes."""
        dtype = h5py.string_dtype() if kind.dtype == "text" else kind.dtype
        unit = f"{self._unit}2" if kind.unit == "m2" else kind.unit
        data = netcdf_array(self._file, name, kind.dims, unit, kind.meaning, dtype=dtype, **options)
        data.attrs.update(said)
        self._dtypes[name] = data.dtype

    def extend(self, axis: str, values: ArrayLike, **maps: ArrayLike) -> None:
        """Append the steps ``values (n,)`` [s] to a growing axis, and (n, ...) to maps along it.

        They wait for some megabytes, because HDF5 takes as long for one step as for many.
        """
        for name, added in ((axis, values), *maps.items()):
            steps: NDArray[Any] = np.array(added, dtype=self._dtypes[name])
            self._waiting.setdefault(name, []).append(steps)
            self._waiting_bytes += steps.nbytes
        if self._waiting_bytes >= _MOST_WAITING:
            self._write()

    def _write(self) -> None:
        for name, added in self._waiting.items():
            steps, data = np.concatenate(added), self._file[name]
            data.resize(len(data) + len(steps), axis=0)
            data[len(data) - len(steps) :] = steps
        self._waiting, self._waiting_bytes = {}, 0
        self._raw.check()

    def put(self, time_s: float, **maps: ArrayLike) -> None:
        """Write maps of a single time [s], which do not grow."""
        for name, values in maps.items():
            said = {"clutter_removal": "none", "time_s": time_s}
            self._make(name, TABLES["received"][name], said, data=values)

    def put_truth(self, body: Body) -> None:
        """Write what is true of each person of a body at the times of the frames."""
        # The times of the frames must be in the file before they are read from it.
        self._write()
        axes = {"person": body.names, "joint": NODES, "coordinate": ("x", "y", "z")}
        for name, names in axes.items():
            self._make(name, TABLES["names"][name], data=list(names))
        for name, values in truth_of(body, self._file["time"][:]).items():
            self._make(name, TABLES["people"][name], data=values)

    def close(self) -> None:
        """Write what is buffered and close the file; may be called again."""
        try:
            if self._file:
                self._write()
        finally:
            self._file.close()
            if self._owned:
                self._raw.close()
                self._raw.check()


def read_maps(file: Path | BinaryIO) -> h5py.File:
    """Open what a `MapStore` has written, without HDF5's cache, which would hold 8 MB of each map.

    Whoever reads maps through reads each chunk once.
    """
    return h5py.File(file, "r", rdcc_nbytes=0)


def open_maps(file: Path | BinaryIO, group: str | None = None) -> xr.Dataset:
    """Open what a `MapStore` has written, or a group of it; values are read when they are needed.

    An `InputError` is raised if the file is not there any more, or is damaged.
    """
    import xarray as xr  # slow to import

    try:
        # Values as they are stored: times are numbers of seconds, and 0 is no missing power.
        return xr.open_dataset(file, engine="h5netcdf", decode_cf=False, group=group)
    except (OSError, ValueError, KeyError) as error:
        raise InputError(
            f"'{file}' cannot be read as the maps of a run ({error}); make it anew with rt.run"
        ) from None


def read_truth(file: Path | BinaryIO) -> xr.Dataset:
    """Read what is true of each part, the group ``truth``; errors as of `open_maps`."""
    with open_maps(file, _TRUTH) as truth:
        return truth.load().assign(visible=truth["visible"].astype(bool))
