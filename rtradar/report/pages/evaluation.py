"""Evaluation of classifiers: its tables, pictures and numbers."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rtradar.classify import outcomes as scores
from rtradar.classify.outcomes import HISTORY, TABLE_4, Outcome
from rtradar.classify.study import Study
from rtradar.errors import InputError
from rtradar.report.figures import classifier as figures
from rtradar.system.checks import printable
from rtradar.system.files import atomic_file
from rtradar.system.output_folder import OutputFiles

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
    InputError if the studies have different classes, or the folder cannot be written.
    """
    classes = studies[0].plan["classes"]
    for study in studies:
        if study.plan["classes"] != classes:
            raise InputError(
                f"'{study.folder}' knows other activities than '{studies[0].folder}'; "
                "evaluate them one by one"
            )
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot write to '{out}': {error.strerror}; give a folder that can be written (--out)"
        ) from None
    titles = _titles(studies)
    named = list(zip(titles, studies, strict=True))
    groups: list[Group] = [(title, study.outcomes) for title, study in named]
    groups += baselines.items()
    blocks = [scores.accuracy_table(_rows(studies, titles, baselines))]
    for number, (title, study) in enumerate(named, start=1):
        counts = scores.confusion(study.outcomes, len(classes))
        recordings = scores.recordings_of(study.outcomes, len(classes))
        table = scores.confusion_table(counts, classes, recordings)
        blocks.append(f"{title}: {_about(study)}\n{table}")
        figures.draw_confusion(out / f"confusion-{number}.png", counts, classes, title)
        histories = [one.history for one in study.outcomes]
        figures.draw_learning(out / f"learning-{number}.png", histories, title)
        if any(one.trained_on for one in study.outcomes):
            transfer = scores.transfer(study.outcomes)
            blocks.append(scores.transfer_table(*transfer))
            figures.draw_transfer(out / f"transfer-{number}.png", *transfer, title)
    figures.draw_accuracies(
        out / "accuracy.png", [(title, _accuracies(all_of)) for title, all_of in groups]
    )
    text = "\n\n".join(blocks)
    content = {
        "classes": classes,
        "groups": [_numbers(title, outcomes, len(classes)) for title, outcomes in groups],
        "plans": [study.plan for study in studies],
    }
    _write(out / "table.txt", text + "\n")
    _write_csv(out, groups)
    content["files"] = EVALUATION_FILES.list_of(out)
    _write(out / "evaluation.json", json.dumps(content, indent=1) + "\n")
    return text, content


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
        "confusion": scores.confusion(outcomes, n_classes).tolist(),
        "recordings": scores.recordings_of(outcomes, n_classes),
        "trainings": [
            {
                "name": one.name,
                "accuracy": one.accuracy,
                "test_clouds": len(one.truth),
                "test_recordings": len(set(one.recordings.tolist())),
                "seconds": one.seconds,
            }
            for one in outcomes
        ],
    }
    if any(one.trained_on for one in outcomes):
        values, mean, spread = scores.transfer(outcomes)
        content["transfer"] = {
            "values": values,
            "mean": _plain(mean.tolist()),
            "spread": _plain(spread.tolist()),
        }
    return content


def _plain(rows: list[list[float]]) -> list[list[float | None]]:
    """Replace NaN, which JSON lacks, by None."""
    return [[value if value == value else None for value in row] for row in rows]


def _write_csv(out: Path, groups: Sequence[Group]) -> None:
    head = [
        "classifier",
        "training",
        "trained_on",
        "test_clouds",
        "test_recordings",
        "accuracy",
        "seconds",
    ]
    trainings, history = [], []
    for title, outcomes in groups:
        for one in outcomes:
            counts = len(one.truth), len(set(one.recordings.tolist()))
            numbers = f"{one.accuracy:.6f}", f"{one.seconds:.3f}"
            trainings.append([title, one.name, one.trained_on, *counts, *numbers])
            history += [
                [title, one.name, epoch, *(f"{row[name]:.6g}" for name in HISTORY)]
                for epoch, row in enumerate(one.history, start=1)
            ]
    _write(out / "trainings.csv", _csv(head, trainings))
    _write(out / "history.csv", _csv(["classifier", "training", "epoch", *HISTORY], history))


def _csv(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows([head, *rows])
    return text.getvalue()


def _write(path: Path, text: str) -> None:
    with atomic_file(path) as file:
        file.write(text.encode())
