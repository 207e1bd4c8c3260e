"""Formats of recordings: `load_motion` reads them all, by the reader of each."""

from __future__ import annotations

import inspect
import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from rtradar.errors import InputError
from rtradar.motion.motion import Motion
from rtradar.motion.skeleton import OWN_NAMES
from rtradar.recordings import Finding, Source, check_rate, check_unit, check_up
from rtradar.system.checks import brief
from rtradar.system.files import atomic_file, digest_of, read_arrays
from rtradar.system.registries import READERS, reader_of

register_reader = READERS.register


def load_motion(
    path: str | Path,
    skeleton: str | Path | None = None,
    *,
    up: str | None = "auto",
    unit: str | float | None = None,
    rate_hz: float | None = None,
    unit_m: float | None = None,
) -> Motion:
    """Read a motion-capture recording.

    What its file does not say is found from the person: the unit by the stature, up by who stands
    on a floor. What contradicts the format is warned of.

    Parameters
    ----------
    path : path
        ``.amc`` (with its ``skeleton``), ``.bvh``, ``.c3d`` and ``.trc`` with the markers of CMU,
        HDM05 or Plug-in Gait or with joints, ``.npz`` and ``.csv`` with joint positions, ``.npz``
        of AMASS, or an ending of `READERS`.
    skeleton : path, optional
        The subject's ``.asf``; needed by ``.amc``.
    up : {"auto", "x", "y", "z", "-x", "-y", "-z"}, optional
        Axis of the file that is up.
    unit : {"m", "cm", "mm", "in", "cmu"} or float, optional
        Length unit of the file, or the metres of one; an ``.asf`` says it itself.
    rate_hz : float, optional
        Frames a second, in place of those that the file says; an ``.amc`` does not say them, and is
        taken for 120 Hz [Hz].
    unit_m : float, optional
        Another name of ``unit`` [m].

    Returns
    -------
    Motion
        World axes (y-up mocap (z, x, y) becomes (x, y, z)), metres, not yet placed before a radar.
        Its ``findings`` say what was found.

    Raises
    ------
    InputError
        One line that names the file and, inside it, the line; and the option that tells, where two
        readings are as good as each other.
    ExtensionError
        Where the reader comes from another package, and fails.
    """
    name = reader_of(path, skeleton)
    file = Path(path)
    read, where = READERS[name], str(file)
    given = {
        "skeleton": None if skeleton is None else Path(skeleton),
        "unit_m": check_unit(where, unit if unit_m is None else unit_m),
        "up": check_up(where, up),
        "rate_hz": check_rate(where, rate_hz),
    }
    # Readers differ in what they need to be told; what one does not take is refused if it was
    # given.
    with READERS.guarded(name):
        taken = inspect.signature(read).parameters
        for option, value in given.items():
            if value is not None and option not in taken:
                said = "unit" if option == "unit_m" else option
                raise InputError(f"{file}: {name.upper()} files take no {said}; leave it out")
        motion = read(file, **{option: value for option, value in given.items() if option in taken})
    if not isinstance(motion, Motion):
        raise READERS.refuse(name, f"gave a {type(motion).__name__}, not a Motion")
    # What a run file needs to read the same again: the keys of a person, and the digests of all
    # files that were read, with the user's own names of joints if there are any.
    keys: dict[str, Any] = {"motion": str(file.absolute())}
    if skeleton is not None:
        keys["skeleton"] = str(Path(skeleton).absolute())
    read_too = [os.path.abspath(own)] if (own := os.environ.get(OWN_NAMES)) else []
    paths = [path for path in (*keys.values(), *read_too) if os.path.isfile(path)]
    files = {path: digest_of(path) for path in paths}
    told = {"up": given["up"], "unit": given["unit_m"], "rate_hz": given["rate_hz"]}
    keys |= {key: value for key, value in told.items() if value is not None}
    return motion.made_from(Source(keys, files))


_ARRAYS = ("offsets", "root_positions", "rotations")
_TEXTS = (
    *("name", "joints", "parents", "rate_hz", "first_frame_s", "length_s", "girth", "findings"),
)


def save_motion(path: str | Path, motion: Motion) -> None:
    """Write a motion to a file, of which `rtradar.load_motion` makes the same again.

    Parameters
    ----------
    path : path
        File, whose ending should be ``.motion``.
    motion : Motion
        Motion.
    """
    text = json.dumps({key: getattr(motion, key) for key in _TEXTS})
    arrays = {key: getattr(motion, key) for key in _ARRAYS}
    with atomic_file(path) as file:
        np.savez(file, text=np.array(text), **arrays)


def load_saved(path: Path) -> Motion:
    """Read a file of `save_motion`; an `InputError` tells what is wrong with it."""
    try:
        arrays = read_arrays(path)
        text = json.loads(str(arrays.pop("text")))
        fields: dict[str, Any] = {key: text[key] for key in _TEXTS}
        fields |= {key: arrays[key] for key in _ARRAYS}
        for key in ("joints", "parents"):
            fields[key] = tuple(fields[key])
        fields["findings"] = tuple(Finding(*found) for found in fields["findings"])
        return Motion(**fields)
    except InputError:
        raise
    except OSError as error:
        raise InputError(f"{path}: cannot read this MOTION file ({error.strerror})") from None
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(
            f"{path}: no motion that rtradar saved, or a damaged one ({brief(str(error))[1:-1]})"
        ) from None
