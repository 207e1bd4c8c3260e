"""`Result`: what a run found, in memory, with its files where a folder was given."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rtradar.cards import html_card, text_card
from rtradar.clouds import SpatialCloud
from rtradar.errors import InputError
from rtradar.pipeline.output.snapshots import snapshots
from rtradar.pipeline.output.truth import EchoTable
from rtradar.pipeline.output.writer import open_maps, read_truth
from rtradar.radar import Radar
from rtradar.report.canvas import central_limits
from rtradar.report.html import InlinePage, signal_to_noise
from rtradar.report.plots import Plots
from rtradar.scatter.link_budget import LinkBudget
from rtradar.system.figure_style import figure_for, new_figure, png_of

if TYPE_CHECKING:
    import xarray as xr

    from rtradar.pipeline.experiment import Experiment


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
    experiment : Experiment, optional
        What was simulated, to be changed and run again; None for IF samples.

    Examples
    --------
    >>> import rtradar as rt
    >>> motion = rt.synthetic_motion("walk", duration_s=0.5)
    >>> result = rt.run(
    ...     motion, rt.Radar.preset("paper-12ghz"), fidelity="analytic", duration_s=0.15
    ... )
    >>> frame = result.maps["range_doppler"].sel(time=0.1, method="nearest")
    >>> frame.shape, frame.attrs["units"]
    ((256, 133), 'm2')
    >>> axes = result.plot.spectrogram()
    >>> axes.get_xlabel()
    'Time [s]'
    """

    points: NDArray[np.float64]
    spatial: SpatialCloud
    summary: dict[str, Any]
    radar: Radar
    link_budget: LinkBudget | None = None
    out: Path | None = None
    experiment: Experiment | None = None
    _in_memory: xr.Dataset | None = None
    _truth: xr.Dataset | None = None
    _table: EchoTable | None = None

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

    @cached_property
    def truth(self) -> xr.Dataset:
        """What is true of each part of the people and of each object, at the times of the frames.

        By ``time`` and ``part``: ``range_m`` and ``range_rate_mps`` of the direct echo, seen or
        not, NaN of a part that has none at that level; its ``power_m2`` and whether it is
        ``visible``; and by ``part`` the number of the ``person``, -1 of an object. An `InputError`
        is raised for IF samples, whose echoes are not known, and if the file is not there any more.
        """
        if self._truth is not None:
            return self._truth
        if self.out is None or self.link_budget is None:
            raise InputError(
                "truth: of IF samples the echoes are not known; simulate them with rt.run"
            )
        return read_truth(self.out / "maps.h5")

    @cached_property
    def plot(self) -> Plots:
        """Pictures of the maps and clouds, such as ``plot.range_doppler(time_s=1.2)``.

        Each method returns Matplotlib axes, in the units of the field.
        """
        return plots_of(self, self.maps, new_figure=figure_for)

    def view(self, *, height_px: int = 900) -> InlinePage:
        """Show body, paths and maps, linked and over time, as a page in the notebook.

        Parameters
        ----------
        height_px : int
            Height of the page in the notebook [pixel].

        Returns
        -------
        InlinePage
            Page that a notebook shows, and that its method ``save`` writes into a file.

        Raises
        ------
        InputError
            If the results are those of IF samples, where there is no body to show, or if files of
            the folder are missing or damaged.
        """
        from rtradar.pipeline.output.view import load_run_view, run_view_of
        from rtradar.report.run_view import write_view

        if self._table is not None:
            maps = {str(name): values.values for name, values in self.maps.variables.items()}
            run_view = run_view_of(self, maps, snapshots(self._table))
        elif self.out is not None:
            run_view = load_run_view(self.out)
        else:
            raise InputError(
                "view: IF samples have no body to show; look at the maps with result.plot"
            )
        # The page is written as a file, as for `rtradar view`, and read again.
        with TemporaryDirectory() as folder:
            write_view(Path(folder) / "view.html", run_view)
            page = (Path(folder) / "view.html").read_text(encoding="utf-8")
        return InlinePage(page, height_px)

    @property
    def _title(self) -> str:
        return str(self.summary["parameters"].get("motion", "IF samples"))

    def _rows(self) -> dict[str, str]:
        """Return what the radar saw, by labels."""
        summary, rows = self.summary, {}
        if len(self.points):
            low, high = central_limits(self.points)
            nearest, farthest = summary.get("detected_range_m") or (low[1], high[1])
            rows["range"] = f"{nearest:.1f} to {farthest:.1f} m"
            rows["velocity"] = f"{low[2]:+.1f} to {high[2]:+.1f} m/s, positive: receding"
        if ratio := signal_to_noise(summary):
            rows["SNR"] = ratio
        frames = f"in {summary['windows']} frames of {summary['capture_s']:.2f} s of radar"
        rows["detections"] = f"{summary['detections']} {frames}"
        rows["points"] = (
            f"{len(self.points)} (time, range, velocity), drawn on the surface about the detections"
        )
        rows["spatial"] = f"{len(self.spatial.points)} points (x, y, z)"
        return rows

    def _made(self) -> dict[str, str]:
        """Return how and where it was made, by labels."""
        parameters = self.summary["parameters"]
        names = [f"{key} {parameters[key]}" for key in ("fidelity", "scene") if key in parameters]
        return {
            "made by": ", ".join([f"radar {self.radar.name}", *names]),
            "computed in": f"{self.summary['wall_s']:.1f} s",
            "maps": "in memory" if self.out is None else str(self.out),
        }

    def __repr__(self) -> str:
        return text_card("Result", self._title, self._rows() | self._made())

    def _repr_html_(self) -> str:
        picture = None
        with suppress(InputError):  # the folder may be gone
            axes = plots_of(self, self.maps).range_doppler()
            picture = png_of(axes.get_figure(root=True))
        note = "result.plot draws, result.view() moves, result.maps has the maps."
        rows = self._rows() | self._made()
        tables = {"": {label[0].upper() + label[1:]: value for label, value in rows.items()}}
        return html_card("Result", self._title, tables, picture=picture, note=note)


def plots_of(result: Result, maps: Any, **options: Any) -> Plots:
    """Return the pictures of a result and its open maps, on figures for files where none are told.

    The options are those of `Plots`.
    """
    found = maps, result.points, result.spatial, result.radar, result.summary
    return Plots(*found, **{"new_figure": new_figure, **options})
