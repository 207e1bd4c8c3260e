"""Runs one small kernel on one Mitsuba variant; `rtradar.trace.backends.verdict` starts it in a process of its own.

A libLLVM that does not suit Dr.Jit aborts the process that uses it, so this file is run, never imported. It prints one
line of JSON before the kernel (the version of the libLLVM that Dr.Jit took), one after it, and one of how fast it is if asked.
"""

import json
import sys
import time
from typing import Any

RAYS = 4096
"""At once, where speed is asked for: as many as `specular` and `physical-optics` send; `fresnel` and `rays` send more."""

BANDS = 64
"""About the axis of a sphere, of which the rays meet some."""

REPEATS = 5


def main(variant: str, timed: bool) -> None:
    """Intersect a triangle with two rays and take a minimum, the instruction that LLVM 15 and 16 cannot select."""
    import drjit as dr
    import mitsuba as mi

    print(json.dumps({"llvm_version": list(dr.detail.llvm_version())}), flush=True)
    dr.set_thread_count(1)  # as for rtradar, unless rays are many
    mi.set_variant(variant)
    mesh = mi.Mesh("triangle", 3, 1)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = [0, 0, 0, 1, 0, 0, 0, 1, 0]
    parameters["faces"] = [0, 1, 2]
    parameters.update()
    scene = mi.load_dict({"type": "scene", "triangle": mesh})
    distances = []
    for x in (0.25, 2.0):
        hit = scene.ray_intersect_preliminary(
            mi.Ray3f(mi.Point3f(x, 0.25, 4.0), mi.Vector3f(0, 0, -1))
        )
        nearest: Any = dr.slice(dr.minimum(hit.t, dr.opaque(mi.Float, 5.0)))
        distances.append(float(nearest))
    # A hit may lie some steps of float32 off: reciprocals of rays are first guessed by the processor, each maker's its own way.
    works = all(
        abs(distance - right) < 1e-6 * right
        for distance, right in zip(distances, (4, 5), strict=True)
    )
    print(json.dumps({"works": works}), flush=True)
    if timed:
        print(json.dumps({"query_s": query_s(mi)}), flush=True)


def query_s(mi: Any) -> float:
    """Seconds until it is known which of `RAYS` rays meet a sphere of triangles, from arrays of NumPy to one of NumPy."""
    import numpy as np

    # Two poles apart, vertices in a grid of polar angle and azimuth: triangles need not be even for this.
    polar, azimuth = np.meshgrid(
        np.linspace(0, np.pi, BANDS + 1), np.linspace(0, 2 * np.pi, BANDS + 1), indexing="ij"
    )
    vertices = np.stack(
        [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)], axis=-1
    )
    corner = (np.arange(BANDS)[:, None] * (BANDS + 1) + np.arange(BANDS)).ravel()[:, None]
    right, below = corner + 1, corner + BANDS + 1
    faces = np.concatenate(
        [np.hstack([corner, below, right]), np.hstack([right, below, below + 1])]
    )
    mesh = mi.Mesh("sphere", len(vertices) ** 2, len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = vertices.ravel().astype(np.float32)
    parameters["faces"] = faces.ravel().astype(np.uint32)
    parameters.update()
    scene = mi.load_dict({"type": "scene", "sphere": mesh})
    # Half of them meet it.
    places = np.random.default_rng(0).uniform(-1.25, 1.25, (2, RAYS)).astype(np.float32)
    best = float("inf")
    for _ in range(REPEATS):
        began = time.perf_counter()
        met = ask(mi, scene, places)
        best = min(best, time.perf_counter() - began)
    radius = np.hypot(*places)
    if (
        met[radius > 1].any() or not met[radius < 0.99].all()
    ):  # its triangles lie less than 0.3 % inside of a sphere
        raise RuntimeError("rays meet what they must not meet")
    return best


def ask(mi: Any, scene: Any, places: Any) -> Any:
    """Whether rays downwards meet the scene: ``places (xy, ray)``, float32, to (ray,)."""
    import numpy as np

    down = mi.Vector3f(0, 0, -1)
    if mi.variant().startswith("scalar"):
        return np.array([scene.ray_test(mi.Ray3f(mi.Point3f(x, y, 4), down)) for x, y in places.T])
    starts = mi.Point3f(
        mi.Float(places[0]),
        mi.Float(places[1]),
        mi.Float(np.full(places.shape[1], 4, dtype=np.float32)),
    )
    return scene.ray_test(mi.Ray3f(starts, down)).numpy()


if __name__ == "__main__":
    if sys.platform != "win32":
        import resource

        resource.setrlimit(
            resource.RLIMIT_CORE, (0, 0)
        )  # an abort may come and should leave no core file
    main(sys.argv[1], "--timed" in sys.argv[2:])
