"""`run`: one recording, one radar, one scene, one model, streamed from motion to point cloud."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Unpack

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
from rtradar.pipeline.output.echo_table import EchoTable
from rtradar.pipeline.output.map_store import open_maps, read_maps, read_truth
from rtradar.pipeline.output.pictures import draw_pictures
from rtradar.pipeline.output.snapshots import snapshots
from rtradar.pipeline.output.summary import cost, finished, room_findings, summary_of
from rtradar.pipeline.output.view import run_view_of
from rtradar.pipeline.output.writer import RUN_FILES, RunWriter, if_array, write_clouds
from rtradar.pipeline.prepare import people_in, prepare
from rtradar.pipeline.processing import Clouds
from rtradar.pipeline.result import Result
from rtradar.pipeline.timing import forget_peak_memory
from rtradar.radar import Radar
from rtradar.report import write_report
from rtradar.report.snapshots import save_snapshots
from rtradar.scene import Scene
from rtradar.settings import RunOptions, RunSettings, settings_of, takes_settings
from rtradar.system.checks import check_path
from rtradar.system.clock import Moment
from rtradar.system.output_folder import atomic_folder
from rtradar.trace.rays import rays_traced

_MOMENTS = 100, 20.0  # of the moving body on the page, and as many a second at most


@takes_settings
def run(
    motion: Moving,
    radar: Radar | str | Path,
    scene: Scene | str | Path | None = None,
    *,
    out: str | Path | None = None,
    overwrite: bool = False,
    pictures: bool = True,
    **options: Unpack[RunOptions],
) -> Result:
    """Simulate people before a radar: maps, clouds and a summary, in memory or in a folder.

    Parameters
    ----------
    motion : Motion, Person, str, path, or sequence of them and of Object
        Who moves: a recording, which the run places where the scene has its person, people with
        places of their own, or several of these, and objects beside those of the scene. Text is
        the path of a recording, or ``synthetic:`` and an activity.
    radar : Radar, str or path
        Radar, which the scene puts at its position, or what `Radar.load` takes.
    scene : Scene, str or path, optional
        Walls and furniture around the person, or what `Scene.load` takes; free space if left out.
    out : path, optional
        Folder for maps, clouds, pictures, report and summary, which is made if it does not exist.
        The files of an earlier run that its ``summary.json`` lists are replaced or removed; all
        others stay as they are. If left out, nothing is written, and the maps are kept in memory.
    overwrite : bool
        Whether files that ``out`` holds under names of the new ones are replaced even where no
        ``summary.json`` lists them.
    pictures : bool
        Whether pictures are drawn into ``out``. The report is made without them too.
    **options
        Settings, such as ``fidelity``, ``snr_db`` or ``seed``: the fields of `rtradar.RunSettings`.

    Returns
    -------
    Result

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
    parts = given_parts(motion, radar, scene, settings)
    if out is None:
        return _run_in_memory(*parts, settings)
    return run_into(check_path("out", out), *parts, settings, overwrite, pictures)


def _run_in_memory(motion: Movers, radar: Radar, scene: Scene, settings: RunSettings) -> Result:
    if settings.save_if:
        raise InputError(
            "save_if = True keeps IF samples in a folder; give it, out=, or take them from "
            "rt.simulate(...).samples"
        )
    started, rays_before = _start()
    capture = prepare(motion, radar, scene, settings, in_memory=True)
    file = BytesIO()
    clouds, table = _stream(capture, file)
    summary = summary_of(capture, clouds, started) | {"rays_traced": rays_traced() - rays_before}
    with capture.stages.time("write"), open_maps(file) as maps:
        maps.load()
        _add_room(summary, capture, maps)
        truth = read_truth(file)
    described = capture.described()
    summary["run"] = in_words(described)
    summary = finished(summary | cost(capture.processing, capture.n_chirps, started))
    kept = {"_in_memory": maps, "_truth": truth, "_table": table}
    return _result(capture, clouds, summary, described, **kept)


def run_into(
    out: Path,
    motion: Movers,
    radar: Radar,
    scene: Scene,
    settings: RunSettings,
    overwrite: bool = False,
    pictures: bool = True,
    place: Path | None = None,
) -> Result:
    """Run with these settings and write the files of `RUN_FILES` into a folder; see `run`.

    ``place`` is where the folder will be in the end, if that is elsewhere.
    """
    started, rays_before = _start()
    if not overwrite:
        refuse_another(out, [person.motion for person in people_in(scene, motion)[1]])
    # Place the person, build the echo model, and settle link budget, noise and clutter.
    capture = prepare(motion, radar, scene, settings)
    described = capture.described()
    with atomic_folder(out, RUN_FILES, overwrite=overwrite) as folder:
        kept = if_array(folder / "if.zarr", capture) if settings.save_if else None
        # Echoes, IF samples, range spectra, clutter removal, Doppler, detection and angles.
        clouds, table = _stream(capture, folder / "maps.h5", kept)
        with capture.stages.time("write"):
            write_clouds(folder, clouds)
        drawn: dict[str, Path] = {}
        if pictures:
            with capture.stages.time("pictures"):
                drawn = draw_pictures(folder, capture, clouds)
        summary = summary_of(capture, clouds, started)
        summary["rays_traced"] = rays_traced() - rays_before
        summary["run"] = write_run_file(folder, place or out, described)
        with capture.stages.time("view"):
            save_snapshots(folder / "view.npz", snapshots(table))
            with read_maps(folder / "maps.h5") as maps:
                _add_room(summary, capture, maps)
        with capture.stages.time("report"):
            write_report(
                folder / "report.html",
                radar=capture.radar,
                summary=summary,
                pictures=drawn,
                rdt_points=clouds.rdt.points,
                spatial=clouds.spatial,
                run_view=run_view_of(
                    folder,
                    summary,
                    capture.radar,
                    capture.processing.window_functions,
                    at_most=_MOMENTS,
                ),
            )
        summary |= {"pictures": pictures} | cost(capture.processing, capture.n_chirps, started)
        summary = finished(summary, folder)
    return _result(capture, clouds, summary, described, out=out.absolute())


def _result(
    capture: Capture,
    clouds: Clouds,
    summary: dict[str, Any],
    described: dict[str, Any],
    **where: Any,
) -> Result:
    """Return the result of a capture, whose maps are ``where`` it says."""
    found = clouds.rdt.points, clouds.spatial, summary, capture.radar, capture.link_budget
    return Result(*found, experiment=Experiment(described), **where)


def _start() -> tuple[Moment, int]:
    """Return the moment at which a run starts, and the number of rays traced before."""
    forget_peak_memory()
    return Moment.now(), rays_traced()


def _add_room(summary: dict[str, Any], capture: Capture, maps: Any) -> None:
    """Add what the open maps tell about the room, where there is one."""
    if "room" in summary:
        summary["room"] = summary["room"] | room_findings(capture, maps)


def _stream(capture: Capture, maps: Path | BinaryIO, kept: Any = None) -> tuple[Clouds, EchoTable]:
    """Stream a capture into a file of maps, and IF samples into an array.

    Returned are its clouds, and the table of its echoes.
    """
    table, starts = EchoTable(capture), capture.frame_starts
    with RunWriter(maps, capture.processing, capture.title, starts, table) as writer:
        capture.stream(writer, kept)
        return writer.finish(capture.body), table
