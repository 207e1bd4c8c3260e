"""What the header of a mesh file promises, looked at before a reader reserves memory for it."""

from __future__ import annotations

import json
import re
import struct

from rtradar.errors import InputError
from rtradar.system.checks import shown

_MOST_PLY_HEADER = 65_536
_MOST_GLB_HEADER = 16_000_000
_NUMBERS_A_FACE = 12
"""Three corners with place, normal, texture and index each: what a glb without shared vertices has."""


def refuse_hostile_header(where: str, ending: str, content: bytes, most_faces: int) -> None:
    """Look at the counts in a PLY or glb file; other kinds carry none that a reader believes.

    Parameters
    ----------
    where : str
        Begins the message.
    ending : str
        Of the file's name, such as ``.ply``.
    content : bytes
        All of the file.
    most_faces : int
        How many faces a mesh may have.

    Raises
    ------
    InputError
        Where it promises more than ``most_faces`` faces could need, or has no header.
    """
    check = {".ply": _check_ply, ".glb": _check_glb}.get(ending)
    if check is not None:
        check(where, content, most_faces)


def _check_ply(where: str, content: bytes, most_faces: int) -> None:
    head, end, _ = content[:_MOST_PLY_HEADER].partition(b"end_header")
    if not end:
        raise InputError(f"{where} is broken or is no ply file: its header has no end")
    for kind, count in re.findall(rb"element\s+(\S+)\s+(\d+)", head):
        most = most_faces if kind == b"face" else 3 * most_faces
        if len(count) > 12 or int(count) > most:
            raise InputError(
                f"{where} promises more elements {shown(kind.decode('ascii', 'replace'))} than the {most} allowed"
            )


def _check_glb(where: str, content: bytes, most_faces: int) -> None:
    broken = f"{where} is broken or is no glb file"
    length = struct.unpack("<I", content[12:16])[0] if len(content) >= 20 else 0
    if not 0 < length <= _MOST_GLB_HEADER:
        raise InputError(
            f"{broken}: its header has {length} bytes; 1 to {_MOST_GLB_HEADER} are allowed"
        )
    try:
        accessors = json.loads(content[20 : 20 + length]).get("accessors", [])
        count = sum(abs(int(accessor["count"])) for accessor in accessors)
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
        raise InputError(f"{broken}: its header cannot be read") from None
    # An accessor without data is filled with zeros, however many it names, and one whose rows overlap grows.
    if count > _NUMBERS_A_FACE * most_faces:
        raise InputError(
            f"{where} promises more data than the {most_faces} triangles that are allowed could have"
        )
