"""`Result`: what a run found, in memory, with its files where a folder was given."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds import SpatialCloud
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.map_store import open_maps
from rtradar.radar import Radar
from rtradar.scatter.link_budget import LinkBudget

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """Results of a run, or of IF samples that were processed.

    Parameters
    ----------
    points : (point, 3) float64
        RDT cloud: time [s], range [m], velocity [m/s].
    spatial : SpatialCloud
        Spatial cloud: place [m], velocity [m/s], power and time [s] of each point.
    summary : dict
        Contents of ``summary.json``.
    radar : Radar
        Radar at its position in the scene.
    link_budget : LinkBudget, optional
        Echo power of each part over time, and its occluded fraction; None for IF samples, whose
        echoes are not known one by one.
    out : path, optional
        Folder of the files; None if everything is in memory.
    """

    points: NDArray[np.float64]
    spatial: SpatialCloud
    summary: dict[str, Any]
    radar: Radar
    link_budget: LinkBudget | None = None
    out: Path | None = None
    _in_memory: xr.Dataset | None = field(default=None)
    _capture: Capture | None = field(default=None)

    @cached_property
    def maps(self) -> xr.Dataset:
        """Maps as ``maps.h5`` has them, with axes, units and meanings in ``attrs``.

        They are ``range_doppler``, ``detections``, ``range_time``, ``spectrogram``, and
        ``range_azimuth`` and ``range_elevation`` where the radar measures these angles; powers are
        in m^2. With a folder, values are read from there when they are needed. An `InputError` is
        raised if the file is not there any more.
        """
        if self._in_memory is not None:
            return self._in_memory
        assert self.out is not None
        return open_maps(self.out / "maps.h5")

    def __repr__(self) -> str:
        return "\n".join(self._lines())

    def _lines(self) -> Iterator[str]:
        summary, parameters = self.summary, self.summary["parameters"]
        named = [f"{key} {parameters[key]}" for key in ("fidelity", "scene") if key in parameters]
        title = parameters.get("motion", "IF samples")
        yield f"Result of {', '.join([title, f'radar {self.radar.name}', *named])}"
        yield (
            f"  {summary['capture_s']:.2f} s of radar in {summary['windows']} frames, "
            f"{summary['detections']} detections"
        )
        if len(self.points):
            (_, nearest, slowest), (_, farthest, fastest) = (
                limit(self.points, axis=0) for limit in (np.min, np.max)
            )
            yield (
                f"  range {nearest:.2f} to {farthest:.2f} m, "
                f"velocity {slowest:.2f} to {fastest:.2f} m/s"
            )
        yield f"  points {self.points.shape}: time [s], range [m], velocity [m/s]"
        yield f"  spatial {self.spatial.points.shape}: x, y, z [m]; velocity, power, time"
        yield f"  maps {'in memory' if self.out is None else f'in {str(self.out)!r}'}"
