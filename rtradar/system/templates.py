"""Templates of pages and of texts for the terminal, which stand in files beside their modules."""

from __future__ import annotations

from functools import cache
from itertools import groupby, zip_longest
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from jinja2 import Environment


@cache
def templates(folder: Path, *, escaped: bool) -> Environment:
    """Return the templates of a folder, in the language of Jinja.

    Parameters
    ----------
    folder : Path
        Folder of the templates.
    escaped : bool
        Whether what is filled in is escaped, as on pages of HTML.

    Returns
    -------
    Environment
        Environment of Jinja, in which a name that is not given is an error.
    """
    from jinja2 import Environment, FileSystemLoader, StrictUndefined  # slow to import

    return Environment(
        autoescape=escaped,
        loader=FileSystemLoader(folder),
        lstrip_blocks=True,
        trim_blocks=True,
        undefined=StrictUndefined,
    )


def aligned(text: str) -> str:
    """Align the columns of the Markdown tables of a text, and rule a line below their heads.

    Parameters
    ----------
    text : str
        Text in which a line of a table begins and ends with a bar.

    Returns
    -------
    str
        Text with padded cells.
    """
    lines: list[str] = []
    # Each run of lines that begin with a bar is a table; other lines stay.
    for is_table, block in groupby(text.split("\n"), lambda line: line.startswith("|")):
        if not is_table:
            lines += block
            continue
        rows = [[cell.strip() for cell in line[1:-1].split(" | ")] for line in block]
        widths = [max(map(len, column)) for column in zip_longest(*rows, fillvalue="")]
        padded = [map(str.ljust, row, widths) for row in rows]
        head, *body = (f"| {' | '.join(cells)} |" for cells in padded)
        rule = "|".join("-" * (width + 2) for width in widths)
        lines += [head, f"|{rule}|", *body]
    return "\n".join(lines)
