"""Evaluation of classifiers: its tables, numbers, and pictures of trainings."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.classify import outcomes as scores
from rtradar.classify.outcomes import (
    HISTORY,
    TABLE_4,
    Answers,
    Outcome,
    balanced_accuracy,
    calibration_error,
    interval,
)
from rtradar.classify.study import Study
from rtradar.errors import InputError
from rtradar.report.canvas import add_colour_bar
from rtradar.system.checks import printable
from rtradar.system.figure_style import (
    LIGHT,
    STYLE,
    WIDTH_IN,
    dress,
    new_figure,
    save_figure,
    write_heading,
)
from rtradar.system.files import csv_text
from rtradar.system.output_folder import OutputFiles
from rtradar.system.templates import templates

Group = tuple[str, Sequence[Outcome]]

EVALUATION_FILES = OutputFiles(
    "evaluation.json",
    r"evaluation\.json|trainings\.csv|history\.csv|table\.txt|accuracy\.png"
    r"|(confusion|learning|transfer)-[1-9]\d*\.png",
)
"""Files of an evaluation."""


def write_evaluation(
    studies: Sequence[Study], baselines: dict[str, list[Outcome]], out: Path
) -> tuple[str, dict[str, Any]]:
    """Write tables, pictures and numbers of studies of the same clouds, and of baselines.

    Returns the table for the terminal and the content of ``evaluation.json``. The other files are
    ``trainings.csv``, ``history.csv``, ``table.txt`` and ``accuracy.png``, and for each study
    ``confusion-N.png``, ``learning-N.png`` and, for the scheme ``across``, ``transfer-N.png``.
    ``out`` must exist. InputError if the studies have different classes.
    """
    classes = studies[0].plan["classes"]
    for study in studies:
        if study.plan["classes"] != classes:
            raise InputError(
                f"'{study.folder}' knows other activities than '{studies[0].folder}'; "
                "evaluate them one by one"
            )
    titles = _titles(studies)
    named = list(zip(titles, studies, strict=True))
    groups: list[Group] = [(title, study.outcomes) for title, study in named]
    groups += baselines.items()
    # A table of accuracies over all, then of each study what it confuses, how it learnt, and how it
    # transfers.
    blocks = [scores.accuracy_table(_rows(studies, titles, baselines))]
    for number, (title, study) in enumerate(named, start=1):
        counts = scores.confusion(study.outcomes, len(classes))
        recordings = scores.recordings_of(study.outcomes, len(classes))
        table = scores.confusion_table(counts, classes, recordings)
        blocks.append(f"{title}: {_about(study)}\n{table}")
        draw_confusion(out / f"confusion-{number}.png", counts, classes, title)
        histories = [one.history for one in study.outcomes]
        draw_learning(out / f"learning-{number}.png", histories, title)
        if any(one.trained_on for one in study.outcomes):
            transfer = scores.transfer(study.outcomes)
            blocks.append(scores.transfer_table(*transfer))
            draw_transfer(out / f"transfer-{number}.png", *transfer, title)
    # Scores by person need the answers themselves, which only some trainings have kept.
    if judged := [(title, found) for title, each in groups if (found := together(each))]:
        blocks.append(score_table(judged))
    rows = [(title, _accuracies(outcomes)) for title, outcomes in groups]
    draw_accuracies(out / "accuracy.png", rows)
    text = "\n\n".join(blocks)
    content = {
        "classes": classes,
        "groups": [_numbers(title, outcomes, len(classes)) for title, outcomes in groups],
        "plans": [study.plan for study in studies],
    }
    # Everything as files; the JSON file is the last, because it lists the others.
    (out / "table.txt").write_text(text + "\n", encoding="utf-8")
    _write_csv(out, groups)
    content["files"] = EVALUATION_FILES.list_of(out)
    (out / "evaluation.json").write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return text, content


def together(outcomes: Sequence[Outcome]) -> Answers | None:
    """Return the answers of all trainings; None where one has kept none."""
    each = [one.answers for one in outcomes]
    known = [answers for answers in each if answers is not None]
    if not known or len(known) < len(each):
        return None
    return Answers(*(np.concatenate(columns) for columns in zip(*known, strict=True)))


def scores_of(answers: Answers) -> dict[str, Any]:
    """Return balanced accuracies, their interval over people, and the error of calibration."""
    recordings = answers.by_recording()
    return {
        "balanced": balanced_accuracy(answers),
        "balanced_by_recording": balanced_accuracy(recordings),
        "interval": interval(recordings),
        "calibration_error": calibration_error(recordings),
        "recordings": len(recordings.truth),
        "people": len(set(answers.subjects.tolist())),
    }


def score_table(judged: Sequence[tuple[str, Answers]]) -> str:
    """Format balanced accuracies [%] of clouds and of recordings."""
    template = templates(Path(__file__).with_name("pages"), escaped=False).get_template(
        "scores.txt"
    )
    width = max(len("balanced, in %"), *(len(title) for title, _ in judged))
    found = [(title, scores_of(answers)) for title, answers in judged]
    return template.render(width=width, judged=found).rstrip()


def _accuracies(outcomes: Sequence[Outcome]) -> list[float]:
    return [outcome.accuracy for outcome in outcomes]


def _titles(studies: Sequence[Study]) -> list[str]:
    """Return a unique name for each; the folder is added if recipe and points are ambiguous."""
    plain = [study.title for study in studies]
    return [
        title
        if plain.count(title) == 1
        else f"{title} ({printable(study.folder.name)}, {study.plan['split']})"
        for title, study in zip(plain, studies, strict=True)
    ]


def _rows(
    studies: Sequence[Study], titles: Sequence[str], baselines: dict[str, list[Outcome]]
) -> list[tuple[str, Sequence[float], str]]:
    rows: list[tuple[str, Sequence[float], str]] = []
    for title, study in zip(titles, studies, strict=True):
        done, planned = len(study.outcomes), len(study.plan["trainings"])
        remark = "" if done == planned else f"{done} of {planned} trained"
        rows.append((title, _accuracies(study.outcomes), remark))
    rows += [(name, _accuracies(outcomes), "") for name, outcomes in baselines.items()]
    # The paper's own are beside them if the split is the paper's.
    sizes = {study.plan["recipe"]["points"] for study in studies if study.plan["split"] == "folds"}
    for size, percent in TABLE_4.items():
        if size in sizes:
            rows.append((f"Table 4, {size} points", [value / 100 for value in percent], ""))
    return rows


def _about(study: Study) -> str:
    numbers = scores.summary(study.outcomes)
    return (
        f"split {study.plan['split']}, "
        f"{numbers['test_clouds']} answers about {numbers['test_recordings']} recordings, "
        f"{len(study.outcomes[0].history)} epochs, {numbers['seconds'] / 60:.1f} min"
    )


def _numbers(title: str, outcomes: Sequence[Outcome], n_classes: int) -> dict[str, Any]:
    content = {
        "title": title,
        "summary": scores.summary(outcomes),
        "scores": scores_of(found) if (found := together(outcomes)) else None,
        "confusion": scores.confusion(outcomes, n_classes).tolist(),
        "recordings": scores.recordings_of(outcomes, n_classes),
        "trainings": [_training(one) for one in outcomes],
    }
    if any(one.trained_on for one in outcomes):
        values, *tables = scores.transfer(outcomes)
        # JSON lacks NaN.
        mean, spread = (
            [[None if np.isnan(value) else value for value in row] for row in each.tolist()]
            for each in tables
        )
        content["transfer"] = {"values": values, "mean": mean, "spread": spread}
    return content


def _training(one: Outcome) -> dict[str, Any]:
    return {
        "name": one.name,
        "accuracy": one.accuracy,
        "test_clouds": len(one.truth),
        "test_recordings": len(set(one.recordings.tolist())),
        "seconds": one.seconds,
    }


def _write_csv(out: Path, groups: Sequence[Group]) -> None:
    what = ["classifier", "training"]
    head = [*what, "trained_on", "test_clouds", "test_recordings", "accuracy", "seconds"]
    trainings, history = [], []
    for title, outcomes in groups:
        for one in outcomes:
            name, accuracy, *counts, seconds = _training(one).values()
            numbers = f"{accuracy:.6f}", f"{seconds:.3f}"
            trainings.append([title, name, one.trained_on, *counts, *numbers])
            history += [
                [title, one.name, epoch, *(f"{row[name]:.6g}" for name in HISTORY)]
                for epoch, row in enumerate(one.history, start=1)
            ]
    (out / "trainings.csv").write_text(csv_text(head, trainings), encoding="utf-8")
    head = [*what, "epoch", *HISTORY]
    (out / "history.csv").write_text(csv_text(head, history), encoding="utf-8")


# -- pictures --------------------------------------------------------------------------------------


def draw_accuracies(path: Path, rows: Sequence[tuple[str, Sequence[float]]]) -> None:
    """Draw a box plot of the accuracies in each row: a box between quartiles, a dot each."""
    figure = new_figure(4.2, width_in=max(WIDTH_IN, 1.4 + 1.1 * len(rows)))
    axes = figure.subplots()
    percent = [100 * np.asarray(fractions) for _, fractions in rows]
    axes.boxplot(percent, widths=0.5, showfliers=False, medianprops={"color": LIGHT.cycle[1]})
    # Every training is a dot, spread sideways so that equal ones do not cover each other.
    for place, values in enumerate(percent, start=1):
        offsets = np.linspace(-0.12, 0.12, len(values)) if len(values) > 1 else np.zeros(1)
        axes.plot(place + offsets, values, ".", color=LIGHT.cycle[0], alpha=0.6)
    names = [name.replace(", ", "\n", 1) for name, _ in rows]
    axes.set_xticks(range(1, len(rows) + 1), names)
    axes.set(ylabel="Test accuracy [%]", xlabel="Classifier")
    axes.set_ylim(min(0.0, *map(min, percent)), 102)
    dress(axes, title="Test accuracy")
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
            # Curves are cut to the shortest training, over which a mean is known.
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
            # Dark cells have white text.
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
