"""The paper beside what this package gives: its items one by one, and its own choices of a run.

`make_paper` puts all items into one folder; a command that was killed goes on with it.
"""

from __future__ import annotations

import json
import time
import warnings
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tqdm import tqdm

from rtradar.errors import ValidityWarning
from rtradar.paper.items import AS_PAPER, Item, Sources, find_recordings, load_items, paper_warnings
from rtradar.system.files import atomic_file, read_json
from rtradar.system.output_folder import OutputFiles, resumable_folder

__all__ = ["AS_PAPER", "Item", "make_paper", "paper_warnings"]


PAPER_FILES = OutputFiles("paper.json", r"paper\.(html|json)|(figure|table|number)-[a-z0-9-]+\.png")
"""Files of the page."""


def _parts() -> dict[str, Callable[[Sources], dict[str, Any]]]:
    """Return what measures the figures of the items, in turn; slow to import."""
    from rtradar.paper.captures import activity_figures, cost_figures, detection_figures
    from rtradar.paper.formulas import radar_figures
    from rtradar.paper.learning import learning_figures

    return {
        "radar": radar_figures,
        "activities": activity_figures,
        "detections": detection_figures,
        "cost": cost_figures,
        "learning": learning_figures,
    }


def make_paper(
    out: str | Path,
    *,
    quick: bool = False,
    full: bool = False,
    mocap: str | Path | None = None,
    overwrite: bool = False,
) -> dict[str, Any]:
    """Put every figure, table, equation and stated number of the paper beside ours.

    What is measured is kept as soon as it is made, so that a killed command goes on.

    Parameters
    ----------
    out : path
        Folder for ``paper.html``, ``paper.json`` and the pictures.
    quick : bool
        Whether table 3 takes one frame of one activity, and the run at 77 GHz 1 s.
    full : bool
        Whether the trainings are done anew, in about 18 hours, and not taken from a stored result.
    mocap : path, optional
        Folder of recordings of HDM05; without it synthetic actors do the activities.
    overwrite : bool
        Whether files that others made under the names of new ones are replaced.

    Returns
    -------
    dict
        Content of ``paper.json``: ``items``, ``parts`` (what was measured, and how long it took),
        ``settings``, ``version``, ``files``.

    Raises
    ------
    InputError
        If the folder holds files of others or cannot be written, or there are no recordings.
    """
    folder = Path(out)
    sources = Sources(folder, quick, full, find_recordings(None if mocap is None else Path(mocap)))
    settings = {"quick": quick, "full": full, "who": sources.named}
    with resumable_folder(folder, PAPER_FILES, overwrite=overwrite):
        kept = _kept(folder, settings)
        # Before any picture, so that each is known as ours however this ends.
        content = _write(folder, settings, kept)
        # Each part is written as soon as it is measured, so that a command that was stopped can go
        # on.
        parts = _parts()
        with tqdm(total=len(parts), initial=len(kept), unit="part", disable=None) as bar:
            for name, measure in parts.items():
                if name in kept:
                    continue
                bar.set_description(name)
                began, spent = time.perf_counter(), time.process_time()
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", ValidityWarning)
                    figures = measure(sources)
                took = time.perf_counter() - began, time.process_time() - spent
                kept[name] = {"figures": figures, "wall_s": took[0], "cpu_s": took[1]}
                content = _write(folder, settings, kept)
                bar.update()
        _write_page(folder, sources, content)
    return content


def _kept(folder: Path, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return the parts that an earlier command with the same settings has finished."""
    # Figures of other settings or of another version would not fit the rest.
    with suppress(OSError, ValueError, KeyError, TypeError, AttributeError):
        there = read_json(folder / PAPER_FILES.listing)
        if there["settings"] == settings and there["version"] == version("rtradar"):
            return {name: part for name, part in there["parts"].items() if part["figures"]}
    return {}


def _write(folder: Path, settings: Mapping[str, Any], parts: Mapping[str, Any]) -> dict[str, Any]:
    """Write ``paper.json`` with the items that are measured so far."""
    figures = {key: value for part in parts.values() for key, value in part["figures"].items()}
    items = load_items()
    pictures = [item.picture for item in items if item.picture]
    content = {
        "items": [_shown(folder, item) for one in items if (item := one.filled(figures))],
        "settings": dict(settings),
        "version": version("rtradar"),
        "parts": dict(parts),
        "files": sorted({"paper.html", PAPER_FILES.listing, *pictures}),
    }
    with atomic_file(folder / PAPER_FILES.listing) as file:
        file.write((json.dumps(content, indent=1) + "\n").encode())
    return content


def _shown(folder: Path, item: Item) -> dict[str, Any]:
    """Return the item without a picture where there is none: curves come with ``full``."""
    there = item.picture is not None and (folder / item.picture).is_file()
    return asdict(item) | ({} if there else {"picture": None})


def _write_page(folder: Path, sources: Sources, content: Mapping[str, Any]) -> None:
    from rtradar.report.html import write_page

    seconds = sum(part["wall_s"] for part in content["parts"].values())
    about = f"Who moves: {sources.named}. Measured in {seconds:.0f} s"
    about += ", quickly: with fewer cases of table 3 and 77 GHz." if sources.quick else "."
    items = content["items"]
    values = {
        "kind": "The paper beside rtradar",
        "heading": "4D radar simulator for human activity recognition",
        "subtitle": about,
        "folder": folder,
        "items": items,
        "links": {item["id"]: _link(item["title"]) for item in items},
    }
    write_page(folder / "paper.html", "paper.html", values)


def _link(title: str) -> str:
    """Return a title for the contents: the number if the item has one, else its subject."""
    number, _, subject = title.partition(": ")
    return f"{subject} ({number.split()[1]})" if number.startswith("Section") else number
