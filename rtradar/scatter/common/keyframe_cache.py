"""A memory for anchors: the first that come stay, later ones pass through."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Generic, TypeVar

_Key = TypeVar("_Key", bound=Hashable)
_Value = TypeVar("_Value")


class FirstCome(Generic[_Key, _Value]):
    """What was found for some keys.

    A recording is gone through twice from its start, once for its power and once for its signal. Were the last ones kept, a
    recording a little longer than this memory would find nothing left of them when it starts again.

    Parameters
    ----------
    stay : int
        How many stay.
    passing : int
        How many of those that come later are held at a time, the last that were asked for.
    """

    def __init__(self, stay: int, passing: int) -> None:
        self._most, self._passing = stay, passing
        self._staying: dict[_Key, _Value] = {}
        self._later: OrderedDict[_Key, _Value] = OrderedDict()

    def __contains__(self, key: object) -> bool:
        return key in self._staying or key in self._later

    def get(self, key: _Key, find: Callable[[], _Value]) -> _Value:
        """What is known for a key, or found now."""
        if key in self._staying:
            return self._staying[key]
        if key in self._later:
            self._later.move_to_end(key)
            return self._later[key]
        value = find()
        self.keep(key, value)
        return value

    def keep(self, key: _Key, value: _Value) -> None:
        """Remember what was found for a key that is not known."""
        if len(self._staying) < self._most:
            self._staying[key] = value
        else:
            self._later[key] = value
            if len(self._later) > self._passing:
                self._later.popitem(last=False)
