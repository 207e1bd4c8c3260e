"""The page on data sets trains a PointNet from a `DataLoader` in at most twenty lines."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from rtradar.clouds import Sample
from rtradar.clouds.sample_files import write_index, write_sample

PAGE = Path(__file__).parents[2] / "docs" / "data-sets.md"


def write_collection(folder: Path) -> None:
    """Two activities that differ in how far velocity goes."""
    random = np.random.default_rng(0)
    for number in range(16):
        points = random.normal([0.8, 4, 0], [0.4, 0.2, 0.5 if number % 2 else 2.0], (300, 3))
        about = {"recording": f"r{number}", "subject": f"s{number % 4}"}
        about |= {"start_s": 0.0, "duration_s": 1.6}
        sample = Sample(points, "walk" if number % 2 else "kick", about)
        write_sample(folder, f"s{number:02}", sample, np.zeros((0, 3)))
    write_index(folder, [f"s{number:02}" for number in range(16)])


def test_a_pointnet_trains(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_collection(tmp_path)
    blocks = re.findall(r"^```python\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.M | re.S)
    train, split = (
        next(block for block in blocks if word in block) for word in ("nn.Linear", "Subset")
    )
    assert len([line for line in train.splitlines() if line.strip()]) <= 20
    assert "DataLoader(clouds, batch_size=8" in train
    names: dict[str, Any] = {}
    with torch.random.fork_rng():
        torch.manual_seed(0)
        exec(train.replace("out/first", str(tmp_path)).replace("range(20)", "range(10)"), names)
    said = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert float(said[-1][1]) < 0.3 < float(said[0][1])  # log(2) = 0.69 where nothing is known
    assert float(said[-1][2]) == 1.0
    exec(split.replace("out/first", str(tmp_path)), names)
    subjects = [
        {names["rt"].Collection(tmp_path).column("subject")[index] for index in part.indices}
        for part in (names["learn"], names["ask"])
    ]
    assert subjects[0].isdisjoint(subjects[1])
