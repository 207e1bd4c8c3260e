"""Formats of recordings: `load_motion` reads them all, by the reader of each."""

from __future__ import annotations

import inspect
from pathlib import Path

from rtradar.errors import InputError
from rtradar.motion.motion import Motion
from rtradar.system.registries import READERS, reader_of

register_reader = READERS.register


def load_motion(
    path: str | Path, skeleton: str | Path | None = None, *, unit_m: float | None = None
) -> Motion:
    """Read a motion-capture recording.

    Parameters
    ----------
    path : path
        ``.amc`` (120 Hz, with its ``skeleton``), ``.bvh``, ``.c3d`` with the markers of CMU and
        HDM05, ``.npz`` and ``.csv`` with joint positions, or an ending of `READERS`.
    skeleton : path, optional
        The subject's ``.asf``; needed by ``.amc``.
    unit_m : float, optional
        Metres in one length unit of a ``.bvh``, which does not say; found from the person's size
        where not given. A ``.c3d`` needs it only where it does not say, joint positions only where
        they are not in metres.

    Returns
    -------
    Motion
        World axes (y-up mocap (z, x, y) becomes (x, y, z)), metres, not yet placed before a radar.

    Raises
    ------
    InputError
        One line that names the file and, inside it, the line.
    ExtensionError
        Where the reader comes from another package, and fails.
    """
    file, name = Path(path), reader_of(path, skeleton)
    read = READERS[name]
    with READERS.guarded(name):
        taken = inspect.signature(read).parameters
        given = {"skeleton": None if skeleton is None else Path(skeleton), "unit_m": unit_m}
        for option, value in given.items():
            if value is not None and option not in taken:
                raise InputError(f"{file}: {name.upper()} files take no {option}; leave it out")
        motion = read(file, **{option: value for option, value in given.items() if option in taken})
    if not isinstance(motion, Motion):
        raise READERS.refuse(name, f"gave a {type(motion).__name__}, not a Motion")
    return motion
