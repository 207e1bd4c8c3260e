"""Table 4 and pictures 14 to 16: from a stored result, which says when it was made, or anew."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from typing import Any

import numpy as np

from rtradar.paper.items import CURVES, SIZES, Sources
from rtradar.report.evaluation import draw_confusion, draw_learning
from rtradar.system.figure_style import LIGHT, dress, new_figure, save_figure


def stored_result() -> dict[str, Any]:
    """Read the result of the trainings that take hours.

    Returns
    -------
    dict
        ``script``, ``commit`` and ``date``; ``paper`` and ``ours`` by points of a cloud; the
        `CURVES` of ``first_trial`` and ``all_epochs``, and the matrix of the ``best`` fold.
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
    # Table 4 has the ten folds of the paper for each size of a cloud, and ours beside them.
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
        "lean": "; ".join(f"{size}: {mean:.1f}" for size, mean in result["lean"].items()),
        "median": float(np.median(chosen)),
        "quartiles": " and ".join(f"{value:.1f}" for value in np.quantile(chosen, (0.25, 0.75))),
        "spatial": _spatial(result["spatial"], full=sources.full),
    }
    # The paper shows the curves of single trainings.
    trial, long = result["first_trial"], result["all_epochs"]
    found |= {
        "first_trial_epochs": len(trial["test_accuracy"]),
        "first_trial_test": 100 * trial["test_accuracy"][-1],
        "all_epochs_loss": long["train_loss"][-1],
        "all_epochs_train": 100 * long["train_accuracy"][-1],
        "all_epochs_test_early": 100 * float(np.mean(long["test_accuracy"][60:70])),
        "all_epochs_test_last": 100 * long["test_accuracy"][-1],
    }
    counts = np.array(result["best"]["counts"])
    found |= {"best": 100 * counts.trace() / counts.sum(), "best_clouds": int(counts.sum())}
    return found | {"rate_batches": 1e-4 * 0.5**12, "rate_160": 1e-4 * 0.5**16}


def _shown(one: Mapping[str, Any]) -> str:
    return f"{one['mean']:.1f} ± {one['spread']:.1f}"


def _spatial(one: Mapping[str, Any], *, full: bool) -> str:
    """Say what is known of spatial clouds."""
    origin = "this run" if full else f"{one['script']}, commit {one['commit']} of {one['date']}"
    return (
        f"PointNet with the paper's settings and {one['points']} points of {one['clouds']} clouds: "
        f"{one['spatial']:.1f} % right on spatial clouds and {one['rdt']:.1f} % on the RDT clouds "
        f"of the same captures, in {one['answers']} answers each ({origin})"
    )


def _draw(sources: Sources, result: Mapping[str, Any]) -> None:
    """Draw the paper's four boxes and ours beside them, and what it shows of single trainings."""
    figure = new_figure(4.2)
    axes = figure.subplots()
    place = np.arange(len(SIZES), dtype=np.float64)
    # The boxes of the paper and ours stand side by side for each size.
    for beside, name, colour in ((-0.18, "paper", LIGHT.faint), (0.18, "ours", LIGHT.cycle[0])):
        boxes = [result[name][size] for size in SIZES]
        axes.boxplot(
            boxes if name == "paper" else [one["each"] for one in boxes],
            positions=place + beside,
            widths=0.28,
            showfliers=False,
            patch_artist=True,
            boxprops={"facecolor": colour, "alpha": 0.5},
            medianprops={"color": LIGHT.text},
        )
    axes.set_xticks(place, SIZES)
    axes.set(xlabel="Points of a cloud", ylabel="Test accuracy [%]", ylim=(45, 102))
    dress(axes, title="Table 4: ten folds of the paper (left boxes), and ours (right)")
    save_figure(figure, sources.out / "table-4.png")
    for number, name, title in (
        (14, "first_trial", "Learning rate 1e-6"),
        (15, "all_epochs", "Learning rate 1e-4"),
    ):
        curves = result[name]
        epochs = zip(*(curves[key] for key in CURVES), strict=True)
        history = [dict(zip(CURVES, values, strict=True)) for values in epochs]
        draw_learning(sources.out / f"figure-{number}.png", [history], title)
    best = result["best"]
    counts = np.array(best["counts"])
    draw_confusion(sources.out / "figure-16.png", counts, best["classes"], "Best of ten folds")
