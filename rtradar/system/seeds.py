"""Seeds: which are allowed, and the random streams that follow from one; by one rule everywhere."""

from __future__ import annotations

import numpy as np

from rtradar.errors import InputError
from rtradar.system.checks import brief

MOST_SEED = 2**63 - 1
"""Fits the whole numbers of every file that keeps it."""

_WORD = 2**32
"""A seed below it is one of the words that NumPy mixes."""


def check_seed(where: str, seed: object) -> int:
    """A whole number from 0 to `MOST_SEED`, as an int.

    Parameters
    ----------
    where : str
        What the message begins with, such as a table of a file; may be empty.
    seed : object
        As given.

    Returns
    -------
    int

    Raises
    ------
    InputError
        Where it is anything else.
    """
    if (
        isinstance(seed, bool)
        or not isinstance(seed, int | np.integer)
        or not 0 <= seed <= MOST_SEED
    ):
        raise InputError(
            f"{where}seed = {brief(seed)}; it must be a whole number from 0 to {MOST_SEED}"
        )
    return int(seed)


def stream(seed: int, *numbers: int) -> np.random.SeedSequence:
    """What seeds the random stream of these numbers, unlike that of other numbers and of other seeds.

    Parameters
    ----------
    seed : int
        As of `check_seed`.
    *numbers : int
        At least 0, each below 2^32 but the last; always as many of them for one purpose.

    Returns
    -------
    SeedSequence

    Raises
    ------
    InputError
        Where the seed is not allowed.
    """
    seed = check_seed("", seed)
    if seed < _WORD:
        return np.random.SeedSequence([seed, *numbers])
    # NumPy would write the words of seed and numbers in a row, and 7 + 5 2^32 with 0 would be 7 with 5. It sets those of a spawn
    # key apart: they come after at least four words of the seed, and their count keeps the key from being empty.
    return np.random.SeedSequence(seed, spawn_key=(len(numbers), *numbers))


def word(seed: int) -> int:
    """The seed itself below 2^32, else 32 bits that follow from it: for packages that take no more.

    Parameters
    ----------
    seed : int
        As of `check_seed`.

    Returns
    -------
    int

    Raises
    ------
    InputError
        Where the seed is not allowed.
    """
    seed = check_seed("", seed)
    return seed if seed < _WORD else int(stream(seed).generate_state(1)[0])
