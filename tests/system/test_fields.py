"""Fields of dataclasses: what their annotations allow, and one line for everything else."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
import pytest

from rtradar.errors import InputError
from rtradar.system.fields import (
    Angle,
    Limits,
    MaybeEmpty,
    Point,
    check_fields,
    keys_of,
    read_range,
    read_table,
    rules_of,
)


class Kept(tuple[float, ...]):
    """A tuple that says more by its type."""


@dataclass(frozen=True)
class Inner:
    """A table in a table."""

    length_m: Annotated[float, Limits(0, 5)]

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, kw_only=True)
class Table:
    """Something of every kind."""

    name: str
    note: MaybeEmpty = ""
    sweep_hz: Annotated[float, Limits(1e9, 1e12)] = 12e9
    count: Annotated[int, Limits(1, 9)] = 3
    on: bool = False
    kind: Literal["a", "b"] = "a"
    word: Annotated[str, Limits(allowed=("x", "y"))] = "x"
    place: Point = (0.0, 0.0, 0.0)
    turn_deg: Angle | None = None
    times: tuple[float, ...] = ()
    pairs: Annotated[
        tuple[tuple[str, int], ...] | None, Limits(wanted="it must be pairs", counts=(1, 2))
    ] = None
    level: Annotated[float | Literal["off"], Limits(0, math.inf, "it must be a level")] = 1.0
    inner: Inner | None = None
    other: Mapping[str, Any] | None = None

    def __post_init__(self) -> None:
        check_fields(self, "table: ")


def test_values_get_their_types() -> None:
    kept = Kept((1.0, 2.0, 3.0))
    made = Table(
        name="n",
        sweep_hz=np.float32(2e9),
        count=np.int64(2),
        on=np.bool_(True),
        place=np.array([1, 2, 3]),
        times=iter([1, 2]),
        pairs=[["a", 1]],
        level=math.inf,
        inner={"length_m": 1},
        other={"any": object},
    )  # type: ignore[arg-type]
    assert [type(value) for value in (made.sweep_hz, made.count, made.on)] == [float, int, bool]
    assert (made.place, made.times, made.pairs) == ((1.0, 2.0, 3.0), (1.0, 2.0), (("a", 1),))
    assert made.inner == Inner(1.0)
    assert Table(name="n", place=kept).place is kept
    assert Table(name="n", level="off", turn_deg=None).level == "off"


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        *(("name", value, "it must be a string of one line") for value in ("", " ", "a\nb", 3)),
        ("note", "a\nb", "it must be one line of text"),
        *(("count", value, "a whole number from 1 to 9") for value in (0, 10, 2.0, True, "3")),
        *(
            ("sweep_hz", value, "it must be a number from 1e\\+09 to 1e\\+12")
            for value in (-4e9, 0, math.nan, math.inf, "4e9", True, [4e9], {"hz": 4e9}, 10**400)
        ),
        ("sweep_hz", 77, r"is that 77e9\?"),
        ("on", 1, "it must be true or false"),
        *(("kind", value, "allowed: a, b") for value in ("c", "A", 1, ["a"])),
        ("word", "z", "allowed: x, y"),
        *(
            ("place", value, "it must be 3 numbers from -1000 to 1000")
            for value in ((1, 2), [1] * 4, 5, "123", [1, 2, math.nan], [[1, 2, 3]], (0, 0, 1e9))
        ),
        ("turn_deg", 361, "it must be a number from -360 to 360"),
        ("times", [1, "2"], "it must be a list of numbers"),
        *(("pairs", value, "it must be pairs") for value in ((), [["a", 0.5]], [["a", 1]] * 3)),
        *(("level", value, "it must be a level") for value in (-1, "on", None, 10**400)),
        ("inner", 3, "it must be a table of the fields of Inner"),
        ("inner", {"length_m": 6}, "length_m = 6; it must be a number from 0 to 5"),
        ("inner", {"lenght_m": 1}, r"unknown key .lenght_m. \(did you mean length_m"),
        ("inner", {}, "length_m is missing; needed: length_m"),
        ("other", [1], "it must be a Mapping"),
    ],
)
def test_what_is_not_allowed_is_told_in_one_line(field: str, value: Any, message: str) -> None:
    with pytest.raises(InputError, match=rf"^table: {field}.*{message}") as caught:
        Table(**{"name": "n", field: value})
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 200


def test_keys_of_a_table_are_the_fields() -> None:
    needed, others = keys_of(Table)
    assert needed == ("name",)
    assert set(others) == rules_of(Table).keys() - {"name"}
    assert read_table(Table, "", {"name": "n", "count": 4}) == Table(name="n", count=4)


def test_a_range_has_its_least_value_first() -> None:
    assert read_range("[drawn] ", "tempo", [0.8, 1], 0.4, 2) == (0.8, 1.0)
    for value in ([1, 0.8], [0.1, 1], 1, [1]):
        with pytest.raises(InputError, match=r"^\[drawn\] tempo = .* a range \[least, most\]"):
            read_range("[drawn] ", "tempo", value, 0.4, 2)
