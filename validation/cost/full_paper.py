"""How long `rtradar paper --full` takes: its parts, measured once, times how often each comes.

    python validation/cost/full_paper.py [--json FILE]

Measured are two clouds of each activity, in as many processes as there are cores, and one epoch of
each recipe and size of cloud, of random points, which take as long as those of people.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import torch

from rtradar.campaign import build_dataset
from rtradar.classify.recipes import LEAN, PAPER, Recipe
from rtradar.classify.training import Examples, pick_device, pick_precision, train_network
from rtradar.paper.learning import SIZES

SPEC = Path(__file__).resolve().parents[1] / "paper_400.toml"
CLOUDS, TRAINED, FOLDS, ALL_EPOCHS = 400, 360, 10, 200
MEASURED = 8
"""Clouds that are built: two of each activity."""


def clouds_s() -> float:
    """Time for all clouds of the data set [s]."""
    with tempfile.TemporaryDirectory() as folder:
        few, out = Path(folder, "few.toml"), Path(folder, "out")
        few.write_text(SPEC.read_text().replace("count = 100", f"count = {MEASURED // 4}"))
        build_dataset(few, out)  # starts processes and compiles, too: not counted
        few.write_text(few.read_text().replace("seed = 0", "seed = 1"))
        began = time.perf_counter()
        build_dataset(few, Path(folder, "again"))
        return (time.perf_counter() - began) * CLOUDS / MEASURED


def epoch_s(recipe: Recipe) -> float:
    """Time of one epoch of a fold, its test included [s]."""
    torch.manual_seed(0)
    points = torch.randn(CLOUDS, int(SIZES[-1]), 3)
    examples = Examples(points, torch.arange(CLOUDS) % 4, ("a", "b", "c", "d"))
    once = recipe.changed(epochs=1)
    given = examples[np.arange(TRAINED)], examples[np.arange(TRAINED, CLOUDS)], once
    _, history = train_network(*given, device=pick_device("auto"))
    return float(history[0]["seconds"])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, help="write the seconds there")
    options = parser.parse_args()
    found = {"400 clouds": clouds_s()}
    precision = pick_precision(pick_device("auto"))
    for recipe in (PAPER, LEAN):
        for size in SIZES:
            one = recipe.changed(points=int(size), precision=precision)
            each = epoch_s(one)
            name = f"{recipe.name}, {size} points, {FOLDS} folds of {one.epochs_run} epochs"
            found[name] = FOLDS * one.epochs_run * each
            print(f"{name}: {each:.1f} s an epoch", flush=True)
            if (recipe, size) == (PAPER, "1000"):
                found["the same of spatial clouds"] = found[name]
                found[f"two trainings of {ALL_EPOCHS} epochs"] = 2 * ALL_EPOCHS * each
    for name, seconds in found.items():
        print(f"{name:48}{seconds / 3600:8.2f} h")
    print(f"{'all':48}{sum(found.values()) / 3600:8.2f} h")
    if options.json is not None:
        options.json.write_text(json.dumps(found, indent=1) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
