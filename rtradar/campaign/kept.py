"""What a data set keeps of each sample beside its clouds: maps, and the joints as labels."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any, NamedTuple, Unpack

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.clouds.sample_files import ARRAYS, KINDS
from rtradar.description import Movers
from rtradar.pipeline.output.truth import EchoTable
from rtradar.pipeline.output.writer import axes_of
from rtradar.pipeline.prepare import prepare
from rtradar.pipeline.processing import CloudMaker, Clouds, Processing, SourceOfCells
from rtradar.pipeline.sources import Sources
from rtradar.process import angle_grid, measured_angles, range_azimuth, window_cycles
from rtradar.radar import Radar
from rtradar.scene import Scene
from rtradar.settings import RunOptions, RunSettings

KEPT = tuple(kind for kind in KINDS if kind not in ("clouds", "spatial"))
"""Kinds that a specification may keep."""


class Capture(NamedTuple):
    """Clouds of one sample, and the arrays that it keeps by name.

    ``sources`` are the names of people and objects whom the spatial points may be of; there are
    none where one person is alone.
    """

    clouds: Clouds
    maps: dict[str, NDArray[Any]]
    sources: tuple[str, ...] = ()


def capture_of(
    people: Movers,
    radar: Radar,
    scene: Scene,
    keep: Sequence[str],
    angles: bool = True,
    clouds: bool = True,
    **options: Unpack[RunOptions],
) -> Capture:
    """Compute the clouds of a run with these settings, and the kinds of arrays to ``keep``.

    Joints are those of the first person. Without ``angles`` the spatial cloud is empty, without
    ``clouds`` all are.
    """
    angles = angles and (clouds or "range_azimuth" in keep)
    capture = prepare(people, radar, scene, RunSettings(**options))
    # Who returned a point is asked only where there are several to ask for.
    sources = (*capture.body.names, *(one.name for one in capture.scene.objects))
    several = angles and clouds and len(sources) > 1
    source_of = Sources(EchoTable(capture, middles=False)).of_cells if several else None
    keeper = MapKeeper(capture.processing, keep, source_of, angles, clouds)
    capture.stream(keeper, progress=False)
    # Joints are labels at the times of the frames.
    maps = keeper.maps()
    if "joints" in keep:
        maps.setdefault("time", capture.radar.window_times(capture.frame_starts))
        maps["joints"] = capture.body.people[0].motion.at(maps["time"])[0]
    return Capture(keeper.finish(), maps, sources if several else ())


def sizes(radar: Radar, window_s: float | None = None) -> tuple[object, ...]:
    """Return what decides the sizes and axes of a radar's maps, for comparison.

    ``window_s`` is the length of a window of the spectrogram [s].
    """
    window = window_cycles(radar, window_s)
    return (
        radar.range_m.tobytes(),
        *(radar.velocity_mps(n).tobytes() for n in (radar.cycles_per_frame, window)),
        measured_angles(radar) and angle_grid(radar).tobytes(),
        radar.cycle_duration_s,
        radar.hop_cycles,
    )


class MapKeeper:
    """Makes the clouds of one capture from its range spectra, and collects maps on the way.

    ``source_of`` tells who returned most of a cell, where that is asked; without ``angles`` the
    spatial cloud is empty, without ``clouds`` all are, and frames are processed only where a map of
    theirs is kept. So that memory stays low, `push` takes at most ``max_chirps`` chirps.
    """

    def __init__(
        self,
        processing: Processing,
        keep: Sequence[str],
        source_of: SourceOfCells | None = None,
        angles: bool = True,
        clouds: bool = True,
    ) -> None:
        self._processing, self._keep, self._makes_clouds = processing, keep, clouds
        self._clouds = CloudMaker(processing, source_of, angles)
        self.max_chirps = self._clouds.max_chirps
        self._spectrogram = processing.spectrogram()
        self._steps: defaultdict[str, list[NDArray[np.floating]]] = defaultdict(list)

    def push(self, spectra: NDArray[np.complex64], first: int) -> None:
        """Process the next chirps, (chirp, rx, range) of whole TDM cycles from ``first`` on."""
        spectra = self._clouds.without_clutter(spectra, first)
        if "spectrograms" in self._keep:
            columns = self._spectrogram.push(spectra)
            self._add(spectrogram_time=columns.time, spectrogram=columns.power)
        # Without clouds or maps of frames the spectrogram is all there is to compute.
        if not (self._makes_clouds or {"range_doppler", "range_azimuth"} & {*self._keep}):
            return
        for frame in self._clouds.frames(spectra):
            self._add(time=[frame.middle_s])
            if "range_doppler" in self._keep:
                self._add(range_doppler=frame.power[None])
            if "range_azimuth" in self._keep and frame.angles is not None:
                self._add(range_azimuth=range_azimuth(frame.angles, self._processing.radar)[None])

    def _add(self, **steps: ArrayLike) -> None:
        for name, values in steps.items():
            self._steps[name].append(np.asarray(values, dtype=ARRAYS[name].dtype))

    def maps(self) -> dict[str, NDArray[np.floating]]:
        """Return the maps of all frames by name, with their axes; nothing if none is kept.

        Maps and joints share the time axis of the frames. Call it once: the frames of a map are
        freed when the map is joined, so that memory never holds all maps twice.
        """
        if not self._keep:
            return {}
        maps = {name: np.concatenate(self._steps.pop(name)) for name in list(self._steps)}
        needed = {axis for name in maps for axis in ARRAYS[name].dims}
        axes = axes_of(self._processing)
        return maps | {name: values for name, values in axes.items() if name in needed}

    def finish(self) -> Clouds:
        """Return the clouds of all frames so far."""
        return (self._clouds if self._makes_clouds else CloudMaker(self._processing)).finish()
