"""The file that says which samples of a folder belong to its collection."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable
from pathlib import Path

from rtradar.clouds.sample_file import FORMAT
from rtradar.errors import InputError
from rtradar.system.checks import shown
from rtradar.system.files import atomic_file, read_json, remove_parts

INDEX = "collection.json"
"""Name of the file that says which samples belong to the collection."""

_IDENTITY = re.compile(r"[A-Za-z0-9_-]{1,100}")  # a name, and no way to another folder


def sweep(folder: Path) -> int:
    """Remove what killed writers left of samples; their number. None may be writing."""
    return remove_parts(folder, rf"({_IDENTITY.pattern}\.npz|{re.escape(INDEX)})")


def write_index(folder: Path, identities: Iterable[str]) -> None:
    """Say which samples belong to the collection, whether they are there already or not.

    Raises
    ------
    InputError
        Where it cannot be written, or a file of that name is there that is no index.
    """
    path = folder / INDEX
    if os.path.lexists(path) and not _is_index(path):
        raise InputError(
            f"'{path}' is there, and no index of a collection; move it away, or give another folder (--out)"
        )
    content = json.dumps({"format": FORMAT, "samples": sorted(identities)}, indent=0)
    with atomic_file(path) as file:
        file.write(content.encode() + b"\n")
        file.flush()
        os.fsync(file.fileno())


def _is_index(path: Path) -> bool:
    """Whether it looks like one, of whatever format."""
    try:
        content = read_json(path)
    except (OSError, ValueError):
        return False
    return (
        isinstance(content, dict)
        and "format" in content
        and isinstance(content.get("samples"), list)
    )


def read_index(folder: Path) -> tuple[str, ...]:
    """Ids of the samples that belong to the collection, ascending.

    Raises
    ------
    InputError
        Where the folder holds no collection, or one of another format.
    """
    path = folder / INDEX
    try:
        content = read_json(path)
    except OSError as error:
        why = error.strerror
        raise InputError(
            f"'{folder}' holds no collection ({INDEX}: {why}); make one with: rtradar dataset build"
        ) from None
    except ValueError:
        raise InputError(
            f"'{path}' is damaged; move it away and mend the collection with: rtradar dataset build"
        ) from None
    if (
        not isinstance(content, dict)
        or content.get("format") != FORMAT
        or not isinstance(content.get("samples"), list)
    ):
        raise InputError(
            f"'{path}' is no index of format {FORMAT}; build the collection anew with: rtradar dataset build"
        )
    identities = content["samples"]
    for identity in identities:
        if not (isinstance(identity, str) and _IDENTITY.fullmatch(identity)):
            raise InputError(
                f"'{path}' names {shown(identity)}, which is no sample; mend the collection with: rtradar dataset build"
            )
    return tuple(sorted(identities))
