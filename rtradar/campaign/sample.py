"""One sample: its recipe, its id and its making."""

from __future__ import annotations

import hashlib
import json
import time
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.clouds.dataset_store import FORMAT, Sample
from rtradar.errors import ValidityWarning
from rtradar.motion import Motion, cut, synthetic_motion
from rtradar.pipeline import clouds_of
from rtradar.radar import Radar
from rtradar.scene import Scene
from rtradar.system.files import open_regular
from rtradar.system.seeds import stream

SPATIAL_POINTS = 3000
"""Largest number of points of the spatial cloud, a uniform sample if there are more."""

_ID_DIGITS = 20  # 80 bits: two of a million samples share an id once in 2e12 collections
_SPATIAL_STREAM = 2  # differs from the random streams of noise and RDT cloud with the same seed


@dataclass(frozen=True)
class Recipe:
    """All that one sample follows from.

    Parameters
    ----------
    label : str
        The activity.
    parameters : mapping
        Plain JSON values, from which everything else follows; part of the provenance.
    radar : Radar
    scene : Scene
    motion : Motion, optional
        The recording; None: a synthetic actor, made anew from the parameters.
    """

    label: str
    parameters: Mapping[str, Any]
    radar: Radar
    scene: Scene
    motion: Motion | None = None

    @cached_property
    def identity(self) -> str:
        """Id of the sample: a hash of the label, the parameters and the format of the file."""
        content = {"format": FORMAT, "label": self.label, "parameters": self.parameters}
        text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()[:_ID_DIGITS]

    @property
    def kind(self) -> tuple[str, str, str]:
        """Radar, scene and fidelity, on which the cost depends most."""
        return self.parameters["radar"], self.parameters["scene"], self.parameters["fidelity"]

    @property
    def interval_s(self) -> float:
        """Length of the interval [s], to which the cost is in proportion."""
        return float(self.parameters["duration_s"])

    def packed(self) -> Recipe:
        """Return a copy whose motion is cut to the interval, small enough to send to a worker."""
        if self.motion is None:
            return self
        start_s = self.parameters["start_s"]
        # An interval to the end is rounded, and may be a little longer than what is there.
        return replace(
            self,
            motion=cut(
                self.motion, start_s, min(self.interval_s, self.motion.duration_s - start_s)
            ),
        )


class Made(NamedTuple):
    """Sample, spatial cloud (m, 3) [m] of the same capture, and time ``work_s`` without warm-up."""

    sample: Sample
    spatial: NDArray[np.float64]
    work_s: float


def make(recipe: Recipe) -> Made:
    """Make a sample of a `packed` recipe.

    Raises
    ------
    InputError
        Where the person cannot be where the recipe says, before that radar.
    """
    began = time.perf_counter()
    told = recipe.parameters
    if recipe.motion is None:
        # The whole take is made, because the path of a walk depends on its length.
        keys = ("height_m", "build", "tempo", "amplitude", "side", "take")
        actor = {key: told[key] for key in keys}
        motion = synthetic_motion(
            recipe.label, seed=told["subject_seed"], duration_s=told["take_s"], **actor
        )
        start_s = told["start_s"]
    else:
        motion, start_s = recipe.motion, 0.0
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ValidityWarning)
        clouds, warmup_s = clouds_of(
            motion,
            recipe.radar,
            recipe.scene,
            fidelity=told["fidelity"],
            start_s=start_s,
            duration_s=told["duration_s"],
            heading_deg=told["heading_deg"],
            snr_db=told["snr_db"],
            pfa=told["pfa"],
            seed=told["seed"],
            clutter_removal=told["clutter_removal"],
        )
    found = {
        "detections": clouds.rdt.n_voxels,
        "rdt_triangles": clouds.rdt.n_triangles,
        "xyz_points_found": clouds.n_spatial,
        "limits": sorted(
            {
                str(warning.message)
                for warning in caught
                if issubclass(warning.category, ValidityWarning)
            }
        ),
    }
    places = clouds.spatial.points
    if len(places) > SPATIAL_POINTS:
        random = np.random.default_rng(stream(told["seed"], _SPATIAL_STREAM))
        places = places[np.sort(random.choice(len(places), SPATIAL_POINTS, replace=False))]
    sample = Sample(clouds.rdt.points, recipe.label, {**told, **found})
    return Made(sample, places, time.perf_counter() - began - warmup_s)


def scene_digest(scene: Scene) -> str:
    """Hash of a scene, including the content of its mesh files."""

    def content(value: object) -> str:
        return digest([value]) if isinstance(value, Path) else str(value)

    return hashlib.sha256(
        json.dumps(asdict(scene), sort_keys=True, default=content).encode()
    ).hexdigest()[:_ID_DIGITS]


def digest(paths: list[Path]) -> str:
    """Hash of the content of files, one after the other."""
    found = hashlib.sha256()
    for path in paths:
        with open_regular(path) as file:
            found.update(hashlib.file_digest(file, "sha256").digest())
    return found.hexdigest()[:_ID_DIGITS]
