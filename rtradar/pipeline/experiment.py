"""`Experiment`: what is simulated, to be changed by keys, run, and run again."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rtradar.description import Parts, parts_of, read_run_file, with_value
from rtradar.settings import SimulationOptions

if TYPE_CHECKING:
    from rtradar.pipeline.result import Result
    from rtradar.pipeline.simulation import Simulation


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
        self, out: str | Path | None = None, *, overwrite: bool = False, pictures: bool = True
    ) -> Result:
        """Run it, as `rtradar.run` does.

        Parameters
        ----------
        out : path, optional
            Folder for the results; if left out, nothing is written.
        overwrite : bool
            Whether files of others that have the names of new ones are replaced.
        pictures : bool
            Whether pictures are drawn.

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
        from rtradar.pipeline.simulation import simulate

        people, radar, scene, settings = self.parts
        taken = SimulationOptions.__annotations__
        options: Any = {name: value for name, value in vars(settings).items() if name in taken}
        return simulate(people, radar, scene, **options)
