"""IF samples as whole numbers of 16 bits, I and Q in turn, as radar boards give them; a JSON file beside them says the rest."""

from __future__ import annotations

import json
import math
import os
from pathlib import Path
from typing import Any

import numpy as np

from rtradar.errors import InputError
from rtradar.exchange.recording import (
    IF_AXES,
    IF_UNIT,
    IfCube,
    IfRecording,
    quantities,
    radar_of,
    radar_text,
    scalars,
)
from rtradar.system.files import atomic_file, open_regular, read_json

_LARGEST = 32767
_WHAT = "IF samples of rtradar: sample = scale * (I + 1j Q)"


def write_int16(path: Path, recording: IfRecording) -> dict[str, Any]:
    """Write (chirp, tx, rx, sample, IQ) as little-endian int16 with a JSON file beside it.

    The largest real or imaginary part becomes 32767, and rounding errors are at most half of
    ``scale``.

    Raises
    ------
    InputError
        If a file cannot be written, a foreign file has the name of the JSON file, or a sample is
        not finite.
    """
    beside = path.with_suffix(".json")
    for file in (path, beside):
        if file.is_dir():
            raise InputError(f"cannot write '{file}': a directory; give another file (--out)")
    if os.path.lexists(beside) and not _ours(beside):
        raise InputError(
            f"'{beside}' is there, and something else; it would be replaced: "
            "give another file (--out)"
        )
    peak = 0.0
    for _, block in recording.blocks("finding the peak"):
        largest = float(np.abs(block.view(np.float32)).max())
        if not np.isfinite(largest):
            raise InputError(
                f"{recording.name}: a sample is not finite, and has no place in 16 bits; "
                "run it again"
            )
        peak = max(peak, largest)
    scale = peak / _LARGEST if peak else 1.0
    about = {
        "what": _WHAT,
        "data": path.name,
        "type": "int16, little-endian",
        "axes": [*IF_AXES, "iq"],
        "shape": [*recording.shape, 2],
        "scale": scale,
        "unit": IF_UNIT,
        "quantisation": scale / 2,
        **scalars(recording.radar),
        "tx_position_m": recording.radar.tx.tolist(),
        "rx_position_m": quantities(recording.radar, 1)["rx_position"].values.tolist(),
        "radar": json.loads(radar_text(recording.radar)),
    }
    with atomic_file(beside) as text, atomic_file(path) as raw:
        text.write((json.dumps(about, indent=1) + "\n").encode("utf-8"))
        for _, block in recording.blocks("writing"):
            # In float64: the quotient of two float32 could round to the wrong side of a half.
            raw.write(
                np.rint(block.view(np.float32).astype(np.float64) / scale).astype("<i2").tobytes()
            )
        beside.unlink(
            missing_ok=True
        )  # of another cube: never beside this one, wherever the next steps end
    return {"beside": str(beside), "scale": scale, "quantisation": scale / 2, "type": "int16"}


def read_int16(path: Path) -> IfCube:
    """What `write_int16` wrote, each part to half of ``scale`` and the rounding of float32.

    Raises
    ------
    Exception
        Of many kinds where the files are others; `rtradar.exchange.read_if` makes one line of it.
    """
    about = read_json(path.with_suffix(".json"))
    shape = tuple(map(int, about["shape"]))
    with open_regular(path) as file:
        whole = np.fromfile(file, dtype="<i2")
    if len(shape) != 5 or min(shape) < 0 or shape[4] != 2 or whole.size != math.prod(shape):
        raise ValueError(f"{whole.size} numbers where the JSON file tells of {shape}")
    scale = float(about["scale"])
    if not 0 < scale * (_LARGEST + 1) <= np.finfo(np.float32).max:
        raise ValueError(f"scale is {scale:g}")
    parts = (whole.astype(np.float64) * scale).astype(np.float32)
    return IfCube(parts.view(np.complex64).reshape(shape[:4]), radar_of(json.dumps(about["radar"])))


def _ours(path: Path) -> bool:
    try:
        return bool(read_json(path)["what"] == _WHAT)
    except (OSError, ValueError, KeyError, TypeError):
        return False
