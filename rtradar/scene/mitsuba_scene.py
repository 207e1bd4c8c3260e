"""The posed body as a Mitsuba scene.

Every part is an instance of one unit sphere of triangles, which its ``to_world`` moves, rotates and
stretches: a new pose costs 21 matrices and the small upper tree of the ray tracer, where new
vertices cost a full rebuild. Mitsuba's own ``sphere`` is not used, because it is silently wrong
under a stretch that is not uniform, nor its ``ellipsoids``, which cull back faces. Everywhere here
``mi`` is the module of Mitsuba with its variant set.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def _part_key(part: int) -> str:
    return f"part{part:04d}"


def triangle_mesh(mi: Any, vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> Any:
    """Make a Mitsuba mesh, of which only the hits of rays are used.

    The vertices (vertex, 3) should lie near the origin, because they are rounded to float32.
    """
    mesh = mi.Mesh(
        "triangles", len(vertices), len(faces), has_vertex_normals=False, has_vertex_texcoords=False
    )
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ravel(vertices).astype(np.float32)
    parameters["faces"] = np.ravel(faces).astype(np.uint32)
    parameters.update()
    return mesh


def build_body_scene(
    mi: Any, vertices: NDArray[np.float64], faces: NDArray[np.integer], n_parts: int
) -> Any:
    """Build a Mitsuba scene of ``n_parts`` instances of one closed triangle mesh, a unit sphere."""
    mesh = triangle_mesh(mi, vertices, faces)
    instance = {"type": "instance", "group": {"type": "ref", "id": "shapes"}}
    return mi.load_dict(
        {
            "type": "scene",
            "shapes": {"type": "shapegroup", "unit_sphere": mesh},
            **{_part_key(part): dict(instance) for part in range(n_parts)},
        }
    )


def pose_body_scene(mi: Any, parameters: Any, matrices: NDArray[np.float64]) -> None:
    """Move the instances of a scene that `build_body_scene` made, by its parameters.

    The ``matrices (part, 4, 4)`` transform the unit sphere to the scene.
    """
    for part, matrix in enumerate(matrices):
        parameters[f"{_part_key(part)}.to_world"] = mi.Transform4f(matrix)
    parameters.update()
