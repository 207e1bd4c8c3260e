"""The plan of a folder of trainings: what is trained there, of which clouds, and how they are split."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from rtradar.classify.recipes import Recipe
from rtradar.errors import InputError
from rtradar.system.files import atomic_file, read_json

PLAN = "plan.json"
_PLAN_KEYS = (
    "data",
    "clouds",
    "fingerprint",
    "classes",
    "recipe",
    "split",
    "folds",
    "seed",
    "trainings",
)
_MOST_NAMES = 10_000  # of classes, and of trainings


def check_plan(out: Path, plan: dict[str, Any]) -> None:
    """Raise where the folder holds another plan; where the data lie may change."""
    path = out / PLAN
    try:
        if not os.path.lexists(path):
            if found := sorted(out.glob("training-*")):
                raise InputError(
                    f"'{out}' holds '{found[0].name}', but no {PLAN} of rtradar; give another folder (--out)"
                )
            return
    except OSError as error:  # such as a name that is too long
        raise _unwritable(out, error) from None
    try:
        there = read_json(path)
        free = {"data"} | ({"made"} - there.keys())
        other = next(
            (name for name, value in plan.items() if name not in free and there.get(name) != value),
            None,
        )
    except (OSError, ValueError, AttributeError):
        raise InputError(f"'{path}' is damaged; give another folder (--out)") from None
    if other is not None:
        was, now = _difference(there.get(other), plan[other])
        raise InputError(
            f"'{out}' holds other trainings ({other}: {was}, not {now}); give another folder (--out)"
        )


def write_plan(out: Path, plan: dict[str, Any]) -> None:
    """Write it into the folder, which is made if it is not there."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(out, error) from None
    with atomic_file(out / PLAN) as file:
        file.write((json.dumps(plan, indent=1) + "\n").encode())


def read_plan(folder: Path) -> dict[str, Any]:
    """The plan of a folder; InputError where there is none, or a damaged one."""
    try:
        plan = read_json(folder / PLAN)
        Recipe(**plan["recipe"])
        for name in ("data", "classes", "trainings"):
            if (
                (name != "data" and not plan[name])
                or len(plan[name]) > _MOST_NAMES
                or not all(isinstance(one, str) for one in plan[name])
            ):
                raise ValueError
        return {name: plan[name] for name in _PLAN_KEYS} | {"made": plan.get("made")}
    except OSError as error:
        raise InputError(
            f"'{folder}' holds no trainings ({PLAN}: {error.strerror}); make them with: rtradar train"
        ) from None
    except (ValueError, KeyError, TypeError):
        raise InputError(f"'{folder / PLAN}' is damaged; train into another folder") from None


def _unwritable(out: Path, error: OSError) -> InputError:
    return InputError(
        f"cannot write to '{out}': {error.strerror}; give a folder that can be written (--out)"
    )


def _difference(was: Any, now: Any) -> tuple[Any, Any]:
    """What is not the same, of dictionaries only the first entry."""
    if isinstance(was, dict) and isinstance(now, dict):
        name = next(name for name in {**was, **now} if was.get(name) != now.get(name))
        return f"{name} {was.get(name)}", f"{now.get(name)}"
    return was, now
