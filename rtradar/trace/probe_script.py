"""Runs one small kernel on one Mitsuba variant, in a process that `probe_backend` starts.

A libLLVM that does not suit Dr.Jit aborts the process that uses it, so this file is run, never
imported. It prints one line of JSON before the kernel (the version of the libLLVM that Dr.Jit took)
and one after it.
"""

import json
import sys
from typing import Any


def main(variant: str) -> None:
    """Intersect a triangle with rays and take a minimum, which LLVM 15 and 16 cannot compile."""
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
    works = True
    for x, right in ((0.25, 4), (2.0, 5)):
        ray = mi.Ray3f(mi.Point3f(x, 0.25, 4.0), mi.Vector3f(0, 0, -1))
        hit = scene.ray_intersect_preliminary(ray)
        nearest: Any = dr.slice(dr.minimum(hit.t, dr.opaque(mi.Float, 5.0)))
        # It may be some steps of float32 off: each processor guesses reciprocals in its own way.
        works = works and abs(float(nearest) - right) < 1e-6 * right
    print(json.dumps({"works": works}), flush=True)


if __name__ == "__main__":
    if sys.platform != "win32":
        import resource

        # An abort may come, and should leave no core file.
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    main(sys.argv[1])
