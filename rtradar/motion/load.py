"""`load_motion`: one door for every file format."""

from __future__ import annotations

from pathlib import Path

from rtradar.errors import InputError
from rtradar.motion.asf import load_amc, load_skeleton
from rtradar.motion.bvh import load_bvh
from rtradar.motion.c3d import load_c3d
from rtradar.motion.motion import Motion


def load_motion(path: str | Path, skeleton: str | Path | None = None, *, unit_m: float | None = None) -> Motion:
    """Read a motion-capture recording.

    Parameters
    ----------
    path : path
        ``.amc`` (120 Hz, with its ``skeleton``), ``.bvh``, or ``.c3d`` with the markers of CMU and HDM05.
    skeleton : path, optional
        The subject's ``.asf``; needed by ``.amc``.
    unit_m : float, optional
        Metres in one length unit of a ``.bvh``, which does not say; found from the person's size where not given. Of a
        ``.c3d`` that does not say.

    Returns
    -------
    Motion
        World axes (y-up mocap (z, x, y) becomes (x, y, z)), metres, not yet placed before a radar.

    Raises
    ------
    InputError
        One line that names the file and, inside it, the line.
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if suffix == ".amc":
        if skeleton is None:
            raise InputError(f"{file}: an AMC file needs its skeleton; give the subject's .asf (--skeleton)")
        if unit_m is not None:
            raise InputError(f"{file}: unit_m belongs to BVH files; an ASF skeleton states its unit")
        return load_amc(file, load_skeleton(Path(skeleton)))
    if suffix == ".bvh":
        if skeleton is not None:
            raise InputError(f"{file}: a BVH file holds its own skeleton; leave {skeleton} out")
        return load_bvh(file, unit_m)
    if suffix == ".c3d":
        if skeleton is not None:
            raise InputError(f"{file}: a C3D file holds markers, from which joints are found; leave {skeleton} out")
        return load_c3d(file, unit_m)
    raise InputError(f"{file}: unknown kind of motion file {suffix!r}; allowed are .amc (with .asf), .bvh and .c3d")
