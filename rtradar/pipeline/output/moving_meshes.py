"""Meshes that move, as `rtradar view` shows them: objects, and people whose body is a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.scene import Object

_CELL_M, _COARSER = 0.005, 1.2


def moving_meshes(
    body: Body, objects: Sequence[Object], times: NDArray[np.float64], most_faces: int
) -> dict[str, NDArray[Any]]:
    """Return the fields of `Snapshots` of the meshes of people and objects at times (time,) [s].

    Each mesh is thinned to ``most_faces``. Breath, which moves a chest by millimetres, is left out.
    """
    names = "faces", "of_vertex", "part", "vertex", "row", "weight"
    found: dict[str, list[NDArray[Any]]] = {name: [] for name in names}
    rows: list[NDArray[np.float64]] = [np.zeros((len(times), 0, 3))]
    sources: list[int] = []
    n_vertices = 0

    def add(source: int, faces: Any, part: Any, blend: Any, bones: Any) -> None:
        nonlocal n_vertices
        blend = blend.tocoo()
        found["faces"].append(faces + n_vertices)
        found["of_vertex"].append(np.full(len(part), len(sources)))
        found["part"].append(part)
        found["vertex"].append(blend.row + n_vertices)
        found["row"].append(blend.col + sum(one.shape[1] for one in rows))
        found["weight"].append(blend.data)
        rows.append(bones)
        sources.append(source)
        n_vertices += len(part)

    for number, person in enumerate(body.people):
        if (mesh := person.mesh) is not None:
            kept, faces = thinned_mesh(mesh.fit.vertices, mesh.faces(), most_faces)
            part = np.flatnonzero(body.owner == number)[mesh.weights()[kept].argmax(axis=1)]
            bones = mesh.bones(np.minimum(times, person.duration_s))
            add(number, faces, part, mesh.fit.skinning[kept], bones)
    from scipy.sparse import csr_matrix  # slow to import

    for number, one in enumerate(objects, start=len(body.people)):
        kept, faces = thinned_mesh(one.shape.vertices, one.shape.faces, most_faces)
        rotation, place = one.pose(times)
        blend = csr_matrix(np.concatenate([one.shape.vertices[kept], np.ones((len(kept), 1))], 1))
        bones = np.concatenate([np.swapaxes(rotation, 1, 2), place[:, None]], axis=1)
        add(number, faces, np.full(len(kept), -1), blend, bones)

    def joined(name: str, shape: tuple[int, ...] = (0,), kind: Any = np.int64) -> NDArray[Any]:
        return np.concatenate([np.zeros(shape), *found[name]]).astype(kind)

    return {
        "object_names": np.array([one.name for one in objects], dtype=np.str_),
        "mesh_source": np.array(sources, dtype=np.int64),
        "mesh_faces": joined("faces", (0, 3)),
        "mesh_of_vertex": joined("of_vertex"),
        "mesh_part": joined("part"),
        "mesh_rows": np.concatenate(rows, axis=1).astype(np.float32),
        "blend_vertex": joined("vertex"),
        "blend_row": joined("row"),
        "blend_weight": joined("weight", kind=np.float32),
    }


def thinned_mesh(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], most_faces: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return which vertices of a mesh to draw, and faces of these, ``most_faces`` or fewer.

    Vertices in one cell of a grid become one, the first; the cells grow until that is enough.
    """
    kept, cell_m = np.arange(len(vertices)), _CELL_M
    thinned = faces
    while len(thinned) > most_faces:
        cells = np.floor(vertices / cell_m).astype(np.int64)
        _, kept, number = np.unique(cells, axis=0, return_index=True, return_inverse=True)
        thinned = number.reshape(-1)[faces]
        thinned = thinned[(thinned != np.roll(thinned, 1, axis=1)).all(axis=1)]
        cell_m *= _COARSER
    return kept, thinned
