"""IF samples as 16-bit integers: a plain array, or the file that a DCA1000 records.

A chip of Texas Instruments sends its samples over LVDS lanes, and the board writes the words as
they arrive, little-endian. Chirps follow in the order of sending. The orders are those of TI's
application report SWRA581, "Mmwave Radar Device ADC Raw Data Capture".

The board sends its words in packets of at most 1456 bytes, whose headers programs that listen to it
may write, too. Before the words stand the number of the packet, from 1 on (4 bytes), and the number
of bytes sent before (6 bytes), little-endian; mmWave Studio writes the length of the packet between
both (4 bytes). A packet that was lost is a gap in the numbers.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import re
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError, ValidityWarning
from rtradar.exchange.recording import IF_AXES, IF_UNIT, ROW_AXES, IfRecording, SampleFile, radar_of
from rtradar.radar import Radar
from rtradar.signal.multiplexing import chirps_together
from rtradar.signal.real_samples import complex_of_real, real_of_complex
from rtradar.system.checks import brief
from rtradar.system.files import atomic_file, open_regular, read_json

_LARGEST = 32767
_WHAT = "IF samples of rtradar: sample = scale * (I + 1j Q)"


def write_int16(
    path: Path, recording: IfRecording, layout: Dca1000Layout | None = None
) -> dict[str, Any]:
    """Write little-endian int16 with a JSON file beside it, which has their scale and the radar.

    They are (chirp, tx, rx, sample, IQ), or chirps in the order of a DCA1000. The largest number
    becomes 32767, and rounding errors are at most half of ``scale``. InputError if a file cannot be
    written, a foreign file has the name of the JSON file, or a sample is not finite.
    """
    beside = path.with_suffix(".json")
    # Two files are written; a JSON file of somebody else is not replaced.
    for file in (path, beside):
        if file.is_dir():
            raise InputError(f"cannot write '{file}': a directory; give another file (--out)")
    if os.path.lexists(beside) and _description(path) is None:
        raise InputError(
            f"'{beside}' is there, and something else; it would be replaced: "
            "give another file (--out)"
        )
    real = layout is not None and layout.real
    if layout is not None:
        layout = of_radar(layout, recording.radar)
    # The samples are read twice: first for the largest number, which sets the scale of all.
    peak = 0.0
    for _, block in recording.blocks("finding the peak"):
        largest = float(np.abs(_parts(block, real)).max())
        if not np.isfinite(largest):
            raise InputError(
                f"{recording.name}: a sample is not finite, and has no place in 16 bits; "
                "run it again"
            )
        peak = max(peak, largest)
    scale = peak / _LARGEST if peak else 1.0
    # The description appears only when the samples are complete.
    about = _about(path, recording, layout) | {"scale": scale, "quantisation": scale / 2}
    with atomic_file(beside) as text, atomic_file(path) as raw:
        text.write((json.dumps(about, indent=1) + "\n").encode("utf-8"))
        for _, block in recording.blocks("writing"):
            # In float64: the quotient of two float32 could round to the wrong side of a half.
            words = np.rint(_parts(block, real) / scale).astype("<i2")
            if layout is not None:
                words = pack(words.reshape(-1, *words.shape[2:]), layout)
            raw.write(words.tobytes())
        # The text of an older cube must not lie beside this one, wherever the next steps end.
        beside.unlink(missing_ok=True)
    rows = {"axes": list(ROW_AXES), "shape": list(recording.shape)}
    said = {"beside": str(beside), "scale": scale, "quantisation": scale / 2, "type": "int16"}
    return said if layout is None else rows | said


def _parts(block: NDArray[np.complex64], real: bool) -> NDArray[np.float64]:
    """Return real and imaginary parts (..., sample, part), or real samples as their only part."""
    if real:
        return real_of_complex(block)[..., None]
    return block.view(np.float32).reshape(*block.shape, 2).astype(np.float64)


def _about(path: Path, recording: IfRecording, layout: Dca1000Layout | None) -> dict[str, Any]:
    """Return what the JSON file says, without the scale."""
    radar = recording.radar
    about: dict[str, Any] = {
        "what": _WHAT,
        "data": path.name,
        "type": "int16, little-endian",
        "axes": [*IF_AXES, "iq"],
        "shape": [*recording.cube_shape, 2],
        "unit": IF_UNIT,
        **recording.waveform(),
        "radar": json.loads(recording.radar_text),
    }
    # A raw capture has no axes of antennas: its words come in the order in which the board sends
    # them.
    if layout is not None:
        shape = [recording.shape[0], words_of(layout, radar)]
        return about | {
            "axes": ["chirp", "word"],
            "shape": shape,
            "dca1000": dataclasses.asdict(layout),
        }
    rx = recording.quantities()["rx_position"].values
    return about | {"tx_position_m": radar.tx.tolist(), "rx_position_m": rx.tolist()}


def open_int16(
    path: Path, radar: Radar | None = None, layout: Dca1000Layout | None = None
) -> SampleFile:
    """Open what `write_int16` wrote, or what a DCA1000 recorded, for which a radar is needed.

    The JSON file beside it, if it is one of rtradar, says what is not given. Without it samples are
    the numbers of the ADC.
    """
    about = _description(path) or {}
    if not about and radar is None:
        raise ValueError("no JSON file beside it tells of its radar, and none is given (--radar)")
    # What is given goes before what the JSON file says.
    radar = radar_of(json.dumps(about["radar"])) if radar is None else radar
    if layout is None and "dca1000" in about:
        layout = Dca1000Layout(**about["dca1000"])
    if layout is None and not about:
        layout = Dca1000Layout()
    scale = float(about.get("scale", 1.0))
    if not 0 < scale * (_LARGEST + 1) <= np.finfo(np.float32).max:
        raise ValueError(f"scale is {scale:g}")
    if layout is None:
        return _open_plain(path, radar, scale, tuple(map(int, about["shape"])))
    # A file that a board sent may still have the headers of packets in it.
    own, packets = of_radar(layout, radar), None if about else packets_in(path)
    n_bytes = path.stat().st_size if packets is None else packets.size
    row = 2 * words_of(own, radar)
    take: Callable[[int, int], NDArray[np.int16]] = partial(_words, path)
    if packets is not None:
        take, n_bytes = packets.words, _cut(packets, _whole(radar) * row)
    # Anything but whole frames, or cycles, means another radar or another order.
    chirps, odd = divmod(n_bytes, row)
    if odd or not chirps or chirps % _whole(radar):
        raise InputError(_of_another_size(path, radar, own, n_bytes))

    def read(first: int, last: int) -> NDArray[np.complex64]:
        words = take(first * row, (last - first) * row // 2)
        parts = unpack(words.reshape(last - first, -1), own, radar).astype(np.float64) * scale
        if own.real:
            return complex_of_real(parts[..., 0])
        return parts.astype(np.float32).view(np.complex64)[..., 0]

    size = (chirps, radar.n_rx, radar.samples_per_chirp)
    return SampleFile(path, radar, size, read, "m" if about else "count")


def _cut(packets: Packets, group: int) -> int:
    """Bytes of whole frames or cycles, ``group`` bytes each, in packets; what lacks is said."""
    kept = packets.size // group * group
    said = [f"{len(packets.place)} packets with headers, which are left out"]
    if packets.lost:
        said.append(f"{packets.lost} were lost, and zeros stand for them")
    if 0 < kept < packets.size:
        said.append(f"the last {packets.size - kept} bytes are no whole frame and are left out")
    warnings.warn(f"'{packets.path}': {'; '.join(said)}", ValidityWarning, stacklevel=4)
    return kept or packets.size


def _open_plain(path: Path, radar: Radar, scale: float, shape: tuple[int, ...]) -> SampleFile:
    size = path.stat().st_size
    if len(shape) != 5 or min(shape) < 0 or shape[4] != 2 or size != 2 * math.prod(shape):
        raise ValueError(f"{size // 2} numbers where the JSON file tells of {shape}")
    row = 2 * math.prod(shape[2:])

    def read(first: int, last: int) -> NDArray[np.complex64]:
        words = _words(path, first * row, (last - first) * row // 2)
        parts = (words.astype(np.float64) * scale).astype(np.float32)
        return parts.view(np.complex64).reshape(last - first, *shape[2:4])

    return SampleFile(path, radar, (shape[0] * shape[1], *shape[2:4]), read, tx_per_cycle=shape[1])


def _words(path: Path, offset: int, count: int) -> NDArray[np.int16]:
    with open_regular(path) as file:
        words = np.fromfile(file, dtype="<i2", count=count, offset=offset)
    if len(words) != count:
        raise ValueError("it became shorter while it was read")
    return words


def _of_another_size(path: Path, radar: Radar, layout: Dca1000Layout, size: int) -> str:
    """Say how a file does not fit."""
    row = 2 * words_of(layout, radar)
    kind, count = ("real", 2) if layout.real else ("complex", 1)
    of_chirp = f"{radar.n_rx} Rx, {count * radar.samples_per_chirp} {kind} samples, {layout.lanes} "
    cure = "give the radar and the layout that recorded it (--radar, --lanes, --real)"
    group, whole = "frames" if radar.in_frames else "cycles", _whole(radar)
    if size >= whole * row:
        cure += f", or cut it to its first {size // (whole * row) * whole * row} bytes"
    return (
        f"'{path}' has {size} bytes, which are {size / row:.6g} chirps of radar '{radar.name}' "
        f"({of_chirp}lanes: {row} bytes), no whole number of {group} of {whole}; {cure}"
    )


def _whole(radar: Radar) -> int:
    """Number of stored chirps in a frame of a radar that pauses between them, else in a cycle."""
    together = radar.chirps_per_frame if radar.in_frames else radar.n_tx
    return together // chirps_together(radar)


def _description(path: Path) -> dict[str, Any] | None:
    """Return the JSON file beside a file of samples, None if there is none of rtradar."""
    try:
        about: dict[str, Any] = read_json(path.with_suffix(".json"))
        return about if about["what"] == _WHAT else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


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
    # What a chip cannot send in this order.
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
    # Four lanes side by side, one for each Rx, zeros on those that are off: I of all lanes, then Q
    # of all.
    if layout.lanes == 4:
        lanes = np.zeros((chirps, samples, n_parts, _MOST_RX), dtype=np.int16)
        lanes[..., _lanes(layout, n_rx)] = np.moveaxis(parts, 1, -1)
        return lanes.reshape(chirps, -1)
    # Two lanes send samples in pairs: both I, then both Q, one Rx after the other.
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
        # Whole packets that hold the words are read, without their headers, and cut to these.
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
        # Each length of a header that is known is tried: all packets but the last are of one size.
        step = PAYLOAD_BYTES + header
        count = -(-size // step)
        last = size - (count - 1) * step - header
        if count < 2 or last < 2 or last % 2:
            continue
        raw = np.memmap(path, np.uint8, "r")
        # The headers alone, a packet apart, without a copy of the file.
        rows = np.lib.stride_tricks.as_strided(raw, (count, header), (step, 1), writeable=False)
        # Two tell of most files; all of them touch every page of a large one.
        if not all(_tells_twice(some) for some in (rows[:2], rows)):
            continue
        # The number of a packet says its place in the capture; one that is missing was lost.
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
