"""From range spectra, block by block, to maps in a file beside the clouds, in constant memory."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rtradar.pipeline.cloud_maker import RANGE_TIME_S, CloudMaker, Clouds, window_angles
from rtradar.pipeline.output.map_store import MapStore
from rtradar.pipeline.received import ReceivedWindow
from rtradar.pipeline.timing import Stages
from rtradar.process import (
    ClutterRemoval,
    Detector,
    SlidingRangeTime,
    SlidingSpectrogram,
    WindowFunctions,
    angle_grid,
    measured_angles,
    power_map,
    range_azimuth,
    range_elevation,
    window_cycles,
)
from rtradar.process.window_functions import HANN
from rtradar.radar import Radar


class Products:
    """All that is made of the range spectra of one capture.

    Parameters
    ----------
    path : path
        HDF5 file of the maps, written anew.
    radar : Radar
    detect : Detector
    seed : int
        Of the sampling of clouds.
    stages : Stages
        Where the time goes.
    title : str
        Of the file.
    removal : ClutterRemoval
        Applied to everything that is made of the spectra.
    received : ReceivedWindow, optional
        A window whose map is kept as it was before the removal.
    window_functions : WindowFunctions
        Window functions of the range spectra and in slow time.

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
        detect: Detector,
        seed: int,
        stages: Stages,
        title: str,
        removal: ClutterRemoval,
        received: ReceivedWindow | None = None,
        window_functions: WindowFunctions = HANN,
    ) -> None:
        self._window_functions = window_functions
        self._radar, self._detect, self._stages, self._received = radar, detect, stages, received
        self._clouds = CloudMaker(
            radar,
            detect=detect,
            seed=seed,
            stages=stages,
            removal=removal,
            window_functions=window_functions,
        )
        self._spectrogram = SlidingSpectrogram(
            radar, removal=removal, window_functions=window_functions
        )
        self._range_time = SlidingRangeTime(radar, removal, step_s=RANGE_TIME_S)
        self.piece = self._clouds.piece
        axes = {
            "range": radar.range_m,
            "velocity": radar.velocity_mps(radar.cycles_per_frame),
            "spectrogram_velocity": radar.velocity_mps(window_cycles(radar)),
        }
        self._angle_names = measured_angles(radar)
        axes |= {name: angle_grid(radar) for name in self._angle_names}
        removed = {
            "time": removal.description(radar.cycles_per_frame),
            "slow_time": removal.description(self._range_time.window_cycles),
            "spectrogram_time": removal.description(window_cycles(radar)),
        }
        self._store = MapStore(path, axes, {"title": title}, clutter_removal=removed)

    def take(self, spectra: NDArray[np.complex64], first: int) -> None:
        """The next chirps, ``spectra (chirp, rx, range)`` from chirp ``first`` on; whole TDM cycles.

        A block that is cut after any multiple of ``piece`` chirps gives the same as the whole.
        """
        radar, stages, store = self._radar, self._stages, self._store
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
        makers = {"azimuth": range_azimuth, "elevation": range_elevation}
        for window in self._clouds.windows(spectra):
            with stages.time("angle"):
                angles = {
                    f"range_{name}": makers[name](window.angles, radar)[None]
                    for name in self._angle_names
                    if window.angles
                }
            with stages.time("write"):
                store.extend(
                    "time",
                    [window.middle_s],
                    range_doppler=window.power[None],
                    detections=window.mask[None],
                    **angles,
                )

    def _keep_received(self, cube: NDArray[np.complexfloating], start_cycle: int) -> None:
        radar = self._radar
        with self._stages.time("received"):
            power = power_map(cube, radar, window_functions=self._window_functions)
            mask = self._detect(power)
            kept = {"range_doppler_received": power, "detections_received": mask}
            if "azimuth" in self._angle_names:
                kept["range_azimuth_received"] = range_azimuth(
                    window_angles(cube, mask, radar, self._window_functions), radar
                )
            self._store.put(float(radar.window_times(np.array([start_cycle]))[0]), **kept)

    def finish(self) -> Clouds:
        """Write what is held, close the file and give the clouds."""
        power, times = self._range_time.finish()
        self._store.extend("slow_time", times, range_time=power)
        self._store.close()
        return self._clouds.finish()

    def close(self) -> None:
        """Close the file; also after an error."""
        self._store.close()
