"""Index of a data set: the list of its samples, and what else its folder may hold."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rtradar.clouds.sample_files import FORMAT, write_durably
from rtradar.errors import InputError
from rtradar.system.checks import brief
from rtradar.system.files import read_json, remove_parts

INDEX = "collection.json"
"""Name of the file that lists the samples of a data set."""

MADE_FROM = "collection.toml"
"""Name of the file that says what a data set was made from."""

_IDENTITY = re.compile(r"[A-Za-z0-9_-]{1,100}")  # a plain name, which cannot lead to another folder


def sweep(folder: Path) -> int:
    """Remove the partial files of interrupted writers, which must have ended; return how many."""
    return remove_parts(folder, rf"({_IDENTITY.pattern}\.npz|{re.escape(INDEX)})")


def write_index(folder: Path, identities: Iterable[str]) -> None:
    """Write the list of samples that belong to the data set; the samples need not exist yet.

    InputError if it cannot be written, or its name belongs to a file that is not an index.
    """
    path = folder / INDEX
    if os.path.lexists(path) and not _is_index(path):
        raise InputError(
            f"'{path}' is there, and no index of a collection; "
            "move it away, or give another folder (--out)"
        )
    content = json.dumps({"format": FORMAT, "samples": sorted(identities)}, indent=0)
    write_durably(path, content.encode() + b"\n")


def read_index(folder: Path) -> tuple[str, ...]:
    """Read the ids of the samples of a data set, ascending; InputError if there is no index."""
    path = folder / INDEX
    try:
        content = read_json(path)
    except OSError as error:
        raise InputError(
            f"'{folder}' holds no collection ({INDEX}: {error.strerror}); "
            "make one with: rtradar dataset build"
        ) from None
    except ValueError:
        raise InputError(
            f"'{path}' is damaged; move it away and mend the collection with: rtradar dataset build"
        ) from None
    if not _has_index_keys(content) or content["format"] != FORMAT:
        raise InputError(
            f"'{path}' is no index of format {FORMAT}; "
            "build the collection anew with: rtradar dataset build"
        )
    identities = content["samples"]
    for identity in identities:
        if not (isinstance(identity, str) and _IDENTITY.fullmatch(identity)):
            raise InputError(
                f"'{path}' names {brief(identity)}, which is no sample; "
                "mend the collection with: rtradar dataset build"
            )
    return tuple(sorted(identities))


def _is_index(path: Path) -> bool:
    """Return whether a file looks like an index, whatever its format number."""
    try:
        return _has_index_keys(read_json(path))
    except (OSError, ValueError):
        return False


def _has_index_keys(content: Any) -> bool:
    found = content if isinstance(content, dict) else {}
    return "format" in found and isinstance(found.get("samples"), list)
