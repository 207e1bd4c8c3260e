"""Files that a run writes while it streams: the maps, and the IF samples if they are kept."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.clouds import save_cloud_npz, save_ply, save_spatial_npz
from rtradar.errors import ValidityWarning
from rtradar.exchange.recording import new_store
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.output.echo_table import EchoTable
from rtradar.pipeline.output.map_store import MapStore
from rtradar.pipeline.output.truth import parts_of, truth_of_parts
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
from rtradar.system.output_folder import OutputFiles, one_of

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


class RunWriter:
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
        removed = {
            "time": removal.description(radar.cycles_per_frame),
            "slow_time": removal.description(self._range_time.window_cycles),
            "spectrogram_time": removal.description(processing.window_cycles),
        }
        self._received = None
        if len(frame_starts) and removed["time"] != "none":
            self._received = ReceivedFrame(radar, int(frame_starts[len(frame_starts) // 2]))
        left_out = ("source",) if table is None else ()
        said = {"title": title} | ({"gaps": text} if (text := radar.gaps_text) else {})
        parts = None if table is None else parts_of(table.capture)
        self._store = MapStore(
            file, axes_of(processing), said, removed, left_out, processing.unit, parts
        )

    def __enter__(self) -> RunWriter:
        return self

    def __exit__(self, *_: object) -> None:
        self._store.close()

    def push(self, spectra: NDArray[np.complex64], first: int) -> None:
        """Process the next chirps, (chirp, rx, range) of whole TDM cycles from ``first`` on.

        A block that is cut after a multiple of ``max_chirps`` chirps gives the same as the whole.
        """
        stages, store = self._processing.stages, self._store
        if self._received is not None and (cube := self._received.push(spectra, first)) is not None:
            self._keep_received(cube, self._received.start_cycle)
        spectra = self._clouds.without_clutter(spectra, first)
        with stages.time("range"):
            power, times = self._range_time.push(spectra, first)
        with stages.time("spectrogram"):
            columns = self._spectrogram.push(spectra)
        with stages.time("write"):
            store.extend("slow_time", times, range_time=power)
            store.extend("spectrogram_time", columns.time, spectrogram=columns.power)
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
                store.extend_truth(frame.middle_s, of_parts)

    def _angle_maps(self, angles: Any) -> dict[str, NDArray[Any]]:
        makers = {"azimuth": range_azimuth, "elevation": range_elevation}
        radar = self._processing.radar
        return {f"range_{name}": makers[name](angles, radar) for name in self._angle_names}

    def _keep_received(self, cube: NDArray[np.complexfloating], start_cycle: int) -> None:
        radar, windows = self._processing.radar, self._processing.window_functions
        with self._processing.stages.time("received"):
            power = power_map(cube, radar, window_functions=windows)
            mask, _ = self._processing.detect(power, cube)
            kept = {"range_doppler_received": power, "detections_received": mask}
            if "azimuth" in self._angle_names:
                angles = frame_angles(cube, mask, radar, windows)
                kept["range_azimuth_received"] = range_azimuth(angles, radar)
            self._store.put(float(radar.window_times(np.array([start_cycle]))[0]), **kept)

    def finish(self, body: Body | None = None) -> Clouds:
        """Write what is buffered, close the file and return the clouds.

        Of the people of a ``body``, place, speed and joints are written too.
        """
        power, times = self._range_time.finish()
        self._store.extend("slow_time", times, range_time=power)
        if body is not None:
            self._store.put_truth(body)
        self._store.close()
        clouds = self._clouds.finish()
        if not len(clouds.rdt.points):
            text = "nothing was detected: the clouds are empty"
            warnings.warn(text, ValidityWarning, stacklevel=5)
        return clouds


def write_clouds(folder: Path, clouds: Clouds) -> None:
    """Write the files of both clouds."""
    save_cloud_npz(folder / "cloud_rdt.npz", clouds.rdt.points)
    save_ply(folder / "cloud_rdt.ply", clouds.rdt.points)
    save_spatial_npz(folder / "cloud_xyz.npz", clouds.spatial)


class ReceivedFrame:
    """Collects the range spectra of one frame, from cycle ``start_cycle`` on, from a stream."""

    def __init__(self, radar: Radar, start_cycle: int) -> None:
        self.start_cycle = start_cycle
        self._first, self._radar = start_cycle * radar.n_tx, radar
        self._blocks: list[NDArray[np.complexfloating]] = []

    def push(
        self, spectra: NDArray[np.complexfloating], first: int
    ) -> NDArray[np.complexfloating] | None:
        """Take the next chirps; return the cube (cycle, tx, rx, range) once it is whole."""
        last = self._first + self._radar.chirps_per_frame
        begin, end = max(self._first, first), min(last, first + len(spectra))
        if begin >= end:
            return None
        self._blocks.append(spectra[begin - first : end - first].copy())
        if end < last:
            return None
        cube = np.concatenate(self._blocks)
        self._blocks = []
        return cube.reshape(self._radar.cycles_per_frame, self._radar.n_tx, *cube.shape[1:])


def if_array(path: Path, capture: Capture) -> Any:
    """Make a new Zarr array (chirp, rx, sample) for all IF samples, described by attributes."""
    radar = capture.radar
    together = chirps_together(radar)
    shape = (capture.n_chirps // together, radar.n_rx, radar.samples_per_chirp)
    described = ("multiplexing", "chirp_duration_s", "sample_rate_hz")
    attributes = {name: getattr(radar, name) for name in described}
    return new_store(path, shape, block_chirps(radar) // together, attributes)
