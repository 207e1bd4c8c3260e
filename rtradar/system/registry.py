"""Registries of models, motion readers, radars and detectors, which other packages can extend.

Each kind has one `Registry`. It lists what comes with rtradar by the place of its code, loaded on
use. Other packages add theirs by an entry point of the registry's group, and a running program adds
its own by `register`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cached_property
from importlib import import_module
from importlib.metadata import EntryPoint, distributions, entry_points
from typing import Any

from rtradar.errors import BackendError, ExtensionError, InputError


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
        if name in self.built_in:
            module, _, attribute = self.built_in[name].partition(":")
            made: Callable[..., Any] = getattr(import_module(module), attribute)
            return made
        if not installed:
            raise KeyError(name)
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
