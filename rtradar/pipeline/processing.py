"""From range spectra, block by block, to detections, angles and clouds, and how large maps are."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds import RdtCloud, RdtCloudResult, SpatialCloud, points_of_sines, spatial_points
from rtradar.clouds.rdt import UniformSample
from rtradar.errors import InputError
from rtradar.pipeline.timing import Stages
from rtradar.process import (
    AngleSpectra,
    ClutterRemoval,
    SlidingWindows,
    WindowFunctions,
    angle_grid,
    angle_spectra,
    build_detector,
    build_point_detector,
    cell_spectra,
    clutter_removal,
    measured_angles,
    power_map,
    range_spectrum,
    takes_channels,
    window_cycles,
)
from rtradar.process.spectrogram import SlidingSpectrogram
from rtradar.process.window_functions import DEFAULT_WINDOWS, RangeSideLobes, SeenRanges
from rtradar.radar import Radar
from rtradar.settings import RunSettings
from rtradar.signal import separate
from rtradar.signal.multiplexing import chirps_together

CLOUD_POINTS = 3000
"""Points in the RDT cloud (paper, section 3.2.4)."""

SPATIAL_POINTS = 30_000
"""Largest number of points in the spatial cloud, a uniform sample of all: some 3 s of a walk."""

RANGE_TIME_S = 5e-3
"""Time step of the range-time map [s]."""

_CELLS_AT_ONCE = 1024  # 7 kB each, in all channels; a frame with a person has some hundreds
_MAX_BYTES = 8e6  # of IF samples: part of them stays in the cache, and all threads have work


Detect = Callable[
    [NDArray[np.floating], NDArray[np.complexfloating]],
    tuple[NDArray[np.bool_], NDArray[np.float64] | None],
]
"""Map (range, velocity) and cube (cycle, tx, rx, range) of a frame in; the mask of its detections
out, and the sines (cell, 2) of their directions where the detector finds them."""

MEMORY_LIMIT_BYTES = 4_000_000_000
"""Largest size of what is held in memory, maps or IF samples [byte].

It is that of maps of about three minutes, or IF samples of 15 s, of the radar ``paper-12ghz``.
"""


def _detect_of(settings: RunSettings, radar: Radar, window_functions: WindowFunctions) -> Detect:
    """Return the detector of the settings, of power alone or of all channels."""
    name, options = settings.detector, settings.detector_options
    if takes_channels(name):
        of_cube = build_point_detector(
            name, radar, window_functions=window_functions, options=options
        )
        return lambda _, cube: of_cube(cube)
    of_power = build_detector(name, pfa=settings.pfa, looks=radar.n_channels, options=options)
    return lambda power, _: (of_power(power), None)


@dataclass(frozen=True)
class Processing:
    """How range spectra of one capture are processed, with the radar at its position in the scene.

    ``detect`` marks the cells of a frame, ``removal`` removes static clutter before Doppler,
    ``stages`` record the time, and ``unit`` is that of the samples.
    """

    radar: Radar
    settings: RunSettings
    detect: Detect
    removal: ClutterRemoval
    window_functions: WindowFunctions
    stages: Stages = field(default_factory=Stages)
    unit: str = "m"

    @property
    def window_cycles(self) -> int:
        """Number of cycles in a window of the spectrogram."""
        return window_cycles(self.radar, self.settings.spectrogram_window_s)

    def spectrogram(self) -> SlidingSpectrogram:
        """Return what makes the spectrogram of the range spectra."""
        return SlidingSpectrogram(
            self.radar,
            removal=self.removal,
            window=self.window_cycles,
            overlap=self.settings.spectrogram_overlap,
            window_functions=self.window_functions,
        )

    @classmethod
    def of(cls, radar: Radar, settings: RunSettings) -> Processing:
        """Build the processing that these settings name; InputError if a name is unknown."""
        window_functions = WindowFunctions(settings.range_window, settings.doppler_window)
        if settings.slow_time == "capture":
            radar = radar.over_capture()
        detect = _detect_of(settings, radar, window_functions)
        removal = clutter_removal(settings.clutter_removal, radar)
        return cls(radar, settings, detect, removal, window_functions)

    def range_spectra(
        self, at_once: int
    ) -> Callable[[NDArray[np.complex64], int], NDArray[np.complex64]]:
        """Return a function that makes range spectra of the samples of at most ``at_once`` chirps.

        It takes received samples and the number of their first chirp, and gives (chirp, rx, range)
        in an array that the next call fills anew.
        """
        radar = self.radar
        filled = np.empty((at_once, radar.n_rx, radar.samples_per_chirp), np.complex64)

        def range_spectra(received: NDArray[np.complex64], first: int) -> NDArray[np.complex64]:
            with self.stages.time("range"):
                windows, n = self.window_functions, len(received) * chirps_together(radar)
                separated = separate(received, radar, first)
                return range_spectrum(separated, radar, window_functions=windows, out=filled[:n])

        return range_spectra


def block_chirps(radar: Radar) -> int:
    """Return how many chirps are computed or processed together: a hop of the frames, or a frame.

    Maps depend on it in their last bits, because steps of the range-time map end with a block.
    """
    return min(math.ceil(radar.hop_cycles), radar.cycles_per_frame) * radar.n_tx


class Clouds(NamedTuple):
    """The clouds of a capture; the spatial one was sampled from ``n_spatial`` points.

    ``ranges`` are those of the detections, None if there are none.
    """

    rdt: RdtCloudResult
    spatial: SpatialCloud
    n_spatial: int
    ranges: SeenRanges | None


class CellSources(NamedTuple):
    """Who returned most of some cells: ``source`` and ``part (cell,)``, -1 for the room or nobody.

    Objects come after all people, and after all their parts.
    """

    source: NDArray[np.int64]
    part: NDArray[np.int64]


class Frame(NamedTuple):
    """One processed frame from ``start_cycle`` on, centred at ``middle_s``.

    ``power`` is its map (range, velocity) [m^2], ``mask`` marks the detections, ``angles`` are the
    spectra of the detected cells, None if the radar measures no angle, and ``sources`` say who
    returned most of each, None if that is not known.
    """

    start_cycle: int
    middle_s: float
    power: NDArray[np.float32]
    mask: NDArray[np.bool_]
    angles: AngleSpectra | None
    sources: CellSources | None = None


SourceOfCells = Callable[[int, NDArray[np.floating], NDArray[np.bool_]], CellSources]
"""Who returned most of each detected cell, by the first cycle, the map and the mask of a frame."""


class CloudMaker:
    """Accumulates the clouds of one capture from its range spectra.

    ``source_of`` tells who returned most of a cell, where that is known. Without ``angles`` the
    spatial cloud is empty, as it is where the radar measures none. So that memory stays low,
    `push` takes at most ``max_chirps`` chirps.
    """

    def __init__(
        self,
        processing: Processing,
        source_of: SourceOfCells | None = None,
        angles: bool = True,
    ) -> None:
        self._processing, radar, self._source_of = processing, processing.radar, source_of
        self._angles = angles and bool(measured_angles(radar))
        self._sliding = SlidingWindows(radar)
        self._rdt = RdtCloud(radar, CLOUD_POINTS, processing.settings.seed)
        self._ranges = RangeSideLobes(processing.window_functions.range, radar.range_m)
        self._spatial = UniformSample(SPATIAL_POINTS, processing.settings.seed, columns=8)
        # Blocks are whole steps of the range-time map, as many as the cache has room for.
        step = max(1, round(RANGE_TIME_S / radar.cycle_duration_s)) * radar.n_tx
        step_bytes = step * radar.n_rx * radar.samples_per_chirp * np.dtype(np.complex64).itemsize
        self.max_chirps = step * max(1, int(_MAX_BYTES / step_bytes))

    def push(self, spectra: NDArray[np.complex64], first: int) -> None:
        """Process the next chirps: (chirp, rx, range) from chirp ``first`` on, in whole cycles."""
        for _ in self.frames(self.without_clutter(spectra, first)):
            pass

    def without_clutter(self, spectra: NDArray[np.complex64], first: int) -> NDArray[np.complex64]:
        """Remove what static clutter can be removed without the whole frame."""
        with self._processing.stages.time("clutter removal"):
            return self._processing.removal.block(spectra, first)

    def frames(self, spectra: NDArray[np.complex64]) -> Iterator[Frame]:
        """Process and yield the frames that end with these chirps, and add them to the clouds."""
        radar, stages = self._processing.radar, self._processing.stages
        window_functions = self._processing.window_functions
        frames = self._sliding.push(spectra)
        # The generator copies into its buffer as it goes on, and this time has a stage of its own.
        while True:
            with stages.time("frames"):
                frame = next(frames, None)
            if frame is None:
                return
            _, start, window = frame
            with stages.time("clutter removal"):
                cube = self._processing.removal.window(window)
            # The range-Doppler map, and what is detected on it.
            with stages.time("doppler"):
                power = power_map(cube, radar, window_functions=window_functions)
            with stages.time("cfar"):
                mask, sines = self._processing.detect(power, cube)
            # The mask of each frame is a layer of the volume whose surface becomes the RDT cloud.
            middle = float(radar.window_times(np.array([start]))[0])
            with stages.time("cloud"):
                self._rdt.push(mask, middle)
                self._ranges.add(power, mask)
            # Who returned the cells, and where they lie in space. A detector of points finds the
            # directions itself; else they are the peaks of the angle spectra.
            angles = sources = None
            if self._source_of is not None:
                with stages.time("sources"):
                    sources = self._source_of(start, power, mask)
            if self._angles:
                with stages.time("angle"):
                    angles = frame_angles(cube, mask, radar, window_functions)
                    given = radar, middle, *(sources or ())
                    found = (
                        spatial_points(angles, *given)
                        if sines is None
                        else points_of_sines(sines, mask, power, *given)
                    )
                    # Eight numbers for each point, of which a uniform sample is kept in constant
                    # memory.
                    nobody = np.full(len(found.time), -1)
                    who = (nobody if own is None else own for own in (found.source, found.part))
                    columns = found.points, found.velocity, found.power, found.time, *who
                    self._spatial.add(np.column_stack(columns))
            yield Frame(start, middle, power, mask, angles, sources)

    def finish(self) -> Clouds:
        """Return the clouds of all frames so far."""
        with self._processing.stages.time("cloud"):
            rdt = self._rdt.finish()
            rows = self._spatial.rows()
            # The sample is in random order; points are given in the order of time.
            rows = rows[np.argsort(rows[:, 5], kind="stable")]
        who = () if self._source_of is None else rows[:, 6:].astype(np.int64).T
        spatial = SpatialCloud(rows[:, :3], rows[:, 3], rows[:, 4], rows[:, 5], *who)
        return Clouds(rdt, spatial, self._spatial.n_seen, self._ranges.found())


def frame_angles(
    cube: NDArray[np.complexfloating],
    mask: NDArray[np.bool_],
    radar: Radar,
    window_functions: WindowFunctions = DEFAULT_WINDOWS,
) -> AngleSpectra:
    """Return the angle spectra of the detected cells of one frame (cycle, tx, rx, range)."""
    rows, columns = np.nonzero(mask)
    velocity = radar.velocity_mps(radar.cycles_per_frame)
    blocks = []
    # Some cells at a time: all channels of all cells of a busy frame would take much memory.
    for first in range(0, max(len(rows), 1), _CELLS_AT_ONCE):
        row, column = (bins[first : first + _CELLS_AT_ONCE] for bins in (rows, columns))
        values = cell_spectra(cube, radar, row, column, window_functions=window_functions)
        blocks.append(angle_spectra(values, radar, radar.range_m[row], velocity[column]))
    # The blocks are joined as if all cells had been measured at once.
    if len(blocks) == 1:
        return blocks[0]
    joined: dict[str, Any] = {}
    for name in ("y", "z", "range_m", "velocity"):
        parts = [getattr(block, name) for block in blocks]
        joined[name] = None if parts[0] is None else np.concatenate(parts)
    return AngleSpectra(blocks[0].sines, **joined)


def refuse_large(what: str, n_bytes: float, instead: str) -> None:
    """Raise an `InputError` if something would take more than the limit of memory."""
    if n_bytes > MEMORY_LIMIT_BYTES:
        raise InputError(
            f"{what} would take {n_bytes / 1e9:.1f} GB in memory, and at most "
            f"{MEMORY_LIMIT_BYTES / 1e9:.1f} GB are allowed; {instead}"
        )


def refuse_large_maps(radar: Radar, n_chirps: int, *, sources: bool = False) -> None:
    """Raise an `InputError` if maps of so many chirps are too large for memory."""
    interval_s = radar.duration_of(n_chirps)
    what = f"maps of {interval_s:.6g} s of radar '{radar.name}'"
    instead = "give a folder, out=, and they are written there as they are computed"
    refuse_large(what, bytes_of_maps(radar, n_chirps, sources=sources), instead)


def bytes_of_maps(radar: Radar, n_chirps: float, *, sources: bool = False) -> float:
    """Estimate the size of the maps of so many chirps [byte], without that of the spectrogram.

    ``sources`` says whether there is a map of who returned each detection.
    """
    # Frames in the capture, and steps of the range-time map, of which each frame with a gap begins
    # one.
    frames = max(n_chirps / radar.n_tx - radar.cycles_per_frame, 0) / radar.hop_cycles + 1
    steps = radar.duration_of(int(n_chirps)) / RANGE_TIME_S + radar.in_frames * frames
    power, mask = np.dtype(np.float32).itemsize, np.dtype(np.uint8).itemsize
    if sources:
        mask += np.dtype(np.int16).itemsize
    a_range = radar.cycles_per_frame * (power + mask)
    if angles := measured_angles(radar):
        a_range += len(angles) * len(angle_grid(radar)) * power
    return radar.samples_per_chirp * (frames * a_range + steps * power)
