"""Pictures of how well a classifier tells activities apart, as PNG files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rtradar.report.figures.maps import new_figure, save_figure

History = Sequence[dict[str, float]]


def draw_accuracies(path: Path, rows: Sequence[tuple[str, Sequence[float]]], title: str) -> None:
    """Box plot: the trainings of each row as a box from quartile to quartile, with a dot for each.

    Parameters
    ----------
    path : path
        PNG file.
    rows : sequence of (name, accuracies)
        Accuracies between 0 and 1.
    title : str
    """
    figure = new_figure(max(4.0, 1.4 + 1.1 * len(rows)), 4.2)
    axes = figure.subplots()
    percent = [100 * np.asarray(shares) for _, shares in rows]
    axes.boxplot(percent, widths=0.5, showfliers=False, medianprops={"color": "C1"})
    for place, shares in enumerate(percent, start=1):
        offsets = np.linspace(-0.12, 0.12, len(shares)) if len(shares) > 1 else np.zeros(1)
        axes.plot(place + offsets, shares, ".", color="C0", alpha=0.6)
    axes.set_xticks(
        range(1, len(rows) + 1), [name.replace(", ", "\n", 1) for name, _ in rows], fontsize=7
    )
    axes.set(
        ylabel="Test accuracy [%]",
        xlabel="Classifier",
        title=title,
        ylim=(min(0.0, *(min(one) for one in percent)), 102),
    )
    axes.grid(axis="y", alpha=0.3)
    save_figure(figure, path)


def draw_confusion(
    path: Path, counts: NDArray[np.int64], classes: Sequence[str], title: str
) -> None:
    """Draw a confusion matrix ``counts (truth, answer)``, coloured by the fraction of the class."""
    shares = 100 * counts / np.maximum(1, counts.sum(axis=1, keepdims=True))
    cells = [
        [f"{count}\n{share:.0f} %" for count, share in zip(*row, strict=True)]
        for row in zip(counts, shares, strict=True)
    ]
    _draw_matrix(
        path,
        shares,
        cells,
        classes,
        ("Answered", "Shown", "Share of the clouds that show it [%]"),
        title,
    )


def draw_transfer(
    path: Path,
    values: Sequence[str],
    mean: NDArray[np.float64],
    spread: NDArray[np.float64],
    title: str,
) -> None:
    """Draw accuracies ``(trained_on, tested_on)`` of a column's values, NaN where there is none."""
    cells = [
        [
            ""
            if np.isnan(share)
            else f"{100 * share:.0f}" + ("" if np.isnan(error) else f"\n±{100 * error:.0f}")
            for share, error in zip(*row, strict=True)
        ]
        for row in zip(mean, spread, strict=True)
    ]
    _draw_matrix(
        path, 100 * mean, cells, values, ("Asked about", "Trained on", "Test accuracy [%]"), title
    )


def draw_learning(path: Path, histories: Sequence[History], title: str) -> None:
    """Loss and accuracy over epochs: a thin line a training, a thick one for their mean.

    Parameters
    ----------
    path : path
        PNG file.
    histories : sequence of sequence of dict
        Rows of `rtradar.classify.training.train_network`, as many for each training.
    title : str
    """
    figure = new_figure(9, 3.8)
    for axes, name, label, factor in zip(
        figure.subplots(1, 2),
        ("loss", "accuracy"),
        ("Negative log-likelihood [nat]", "Accuracy [%]"),
        (1, 100),
        strict=True,
    ):
        for side, colour in (("train", "C0"), ("test", "C1")):
            curves = [[factor * row[f"{side}_{name}"] for row in history] for history in histories]
            epochs = np.arange(1, min(map(len, curves)) + 1)
            for curve in curves:
                axes.plot(epochs, curve[: len(epochs)], color=colour, linewidth=0.5, alpha=0.35)
            axes.plot(
                epochs,
                np.mean([curve[: len(epochs)] for curve in curves], axis=0),
                color=colour,
                label=side,
            )
        axes.set(xlabel="Epoch", ylabel=label)
        axes.grid(alpha=0.3)
        axes.legend()
    figure.suptitle(title, wrap=True)
    save_figure(figure, path)


def _draw_matrix(
    path: Path,
    percent: NDArray[np.float64],
    cells: Sequence[Sequence[str]],
    names: Sequence[str],
    labels: tuple[str, str, str],
    title: str,
) -> None:
    size = 2.6 + 0.85 * len(names)
    figure = new_figure(size + 0.9, size)
    axes = figure.subplots()
    image = axes.imshow(percent, cmap="Blues", vmin=0, vmax=100)
    for row, line in enumerate(cells):
        for column, text in enumerate(line):
            dark = percent[row, column] > 55
            axes.text(
                column,
                row,
                text,
                ha="center",
                va="center",
                color="white" if dark else "black",
                fontsize=8,
            )
    axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
    axes.set_yticks(range(len(names)), names)
    axes.set(xlabel=labels[0], ylabel=labels[1], title=title)
    figure.colorbar(image, label=labels[2])
    save_figure(figure, path)
