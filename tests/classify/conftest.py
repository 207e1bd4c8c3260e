"""Made-up clouds with the methods of a collection; classes differ in the course of velocity."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from rtradar.clouds.collection import Collection
from rtradar.clouds.sample_files import Sample, write_index, write_sample

LABELS = ("kick", "punch", "walk")


@pytest.fixture(scope="session", autouse=True)
def _one_thread() -> None:
    """Train in one thread: several wait for each other, awake, longer than these networks take."""
    torch.set_num_threads(1)


class MadeUpClouds(Collection):
    """Each motion is seen ``views`` times, by the models in turn; a recording shows one motion."""

    def __init__(
        self,
        *,
        per_class: int = 6,
        views: int = 1,
        n_points: int = 48,
        subjects: int = 3,
        seed: int = 0,
    ) -> None:
        self._n_points, self._seed = n_points, seed
        self.rows: list[dict[str, Any]] = [
            {
                "label": label, "recording": f"{label}-{motion}",
                "subject": f"subject-{motion % subjects}",
                "source": "recorded" if motion % 2 else "synthetic",
                "start_s": 0.5, "duration_s": 1.0, "scene": "free-space", "radar": "paper-12ghz",
                "fidelity": ("analytic", "specular")[view % 2], "snr_db": 20.0, "seed": view,
                "heading_deg": float((motion * 37) % 11),
                "person_position_m": [0.1 * motion, 0.0],
            }
            for label in LABELS
            for motion in range(per_class)
            for view in range(views)
        ]  # fmt: skip
        self._name = "made up"
        self._about = [{"label": row["label"], "provenance": row} for row in self.rows]

    folders: tuple[Path, ...] = ()

    def __len__(self) -> int:
        return len(self.rows)

    def points(self, index: int) -> NDArray[np.float64]:
        random = np.random.default_rng([self._seed, index])
        time = random.uniform(0.5, 1.5, self._n_points)
        turns = 1 + LABELS.index(self.rows[index]["label"])
        velocity = 2 * np.sin(2 * np.pi * turns * (time - 0.5))
        velocity += random.normal(0, 0.1, self._n_points)
        return np.stack([time, 4 + random.normal(0, 0.1, self._n_points), velocity], axis=1)

    def spatial(self, index: int) -> NDArray[np.float64]:
        return np.random.default_rng([self._seed, index, 1]).normal(size=(index % 4 * 5, 3))


@pytest.fixture(scope="session")
def made_up() -> Callable[..., MadeUpClouds]:
    return MadeUpClouds


@pytest.fixture(scope="session")
def collection(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The made-up clouds in a folder, as a data set leaves them."""
    folder, clouds = tmp_path_factory.mktemp("clouds"), MadeUpClouds(views=2)
    names = [f"{index:03d}" for index in range(len(clouds))]
    for index, (name, row) in enumerate(zip(names, clouds.rows, strict=True)):
        provenance = {key: value for key, value in row.items() if key != "label"}
        sample = Sample(clouds.points(index), row["label"], provenance)
        write_sample(folder, name, sample, clouds.spatial(index))
    write_index(folder, names)
    return folder
