"""Seeds: their range, and the random streams that follow from one."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

from rtradar.system.fields import Limits, read_value

if TYPE_CHECKING:
    import numpy as np

MOST_SEED = 2**63 - 1
"""Largest seed, which fits the integers of every file format."""

Seed = Annotated[int, Limits(0, MOST_SEED)]

_WORD = 2**32
"""Seeds below it are single words of the entropy that NumPy mixes."""


def check_seed(where: str, seed: object) -> int:
    """Return a seed from 0 to `MOST_SEED` as an int; InputError, begun with ``where``, if not."""
    found: int = read_value(Seed, where, "seed", seed)
    return found


def stream(seed: int, *numbers: int) -> np.random.SeedSequence:
    """Return the seed sequence of a random stream, unlike that of other numbers or seeds.

    Parameters
    ----------
    seed : int
        Seed from 0 to `MOST_SEED`.
    *numbers : int
        Numbers of the stream, at least 0, each below 2^32 but the last; always as many of them for
        one purpose.

    Returns
    -------
    SeedSequence

    Raises
    ------
    InputError
        If the seed is out of range.
    """
    import numpy as np  # a refusal on the command line does not need it

    if not (type(seed) is int and 0 <= seed <= MOST_SEED):  # each cycle of noise asks for one
        seed = check_seed("", seed)
    if seed < _WORD:
        return np.random.SeedSequence([seed, *numbers])
    # NumPy would write the words of seed and numbers in a row: 7 + 5 2^32 with 0 would be 7 with 5.
    # Those of a spawn key it sets apart, after at least four words of the seed; their count keeps
    # the key from being empty.
    return np.random.SeedSequence(seed, spawn_key=(len(numbers), *numbers))


def word(seed: int) -> int:
    """Return 32 bits that follow from a seed, for packages that take no more."""
    seed = check_seed("", seed)
    return seed if seed < _WORD else int(stream(seed).generate_state(1)[0])
