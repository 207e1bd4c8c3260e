"""The first that come stay."""

from __future__ import annotations

from rtradar.scatter.common.poses import KeyframeCache


def test_a_second_pass_from_the_start_finds_the_first_ones_again() -> None:
    memory: KeyframeCache[int, int] = KeyframeCache(stay=5, passing=2)
    found: list[int] = []

    def look(key: int) -> int:
        def find() -> int:
            found.append(key)
            return key * key

        return memory.get(key, find)

    assert [look(key) for key in range(10)] == [key * key for key in range(10)]
    assert found == list(range(10))
    # The last two were held until now; 5 to 7 went, and what is asked for anew makes others go.
    assert [look(key) for key in (8, 9, 8)] == [64, 81, 64]
    assert found == list(range(10))
    assert [look(key) for key in range(10)] == [key * key for key in range(10)]
    assert found[10:] == [5, 6, 7, 8, 9]
