"""What an evaluation of classifiers leaves in its folder, and prints."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rtradar.classify.scores import (
    TABLE_4,
    accuracies,
    accuracy_table,
    confusion,
    confusion_table,
    recordings_of,
    summary,
    transfer,
    transfer_table,
)
from rtradar.classify.store import Outcome
from rtradar.classify.study import Study
from rtradar.errors import InputError
from rtradar.report.figures.classifier import (
    draw_accuracies,
    draw_confusion,
    draw_learning,
    draw_transfer,
)
from rtradar.system.checks import printable
from rtradar.system.files import atomic_file
from rtradar.system.output_folder import OutputFiles

Group = tuple[str, Sequence[Outcome]]

EVALUATION_FILES = OutputFiles(
    "evaluation.json",
    r"evaluation\.json|trainings\.csv|history\.csv|table\.txt|accuracy\.png|(confusion|learning|transfer)-[1-9]\d*\.png",
)
"""Those that an evaluation makes."""


def write_evaluation(
    studies: Sequence[Study], baselines: dict[str, list[Outcome]], out: Path
) -> tuple[str, dict[str, Any]]:
    """Tables, pictures and numbers of some studies of the same clouds, and of baselines.

    Parameters
    ----------
    studies : sequence of Study
        With the same classes.
    baselines : dict
        As of `rtradar.classify.baselines.judge_baselines`; may be empty.
    out : path
        Output folder, which is created if necessary, for ``evaluation.json``, ``trainings.csv``,
        ``history.csv``, ``table.txt`` and ``accuracy.png``, and for each study
        ``confusion-N.png``, ``learning-N.png`` and, for ``across``, ``transfer-N.png``.

    Returns
    -------
    table : str
        For the terminal.
    content : dict
        That of ``evaluation.json``.

    Raises
    ------
    InputError
        Where the studies know other classes, or the folder cannot be written.
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
    groups: list[Group] = [
        (title, study.outcomes) for title, study in zip(titles, studies, strict=True)
    ]
    groups += list(baselines.items())
    blocks = [accuracy_table(_rows(studies, titles, baselines))]
    for number, (title, study) in enumerate(zip(titles, studies, strict=True), start=1):
        counts = confusion(study.outcomes, len(classes))
        blocks.append(
            f"{title}: {_about(study)}\n"
            f"{confusion_table(counts, classes, recordings_of(study.outcomes, len(classes)))}"
        )
        draw_confusion(out / f"confusion-{number}.png", counts, classes, title)
        draw_learning(
            out / f"learning-{number}.png", [one.history for one in study.outcomes], title
        )
        if any(one.trained_on for one in study.outcomes):
            found = transfer(study.outcomes)
            blocks.append(transfer_table(*found))
            draw_transfer(out / f"transfer-{number}.png", *found, title)
    draw_accuracies(
        out / "accuracy.png",
        [(title, accuracies(outcomes).tolist()) for title, outcomes in groups],
        "Test accuracy",
    )
    table = "\n\n".join(blocks)
    content = {
        "classes": classes,
        "groups": [_numbers(title, outcomes, len(classes)) for title, outcomes in groups],
    }
    content["plans"] = [study.plan for study in studies]
    _write(out / "table.txt", table + "\n")
    _write_csv(out, groups)
    content["files"] = EVALUATION_FILES.list_of(out)
    _write(out / "evaluation.json", json.dumps(content, indent=1) + "\n")
    return table, content


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
        rows.append(
            (
                title,
                accuracies(study.outcomes).tolist(),
                "" if done == planned else f"{done} of {planned} trained",
            )
        )
    rows += [(name, accuracies(outcomes).tolist(), "") for name, outcomes in baselines.items()]
    # The paper's own beside them, where what it did was done.
    sizes = {study.plan["recipe"]["points"] for study in studies if study.plan["split"] == "folds"}
    rows += [
        (f"Table 4, {size} points", [share / 100 for share in TABLE_4[size]], "")
        for size in TABLE_4
        if size in sizes
    ]
    return rows


def _about(study: Study) -> str:
    said = summary(study.outcomes)
    return (
        f"split {study.plan['split']}, "
        f"{said['test_clouds']} answers about {said['test_recordings']} recordings, "
        f"{len(study.outcomes[0].history)} epochs, {said['seconds'] / 60:.1f} min"
    )


def _numbers(title: str, outcomes: Sequence[Outcome], n_classes: int) -> dict[str, Any]:
    trainings = [
        {
            "name": one.name,
            "accuracy": one.accuracy,
            "test_clouds": len(one.truth),
            "test_recordings": len(set(one.recordings.tolist())),
            "seconds": one.seconds,
        }
        for one in outcomes
    ]
    content = {
        "title": title,
        "summary": summary(outcomes),
        "confusion": confusion(outcomes, n_classes).tolist(),
        "recordings": recordings_of(outcomes, n_classes),
        "trainings": trainings,
    }
    if any(one.trained_on for one in outcomes):
        values, mean, spread = transfer(outcomes)
        content["transfer"] = {
            "values": values,
            "mean": _plain(mean.tolist()),
            "spread": _plain(spread.tolist()),
        }
    return content


def _plain(rows: list[list[float]]) -> list[list[float | None]]:
    """JSON has no NaN."""
    return [[value if value == value else None for value in row] for row in rows]


def _write_csv(out: Path, groups: Sequence[Group]) -> None:
    trainings = [
        [
            title,
            one.name,
            one.trained_on,
            len(one.truth),
            len(set(one.recordings.tolist())),
            f"{one.accuracy:.6f}",
            f"{one.seconds:.3f}",
        ]
        for title, outcomes in groups
        for one in outcomes
    ]
    head = [
        "classifier",
        "training",
        "trained_on",
        "test_clouds",
        "test_recordings",
        "accuracy",
        "seconds",
    ]
    _write(out / "trainings.csv", _csv(head, trainings))
    names = ["rate", "train_loss", "train_accuracy", "test_loss", "test_accuracy", "seconds"]
    history = [
        [title, one.name, epoch, *(f"{row[name]:.6g}" for name in names)]
        for title, outcomes in groups
        for one in outcomes
        for epoch, row in enumerate(one.history, start=1)
    ]
    _write(out / "history.csv", _csv(["classifier", "training", "epoch", *names], history))


def _csv(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    writer.writerows(rows)
    return text.getvalue()


def _write(path: Path, text: str) -> None:
    with atomic_file(path) as file:
        file.write(text.encode())
