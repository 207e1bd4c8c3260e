"""Order of the 16-bit words in which a DCA1000 records the samples of a chip of Texas Instruments.

A chip sends its samples over LVDS lanes, and the board writes the words as they arrive, little-
endian. Chirps follow in the order of sending. The orders are those of TI's application report
SWRA581, "Mmwave Radar Device ADC Raw Data Capture".

The board sends its words in packets of at most 1456 bytes, whose headers programs that listen to it
may write, too. Before the words stand the number of the packet, from 1 on (4 bytes), and the number
of bytes sent before (6 bytes), little-endian; mmWave Studio writes the length of the packet between
both (4 bytes). A packet that was lost is a gap in the numbers.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.system.checks import brief

_MOST_RX = 4
_FOUR_LANES = re.compile(r"[ai]wr(12|14|22)\d\d", re.IGNORECASE)


PAYLOAD_BYTES = 1456
"""Bytes of words in a packet, but the last one of a capture."""

_HEADERS = (10, 14)
_MOST_LOST = 0.5
"""Fraction of the packets that may be lost; beyond, it is taken for words without headers."""


@dataclass(frozen=True)
class Dca1000Layout:
    """Order of the words of a chirp.

    Parameters
    ----------
    lanes : {2, 4}, optional
        Number of LVDS lanes. With 2 (xWR16xx, 18xx, 68xx) the chirp of one Rx follows that of
        another, and of complex samples two real parts come before their two imaginary parts. With 4
        (xWR12xx, 14xx, 22xx) each Rx has a lane, whose words alternate: of complex samples the real
        parts of all lanes come before the imaginary parts. By default the radar's name decides.
    real : bool
        Whether the chip sends real samples, twice as many as the radar has complex ones in a chirp,
        at twice the rate; see `rtradar.signal.real_samples`.
    q_first : bool
        Whether the imaginary part (Q) comes before the real one (I), as programs of the mmWave SDK
        set it (SampleSwap 1 of adcbufCfg).
    rx_mask : int, optional
        Bits of the Rx that are switched on (channelCfg), from 1 to 15. It matters for 4 lanes
        alone, where those of the other Rx carry zeros; by default the first ones are on.

    Raises
    ------
    InputError
        If a value is none of these.
    """

    lanes: Literal[2, 4] | None = None
    real: bool = False
    q_first: bool = False
    rx_mask: int | None = None

    def __post_init__(self) -> None:
        if self.lanes not in (2, 4, None):
            raise InputError(f"DCA1000: lanes = {brief(self.lanes)}; a chip has 2 or 4 (--lanes)")
        mask = self.rx_mask
        if mask is not None and (not isinstance(mask, int) or not 0 < mask < 2**_MOST_RX):
            raise InputError(
                f"DCA1000: rx_mask = {brief(mask)}; it must be a whole number from 1 to 15, the "
                "bits of the Rx that are on (--rx-mask)"
            )
        if self.real and self.q_first:
            raise InputError("DCA1000: real samples have no Q; leave out q_first (--q-first)")


def of_radar(layout: Dca1000Layout, radar: Radar) -> Dca1000Layout:
    """Settle the lanes; InputError where a chip sends no chirps of this radar in this order."""
    if layout.lanes is None:
        return of_radar(replace(layout, lanes=4 if _FOUR_LANES.match(radar.name) else 2), radar)
    n_rx, on = radar.n_rx, layout.rx_mask and layout.rx_mask.bit_count()
    if on is not None and on != n_rx:
        raise InputError(
            f"DCA1000: rx_mask = {layout.rx_mask} switches {on} Rx on, radar '{radar.name}' has "
            f"{n_rx}; give the mask of those (--rx-mask)"
        )
    if layout.lanes == 4 and n_rx > _MOST_RX:
        raise InputError(
            f"DCA1000: radar '{radar.name}' has {n_rx} Rx, and 4 lanes carry at most 4; take "
            "the order of 2 lanes (--lanes 2)"
        )
    if layout.lanes == 2 and not layout.real and radar.samples_per_chirp % 2:
        raise InputError(
            f"DCA1000: 2 lanes send complex samples in pairs, and radar '{radar.name}' has "
            f"{radar.samples_per_chirp} in a chirp; take an even number (samples_per_chirp)"
        )
    return layout


def words_of(layout: Dca1000Layout, radar: Radar) -> int:
    """Number of words in a chirp: one for each part, or each of twice as many real samples."""
    return 2 * radar.samples_per_chirp * (_MOST_RX if layout.lanes == 4 else radar.n_rx)


def pack(parts: NDArray[np.int16], layout: Dca1000Layout) -> NDArray[np.int16]:
    """Order parts (chirp, rx, sample, part) as words (chirp, word); one part if real."""
    if layout.q_first:
        parts = parts[..., ::-1]
    chirps, n_rx, samples, n_parts = parts.shape
    if layout.lanes == 4:
        lanes = np.zeros((chirps, samples, n_parts, _MOST_RX), dtype=np.int16)
        lanes[..., _lanes(layout, n_rx)] = np.moveaxis(parts, 1, -1)
        return lanes.reshape(chirps, -1)
    if n_parts == 2:
        parts = parts.reshape(chirps, n_rx, -1, 2, 2).swapaxes(-1, -2)
    return parts.reshape(chirps, -1)


def unpack(words: NDArray[np.int16], layout: Dca1000Layout, radar: Radar) -> NDArray[np.int16]:
    """Order words (chirp, word) as parts (chirp, rx, sample, part): what `pack` inverts."""
    chirps, n_parts = len(words), 1 if layout.real else 2
    if layout.lanes == 4:
        lanes = words.reshape(chirps, -1, n_parts, _MOST_RX)[..., _lanes(layout, radar.n_rx)]
        parts = np.moveaxis(lanes, -1, 1)
    elif n_parts == 2:
        parts = words.reshape(chirps, radar.n_rx, -1, 2, 2).swapaxes(-1, -2)
        parts = parts.reshape(chirps, radar.n_rx, -1, 2)
    else:
        parts = words.reshape(chirps, radar.n_rx, -1, 1)
    return np.ascontiguousarray(parts[..., ::-1] if layout.q_first else parts)


def _lanes(layout: Dca1000Layout, n_rx: int) -> NDArray[Any]:
    """Lane of each Rx that is on."""
    mask = 2**n_rx - 1 if layout.rx_mask is None else layout.rx_mask
    return np.flatnonzero([mask >> lane & 1 for lane in range(_MOST_RX)])


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
