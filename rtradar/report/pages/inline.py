"""A page in one file that a notebook shows where it was made."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path

from rtradar.system.files import atomic_file


@dataclass(frozen=True, repr=False)
class InlinePage:
    """A page that makes no request; a notebook shows it in a frame of its own.

    Parameters
    ----------
    html : str
        The whole page.
    height_px : int
        Height of the frame [pixel].
    """

    html: str
    height_px: int = 900

    def save(self, path: str | Path) -> None:
        """Write the page into a file, which any browser opens.

        Parameters
        ----------
        path : path
            File that is written.

        Raises
        ------
        InputError
            If the file cannot be written; an existing file is then unchanged.
        """
        with atomic_file(path) as file:
            file.write(self.html.encode())

    def __repr__(self) -> str:
        return f"InlinePage of {len(self.html) / 1e6:.1f} MB; save(path) writes it"

    def _repr_html_(self) -> str:
        # A frame keeps styles and scripts of page and notebook apart.
        style = f"width: 100%; height: {self.height_px}px; border: 0"
        return f'<iframe srcdoc="{escape(self.html)}" style="{style}" title="rtradar"></iframe>'
