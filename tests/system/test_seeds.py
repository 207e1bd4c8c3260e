"""Seeds: one rule for which are allowed, and no two that share a random stream."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product
from typing import Any

import numpy as np
import pytest

import rtradar as rt
from rtradar.clouds import RdtCloud
from rtradar.clouds.rdt import UniformSample
from rtradar.errors import InputError
from rtradar.signal import Noise
from rtradar.system.seeds import MOST_SEED, check_seed, stream, word

RADAR = rt.Radar(tx_y=1, tx_z=0, rx_y=1, rx_z=0, samples_per_chirp=16, frame_duration_s=0.01)
WORD = 2**32


def state(*told: int) -> tuple[int, ...]:
    return tuple(stream(*told).generate_state(8).tolist())


def noise(seed: int, cycle: int) -> Any:
    samples = np.zeros((1, 1, 16), np.complex64)
    Noise(1.0, seed).add(samples, RADAR, cycle)
    return samples


def test_a_long_seed_is_no_short_one_at_another_cycle() -> None:
    assert not np.array_equal(noise(7 + 5 * WORD, 0), noise(7, 5))
    assert not np.array_equal(noise(7 + 5 * WORD, 0), noise(7, 0))


@pytest.mark.parametrize("seed", [0, 1, 7, WORD - 1])
@pytest.mark.parametrize("numbers", [(), (0,), (5,), (3, 1), (0, WORD + 2)])
def test_short_seeds_keep_their_streams(seed: int, numbers: tuple[int, ...]) -> None:
    expected = np.random.SeedSequence([seed, *numbers]).generate_state(8)
    np.testing.assert_array_equal(stream(seed, *numbers).generate_state(8), expected)
    assert word(seed) == seed


def test_no_two_share_a_stream() -> None:
    """Short seeds share one with more numbers, as NumPy has it; long ones share none."""
    short, long = [0, 1, 5, 7, WORD - 1], product((0, 1, 5, 7), (1, 5, 7, 2**31 - 1))
    seeds = [*short, *(low + high * WORD for low, high in long)]
    of_long = set[tuple[int, ...]]()
    of_short = set[tuple[int, ...]]()
    for count in range(3):
        numbers = list(product((0, 1, 5, 7), repeat=count))
        own = [(seed, state(seed, *one)) for seed in seeds for one in numbers]
        assert len({found for _, found in own}) == len(own)
        of_short |= {found for seed, found in own if seed < WORD}
        of_long |= {found for seed, found in own if seed >= WORD}
    assert not of_short & of_long


USERS: dict[str, Callable[[Any], object]] = {
    "synthetic motion": lambda seed: rt.synthetic_motion("walk", seed=seed, duration_s=0.2),
    "noise": lambda seed: Noise(1.0, seed),
    "sample": lambda seed: UniformSample(3, seed),
    "cloud": lambda seed: RdtCloud(RADAR, seed=seed),
    "check": lambda seed: check_seed("", seed),
    "word": word,
}


HUGE = pytest.param(10**5000, id="huge")


@pytest.mark.parametrize("seed", [-1, 2**63, HUGE, 1.5, True, None, "7", np.int64(-3), math.nan])
@pytest.mark.parametrize("user", USERS)
def test_what_is_no_seed_is_told_in_one_line(user: str, seed: object) -> None:
    with pytest.raises(
        InputError, match=r"seed = .*; it must be a whole number from 0 to 9223372036854775807"
    ) as caught:
        USERS[user](seed)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("seed", [0, WORD - 1, WORD, MOST_SEED, np.int64(9), np.uint64(2**63 - 1)])
@pytest.mark.parametrize("user", USERS)
def test_every_seed_that_is_one_serves(user: str, seed: int) -> None:
    USERS[user](seed)


def test_packages_that_take_32_bits_get_no_more() -> None:
    assert 0 <= word(MOST_SEED) < WORD
    assert len({word(7 + high * WORD) for high in range(50)}) == 50
