"""From range spectra, block by block, to maps in a file and to clouds, in constant memory."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds import RdtCloud, RdtCloudResult, SpatialCloud, UniformSample, spatial_points
from rtradar.pipeline.received import ReceivedWindow
from rtradar.pipeline.store import MapStore
from rtradar.pipeline.timing import Stages
from rtradar.process import (
    SPECTROGRAM_CYCLES,
    AngleSpectra,
    ClutterRemoval,
    SlidingSpectrogram,
    SlidingWindows,
    angle_grid,
    angle_spectra,
    cell_spectra,
    os_cfar,
    power_map,
    range_azimuth,
    range_elevation,
    range_time,
)
from rtradar.radar import Radar

CLOUD_POINTS = 3000
"""Points in the RDT cloud (paper, section 3.2.4)."""

SPATIAL_POINTS = 30_000
"""Most points in the spatial cloud: about 3 s of a walk at 12 GHz; of more a uniform sample, so that memory does not grow."""

_RANGE_TIME_S = 5e-3
"""Step of the range-time map."""

_PIECE_BYTES = 8e6
"""IF samples at once: some of it stays in a processor's cache, and threads still have enough to share."""


class Clouds(NamedTuple):
    """``rdt``: the range-Doppler-time cloud; ``spatial``: points in the room; ``n_spatial``: points it was sampled from."""

    rdt: RdtCloudResult
    spatial: SpatialCloud
    n_spatial: int


class Products:
    """All that is made of the range spectra of one capture.

    Parameters
    ----------
    path : path
        HDF5 file of the maps, written anew.
    radar : Radar
    pfa : float
        False-alarm rate of OS-CFAR.
    seed : int
        Of the sampling of clouds.
    stages : Stages
        Where the time goes.
    title : str
        Of the file.
    removal : ClutterRemoval
        Applied before Doppler, and to all that is made of the spectra but for the mean, which knows windows only.
    received : ReceivedWindow, optional
        A window whose map is kept as it was before the removal.

    Attributes
    ----------
    piece : int
        Chirps to take at once, so that memory stays low.
    """

    def __init__(
        self,
        path: Path,
        radar: Radar,
        *,
        pfa: float,
        seed: int,
        stages: Stages,
        title: str,
        removal: ClutterRemoval,
        received: ReceivedWindow | None = None,
    ) -> None:
        self._radar, self._pfa, self._stages, self._removal, self._received = radar, pfa, stages, removal, received
        self._windows, self._spectrogram = SlidingWindows(radar), SlidingSpectrogram(radar)
        self._rdt, self._spatial = RdtCloud(radar, CLOUD_POINTS, seed), UniformSample(SPATIAL_POINTS, seed, columns=6)
        axes = {
            "range": radar.range_m,
            "velocity": radar.velocity_mps(radar.cycles_per_frame),
            "spectrogram_velocity": radar.velocity_mps(SPECTROGRAM_CYCLES),
        }
        # Two channels on a line tell a direction along it.
        lines = {"azimuth": radar.tx_y * radar.rx_y > 1, "elevation": radar.tx_z * radar.rx_z > 1}
        self._angle_names = [name for name, there in lines.items() if there]
        axes |= {name: angle_grid(radar) for name in self._angle_names}
        self._store = MapStore(path, axes, {"title": title})
        step = max(1, round(_RANGE_TIME_S / radar.cycle_duration_s)) * radar.n_tx
        step_bytes = step * radar.n_rx * radar.samples_per_chirp * np.dtype(np.complex64).itemsize
        self.piece = step * max(1, int(_PIECE_BYTES / step_bytes))

    def take(self, spectra: NDArray[np.complex64], first: int) -> None:
        """The next chirps, ``spectra (chirp, rx, range)`` from chirp ``first`` on; whole TDM cycles.

        A block that is cut after any multiple of ``piece`` chirps gives the same as the whole.
        """
        radar, stages, store = self._radar, self._stages, self._store
        if self._received is not None and (cube := self._received.push(spectra, first)) is not None:
            self._keep_received(cube, self._received.start_cycle)
        with stages.time("clutter removal"):
            spectra = self._removal.block(spectra, first)
        with stages.time("range"):
            power, times = range_time(spectra, radar, first_chirp=first, step_s=_RANGE_TIME_S)
        with stages.time("spectrogram"):
            columns = self._spectrogram.push(spectra)
        with stages.time("write"):
            store.extend("slow_time", times, range_time=power)
            store.extend("spectrogram_time", columns.time, spectrogram=columns.power)
        for _, start, window in self._windows.push(spectra):
            with stages.time("clutter removal"):
                cube = self._removal.window(window)
            with stages.time("doppler"):
                power = power_map(cube, radar)
            with stages.time("cfar"):
                mask = os_cfar(power, pfa=self._pfa, looks=radar.n_channels)
            middle = float(radar.window_times(np.array([start]))[0])
            with stages.time("cloud"):
                self._rdt.push(mask, middle)
            with stages.time("angle"):
                maps = self._angles(cube, mask, middle)
            with stages.time("write"):
                angles = {name: values[None] for name, values in maps.items()}
                store.extend("time", [middle], range_doppler=power[None], detections=mask[None], **angles)

    def _keep_received(self, cube: NDArray[np.complexfloating], start_cycle: int) -> None:
        radar = self._radar
        with self._stages.time("received"):
            power = power_map(cube, radar)
            mask = os_cfar(power, pfa=self._pfa, looks=radar.n_channels)
            kept = {"range_doppler_received": power, "detections_received": mask}
            if "azimuth" in self._angle_names:
                kept["range_azimuth_received"] = range_azimuth(self._spectra(cube, mask), radar)
            self._store.put(float(radar.window_times(np.array([start_cycle]))[0]), **kept)

    def _spectra(self, cube: NDArray[np.complexfloating], mask: NDArray[np.bool_]) -> AngleSpectra:
        """Angle spectra of the detected cells of one window."""
        radar = self._radar
        rows, columns = np.nonzero(mask)
        velocity = radar.velocity_mps(radar.cycles_per_frame)
        return angle_spectra(cell_spectra(cube, radar, rows, columns), radar, radar.range_m[rows], velocity[columns])

    def _angles(
        self, cube: NDArray[np.complexfloating], mask: NDArray[np.bool_], middle: float
    ) -> dict[str, NDArray[np.floating]]:
        if not self._angle_names:
            return {}
        radar = self._radar
        spectra = self._spectra(cube, mask)
        found = spatial_points(spectra, radar, middle)
        self._spatial.add(np.column_stack([found.points, found.velocity, found.power, found.time]))
        makers = {"azimuth": range_azimuth, "elevation": range_elevation}
        return {f"range_{name}": makers[name](spectra, radar) for name in self._angle_names}

    def finish(self) -> Clouds:
        """Close the file and give the clouds."""
        self._store.close()
        with self._stages.time("cloud"):
            rdt = self._rdt.finish()
            rows = self._spatial.rows()
            rows = rows[np.argsort(rows[:, 5], kind="stable")]
        return Clouds(rdt, SpatialCloud(rows[:, :3], rows[:, 3], rows[:, 4], rows[:, 5]), self._spatial.n_seen)

    def close(self) -> None:
        """Close the file; also after an error."""
        self._store.close()
