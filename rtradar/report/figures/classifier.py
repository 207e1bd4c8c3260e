"""Pictures of the accuracy of classifiers, as PNG files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rtradar.report.figures.canvas import new_figure, save_figure

History = Sequence[dict[str, float]]


def draw_accuracies(path: Path, rows: Sequence[tuple[str, Sequence[float]]]) -> None:
    """Draw a box plot of rows of name and accuracies: a box between quartiles, a dot a training."""
    figure = new_figure(max(4.0, 1.4 + 1.1 * len(rows)), 4.2)
    axes = figure.subplots()
    percent = [100 * np.asarray(fractions) for _, fractions in rows]
    axes.boxplot(percent, widths=0.5, showfliers=False, medianprops={"color": "C1"})
    for place, values in enumerate(percent, start=1):
        offsets = np.linspace(-0.12, 0.12, len(values)) if len(values) > 1 else np.zeros(1)
        axes.plot(place + offsets, values, ".", color="C0", alpha=0.6)
    names = [name.replace(", ", "\n", 1) for name, _ in rows]
    axes.set_xticks(range(1, len(rows) + 1), names, fontsize=7)
    axes.set(ylabel="Test accuracy [%]", xlabel="Classifier", title="Test accuracy")
    axes.set_ylim(min(0.0, *map(min, percent)), 102)
    axes.grid(axis="y", alpha=0.3)
    save_figure(figure, path)


def draw_confusion(
    path: Path, counts: NDArray[np.int64], classes: Sequence[str], title: str
) -> None:
    """Draw a confusion matrix ``counts (truth, answer)``, coloured by the fraction of the class."""
    percent = 100 * counts / np.maximum(1, counts.sum(axis=1, keepdims=True))
    cells = [
        [f"{count}\n{value:.0f} %" for count, value in zip(*row, strict=True)]
        for row in zip(counts, percent, strict=True)
    ]
    labels = "Answered", "Shown", "Share of the clouds that show it [%]"
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


def draw_learning(path: Path, histories: Sequence[History], title: str) -> None:
    """Draw loss and accuracy over epochs: a thin line a training, a thick one for their mean."""
    figure = new_figure(9, 3.8)
    left, right = figure.subplots(1, 2)
    for axes, name, label, factor in (
        (left, "loss", "Negative log-likelihood [nat]", 1),
        (right, "accuracy", "Accuracy [%]", 100),
    ):
        for side, colour in (("train", "C0"), ("test", "C1")):
            curves = [[factor * row[f"{side}_{name}"] for row in history] for history in histories]
            epochs = np.arange(1, min(map(len, curves)) + 1)
            curves = [curve[: len(epochs)] for curve in curves]
            for curve in curves:
                axes.plot(epochs, curve, color=colour, linewidth=0.5, alpha=0.35)
            axes.plot(epochs, np.mean(curves, axis=0), color=colour, label=side)
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
            tint = "white" if percent[row, column] > 55 else "black"
            axes.text(column, row, text, ha="center", va="center", color=tint, fontsize=8)
    axes.set_xticks(range(len(names)), names, rotation=30, ha="right")
    axes.set_yticks(range(len(names)), names)
    axes.set(xlabel=labels[0], ylabel=labels[1], title=title)
    figure.colorbar(image, label=labels[2])
    save_figure(figure, path)
