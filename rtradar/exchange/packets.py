"""Captures of a DCA1000 with the headers of its packets, as programs that listen to it write them.

The board sends its words in packets of at most 1456 bytes. Before them stand the number of the
packet, from 1 on (4 bytes), and the number of bytes sent before (6 bytes), little-endian; mmWave
Studio writes the length of the packet between both (4 bytes). A packet that was lost is a gap in
the numbers.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

PAYLOAD_BYTES = 1456
"""Bytes of words in a packet, but the last one of a capture."""

_HEADERS = (10, 14)
_MOST_LOST = 0.5
"""Fraction of the packets that may be lost; beyond, it is taken for words without headers."""


@dataclass(frozen=True, eq=False)
class Packets:
    """Words in the packets of a file.

    ``place`` (packet,) is the number of each packet in the file by its number in the capture, -1
    where it was lost; ``last`` the bytes of the last one.
    """

    path: Path
    header: int
    place: NDArray[np.int64]
    last: int

    @property
    def size(self) -> int:
        """Number of bytes of words, those of lost packets included."""
        return (len(self.place) - 1) * PAYLOAD_BYTES + self.last

    @property
    def lost(self) -> int:
        """Number of lost packets."""
        return int((self.place < 0).sum())

    def words(self, offset: int, count: int) -> NDArray[np.int16]:
        """Return ``count`` words from a byte of the words on; those of lost packets are 0."""
        first, end = offset // PAYLOAD_BYTES, -(-(offset + 2 * count) // PAYLOAD_BYTES)
        data = np.zeros((end - first, PAYLOAD_BYTES), np.uint8)
        step = PAYLOAD_BYTES + self.header
        raw = np.memmap(self.path, np.uint8, "r")
        for row, place in enumerate(self.place[first:end]):
            if place >= 0:
                own = raw[place * step + self.header : (place + 1) * step]
                data[row, : len(own)] = own
        begin = offset - first * PAYLOAD_BYTES
        return data.reshape(-1)[begin : begin + 2 * count].view("<i2")


def packets_in(path: Path) -> Packets | None:
    """Find the packets of a file; None where it holds words alone."""
    size = path.stat().st_size
    for header in _HEADERS:
        step = PAYLOAD_BYTES + header
        count = -(-size // step)
        last = size - (count - 1) * step - header
        if count < 2 or last < 2 or last % 2:
            continue
        raw = np.memmap(path, np.uint8, "r")
        rows = np.lib.stride_tricks.as_strided(raw, (count, header), (step, 1), writeable=False)
        # Two tell of most files; all of them touch every page of a large one.
        if not all(_tells_twice(some) for some in (rows[:2], rows)):
            continue
        numbers = _number(rows[:, :4])
        whole = int(numbers.max())
        if len(np.unique(numbers)) < count or count < (1 - _MOST_LOST) * whole:
            continue
        place = np.full(whole, -1)
        place[numbers - 1] = np.arange(count)
        return Packets(path, header, place, last if place[-1] == count - 1 else PAYLOAD_BYTES)
    return None


def _tells_twice(rows: NDArray[np.uint8]) -> bool:
    """Whether the numbers of packets (packet, byte) and the bytes before them are the same."""
    numbers, before = _number(rows[:, :4]), _number(rows[:, -6:])
    return bool((numbers >= 1).all() and (before == (numbers - 1) * PAYLOAD_BYTES).all())


def _number(digits: NDArray[np.uint8]) -> NDArray[np.int64]:
    """Numbers (row,) of little-endian bytes (row, byte)."""
    return (digits.astype(np.int64) << 8 * np.arange(digits.shape[1])).sum(axis=1)
