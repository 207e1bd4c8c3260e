"""Patterns of files in a specification, such as ``{label}/{subject}_*.bvh``, and what they match.

``*`` and ``?`` stand for letters of one name, ``**`` for any folders. ``{label}`` and ``{subject}``
stand for letters of one name, too, which become the activity and the subject; each ends where the
text behind it begins.
"""

from __future__ import annotations

import re
from pathlib import Path

from rtradar.errors import InputError
from rtradar.system.checks import brief, inside

FIELD = re.compile(r"\{(label|subject)\}")
"""Part of a pattern that gives a value."""

_PIECE = re.compile(r"\*|\?|\{label\}|\{subject\}")
_MOST_WILD = 10  # wildcards of a pattern, so that matching stays quick


def matching_files(where: str, pattern: str, folder: Path) -> list[tuple[str, dict[str, str]]]:
    """Return the files of a pattern in a folder by relative name, each with the values of fields.

    InputError if there is none, or the pattern leaves the folder.
    """
    if not _PIECE.search(pattern) or _is_file(folder, pattern):
        file_in(where, "file", pattern, folder)
        return [(pattern, {})]
    if inside(folder, pattern) is None:
        raise _leaves(where, "file", pattern)
    if len(_PIECE.findall(pattern)) > _MOST_WILD or pattern.count("**/") > 1:
        raise InputError(
            f"{where}file = {brief(pattern)}: {_MOST_WILD} wildcards are allowed, "
            "one of them **; give fewer"
        )
    *folders, last = pattern.split("/")
    parts = [part if part == "**" else _single(part) for part in folders] + [_single(last)]
    expression, found = _expression(parts), []
    for path in sorted(folder.glob(FIELD.sub("*", "/".join(parts)).replace("[", "[[]"))):
        name = path.relative_to(folder).as_posix()
        if (match := expression.fullmatch(name)) and path.is_file():
            if inside(folder, name) is None:
                raise _leaves(where, "file", name)
            found.append((name, match.groupdict()))
    if not found:
        raise InputError(
            f"{where}file = {brief(pattern)} matches no file in '{folder}'; "
            "mend the pattern, or leave it out"
        )
    return found


def _expression(parts: list[str]) -> re.Pattern[str]:
    """Return the regular expression of a pattern of these names."""
    seen: set[str] = set()

    def wild(piece: str) -> str:
        if piece in ("*", "?"):
            return "[^/]*?" if piece == "*" else "[^/]"
        name, again = piece.strip("{}"), piece in seen
        seen.add(piece)
        return f"(?P={name})" if again else f"(?P<{name}>[^/]+?)"

    def one(part: str) -> str:
        fixed = [re.escape(text) for text in _PIECE.split(part)]
        pieces = [wild(piece) for piece in _PIECE.findall(part)]
        if not pieces:
            return fixed[0]
        # Each but the last ends where the text behind it begins, and is not tried again: the time
        # stays in proportion to the length of the name.
        held = [f"(?>{piece}{text})" for piece, text in zip(pieces[:-1], fixed[1:-1], strict=True)]
        return "".join([fixed[0], *held, pieces[-1], fixed[-1]])

    folders = ["(?:[^/]+/)*" if part == "**" else f"{one(part)}/" for part in parts[:-1]]
    return re.compile("".join(folders) + one(parts[-1]))


def _single(part: str) -> str:
    """Return a name with one star where there are several, which mean the same."""
    return re.sub(r"\*+", "*", part)


def _is_file(folder: Path, name: str) -> bool:
    try:
        return inside(folder, name) is not None and (folder / name).is_file()
    except (OSError, ValueError):
        return False


def file_in(where: str, key: str, name: str, folder: Path) -> Path:
    """Return the path of an existing file in a folder or below; InputError if it is not there."""
    if inside(folder, name) is None:
        raise _leaves(where, key, name)
    if not (folder / name).is_file():
        raise InputError(f"{where}{key} = {brief(name)}: there is no such file in '{folder}'")
    return folder / name


def _leaves(where: str, key: str, name: str) -> InputError:
    return InputError(
        f"{where}{key} = {brief(name)} leaves the folder of recordings; name files in it or below"
    )
