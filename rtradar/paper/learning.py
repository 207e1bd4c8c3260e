"""Table 4 and pictures 14 to 16: from a stored result, which says when it was made, or anew."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import numpy as np

from rtradar.paper.sources import Sources
from rtradar.system.figure_style import LIGHT, dress, new_figure, save_figure

SIZES = ("500", "1000", "2000", "3000")
"""Points of a cloud, the columns of table 4."""


def stored_result() -> dict[str, Any]:
    """Read the result of the trainings that take hours.

    Returns
    -------
    dict
        ``script``, ``commit`` and ``date``; ``paper`` and ``ours`` by points of a cloud.
    """
    text = files("rtradar.paper").joinpath("stored.json").read_text(encoding="utf-8")
    found: dict[str, Any] = json.loads(text)
    return found


def learning_figures(sources: Sources) -> dict[str, Any]:
    """Put our accuracies beside those of table 4.

    Parameters
    ----------
    sources : Sources
        Folder of the pictures, and whether the trainings are done anew.

    Returns
    -------
    dict
        Figures by their names.
    """
    result = stored_result()
    if sources.full:
        from rtradar.paper.training import train_anew  # which needs the extras learn and campaign

        result |= train_anew(sources.out)
    _draw(sources, result)
    paper = {size: np.array(result["paper"][size]) for size in SIZES}
    chosen = paper["1000"]
    where = "this run" if sources.full else f"commit {result['commit']} of {result['date']}"
    found = {
        "origin": f"{result['script']}, {where}",
        "table4_paper": "; ".join(
            f"{size}: {each.mean():.1f} ± {each.std(ddof=1):.1f}" for size, each in paper.items()
        ),
        "table4_ours": "; ".join(f"{size}: {_shown(result['ours'][size])}" for size in SIZES),
        "table4_apart": "; ".join(
            f"{size}: {result['ours'][size]['mean'] - paper[size].mean():+.1f}" for size in SIZES
        ),
        "lean": "; ".join(f"{size}: {result['lean'][size]:g}" for size in SIZES),
        "median": float(np.median(chosen)),
        "quartiles": " and ".join(f"{value:.1f}" for value in np.quantile(chosen, (0.25, 0.75))),
        "spatial": _spatial(result["spatial"]),
    }
    for name in ("first_trial", "all_epochs"):
        found |= {f"{name}_{key}": value for key, value in result[name].items()}
    return found | {"rate_batches": 1e-4 * 0.5**12, "rate_160": 1e-4 * 0.5**16}


def _shown(one: Mapping[str, Any]) -> str:
    if one["spread"] is None:
        return f"{one['mean']:.1f} (first fold alone)"
    return f"{one['mean']:.1f} ± {one['spread']:.1f}"


def _spatial(one: Mapping[str, Any] | None) -> str:
    """Say what is known of spatial clouds."""
    if one is None:
        return "PointNet on spatial clouds has not been measured yet"
    return (
        f"PointNet with the paper's settings and {one['points']} points of {one['clouds']} clouds: "
        f"{one['spatial']:.1f} % right on spatial clouds and {one['rdt']:.1f} % on the RDT clouds "
        f"of the same captures, in {one['answers']} answers each ({one['script']}, commit "
        f"{one['commit']} of {one['date']})"
    )


def _draw(sources: Sources, result: Mapping[str, Any]) -> None:
    """Draw the paper's four boxes, and ours beside them."""
    figure = new_figure(4.2)
    axes = figure.subplots()
    place = np.arange(len(SIZES), dtype=np.float64)
    style: dict[str, Any] = {"widths": 0.28, "showfliers": False, "patch_artist": True}
    style["medianprops"] = {"color": LIGHT.text}
    paper = [result["paper"][size] for size in SIZES]
    style["boxprops"] = {"facecolor": LIGHT.faint}
    axes.boxplot(paper, positions=place - 0.18, **style)
    style["boxprops"] = {"facecolor": LIGHT.cycle[0], "alpha": 0.5}
    for at, size in zip(place + 0.18, SIZES, strict=True):
        one = result["ours"][size]
        if each := one.get("each"):
            axes.boxplot([each], positions=[at], **style)
        spread = one["spread"] or 0.0
        axes.errorbar(at, one["mean"], spread, fmt="o", color=LIGHT.cycle[1], capsize=4)
        axes.annotate(f"{one['folds']}", (at, one["mean"]), (6, -3), textcoords="offset points")
    axes.set_xticks(place, SIZES)
    axes.set(xlabel="Points of a cloud", ylabel="Test accuracy [%]", ylim=(60, 102))
    title = "Table 4: the paper's ten folds (boxes), ours (dots: mean, spread, number of folds)"
    dress(axes, title=title)
    save_figure(figure, sources.out / "table-4.png")
