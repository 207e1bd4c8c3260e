"""IF samples as 16-bit integers: a plain array, or the file that a DCA1000 records."""

from __future__ import annotations

import dataclasses
import json
import math
import os
import warnings
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError, ValidityWarning
from rtradar.exchange.dca1000 import (
    Dca1000Layout,
    Packets,
    of_radar,
    pack,
    packets_in,
    unpack,
    words_of,
)
from rtradar.exchange.recording import (
    IF_AXES,
    IF_UNIT,
    ROW_AXES,
    IfRecording,
    SampleFile,
    radar_of,
)
from rtradar.radar import Radar
from rtradar.signal.multiplexing import chirps_together
from rtradar.signal.real_samples import complex_of_real, real_of_complex
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
    own, packets = of_radar(layout, radar), None if about else packets_in(path)
    n_bytes = path.stat().st_size if packets is None else packets.size
    row = 2 * words_of(own, radar)
    take: Callable[[int, int], NDArray[np.int16]] = partial(_words, path)
    if packets is not None:
        take, n_bytes = packets.words, _cut(packets, _whole(radar) * row)
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
