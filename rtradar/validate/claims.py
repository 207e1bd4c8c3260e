"""The validation scripts: which there are, and which of them a choice means.

A script is one that has a function ``measure`` and takes ``main`` from ``rows``. The keys of its rows are the texts given as
``key=`` in it, and its own name where there are none; they are read from its source, for a choice of one claim must not run
the others.
"""

from __future__ import annotations

import ast
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from rtradar.errors import InputError


@dataclass(frozen=True)
class Claim:
    """One script.

    Parameters
    ----------
    script : path
    keys : tuple of str
        Those that its rows may have.
    """

    script: Path
    keys: tuple[str, ...]

    @property
    def name(self) -> str:
        """Of the script, without its ending."""
        return self.script.stem


def validation_folder() -> Path:
    """Folder of the scripts that come with rtradar: inside the installed package, or at the top of a checkout."""
    installed = Path(str(resources.files("rtradar"))) / "validation"
    return installed if installed.is_dir() else Path(__file__).resolve().parents[2] / "validation"


def claims(folder: Path) -> list[Claim]:
    """All scripts of a folder that measure a claim, by name."""
    found = []
    for script in sorted(folder.rglob("*.py"), key=lambda path: path.stem):
        tree = ast.parse(script.read_text(encoding="utf-8"), str(script))
        measures = any(
            isinstance(node, ast.FunctionDef) and node.name == "measure" for node in tree.body
        )
        asks = any(
            isinstance(node, ast.ImportFrom)
            and node.module == "rtradar.validate.rows"
            and any(alias.name == "main" for alias in node.names)
            for node in tree.body
        )
        if measures and asks:
            found.append(Claim(script, _keys(tree) or (script.stem,)))
    return found


def _keys(tree: ast.Module) -> tuple[str, ...]:
    named = [
        keyword.value.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        for keyword in node.keywords
        if keyword.arg == "key" and isinstance(keyword.value, ast.Constant)
    ]
    return tuple(dict.fromkeys(name for name in named if isinstance(name, str) and name))


def choose(found: Sequence[Claim], only: str | None) -> list[tuple[Claim, str | None]]:
    """Scripts to run, each with the key that its rows are limited to, if any.

    Raises
    ------
    InputError
        Where no script is there, or none has that name or key.
    """
    if not found:
        raise InputError(
            f"there are no validation scripts in '{validation_folder()}'; install rtradar again, or use a checkout"
        )
    if only is None:
        return [(claim, None) for claim in found]
    by_name = [(claim, None) for claim in found if claim.name == only.removesuffix(".py")]
    named = {claim.name for claim, _ in by_name}
    chosen: list[tuple[Claim, str | None]] = [
        *by_name,
        *((claim, only) for claim in found if only in claim.keys and claim.name not in named),
    ]
    if not chosen:
        keys = sorted({key for claim in found for key in claim.keys})
        names = sorted({claim.name for claim in found} - set(keys))
        raise InputError(
            f"--only {only}: no such claim; allowed keys: {', '.join(keys)}; or a script: {', '.join(names)}"
        )
    return chosen
