"""Target of `fuzz_readers.py` for C3D files: markers of a standing person, by the manual."""

from __future__ import annotations

import struct
from contextlib import suppress
from pathlib import Path

import numpy as np
from fuzz_kit import Target, written

from rtradar.body import Body
from rtradar.errors import InputError
from rtradar.motion import load_motion
from rtradar.motion.formats.markers import NEEDED

BLOCK = 512
FRAMES, RATE_HZ = 3, 100.0

# Forward, left (of the left side), up [m].
PLACES = {
    "FHD": (0.10, 0.07, 1.62), "BHD": (-0.08, 0.05, 1.62), "C7": (-0.05, 0.0, 1.45),
    "CLAV": (0.05, 0.0, 1.45), "T10": (-0.10, 0.0, 1.15), "STRN": (0.10, 0.0, 1.15),
    "SHO": (0.0, 0.2, 1.42), "ELB": (0.0, 0.2, 1.12), "WRA": (0.28, 0.2, 1.16),
    "WRB": (0.28, 0.2, 1.08), "FIN": (0.37, 0.2, 1.12), "FWT": (0.12, 0.12, 0.95),
    "BWT": (-0.12, 0.08, 0.95), "KNE": (0.0, 0.12, 0.52), "ANK": (0.0, 0.12, 0.08),
    "TOE": (0.16, 0.12, 0.08),
}  # fmt: skip


def _standing() -> np.ndarray:
    """Markers (frame, marker, 3) [mm] of a person who walks a little."""
    side = np.array([[1, -1 if name[0] == "R" else 1, 1] for name in NEEDED])
    places = np.array([PLACES.get(name) or PLACES[name[1:]] for name in NEEDED]) * side
    return 1e3 * (places + np.arange(FRAMES)[:, None, None] * [0.01, 0.0, 0.0])


def _parameter(group: int, name: str, kind: int, sizes: tuple[int, ...], data: bytes) -> bytes:
    body = struct.pack("<bB", kind, len(sizes)) + bytes(sizes) + data + b"\0"
    return (
        struct.pack("<bb", len(name), group)
        + name.encode()
        + struct.pack("<h", len(body) + 2)
        + body
    )


def c3d(in_floats: bool, up: str = "+Z") -> bytes:
    """A whole file, its points as floats or as whole numbers (https://www.c3d.org, user guide)."""
    scale = -1.0 if in_floats else 0.1
    count = len(NEEDED)
    parameters = struct.pack("<bb", 5, -1) + b"POINT" + struct.pack("<hB", 3, 0)
    for name, kind, sizes, data in (
        ("USED", 2, (), struct.pack("<h", count)),
        ("FRAMES", 2, (), struct.pack("<h", FRAMES)),
        ("SCALE", 4, (), struct.pack("<f", scale)),
        ("RATE", 4, (), struct.pack("<f", RATE_HZ)),
        ("DATA_START", 2, (), struct.pack("<h", 4)),
        ("UNITS", -1, (2,), b"mm"),
        ("Y_SCREEN", -1, (2,), up.encode()),
        ("LABELS", -1, (4, count), b"".join(name.ljust(4).encode() for name in NEEDED)),
    ):
        parameters += _parameter(1, name, kind, sizes, data)
    parameters = (struct.pack("<BBBB", 1, 80, 2, 84) + parameters + bytes(2)).ljust(
        2 * BLOCK, b"\0"
    )
    head = struct.pack("<BBHHHHHfHHf", 2, 80, count, 0, 1, FRAMES, 10, scale, 4, 0, RATE_HZ).ljust(
        BLOCK, b"\0"
    )
    points = np.zeros((FRAMES, count, 4), dtype="<f4" if in_floats else "<i2")
    points[..., :3] = _standing() if in_floats else np.rint(_standing() / scale)
    return head + parameters + points.tobytes()


def _read(folder: Path, data: bytes) -> None:
    motion = load_motion(written(folder / "x.c3d", data))
    motion.at([0.0, motion.duration_s / 2, motion.duration_s])
    with suppress(InputError):
        Body.from_motion(motion).at([0.0, motion.duration_s])


TARGETS = {
    "c3d": Target(
        _read,
        lambda: [c3d(True), c3d(False), c3d(True, "+Y")],
        "POINT ANALOG TRIAL USED FRAMES SCALE RATE DATA_START UNITS Y_SCREEN LABELS "
        "ACTUAL_START_FIELD ACTUAL_END_FIELD FORMAT m",
    )
}
