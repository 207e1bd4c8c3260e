"""Pictures of trainings: confusion matrices, accuracies between groups, and learning curves."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rtradar.report.figures.canvas import add_colour_bar
from rtradar.system.figure_style import (
    LIGHT,
    STYLE,
    WIDTH_IN,
    dress,
    new_figure,
    save_figure,
    write_heading,
)


def draw_confusion(
    path: Path, counts: NDArray[np.int64], classes: Sequence[str], title: str
) -> None:
    """Draw a confusion matrix ``counts (truth, answer)``, coloured by the fraction of the class."""
    percent = 100 * counts / np.maximum(1, counts.sum(axis=1, keepdims=True))
    cells = [
        [f"{count}\n{value:.0f} %" for count, value in zip(*row, strict=True)]
        for row in zip(counts, percent, strict=True)
    ]
    labels = "Answered", "Shown", "Fraction of the clouds that show it [%]"
    _draw_matrix(path, percent, cells, classes, labels, title)


def draw_transfer(
    path: Path,
    values: Sequence[str],
    mean: NDArray[np.float64],
    spread: NDArray[np.float64],
    title: str,
) -> None:
    """Draw accuracies ``(trained_on, tested_on)`` of a column's values, NaN where there is none."""

    def cell(value: float, error: float) -> str:
        text = "" if np.isnan(value) else f"{100 * value:.0f}"
        return text if np.isnan(error) else f"{text}\n±{100 * error:.0f}"

    rows = zip(mean, spread, strict=True)
    cells = [[cell(*pair) for pair in zip(*row, strict=True)] for row in rows]
    labels = "Asked about", "Trained on", "Test accuracy [%]"
    _draw_matrix(path, 100 * mean, cells, values, labels, title)


def draw_learning(path: Path, histories: Sequence[Sequence[dict[str, float]]], title: str) -> None:
    """Draw loss and accuracy over epochs: a thin line a training, a thick one for their mean."""
    figure = new_figure(3.4)
    left, right = figure.subplots(1, 2)
    for axes, name, label, factor in (
        (left, "loss", "Negative log-likelihood [nat]", 1),
        (right, "accuracy", "Accuracy [%]", 100),
    ):
        for side, colour in zip(("train", "test"), LIGHT.cycle, strict=False):
            curves = [[factor * row[f"{side}_{name}"] for row in history] for history in histories]
            epochs = np.arange(1, min(map(len, curves)) + 1)
            curves = [curve[: len(epochs)] for curve in curves]
            for curve in curves:
                axes.plot(epochs, curve, color=colour, linewidth=0.5, alpha=0.35)
            axes.plot(epochs, np.mean(curves, axis=0), color=colour, label=side)
        axes.set(xlabel="Epoch", ylabel=label)
        axes.legend()
        dress(axes)
    write_heading(figure, title)
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
    figure = new_figure(size, width_in=max(WIDTH_IN, size + 0.9))
    figure.set_layout_engine("compressed")
    axes = figure.subplots()
    image = axes.imshow(percent, cmap="Blues", vmin=0, vmax=100)
    for row, line in enumerate(cells):
        for column, text in enumerate(line):
            tint = "white" if percent[row, column] > 55 else "black"
            axes.text(
                column, row, text, ha="center", va="center", color=tint, fontsize=STYLE["font.size"]
            )
    axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
    axes.set_yticks(range(len(names)), names)
    axes.set(xlabel=labels[0], ylabel=labels[1])
    dress(axes, title=title, grid=False)
    add_colour_bar(image, [axes], labels[2], extend="neither")
    save_figure(figure, path)
