"""What can be chosen by name, here and from other packages: models, readers, radars, detectors.

Each kind has one `Registry`. It lists what comes with rtradar by the place of its code, which is
loaded on use, so that a name can be checked, or listed, at no cost. Other packages add theirs by an
entry point of the registry's group, and a running program adds its own by `register`.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from importlib import import_module
from importlib.metadata import EntryPoint, distributions, entry_points
from pathlib import Path
from typing import Any

from rtradar.errors import BackendError, ExtensionError, InputError
from rtradar.system.checks import Table, brief, check_path, read_toml
from rtradar.system.files import shipped_folder, special_kind


class Registry(Mapping[str, Callable[..., Any]]):
    """Functions and classes of one kind by their names.

    Parameters
    ----------
    group : str
        Group of the entry points that add to it, such as ``rtradar.models``.
    noun : str
        What one is called in messages.
    built_in : mapping
        What comes with rtradar: name to ``module:attribute``.
    gone : mapping, optional
        What came with it before: name to what to do instead.
    """

    def __init__(
        self, group: str, noun: str, built_in: Mapping[str, str], gone: Mapping[str, str] = {}
    ) -> None:
        self.group, self.noun, self.built_in, self.gone = group, noun, dict(built_in), dict(gone)
        self._registered: dict[str, Callable[..., Any]] = {}

    @cached_property
    def _installed(self) -> dict[str, list[EntryPoint]]:
        found: dict[str, list[EntryPoint]] = {}
        try:
            entries = list(entry_points(group=self.group))
        except Exception:  # of any package of the environment; what its file holds decides the type
            entries = _readable_entries(self.group)
        for entry in entries:
            found.setdefault(entry.name, []).append(entry)
        return found

    def register(self, name: str, make: Callable[..., Any]) -> None:
        """Add one to this process.

        Parameters
        ----------
        name : str
            Name on the command line and in Python, which must be free.
        make : callable
            Function or class; ``docs/extending.md`` says what each kind takes and gives.

        Raises
        ------
        InputError
            Where the name is taken, or the object cannot be called.
        """
        if name in self:
            raise InputError(f"{self.noun} '{name}' is there already; choose another name")
        if not callable(make):
            raise InputError(
                f"{self.noun} '{name}': a {type(make).__name__} cannot be called; "
                "give a function or a class"
            )
        self._registered[name] = make

    def find(self, name: str, *, instead: str = "") -> Callable[..., Any]:
        """The one of that name.

        Parameters
        ----------
        name : str
        instead : str
            What else is allowed, for the message.

        Raises
        ------
        InputError
            Where there is none; the message lists all.
        ExtensionError
            Where it cannot be loaded, or two packages have one of that name.
        """
        self.check(name, instead=instead)
        return self[name]

    def check(self, name: str, *, instead: str = "") -> None:
        """Raise InputError, as `find` does, if there is none of that name; load nothing."""
        self.refuse_gone(name)
        if not isinstance(name, str) or name not in self:
            raise InputError(
                f"{self.noun} '{name}' is unknown; allowed: {', '.join(self)}{instead}"
            )

    def refuse_gone(self, name: str) -> None:
        """Raise InputError, which says what to take instead, if one of that name is no more."""
        if isinstance(name, str) and name in self.gone and name not in self:
            raise InputError(f"{self.noun} '{name}' is gone; {self.gone[name]}")

    def __getitem__(self, name: str) -> Any:
        # A name must lead to one thing, whoever brings it.
        installed = self._installed.get(name, [])
        if len(installed) + (name in self.built_in) + (name in self._registered) > 1:
            owners = ["rtradar"] * (name in self.built_in) + [
                _package(entry) for entry in installed
            ]
            raise ExtensionError(
                f"{self.noun} '{name}' is claimed by {' and by '.join(owners)}; "
                "uninstall one of them"
            )
        if name in self._registered:
            return self._registered[name]
        # What comes with rtradar is imported when it is asked for.
        if name in self.built_in:
            module, _, attribute = self.built_in[name].partition(":")
            made: Callable[..., Any] = getattr(import_module(module), attribute)
            return made
        if not installed:
            raise KeyError(name)
        # What another package brings may fail as it is loaded.
        with self.guarded(name):
            made = installed[0].load()
        if not callable(made):
            raise ExtensionError(
                f"{self.owner(name)}: {installed[0].value} is a {type(made).__name__}, "
                "not a function or class"
            )
        return made

    def __iter__(self) -> Iterator[str]:
        yield from dict.fromkeys([*self.built_in, *sorted(self._installed), *self._registered])

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __contains__(self, name: object) -> bool:
        return name in self.built_in or name in self._registered or name in self._installed

    def owner(self, name: str) -> str:
        """What a message calls it: the kind, the name, and the package that it comes from."""
        installed = self._installed.get(name, [])
        return f"{self.noun} '{name}'" + (
            f" of package {_package(installed[0])}" if installed else ""
        )

    @contextmanager
    def guarded(self, name: str) -> Iterator[None]:
        """Run code that rtradar did not write, and report its errors in one line.

        Raises
        ------
        ExtensionError
            Replaces any error but those that already have a meaning to the user.
        """
        try:
            yield
        except (InputError, BackendError, ExtensionError, MemoryError):
            raise
        except BaseException as error:
            # A fault of rtradar's own keeps its traceback. Ctrl-C ends the process; an exception
            # derived from KeyboardInterrupt is not Ctrl-C.
            if name in self.built_in or type(error) is KeyboardInterrupt:
                raise
            said = _first_line(error)
            raise ExtensionError(
                f"{self.owner(name)} failed: {type(error).__name__}{f': {said}' if said else ''}; "
                "mend or uninstall it"
            ) from error

    def refuse(self, name: str, why: str) -> ExtensionError:
        """The error to raise where one gave what it must not."""
        return ExtensionError(f"{self.owner(name)} {why}; see docs/extending.md")


def _first_line(error: BaseException) -> str:
    try:
        return (str(error).splitlines() or [""])[0]
    except BaseException:  # it is not rtradar's code that makes the text either
        return ""


def _readable_entries(group: str) -> list[EntryPoint]:
    """Return the entry points of all readable packages, and warn of each of the others."""
    found: dict[str, list[EntryPoint]] = {}
    for package in distributions():
        name = "of unknown name"
        try:
            name = package.name
            # Of two packages of one name the first is imported.
            found.setdefault(name, list(package.entry_points.select(group=group)))
        except Exception as error:
            warnings.warn(
                f"package {name}: its entry points cannot be read ({_first_line(error)}); "
                "reinstall it",
                stacklevel=2,
            )
    return [entry for entries in found.values() for entry in entries]


def _package(entry: EntryPoint) -> str:
    return f"'{entry.dist.name}'" if entry.dist is not None else "unknown"


BOARDS = (
    "iwr1443", "iwr1642", "awr1642", "iwr1843", "awr1843", "awr2243", "awr2243-cascade", "iwr6843",
    "iwr6843ods", "iwr6843aop", "iwrl6432", "awr2944",
)  # fmt: skip
"""Radars that are boards of Texas Instruments."""

RADARS = Registry(
    "rtradar.radars",
    "radar",
    {
        "paper-12ghz": "rtradar.radar:paper_12ghz",
        "paper-77ghz": "rtradar.radar:paper_77ghz",
        **{name: f"rtradar.radar:{name.replace('-', '_')}" for name in (*BOARDS, "radhar", "mars")},
    },
)
"""Radars that have a name: each is made by a function without arguments."""

OR_RADAR_FILE = ", or the path of a TOML or .cfg file"
"""What else than a name says which radar is meant."""

READERS = Registry(
    "rtradar.readers",
    "motion reader",
    {
        "amc": "rtradar.motion.formats.rotations:load_amc",
        "bvh": "rtradar.motion.formats.rotations:load_bvh",
        "c3d": "rtradar.motion.formats.markers:load_c3d",
        "npz": "rtradar.motion.formats.joints:load_npz",
        "csv": "rtradar.motion.formats.joints:load_csv",
        "trc": "rtradar.motion.formats.markers:load_trc",
        "motion": "rtradar.motion.formats:load_saved",
    },
)
"""Readers of motion files, by the ending of the file without the dot."""

MODELS = Registry(
    "rtradar.models",
    "fidelity",
    {
        "analytic-paper": "rtradar.scatter.models.analytic:AnalyticPaper",
        "analytic": "rtradar.scatter.models.analytic:Analytic",
        "specular": "rtradar.scatter.models.specular:Specular",
        "physical-optics": "rtradar.scatter.models.physical_optics:PhysicalOptics",
        "rays": "rtradar.scatter.models.rays:Rays",
        "reference": "rtradar.scatter.models.physical_optics:Reference",
        "auto": "rtradar.scatter.models.auto:Auto",
    },
    gone={
        "fresnel": "take 'specular' with visibility = 'gradual' (--model-option "
        "visibility=gradual), or 'physical-optics'",
    },
)
"""Every model, cheapest first, the one that chooses among them, and those of other packages."""

ACTIVITY_NAMES = (
    "walk", "kick", "punch", "jumping_jack", "stand", "sit", "bend", "squat", "wave", "jump",
    "fall", "walk_in_place", "boxing", "lie",
)  # fmt: skip
"""What synthetic actors can do; `rtradar.motion.ACTIVITIES` says how."""

DETECTORS = Registry(
    "rtradar.detectors",
    "detector",
    {
        "os-cfar": "rtradar.process.cfar:os_cfar",
        "ca-cfar": "rtradar.process.cfar:ca_cfar",
        "ti-oob": "rtradar.process.detectors:ti_oob",
    },
)
"""Functions of power (range, velocity), ``pfa`` and ``looks``, the channels summed in the power; or
of range spectra ``cube``, ``radar`` and ``window_functions``."""


RANDOM_SCENE = "random:"
"""What names of rooms begin with that are drawn by the seed after it."""


def scene_files() -> dict[str, Path]:
    """Find the scenes that come with rtradar, by name."""
    return {file.stem: file for file in sorted(shipped_folder("scenes").glob("*.toml"))}


def radar_table(source: str | Path) -> Table | None:
    """Return the table of a radar's TOML file; None for a name, and for a .cfg file.

    Raises
    ------
    InputError
        Where the file cannot be read or is not TOML, or no radar has the name.
    """
    path, name = check_path("radar", source, or_name=True), str(source)
    if path.suffix == ".toml" and name not in RADARS:
        return read_toml(path, "radar", f"give a TOML file or one of: {', '.join(RADARS)}")
    if path.suffix != ".cfg":
        RADARS.check(name, instead=OR_RADAR_FILE)
    return None


def scene_table(source: str | Path) -> tuple[Path, Table]:
    """Return the TOML file of a scene, given by its path or a name, and the file's table.

    Of ``random:SEED`` the table has the key ``random``.

    Raises
    ------
    InputError
        Where the file cannot be read or is not TOML, or no scene has the name.
    """
    path, known = check_path("scene", source, or_name=True), scene_files()
    # A seed, a name, or the path of a file.
    if (seed := str(source).removeprefix(RANDOM_SCENE)) != str(source):
        if not (seed.isascii() and seed.isdecimal()):
            raise InputError(f"scene {brief(str(source))}: give a seed, as in {RANDOM_SCENE}7")
        return path, {"random": {"seed": int(seed)}}
    if path.suffix != ".toml":
        if str(source) not in known:
            raise InputError(
                f"scene {brief(str(source))} is unknown; allowed: {', '.join(known)}, "
                f"{RANDOM_SCENE}SEED, or the path of a TOML file"
            )
        path = known[str(source)]
    return path, read_toml(path, "scene", "give a TOML file or the name of a scene")


def check_activity(asked: str) -> None:
    """Raise InputError where no synthetic actor does what is asked for, traits as text left out."""
    activity = asked.partition(",")[0] if isinstance(asked, str) else brief(asked)
    if activity not in ACTIVITY_NAMES:
        raise InputError(f"unknown activity {activity!r}; allowed are {', '.join(ACTIVITY_NAMES)}")


def reader_of(path: str | Path, skeleton: str | Path | None = None) -> str:
    """Return the name of the reader of a motion file, which is there.

    Raises
    ------
    InputError
        Where no reader takes such a file, or it is no file, or none without a ``skeleton``.
    """
    file = check_path("recording", path)
    name = file.suffix.lower().removeprefix(".")
    if name == "asf" and name not in READERS:
        raise InputError(
            f"{file}: a skeleton without its motion; give the .amc, and this as --skeleton"
        )
    if name not in READERS and file.is_dir():
        raise InputError(f"{file}: a folder, not a motion file; name one of its files")
    if name not in READERS:
        known = ", ".join(f".{known}" for known in READERS)
        raise InputError(
            f"{file}: unknown kind of motion file {file.suffix!r}; allowed are {known} (an .amc "
            "with its .asf)"
        )
    # Readers of other packages may take folders, and names of what is no file; none may wait.
    if kind := special_kind(file):
        raise InputError(f"{file}: it is {kind}, not a motion file; check the path")
    # A skeleton is read before its recording.
    if name in READERS.built_in and skeleton is None and not os.path.lexists(file):
        raise InputError(
            f"{file}: cannot read this {name.upper()} file (No such file or directory); check the "
            "path"
        )
    return name
