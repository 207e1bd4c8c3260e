"""Three ways to ask Mitsuba which part of a posed body a ray meets: how right, and at what cost.

The unit sphere in the axes of each part that a ray comes near, as the package has it; instances of
Mitsuba's sphere, and of a sphere of triangles, in one scene that is posed anew. Right is what the
closed form of the ellipsoids says in float64. The cost is the processor time of a pose and its
rays, over that of the first way.

    python validation/cost/occluders.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body import unit_sphere
from rtradar.body.body import Poses
from rtradar.trace.backend import available, select, use
from rtradar.trace.rays import rays_of
from rtradar.trace.tracers import BodyTracer
from rtradar.validate.rows import Row, judged, main, reported

Array = NDArray[np.float64]
ANTENNA = np.array([-4.0, 1.0, 1.0])
SUBDIVISIONS = 4
MOST_WRONG = 1e-5


class Instances:
    """Instances of one shape, a dictionary of Mitsuba, posed as the parts of a body."""

    def __init__(self, mi: Any, shape: Any, parts: int) -> None:
        instance = {"type": "instance", "group": {"type": "ref", "id": "shapes"}}
        scene = {"type": "scene", "shapes": {"type": "shapegroup", "shape": shape}}
        self._mi = mi
        self._scene = mi.load_dict(scene | {f"part{n}": dict(instance) for n in range(parts)})
        self._parameters = mi.traverse(self._scene)

    def hits(self, poses: Poses, time_: int, targets: Array) -> NDArray[np.bool_]:
        mi, middle = self._mi, poses.centres[time_].mean(axis=0)
        matrices = np.tile(np.eye(4), (len(poses.semi_axes), 1, 1))
        matrices[:, :3, :3] = poses.frames[time_] * poses.semi_axes[:, None]
        matrices[:, :3, 3] = poses.centres[time_] - middle
        for part, matrix in enumerate(matrices):
            self._parameters[f"part{part}.to_world"] = mi.Transform4f(matrix)
        self._parameters.update()
        ways = targets - ANTENNA
        ways /= np.linalg.norm(ways, axis=1, keepdims=True)
        starts = np.broadcast_to(ANTENNA - middle, ways.shape)
        if mi.variant().startswith("scalar"):
            rays = (
                mi.Ray3f(mi.Point3f(*a), mi.Vector3f(*b)) for a, b in zip(starts, ways, strict=True)
            )
            return np.array([self._scene.ray_test(ray) for ray in rays])
        rows = np.concatenate([starts.T, ways.T]).astype(np.float32)
        return np.asarray(self._scene.ray_test(rays_of(mi, rows)).numpy())


def triangles(mi: Any) -> Any:
    vertices, faces = unit_sphere(SUBDIVISIONS)
    mesh = mi.Mesh("sphere", len(vertices), len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = vertices.ravel().astype(np.float32)
    parameters["faces"] = faces.ravel().astype(np.uint32)
    parameters.update()
    return mesh


def closed_form(poses: Poses, time_: int, targets: Array) -> NDArray[np.bool_]:
    """Whether the line from the antenna through each target, and beyond, meets any ellipsoid."""
    met = np.zeros(len(targets), dtype=bool)
    for centre, frame, axes in zip(
        poses.centres[time_], poses.frames[time_], poses.semi_axes, strict=True
    ):
        start, way = (ANTENNA - centre) @ frame / axes, (targets - ANTENNA) @ frame / axes
        along = -(way @ start) / (way * way).sum(axis=1)
        met |= ((start + along[:, None] * way) ** 2).sum(axis=1) < 1
    return met


def measure(quick: bool) -> list[Row]:
    return [row for kind in available() if kind != "cuda" for row in rows_of(kind, quick)]


def rows_of(kind: Any, quick: bool) -> Iterator[Row]:
    mi, rng = use(select(kind)), np.random.default_rng(0)
    body = rt.Body.from_motion(rt.synthetic_motion("walk", seed=0, duration_s=1.0))
    times = np.linspace(0.0, 1.0, 4 if quick else 40)
    poses, parts = body.at(times), len(body.semi_axes)
    count = 200 if kind == "scalar" else (20_000 if quick else 50_000)
    aims = poses.centres[:, rng.integers(parts, size=count)]
    aims = aims + rng.normal(0.0, 0.1, aims.shape)
    tracer, none = BodyTracer(mi, body.semi_axes), np.full(count, -1)

    def spheres(_: Poses, time_: int, targets: Array) -> NDArray[np.bool_]:
        tracer.pose(poses.centres[time_], poses.frames[time_])
        far = ANTENNA + 3 * (targets - ANTENNA)
        return ~tracer.sees(np.broadcast_to(ANTENNA, far.shape), far, none[: len(far)])

    ways: dict[str, Callable[[Poses, int, Array], NDArray[np.bool_]]] = {
        "the sphere in each part's axes": spheres,
        "instances of the sphere": Instances(mi, {"type": "sphere"}, parts).hits,
        "instances of triangles": Instances(mi, triangles(mi), parts).hits,
    }
    right = [closed_form(poses, number, own) for number, own in enumerate(aims)]
    for rays in (count, 200):
        seconds = {}
        for name, hits in ways.items():
            hits(poses, 0, aims[0, :rays])
            start = time.process_time()
            found = [hits(poses, number, own[:rays]) for number, own in enumerate(aims)]
            seconds[name] = time.process_time() - start
            claim = f"{kind}, {rays} rays a pose: {name}"
            if rays == count:
                wrong = float(np.mean([a != b[:rays] for a, b in zip(found, right, strict=True)]))
                if hits is spheres:
                    yield judged(
                        claim,
                        "fraction of rays that are wrong",
                        "",
                        wrong,
                        MOST_WRONG,
                        says=f"rays past a walker on {kind}: fraction that meet otherwise than in "
                        "float64",
                        cases=count * len(times),
                    )
                else:
                    yield reported(claim, "fraction of rays that are wrong", "", wrong)
            ratio = seconds[name] / seconds["the sphere in each part's axes"]
            yield reported(claim, "processor time over that of the first way", "", ratio)


if __name__ == "__main__":
    sys.exit(main("Ways to ask Mitsuba what a posed body hides.", measure))
