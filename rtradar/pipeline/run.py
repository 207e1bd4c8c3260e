"""`run` and `simulate`: a recording before a radar in a scene, to point clouds or IF samples."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Unpack, cast, overload

import numpy as np
from numpy.typing import NDArray

from rtradar.cards import text_card
from rtradar.description import (
    Movers,
    Moving,
    given_parts,
    in_words,
    refuse_another,
    write_run_file,
)
from rtradar.errors import InputError
from rtradar.pipeline.capture import Capture
from rtradar.pipeline.experiment import Experiment
from rtradar.pipeline.links import links_of
from rtradar.pipeline.output.pictures import draw_pictures, room_of
from rtradar.pipeline.output.snapshots import snapshots
from rtradar.pipeline.output.summary import cost, finished, room_findings, summary_of
from rtradar.pipeline.output.truth import EchoTable, chirps_between, labelled_echoes
from rtradar.pipeline.output.view import run_view_of
from rtradar.pipeline.output.writer import (
    RUN_FILES,
    RunWriter,
    if_array,
    open_maps,
    read_maps,
    read_truth,
    write_clouds,
)
from rtradar.pipeline.prepare import people_in, prepare
from rtradar.pipeline.processing import block_chirps, refuse_large
from rtradar.pipeline.result import Result, plots_of
from rtradar.pipeline.timing import forget_peak_memory
from rtradar.radar import Radar
from rtradar.report import write_report
from rtradar.report.snapshots import save_snapshots
from rtradar.scatter.link_budget import LinkBudget
from rtradar.scene import Scene
from rtradar.settings import RunOptions, RunSettings, SimulationOptions, settings_of, takes_settings
from rtradar.signal.multiplexing import chirps_together
from rtradar.system.checks import check_path
from rtradar.system.output_folder import atomic_folder

if TYPE_CHECKING:
    import xarray as xr

    from rtradar.pipeline.recorded import Samples

_MOMENTS = 100, 20.0  # of the moving body on the page, and as many a second at most


@overload
def run(
    motion: Moving,
    radar: Radar | str | Path,
    scene: Scene | str | Path | None = None,
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    pictures: bool = False,
    links: str = "own",
    **options: Unpack[RunOptions],
) -> Result: ...
@overload
def run(
    motion: Moving,
    radar: list[Radar | str | Path] | list[Radar] | list[str] | tuple[Radar | str | Path, ...],
    scene: Scene | str | Path | None = None,
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    pictures: bool = False,
    links: str = "own",
    **options: Unpack[RunOptions],
) -> dict[str, Result]: ...
@takes_settings
def run(
    motion: Moving,
    radar: Radar | str | Path | Sequence[Radar | str | Path],
    scene: Scene | str | Path | None = None,
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    pictures: bool = False,
    links: str = "own",
    **options: Unpack[RunOptions],
) -> Result | dict[str, Result]:
    """Simulate people before a radar: maps, clouds and a summary, in memory or in a folder.

    Parameters
    ----------
    motion : Motion, Person, str, path, or sequence of them and of Object
        Who moves: a recording, which the run places where the scene has its person, people with
        places of their own, or several of these, and objects beside those of the scene. Text is
        the path of a recording, or ``synthetic:`` and an activity.
    radar : Radar, str or path, or list of them
        Radar, which the scene puts at its position, or what `Radar.load` takes. Several radars see
        the same people at the same times, each with a name and, but for one, a place of its own.
    scene : Scene, str or path, optional
        Walls and furniture around the person, or what `Scene.load` takes; free space if left out.
    links : {"own", "all"}
        Whether each of several radars receives what it has sent itself, or also what each other
        has: the link ``a>b`` has the Tx of a, and all else of b. What goes straight is left out.
    out : path, optional
        Folder for maps, clouds, pictures, report and summary, which is made if it does not exist.
        The files of an earlier run that its ``summary.json`` lists are replaced or removed; all
        others stay as they are. If left out, nothing is written, and the maps are kept in memory.
    overwrite : bool
        Whether files that ``out`` holds under names of the new ones are replaced even where no
        ``summary.json`` lists them.
    pictures : bool
        Whether maps, clouds and room are also drawn as PNG files into ``out``. The report shows
        them all by itself.
    **options
        Settings, such as ``fidelity``, ``snr_db`` or ``seed``: the fields of `rtradar.RunSettings`.

    Returns
    -------
    Result, or dict of Result
        A dict by the names of the links, as of the folders in ``out``, where there are several.

    Raises
    ------
    InputError
        If a value is invalid, or if the maps are too large for memory and ``out`` is left out;
        nothing is written then.
    BackendError
        If the model traces rays and no backend of the requested kind works.
    ExtensionError
        If code of another package fails.

    Examples
    --------
    >>> import rtradar as rt
    >>> motion = rt.synthetic_motion("walk", duration_s=0.5)
    >>> radar = rt.Radar.preset("paper-12ghz")
    >>> result = rt.run(motion, radar, fidelity="analytic", duration_s=0.15)
    >>> result.maps["range_doppler"].dims
    ('time', 'range', 'velocity')
    >>> result.summary["windows"], result.out
    (3, None)
    """
    settings = settings_of("run", RunOptions, options)
    if isinstance(radar, list | tuple):
        place = None if out is None else check_path("out", out)
        return _run_links(motion, radar, scene, settings, links, place, overwrite, pictures)
    parts = given_parts(motion, cast("Radar | str | Path", radar), scene, settings)
    if out is not None:
        return run_into(check_path("out", out), *parts, settings, overwrite, pictures)
    if settings.save_if:
        raise InputError(
            "save_if = True keeps IF samples in a folder; give it, out=, or take them from "
            "rt.simulate(...).samples"
        )
    forget_peak_memory()
    return results_of(prepare(*parts, settings, in_memory=True))


def _run_links(
    motion: Moving,
    radars: Sequence[Radar | str | Path],
    scene: Scene | str | Path | None,
    settings: RunSettings,
    links: str,
    out: Path | None,
    overwrite: bool,
    pictures: bool,
) -> dict[str, Result]:
    """Run each link of several radars; see `run`."""
    # People and scene are loaded once; all links are checked before the first runs.
    loaded = [given_parts([], one, None, settings)[1] for one in radars]
    people, _, room = given_parts(motion, loaded[0] if loaded else "", scene, settings)
    found = {}
    for name, radar in links_of(loaded, room, links).items():
        if out is None:
            forget_peak_memory()
            found[name] = results_of(prepare(people, radar, room, settings, in_memory=True))
        else:
            found[name] = run_into(out / name, people, radar, room, settings, overwrite, pictures)
    return found


def run_into(
    out: Path,
    motion: Movers,
    radar: Radar,
    scene: Scene,
    settings: RunSettings,
    overwrite: bool = False,
    pictures: bool = False,
    place: Path | None = None,
) -> Result:
    """Run with these settings and write the files of `RUN_FILES` into a folder; see `run`.

    ``place`` is where the folder will be in the end, if that is elsewhere.
    """
    forget_peak_memory()
    if not overwrite:
        refuse_another(out, [person.motion for person in people_in(scene, motion)[1]])
    # Place the person, build the echo model, and settle link budget, noise and clutter.
    capture = prepare(motion, radar, scene, settings)
    return results_of(capture, out, overwrite, pictures, place)


def results_of(
    source: Capture | Samples,
    out: Path | None = None,
    overwrite: bool = False,
    pictures: bool = False,
    place: Path | None = None,
) -> Result:
    """Process what is received, simulated or recorded, in memory or into a folder.

    ``place`` is where the folder will be in the end, if that is elsewhere.
    """
    stages = source.processing.stages
    # In memory: the maps go into a file that is held in memory, and are read from it as a dataset.
    if out is None:
        file = BytesIO()
        result, table = _streamed(source, file)
        with stages.time("write"), open_maps(file) as maps:
            maps.load()
            held: dict[str, Any] = {"_in_memory": maps, "_table": table}
            if table is not None:
                result.summary.update(room_findings(table.capture, plots_of(result, maps)))
                result.summary["run"] = in_words(table.capture.described())
                held["_truth"] = read_truth(file)
        return replace(result, summary=finished(result.summary | cost(source)), **held)
    # In a folder: all files appear together, or none of them where something fails.
    with atomic_folder(out, RUN_FILES, overwrite=overwrite) as folder:
        kept = None
        if source.processing.settings.save_if:
            kept = if_array(folder / "if.zarr", source.processing.radar, source.n_chirps)
        result, table = _streamed(source, folder / "maps.h5", kept)
        summary = result.summary
        with stages.time("write"):
            write_clouds(folder, result.points, result.spatial)
        # Everything that is drawn is drawn from the file of the maps, which need not fit into
        # memory.
        room = run_view = None
        with read_maps(folder / "maps.h5") as maps:
            plots = plots_of(result, maps)
            if table is not None:
                summary["run"] = write_run_file(folder, place or out, table.capture.described())
                summary["pictures"] = pictures
                with stages.time("view"):
                    moments = snapshots(table)
                    save_snapshots(folder / "view.npz", moments)
                    summary |= room_findings(table.capture, plots)
                    run_view = run_view_of(result, maps, moments.every(moments.stride(*_MOMENTS)))
                    room = room_of(table.capture, plots)
            if pictures:
                with stages.time("pictures"):
                    draw_pictures(folder, plots, room)
            with stages.time("report"):
                write_report(folder / "report.html", plots, room=room, run_view=run_view)
        # The summary comes last, because it lists all files and has the time that everything took.
        return replace(result, summary=finished(summary | cost(source), folder), out=out.absolute())


def _streamed(
    source: Capture | Samples, file: Path | BinaryIO, kept: Any = None
) -> tuple[Result, EchoTable | None]:
    """Stream what is received into a file of maps, and IF samples into an array.

    Returned are the results, whose summary has what is known so far, and the table of the echoes
    where these are simulated.
    """
    # Echoes, IF samples, range spectra, clutter removal, Doppler, detection and angles.
    table = EchoTable(source) if isinstance(source, Capture) else None
    with RunWriter(file, source.processing, source.title, source.frame_starts, table) as writer:
        # Only what is simulated may be kept.
        source.stream(writer, *([] if kept is None else [kept]))
        clouds = writer.finish()
    # Of samples that were recorded neither echoes nor people are known.
    simulated: dict[str, Any] = {}
    if table is not None:
        budget, experiment = table.capture.link_budget, Experiment(table.capture.described())
        simulated = {"link_budget": budget, "experiment": experiment}
    found = clouds.rdt.points, clouds.spatial, summary_of(source, clouds), source.processing.radar
    return Result(*found, **simulated), table


# -- IF samples, whole or block by block ----------------------------------------------------------


@takes_settings
def simulate(
    motion: Moving,
    radar: Radar | str | Path,
    scene: Scene | str | Path | None = None,
    **options: Unpack[SimulationOptions],
) -> Simulation:
    """Prepare the simulation of a recording, which gives IF samples when it is asked for them.

    Parameters
    ----------
    motion, radar, scene
        The same as for `run`.
    **options
        Settings of the simulation, such as ``fidelity``, ``snr_db`` or ``duration_s``: fields of
        `rtradar.RunSettings`.

    Returns
    -------
    Simulation
        Its samples are those that `run` processes with the same settings.

    Raises
    ------
    InputError, BackendError, ExtensionError
        As in `run`.

    Examples
    --------
    >>> import rtradar as rt
    >>> motion = rt.synthetic_motion("kick", duration_s=0.5)
    >>> radar = rt.Radar.preset("paper-12ghz")
    >>> capture = rt.simulate(motion, radar, fidelity="analytic", duration_s=0.15, snr_db=10)
    >>> capture.samples.dims, capture.samples.shape
    (('chirp', 'rx', 'sample'), (2400, 8, 256))
    >>> sum(len(block) for block in capture.blocks())
    2400
    """
    settings = settings_of("simulate", SimulationOptions, options)
    return Simulation(prepare(*given_parts(motion, radar, scene, settings), settings))


@dataclass(frozen=True, eq=False, repr=False)
class Simulation:
    """Capture of a moving person by a radar, whose IF samples are computed when they are asked for.

    `simulate` makes it. IF samples are complex amplitudes [m], as `rtradar.signal.synthesize`
    defines them, with noise and with the echoes of the room.
    """

    _capture: Capture

    @property
    def radar(self) -> Radar:
        """Radar at its position in the scene."""
        return self._capture.radar

    @property
    def link_budget(self) -> LinkBudget:
        """Echo power of each part over time, and its occluded fraction."""
        return self._capture.link_budget

    @property
    def noise_power_m2(self) -> float:
        """Noise power of one complex sample [m^2]."""
        return self._capture.noise.power

    @property
    def duration_s(self) -> float:
        """Duration of the capture, whole cycles [s]."""
        return self.radar.duration_of(self._capture.n_chirps)

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape (chirp, rx, sample) of the samples.

        Under Doppler division all transmitters transmit at once, and each cycle is one chirp.
        """
        chirps = self._capture.n_chirps // chirps_together(self.radar)
        return chirps, self.radar.n_rx, self.radar.samples_per_chirp

    @cached_property
    def samples(self) -> xr.DataArray:
        """IF samples (chirp, rx, sample) complex64, computed at the first access and kept.

        Coordinates are the time of each chirp, its transmitter, and the time within the chirp. An
        `InputError` is raised if they are larger than `rtradar.pipeline.MEMORY_LIMIT_BYTES`;
        `blocks` gives them in little memory.
        """
        n_bytes = float(np.prod(self.shape, dtype=np.float64)) * np.dtype(np.complex64).itemsize
        refuse_large(
            f"IF samples of {self.duration_s:.3g} s of radar '{self.radar.name}'",
            n_bytes,
            "take them block by block, blocks(), or keep them in a folder: "
            "rt.run(..., save_if=True, out=...)",
        )
        whole = np.empty(self.shape, np.complex64)
        for begin, values in self._blocks():
            whole[begin : begin + len(values)] = values
        return if_samples(whole, self.radar)

    def echoes(self, start_s: float = 0.0, duration_s: float | None = None) -> xr.Dataset:
        """Compute the echoes of each chirp by the level of the simulation: what was traced.

        Parameters
        ----------
        start_s : float
            Time from which on chirps are taken, since the start of the capture [s].
        duration_s : float, optional
            Time over which they are taken [s]; to the end of the capture if left out.

        Returns
        -------
        xarray.Dataset
            By ``chirp``, ``rx`` and ``echo``: ``length_m``, the length of the whole path from Tx to
            Rx at the centre of the chirp [m], float64; ``amplitude``, as `rtradar.Echoes` defines
            it, at the centre of the sweep [m], complex128; and ``visible``, whether it is not 0.
            Coordinates are the ``time`` [s] and the number ``tx`` of each chirp, and of each echo
            the names of its ``part`` and ``path``, the number of the ``person``, -1 of an object,
            and the number of its ``bounces``.

        Raises
        ------
        InputError
            If no chirp is in that time, or the echoes take more memory than results may.

        Examples
        --------
        >>> import rtradar as rt
        >>> motion = rt.synthetic_motion("kick", duration_s=0.5)
        >>> radar = rt.Radar.preset("paper-12ghz")
        >>> capture = rt.simulate(motion, radar, fidelity="analytic", duration_s=0.15)
        >>> echoes = capture.echoes(duration_s=0.01)
        >>> dict(echoes.sizes)
        {'chirp': 160, 'rx': 8, 'echo': 21}
        """
        return labelled_echoes(self._capture, chirps_between(self._capture, start_s, duration_s))

    def blocks(self) -> Iterator[xr.DataArray]:
        """Compute the samples in blocks of chirps, in constant memory.

        Yields
        ------
        (chirp, rx, sample) complex64
            Samples of whole cycles, with the same coordinates as `samples`. Together they are equal
            to these to the bit.
        """
        for begin, values in self._blocks():
            yield if_samples(values.copy(), self.radar, begin)

    def _blocks(self) -> Iterator[tuple[int, NDArray[np.complex64]]]:
        together = chirps_together(self.radar)
        for first, values in self._capture.received(block_chirps(self.radar)):
            yield first // together, values

    def __repr__(self) -> str:
        chirps, rx, samples = self.shape
        rows = {
            "samples": f"chirp {chirps}, rx {rx}, sample {samples}; complex64 [m]",
            "size": f"{self.duration_s:.3f} s, {chirps * rx * samples * 8 / 1e6:.0f} MB",
            "noise": f"{self.noise_power_m2:.3g} m2 per sample",
        }
        return text_card("Simulation", self._capture.title, rows)


def if_samples(values: NDArray[np.complex64], radar: Radar, first: int = 0) -> xr.DataArray:
    """Give IF samples (chirp, rx, sample) their coordinates, from chirp ``first`` on."""
    import xarray as xr  # slow to import

    n, n_rx, n_samples = values.shape
    together, rows = chirps_together(radar), np.arange(first, first + n)
    # Under Doppler division the chirps of a cycle are transmitted together.
    times = radar.centres_of(rows * together)
    coordinates = {
        "chirp": ("chirp", rows, {"long_name": "number of the chirp in the capture"}),
        "time": (
            "chirp",
            times,
            {"units": "s", "long_name": "centre of the chirp since the start of the capture"},
        ),
        "rx": ("rx", np.arange(n_rx), {"long_name": "receiver of the line that is in use"}),
        "fast_time": (
            "sample",
            np.arange(n_samples) / radar.sample_rate_hz,
            {"units": "s", "long_name": "time since the first sample of the chirp"},
        ),
    }
    if not radar.receives_sums:
        text = {"long_name": "transmitter of the chirp"}
        coordinates["tx"] = ("chirp", rows % radar.n_tx, text)
    described = {"units": "m", "long_name": "IF samples", "multiplexing": radar.multiplexing}
    return xr.DataArray(values, coordinates, ("chirp", "rx", "sample"), "if_samples", described)
