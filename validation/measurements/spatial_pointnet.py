"""PointNet with the paper's settings on spatial clouds, and on the RDT clouds of the same captures.

    python validation/measurements/spatial_pointnet.py OUT [--points 1000] [--fold 1 2]

The paper tried points x, y, z without Doppler, and had less than half of them right. Here both
kinds of clouds are of the 400 captures of ``paper_400.toml``, in the paper's ten folds. That takes
most of a day on two cores; a GPU is used where there is one, and ``--fold`` takes some of the
folds. Each cloud is scaled by one number, for x, y and z are alike; RDT clouds are scaled as
always. The script goes on where it was stopped. With ``--json`` it writes what
``rtradar/paper/stored.json`` has under ``spatial``, but for commit and date.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from rtradar.campaign import build_dataset
from rtradar.classify.recipes import PAPER
from rtradar.classify.study import train_study
from rtradar.classify.training import pick_device
from rtradar.clouds.collection import Collection
from rtradar.paper.training import SpatialClouds

SPEC = Path(__file__).resolve().parents[1] / "paper_400.toml"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path, metavar="OUT", help="folder for clouds and trainings")
    parser.add_argument("--points", type=int, default=1000, help="points of each cloud")
    parser.add_argument("--fold", type=int, nargs="+", help="only these folds, from 1")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the accuracies there")
    options = parser.parse_args()
    data = options.out / "clouds"
    build_dataset(SPEC, data)
    found = {
        "script": Path(__file__).name,
        "points": options.points,
        "clouds": len(Collection(data)),
    }
    kinds = {
        "spatial": (SpatialClouds, PAPER.changed(points=options.points, scaling="unit-sphere")),
        "rdt": (Collection, PAPER.changed(points=options.points)),
    }
    for kind, (read, recipe) in kinds.items():
        study = train_study(
            read(data), options.out / kind, recipe, only=options.fold, device=pick_device("auto")
        )
        percent = [100 * one.accuracy for one in study.outcomes]
        tested = sum(len(one.truth) for one in study.outcomes)
        print(f"{kind}: {np.mean(percent):.1f} % of {tested} clouds, folds {percent}", flush=True)
        found |= {kind: float(np.mean(percent)), "folds": len(percent), "answers": tested}
    if options.json:
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
