"""What the fields of a dataclass may hold, by their annotations, from a file or from Python.

The type of a field and its `Limits`, in ``Annotated``, are all that is said of its values: by them
`check_fields` converts and refuses what a constructor is given, `read_table` makes an object of a
table of a TOML file, and the pages list what is allowed. Types are ``float``, ``int``, ``bool``,
``str`` (one line), ``Literal``, tuples, other such dataclasses (or a table of their fields), any
other class, and unions of these. What fields must be to each other is left to their class.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, NamedTuple, TypeVar, Union, get_args, get_origin
from typing import get_type_hints as hints_of

from rtradar.errors import InputError
from rtradar.system.checks import Table, brief, check_keys, is_real, is_whole

_Thing = TypeVar("_Thing")
_FINITE = 1e15
_SMALLER_UNITS = {"hz": (9, 6), "_s": (-6, -3)}
"""Powers of ten of the units in which frequencies and times are often written."""


@dataclass(frozen=True)
class Limits:
    """What a type does not say of a value.

    Parameters
    ----------
    least, most : float
        Least and largest value of a number, or of each number of a list.
    wanted : str
        What is allowed, in words for messages; by default it follows from type and limits.
    counts : (int, int)
        Least and largest number of entries of a list.
    allowed : tuple of str
        What a text may be; anything of one line if left out.
    may_be_empty : bool
        Whether a text may be empty.
    any_text : bool
        Whether a text may have letters that are not printable, as paths may.
    rising : bool
        Whether the entries of a list may not fall.
    """

    least: float = -_FINITE
    most: float = _FINITE
    wanted: str = ""
    counts: tuple[int, int] = (0, 2**31)
    allowed: tuple[str, ...] = ()
    may_be_empty: bool = False
    any_text: bool = False
    rising: bool = False


Angle = Annotated[float, Limits(-360, 360)]
"""Angle of up to a turn either way [deg]."""
Point = Annotated[tuple[float, float, float], Limits(-1000, 1000)]
"""Place or vector of a scene."""
MaybeEmpty = Annotated[str, Limits(wanted="it must be one line of text", may_be_empty=True)]


class Rule(NamedTuple):
    """How a value is read, with a ValueError where it is not allowed, and what is."""

    read: Callable[[Any], Any]
    wanted: str

    def check(self, where: str, key: str, value: Any) -> Any:
        """Return the value in its type; InputError if it is not allowed."""
        try:
            return self.read(value)
        except InputError as error:  # of a table in it, which may say so itself
            own = "" if str(error).startswith(f"{key}: ") else f"{key}: "
            raise InputError(f"{where}{own}{error}") from None
        except (ValueError, OverflowError):
            hint = self._in_units(key, value)
            raise InputError(f"{where}{key} = {brief(value)}; {self.wanted}{hint}") from None

    def _in_units(self, key: str, value: Any) -> str:
        """Ask whether a frequency or a time is meant that is allowed in another unit."""
        powers = _SMALLER_UNITS.get(key[-2:], ()) if is_real(value) and abs(value) < _FINITE else ()
        for power in powers:
            try:
                self.read(value * 10.0**power)
            except ValueError:
                continue
            return f"; is that {value:g}e{power}?"
        return ""


@cache
def rules_of(kind: type) -> Mapping[str, Rule]:
    """Return the rule of each field of a dataclass."""
    hints = annotations_of(kind)
    return {field.name: _rule(hints[field.name]) for field in dataclasses.fields(kind)}


def annotations_of(kind: type) -> dict[str, Any]:
    """Return the annotations of a class, with what is in ``Annotated``."""
    unknown: dict[str, Any] = {}
    # Each class that is not there at run time is taken for anything, one by one, until all names
    # are known.
    while True:
        try:
            return hints_of(kind, localns=unknown, include_extras=True)
        except NameError as error:  # a class that is imported for checkers of types alone
            unknown[str(error.name)] = Any


def check_fields(thing: Any, where: str = "") -> None:
    """Check the fields of a frozen dataclass, and set them in their types.

    ``where`` begins the message of an `InputError`, which names the field and what is allowed.
    """
    kind: type = type(thing)
    for key, rule in rules_of(kind).items():
        object.__setattr__(thing, key, rule.check(where, key, getattr(thing, key)))


def checked(kind: type, where: str, values: Mapping[str, Any]) -> dict[str, Any]:
    """Return values of some fields of a dataclass in their types; see `check_fields`."""
    return {key: rules_of(kind)[key].check(where, key, value) for key, value in values.items()}


def read_value(hint: Any, where: str, key: str, value: Any) -> Any:
    """Return a value that is allowed by an annotation; see `check_fields`."""
    return _rule(hint).check(where, key, value)


def within(least: float, most: float, kind: str = "numbers") -> Limits:
    """Return the limits of a range, which is given by its least and its largest value."""
    wanted = f"it must be a range [least, most] of {kind} from {least:g} to {most:g}"
    return Limits(least, most, wanted, rising=True)


def read_range(where: str, key: str, value: Any, least: float, most: float) -> tuple[float, float]:
    """Return the least and the largest value of a range, which lies within limits."""
    found: tuple[float, float] = read_value(
        Annotated[tuple[float, float], within(least, most)], where, key, value
    )
    return found


def found_in(hint: Any, what: type[_Thing]) -> _Thing | None:
    """Return what an annotation has of a class in ``Annotated``, such as its `Limits`."""
    # What stands at this level goes before what stands deeper, as in a union or a tuple.
    given = [one for one in get_args(hint) if isinstance(one, what)]
    below = (found_in(one, what) for one in get_args(hint))
    return next((one for one in (*given, *below) if one is not None), None)


def keys_of(kind: type, *, without: Sequence[str] = ()) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the keys of the table of a dataclass: those that must be given, and the others."""
    fields = [one for one in dataclasses.fields(kind) if one.init and one.name not in without]
    missing = dataclasses.MISSING
    needed = [one.name for one in fields if one.default is one.default_factory is missing]
    return tuple(needed), tuple(one.name for one in fields if one.name not in needed)


def read_table(kind: type[_Thing], where: str, table: Table) -> _Thing:
    """Make an object of a table whose keys are its fields; ``where`` begins the messages."""
    check_keys(where, table, *keys_of(kind))
    return kind(**table)


@lru_cache(maxsize=1024)
def _rule(hint: Any, limits: Limits | None = None) -> Rule:
    """Make the rule of a type."""
    own, args = get_origin(hint) or hint, get_args(hint)
    # The limits belong to the type that they annotate, and to the types inside of it.
    if own is Annotated:
        given = [one for one in args[1:] if isinstance(one, Limits)]
        return _rule(args[0], given[0] if given else limits)
    bounds = limits or Limits()
    allowed = args if own is Literal else bounds.allowed
    # What reads the value, by the kind of the type.
    if own in (Union, UnionType):
        found = _any_of(
            [_rule(one, limits) for one in args if one is not NoneType], NoneType in args
        )
    elif own is tuple:
        found = _list_of(args, limits)
    elif own in (float, int):
        found = _number(own, bounds)
    elif own is bool:
        found = _where(
            lambda value: type(value).__name__ in ("bool", "bool_"),
            "it must be true or false",
            bool,
        )
    elif allowed:
        found = _where(
            lambda value: isinstance(value, str) and value in allowed,
            f"allowed: {', '.join(allowed)}",
        )
    elif own is str:
        found = _where(
            lambda value: (
                isinstance(value, str)
                and (value.isprintable() or bounds.any_text)
                and (bounds.may_be_empty or bool(value.strip()))
            ),
            "it must be a string of one line, not empty",
        )
    elif isinstance(own, type) and dataclasses.is_dataclass(own):
        found = _table_of(own)
    else:
        found = _where(
            lambda value: own is Any or isinstance(value, own),
            f"it must be a {getattr(own, '__name__', own)}",
        )
    return found._replace(wanted=bounds.wanted or found.wanted)


def _where(
    allows: Callable[[Any], bool], wanted: str, convert: Callable[[Any], Any] | None = None
) -> Rule:
    """Make the rule that a value passes a test."""

    def read(value: Any) -> Any:
        if not allows(value):
            raise ValueError
        return value if convert is None else convert(value)

    return Rule(read, wanted)


def _number(kind: type, limits: Limits) -> Rule:
    least, most, whole = limits.least, limits.most, kind is int
    right = is_whole if whole else is_real
    wanted = f"it must be a {'whole ' * whole}number"
    if (least, most) == (-_FINITE, _FINITE):
        wanted += f" within +-{most:g}"
    else:
        low, high = (f"{one}" if isinstance(one, int) else f"{one:g}" for one in (least, most))
        wanted += f" from {low} to {high}"
    return _where(
        lambda value: right(value) and least <= value <= most,
        wanted,
        # A kind of int stays what it is.
        lambda value: value if whole and isinstance(value, int) else kind(value),
    )


def _any_of(rules: Sequence[Rule], or_none: bool) -> Rule:
    def read(value: Any) -> Any:
        if or_none and value is None:
            return None
        for rule in rules[:-1]:
            try:
                return rule.read(value)
            except InputError:
                raise
            except ValueError:
                continue
        return rules[-1].read(value)

    # What is allowed, in one sentence for all kinds.
    first, *others = (rule.wanted for rule in rules)
    return Rule(read, " or ".join([first, *(one.removeprefix("it must be ") for one in others)]))


def _list_of(args: tuple[Any, ...], limits: Limits | None) -> Rule:
    below = limits and dataclasses.replace(limits, wanted="")
    even = Ellipsis in args
    rules = [_rule(one, below) for one in args if one is not Ellipsis]
    least, most = (limits or Limits()).counts if even else (len(args), len(args))

    def read(value: Any) -> Any:
        # Arrays and any sequences or iterators of values become tuples; a text is none of them.
        own = value.tolist() if hasattr(value, "tolist") else value  # an array of NumPy
        if not isinstance(own, Sequence | Iterator) or isinstance(own, str | bytes):
            raise ValueError
        own = tuple(own)
        if not least <= len(own) <= most:
            raise ValueError
        each = itertools.repeat(rules[0]) if even else rules
        found = tuple(rule.read(one) for rule, one in zip(each, own, strict=False))
        if limits and limits.rising and sorted(found) != list(found):
            raise ValueError
        # A kind of tuple stays what it is.
        return value if isinstance(value, tuple) and type(value) is not tuple else found

    several = "a list of" if even else str(most)
    each = rules[0].wanted.removeprefix("it must be ").removeprefix("a ")
    return Rule(read, f"it must be {several} {each.replace('number', 'numbers')}")


def _table_of(kind: type) -> Rule:
    return _where(
        lambda value: isinstance(value, Mapping | kind),
        f"it must be a table of the fields of {kind.__name__}",
        lambda value: read_table(kind, "", value) if isinstance(value, Mapping) else value,
    )
