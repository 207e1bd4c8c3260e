"""From range spectra, block by block, to detections, their angles and the clouds, in constant memory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds import RdtCloud, RdtCloudResult, SpatialCloud, UniformSample, spatial_points
from rtradar.pipeline.timing import Stages
from rtradar.process import (
    AngleSpectra,
    ClutterRemoval,
    Detector,
    SlidingWindows,
    WindowFunctions,
    angle_spectra,
    cell_spectra,
    measures_angle,
    power_map,
)
from rtradar.process.window_functions import HANN
from rtradar.radar import Radar

CLOUD_POINTS = 3000
"""Points in the RDT cloud (paper, section 3.2.4)."""

SPATIAL_POINTS = 30_000
"""Most points in the spatial cloud: about 3 s of a walk at 12 GHz; of more a uniform sample, so that memory does not grow."""

RANGE_TIME_S = 5e-3
"""Step of the range-time map, which pieces of a block are whole numbers of."""

_CELLS_AT_ONCE = 1024
"""Whose spectra in every channel are there at once, 7 kB each; a window of a person has some hundreds."""

_PIECE_BYTES = 8e6
"""IF samples at once: some of it stays in a processor's cache, and threads still have enough to share."""


class Clouds(NamedTuple):
    """``rdt``: the range-Doppler-time cloud; ``spatial``: points in the room; ``n_spatial``: points it was sampled from."""

    rdt: RdtCloudResult
    spatial: SpatialCloud
    n_spatial: int


class Window(NamedTuple):
    """One processing window: its centre [s], ``power`` and detections ``mask`` (range, velocity), spectra over angle if any."""

    middle_s: float
    power: NDArray[np.float32]
    mask: NDArray[np.bool_]
    angles: AngleSpectra | None


class CloudMaker:
    """The clouds of one capture, made of its range spectra.

    Parameters
    ----------
    radar : Radar
    detect : Detector
    seed : int
        Of the sampling of clouds.
    stages : Stages
        Where the time goes.
    removal : ClutterRemoval
        Applied before Doppler.
    window_functions : WindowFunctions
        Window functions of the range spectra and in slow time.

    Attributes
    ----------
    piece : int
        Chirps to take at once, so that memory stays low.
    """

    def __init__(
        self,
        radar: Radar,
        *,
        detect: Detector,
        seed: int,
        stages: Stages,
        removal: ClutterRemoval,
        window_functions: WindowFunctions = HANN,
    ) -> None:
        self._window_functions = window_functions
        self._radar, self._detect, self._stages, self._removal = radar, detect, stages, removal
        self._sliding = SlidingWindows(radar)
        self._rdt, self._spatial = (
            RdtCloud(radar, CLOUD_POINTS, seed),
            UniformSample(SPATIAL_POINTS, seed, columns=6),
        )
        step = max(1, round(RANGE_TIME_S / radar.cycle_duration_s)) * radar.n_tx
        step_bytes = step * radar.n_rx * radar.samples_per_chirp * np.dtype(np.complex64).itemsize
        self.piece = step * max(1, int(_PIECE_BYTES / step_bytes))

    def take(self, spectra: NDArray[np.complex64], first: int) -> None:
        """The next chirps, ``spectra (chirp, rx, range)`` from chirp ``first`` on; whole TDM cycles."""
        for _ in self.windows(self.without_clutter(spectra, first)):
            pass

    def without_clutter(self, spectra: NDArray[np.complex64], first: int) -> NDArray[np.complex64]:
        """The next chirps less what stands still, as far as one can tell without the whole window."""
        with self._stages.time("clutter removal"):
            return self._removal.block(spectra, first)

    def windows(self, spectra: NDArray[np.complex64]) -> Iterator[Window]:
        """The windows that end with these chirps, given once each, after their detections have gone into the clouds."""
        radar, stages = self._radar, self._stages
        for _, start, window in self._sliding.push(spectra):
            with stages.time("clutter removal"):
                cube = self._removal.window(window)
            with stages.time("doppler"):
                power = power_map(cube, radar, window_functions=self._window_functions)
            with stages.time("cfar"):
                mask = self._detect(power)
            middle = float(radar.window_times(np.array([start]))[0])
            with stages.time("cloud"):
                self._rdt.push(mask, middle)
            angles = None
            if measures_angle(radar):
                with stages.time("angle"):
                    angles = window_angles(cube, mask, radar, self._window_functions)
                    found = spatial_points(angles, radar, middle)
                    self._spatial.add(
                        np.column_stack([found.points, found.velocity, found.power, found.time])
                    )
            yield Window(middle, power, mask, angles)

    def finish(self) -> Clouds:
        """The clouds of all windows so far."""
        with self._stages.time("cloud"):
            rdt = self._rdt.finish()
            rows = self._spatial.rows()
            rows = rows[np.argsort(rows[:, 5], kind="stable")]
        return Clouds(
            rdt, SpatialCloud(rows[:, :3], rows[:, 3], rows[:, 4], rows[:, 5]), self._spatial.n_seen
        )


def window_angles(
    cube: NDArray[np.complexfloating],
    mask: NDArray[np.bool_],
    radar: Radar,
    window_functions: WindowFunctions = HANN,
) -> AngleSpectra:
    """Angle spectra of the detected cells of one window."""
    rows, columns = np.nonzero(mask)
    velocity = radar.velocity_mps(radar.cycles_per_frame)
    pieces = []
    for first in range(0, max(len(rows), 1), _CELLS_AT_ONCE):
        row, column = (bins[first : first + _CELLS_AT_ONCE] for bins in (rows, columns))
        values = cell_spectra(cube, radar, row, column, window_functions=window_functions)
        pieces.append(angle_spectra(values, radar, radar.range_m[row], velocity[column]))
    return pieces[0] if len(pieces) == 1 else _joined(pieces)


def _joined(pieces: list[AngleSpectra]) -> AngleSpectra:
    def column(name: str) -> Any:
        parts = [getattr(piece, name) for piece in pieces]
        return None if parts[0] is None else np.concatenate(parts)

    return AngleSpectra(
        pieces[0].sines, column("y"), column("z"), column("range_m"), column("velocity")
    )
