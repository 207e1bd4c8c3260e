"""`Experiment`: what is simulated, to be changed by keys, run, and run again for several values."""

from __future__ import annotations

import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rtradar.cards import text_table
from rtradar.description import Parts, parts_of, read_run_file, with_value
from rtradar.errors import InputError
from rtradar.pipeline.compared import chamfer_bins, write_tables
from rtradar.pipeline.prepare import prepare
from rtradar.pipeline.result import Result
from rtradar.system.checks import check_path
from rtradar.system.output_folder import OutputFiles, atomic_folder, one_of

if TYPE_CHECKING:
    from rtradar.pipeline.run import Simulation


@dataclass(frozen=True, eq=False)
class Experiment:
    """People, radar, scene and settings of a run, as a run file has them.

    Parameters
    ----------
    table : mapping
        Tables ``people``, ``radar``, ``scene`` and ``settings``.
    folder : path
        Folder that relative paths start from; by default the current one.

    Examples
    --------
    >>> import rtradar as rt
    >>> walk = {"motion": "synthetic:walk", "duration_s": 0.5}
    >>> experiment = rt.Experiment({"people": [walk], "settings": {"duration_s": 0.15}})
    >>> tilted = experiment.replace("radar.pitch_deg", -15).replace("settings.fidelity", "analytic")
    >>> tilted.run().radar.pitch_deg
    -15.0
    """

    table: Mapping[str, Any]
    folder: Path = field(default_factory=Path)

    @classmethod
    def load(cls, path: str | Path, *, changed: bool = False) -> Experiment:
        """Read a run file, such as the ``run.toml`` of a folder.

        Parameters
        ----------
        path : path
            Run file.
        changed : bool
            Whether files that it names may have changed since it was written.

        Returns
        -------
        Experiment

        Raises
        ------
        InputError
            Where it cannot be read, or a file that it names is another one now.
        """
        return cls(read_run_file(Path(path), changed=changed), Path(path).parent)

    def replace(self, key: str, value: object) -> Experiment:
        """Return the experiment with another value under a dotted key.

        Parameters
        ----------
        key : str
            Such as ``radar.pitch_deg``, ``scene.room.left.material`` or ``people.0.heading_deg``.
        value : object
            Value, as in a run file.

        Returns
        -------
        Experiment

        Raises
        ------
        InputError
            Where the key leads nowhere.
        """
        return replace(self, table=with_value(self.table, key, value))

    @cached_property
    def parts(self) -> Parts:
        """People, radar, scene and settings; an `InputError` tells what has no meaning."""
        return parts_of(self.table, self.folder)

    def run(
        self, out: str | Path | None = None, *, overwrite: bool = False, pictures: bool = False
    ) -> Result:
        """Run it, as `rtradar.run` does.

        Parameters
        ----------
        out : path, optional
            Folder for the results; if left out, nothing is written.
        overwrite : bool
            Whether files of others that have the names of new ones are replaced.
        pictures : bool
            Whether PNG files are drawn, as by `rtradar.run`.

        Returns
        -------
        Result

        Raises
        ------
        InputError, BackendError, ExtensionError
            As of `rtradar.run`.
        """
        from rtradar.pipeline.run import run

        people, radar, scene, settings = self.parts
        written: dict[str, Any] = {"out": out, "overwrite": overwrite, "pictures": pictures}
        return run(people, radar, scene, **written, **vars(settings))

    def simulate(self) -> Simulation:
        """Prepare the IF samples, as `rtradar.simulate` does.

        Returns
        -------
        Simulation

        Raises
        ------
        InputError, BackendError, ExtensionError
            As of `rtradar.simulate`.
        """
        from rtradar.pipeline.run import Simulation

        people, radar, scene, settings = self.parts
        return Simulation(prepare(people, radar, scene, replace(settings, background=None)))


# -- several values of some keys ------------------------------------------------------------------

FIGURES = {
    "snr_db": "SNR of people [dB]",
    "signal_to_clutter_db": "signal to clutter [dB]",
    "detections": "detections",
    "of_room": "points in space of nobody, fraction",
    "cloud_bins": "distance of the RDT cloud from the first [bins]",
}
"""What is listed of each run, and drawn."""

_MOST_RUNS = 1000
_FILES = OutputFiles("sweep.json", one_of(("sweep.json", "sweep.csv", "sweep.png")))


@dataclass(frozen=True)
class Sweep:
    """Results of a sweep.

    Parameters
    ----------
    summary : dict
        Contents of ``sweep.json``: the ``keys``, and of each run its ``folder``, its ``values`` in
        the order of the keys, and its ``figures``.
    out : path
        Folder of the files, with the run of each in a folder of its own.
    """

    summary: dict[str, Any]
    out: Path

    def table(self) -> str:
        """Return the figures as aligned text, one line for each run."""
        head = [*self.summary["keys"], *FIGURES]
        rows = [
            [*map(str, run["values"])]
            + ["-" if (own := run["figures"][name]) is None else f"{own:.4g}" for name in FIGURES]
            for run in self.summary["runs"]
        ]
        return text_table([head, *rows])


def sweep(
    experiment: Experiment,
    values: Mapping[str, Sequence[object]],
    *,
    out: str | Path,
    overwrite: bool = False,
    pictures: bool = False,
) -> Sweep:
    """Run an experiment with every combination of the values of some keys.

    Parameters
    ----------
    experiment : Experiment
        What is the same in all runs.
    values : mapping of str to sequence
        Values of each dotted key, such as ``{"radar.pitch_deg": [-15, 0]}``.
    out : path
        Folder for the run of each, and for ``sweep.json``, ``sweep.csv`` and ``sweep.png``.
    overwrite : bool
        Whether files of other origin are replaced.
    pictures : bool
        Whether the runs draw PNG files of their own.

    Returns
    -------
    Sweep

    Raises
    ------
    InputError
        Where a key leads nowhere, there are too many runs, or as of `rtradar.run`.
    BackendError
        As of `rtradar.run`.

    Notes
    -----
    Signal to clutter is that of people to the static clutter of their range cells, before its
    removal; the distance of clouds that of Chamfer, with steps of time, range and velocity as the
    units.
    """
    place, keys = check_path("out", out), list(values)
    combinations = list(itertools.product(*values.values()))
    if not keys or not 1 <= len(combinations) <= _MOST_RUNS:
        raise InputError(f"sweep: {len(combinations)} runs; allowed are 1 to {_MOST_RUNS}")
    # Every combination of the values is made before the first run starts.
    variants = []
    for combination in combinations:
        own = experiment
        for key, value in zip(keys, combination, strict=True):
            own = own.replace(key, value)
        _ = own.parts  # all are refused before the first is run
        variants.append(own)
    runs: list[dict[str, Any]] = []
    first: Result | None = None
    for number, (own, combination) in enumerate(zip(variants, combinations, strict=True), start=1):
        # Of a path the name of its file.
        short = (Path(one).stem if isinstance(one, str) else one for one in combination)
        named = zip((key.rpartition(".")[2] for key in keys), short, strict=True)
        told = re.sub(r"[^\w.=-]+", "-", "-".join(f"{key}={value}" for key, value in named))
        folder = f"{number:03d}-{told[:60]}"
        result = own.run(place / folder, overwrite=overwrite, pictures=pictures)
        first = first or result
        figures = _figures(result, first)
        runs.append({"folder": folder, "values": list(combination), "figures": figures})
    summary: dict[str, Any] = {"keys": keys, "runs": runs}
    # The table and the picture over all runs.
    with atomic_folder(place, _FILES, overwrite=overwrite) as written:
        rows = [
            (run["folder"], *run["values"], *(run["figures"][name] for name in FIGURES))
            for run in runs
        ]
        _draw(written / "sweep.png", summary)
        write_tables(written, summary, _FILES, ("folder", *keys, *FIGURES), rows)
    return Sweep(summary, place)


def _figures(result: Result, first: Result) -> dict[str, float | None]:
    summary, source = result.summary, result.spatial.source
    echo, noise = summary["echo_power_m2"], summary["noise_power_m2"]
    room = summary.get("room", {}).get("clutter", {})
    return {
        "snr_db": float(10 * np.log10(echo / noise)) if echo > 0 and noise > 0 else None,
        "signal_to_clutter_db": room.get("signal_to_clutter_db"),
        "detections": summary["detections"],
        "of_room": None if source is None or not len(source) else float((source == -1).mean()),
        "cloud_bins": chamfer_bins(result.points, first.points, result.radar),
    }


def _draw(path: Path, summary: Mapping[str, Any]) -> None:
    """Draw each figure over the runs: over the value, where one key has numbers."""
    from rtradar.system.figure_style import LIGHT, dress, new_figure, save_figure

    runs, keys = summary["runs"], summary["keys"]
    shown = [name for name in FIGURES if any(run["figures"][name] is not None for run in runs)]
    # Values of one key that are numbers are places on an axis; else the runs stand side by side.
    numbers = len(keys) == 1 and all(isinstance(run["values"][0], int | float) for run in runs)
    places = [run["values"][0] if numbers else n for n, run in enumerate(runs)]
    figure = new_figure(0.6 + 1.5 * len(shown))
    panels = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    for axes, name in zip(panels, shown, strict=True):
        found = [run["figures"][name] for run in runs]
        drawn = [np.nan if value is None else value for value in found]
        axes.plot(places, drawn, "o-" if numbers else "o", color=LIGHT.cycle[0])
        dress(axes, title=FIGURES[name])
    panels[-1].set_xlabel(keys[0] if numbers else ", ".join(keys))
    if not numbers:
        labels = ["\n".join(map(str, run["values"])) for run in runs]
        panels[-1].set_xticks(places, labels)
    save_figure(figure, path)
