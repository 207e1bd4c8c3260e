"""llvm against scalar, and cuda where it exists: the same rays on the same meshes of bodies.

Meshes are float32 triangles on all backends, so rays that graze an edge may differ. For every ray
that does, the edge is sought in float64 and in closed form on the same triangles: the outline of a
part is the convex hull of its vertices along the ray, and where two parts cross, the distances
along the ray to their planes differ by their slope times the distance to the crossing. The side of
a triangle is an edge as well: Embree tries neighbours one by one in float32, and a ray within some
nanometres of their common side may slip through.

On the CPU both backends use Embree and may well agree to the last bit, so each is also compared
with the same triangles intersected one by one in float64. Ellipsoids have no triangles: the first
part that a ray meets is judged by the closed form of the smooth ones.

    python validation/other_methods/backends.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.body.body import ellipsoid_meshes, unit_sphere
from rtradar.kernels.jit import compiled
from rtradar.system.threads import in_threads
from rtradar.trace.backend import available, select, use
from rtradar.trace.tracers import BodyTracer, MeshTracer
from rtradar.validate.rows import Row, judged, main, reported

Array = NDArray[np.float64]
MOST_DIFFERENT = 1e-4
NEAREST_EDGE_M = 10e-6
SUBDIVISIONS = 4
MOST_UNLIKE_SMOOTH = 1e-5  # float32 decides within a millionth of the radius from an outline


def scenes(quick: bool) -> dict[str, rt.Ellipsoids]:
    rng = np.random.default_rng(0)
    found = {}
    for kind in ("walk", "kick") if quick else ("walk", "kick", "punch", "jumping_jack"):
        actor = rt.Body.from_motion(rt.synthetic_motion(kind, seed=0))
        found[kind] = actor.ellipsoids(0.4 * actor.duration_s)
    parts = 40
    axes = np.exp(rng.uniform(np.log(0.01), np.log(0.3), (parts, 3)))
    centres = rng.uniform(-1, 1, (parts, 3)) + np.array([0.0, 0.0, 1.0])
    found["40 random ellipsoids, crossing"] = rt.Ellipsoids(
        centres, Rotation.random(parts, random_state=0).as_matrix(), axes
    )
    return found


def rays(body: rt.Ellipsoids, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Rays from around the radar, near and far, through the parts and beside their outlines."""
    origins = np.array([-4.0, 1.0, 1.0]) + rng.uniform(-0.3, 0.3, (n, 3))
    origins[: n // 5] -= [60.0, 0.0, 0.0]
    part = rng.integers(len(body.centres), size=n)
    local = rng.normal(size=(n, 3))
    local *= (rng.uniform(0.0, 1.3, n) / np.linalg.norm(local, axis=1))[:, None]
    targets = body.centres[part] + np.einsum(
        "nij,nj->ni", body.frames[part], local * body.semi_axes[part]
    )
    return origins, targets


def grazing(body: rt.Ellipsoids, n: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Rays from the radar within some 0.1 mm of a part's outline, where backends may differ."""
    origins = np.array([-4.0, 1.0, 1.0]) + rng.uniform(-0.3, 0.3, (n, 3))
    part = rng.integers(len(body.centres), size=n)
    axes = body.semi_axes[part]
    # In coordinates where the part is the unit sphere, the outline seen from o' is u.o' = 1.
    seen_from = np.einsum("nji,nj->ni", body.frames[part], origins - body.centres[part]) / axes
    distance = np.linalg.norm(seen_from, axis=1)
    pole = seen_from / distance[:, None]
    side = np.cross(pole, rng.normal(size=(n, 3)))
    side /= np.linalg.norm(side, axis=1)[:, None]
    circle = pole / distance[:, None] + np.sqrt(1 - 1 / distance**2)[:, None] * side
    circle *= 1 + rng.uniform(-1e-3, 1e-3, (n, 1))
    return origins, body.centres[part] + np.einsum("nij,nj->ni", body.frames[part], circle * axes)


class Hits(NamedTuple):
    """Part (ray,) met first, -1 for none, and distance (ray,) [m]."""

    part: NDArray[np.int64]
    distance: Array


def trace(kind: str, body: rt.Ellipsoids, origins: Array, targets: Array) -> Hits:
    """The first part of the body as a mesh."""
    vertices, faces = ellipsoid_meshes(body, SUBDIVISIONS)
    tracer = MeshTracer(use(select(kind)), vertices[:, faces].reshape(-1, 3, 3))
    ways = unit(targets - origins)
    face, distance = tracer.meets(origins, np.zeros_like(ways), ways, np.full(len(ways), -1))
    return Hits(face // len(faces), distance)


def trace_ellipsoids(
    kind: str, body: rt.Ellipsoids, origins: Array, targets: Array
) -> NDArray[np.int64]:
    """The first part of the body as ellipsoids."""
    tracer = BodyTracer(use(select(kind)), body.semi_axes)
    tracer.pose(body.centres, body.frames)
    ways = unit(targets - origins)
    return tracer.meets(origins, ways, ways, np.full(len(ways), -1))[0]


def unit(ways: Array) -> Array:
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


# -- the reference ---------------------------------------------------------------------------------


def first_of_smooth(body: rt.Ellipsoids, origins: Array, targets: Array) -> NDArray[np.int64]:
    """First part that each ray meets, of the smooth ellipsoids: |A^-1 (o + t d - c)| = 1."""
    directions = targets - origins
    best, part = np.full(len(origins), np.inf), np.full(len(origins), -1)
    for index, (centre, frame, axes) in enumerate(
        zip(body.centres, body.frames, body.semi_axes, strict=True)
    ):
        o, d = (origins - centre) @ frame / axes, directions @ frame / axes
        square, half, rest = (d * d).sum(1), (o * d).sum(1), (o * o).sum(1) - 1
        root = half * half - square * rest
        met = np.where(root >= 0, (-half - np.sqrt(np.maximum(root, 0))) / square, np.inf)
        met = np.where(met > 0, met, np.inf)
        part[met < best] = index
        best = np.minimum(best, met)
    return part


def first_of_triangles(body: rt.Ellipsoids, origins: Array, targets: Array) -> NDArray[np.int64]:
    """First part that each ray meets, by every triangle in float64 (Moeller and Trumbore, 1997)."""
    vertices, faces = unit_sphere(SUBDIVISIONS)
    part = np.empty(len(origins), dtype=np.int64)
    rays, parts = (origins, targets - origins), (body.centres, body.frames, body.semi_axes)
    in_threads(_first, len(origins), *rays, *parts, vertices, faces, part)
    return part


@compiled()
def _first(start, stop, origins, directions, centres, frames, semi_axes, vertices, faces, found):
    for ray in range(start, stop):
        best, found[ray] = np.inf, -1
        for part in range(len(centres)):
            # In the axes of the part, scaled to its unit sphere; fractions of the length stay.
            o = frames[part].T @ (origins[ray] - centres[part]) / semi_axes[part]
            d = frames[part].T @ directions[ray] / semi_axes[part]
            along = -(o @ d) / (d @ d)
            if (o + along * d) @ (o + along * d) > 1.01:
                continue
            for face in range(len(faces)):
                a, b, c = (
                    vertices[faces[face, 0]],
                    vertices[faces[face, 1]],
                    vertices[faces[face, 2]],
                )
                ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
                vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
                px, py, pz = d[1] * vz - d[2] * vy, d[2] * vx - d[0] * vz, d[0] * vy - d[1] * vx
                det = ux * px + uy * py + uz * pz
                if det == 0:
                    continue
                sx, sy, sz = o[0] - a[0], o[1] - a[1], o[2] - a[2]
                u = (sx * px + sy * py + sz * pz) / det
                if u < 0 or u > 1:
                    continue
                qx, qy, qz = sy * uz - sz * uy, sz * ux - sx * uz, sx * uy - sy * ux
                v = (d[0] * qx + d[1] * qy + d[2] * qz) / det
                if v < 0 or u + v > 1:
                    continue
                t = (vx * qx + vy * qy + vz * qz) / det
                if 0 < t < best:
                    best, found[ray] = t, part


class Triangles:
    """The triangles of a posed body in float64, and the distance of a ray from their edges."""

    def __init__(self, body: rt.Ellipsoids) -> None:
        self.vertices, self.faces = ellipsoid_meshes(body, SUBDIVISIONS)

    def outline(self, part: int, origin: Array, direction: Array) -> float:
        """Distance of the ray from the outline of a part, across it at the part's depth [m]."""
        away = self.vertices[part] - origin
        depth = away @ direction
        middle = float(depth.mean())
        east = np.cross(direction, np.eye(3)[np.argmin(np.abs(direction))])
        east /= np.linalg.norm(east)
        seen = (
            np.column_stack([away @ east, away @ np.cross(direction, east)])
            * (middle / depth)[:, None]
        )
        equations = ConvexHull(seen).equations
        # Inside, the nearest side counts. Outside, the farthest half-plane is a lower bound, which
        # is exact beside a side.
        return float(abs(equations[:, 2].max()))

    def plane(
        self, part: int, origin: Array, direction: Array
    ) -> tuple[float, Array, float] | None:
        """Where a ray first meets the part.

        Returns the distance along the ray, the slope of that distance when the ray is shifted
        (3,), and the distance from a side of the triangle, across the ray [m].
        """
        corners = self.vertices[part][self.faces]
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        normal = np.cross(b - a, c - a)
        facing = normal @ direction
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = np.einsum("ij,ij->i", normal, a - origin) / facing
        place = origin + distance[:, None] * direction
        inside = facing < 0
        for first, second in ((a, b), (b, c), (c, a)):
            inside &= (
                np.einsum("ij,ij->i", np.cross(second - first, place - first), normal) >= -1e-15
            )
        hit = np.flatnonzero(inside & (distance > 0))
        if len(hit) == 0:
            return None
        nearest = hit[np.argmin(distance[hit])]
        across = normal[nearest] - facing[nearest] * direction
        sides = []
        for first, second in ((a, b), (b, c), (c, a)):
            start, side = first[nearest] - place[nearest], second[nearest] - first[nearest]
            start, side = (
                start - (start @ direction) * direction,
                side - (side @ direction) * direction,
            )
            fraction = np.clip(-(start @ side) / (side @ side), 0, 1)
            sides.append(float(np.linalg.norm(start + fraction * side)))
        return float(distance[nearest]), -across / facing[nearest], min(sides)

    def clearance(self, first: int, second: int, origin: Array, direction: Array) -> float:
        """Shift of the ray that would change its answer from one part (or -1, none) to another."""
        named = [part for part in (first, second) if part >= 0]
        found = [self.outline(part, origin, direction) for part in named]
        planes = [
            plane for part in named if (plane := self.plane(part, origin, direction)) is not None
        ]
        found += [side for _, _, side in planes]
        if len(planes) == 2:
            (near, slope, _), (far, other, _) = planes
            found.append(abs(near - far) / max(float(np.linalg.norm(slope - other)), 1e-12))
        return min(found)


# -- rows ------------------------------------------------------------------------------------------


def measure(quick: bool) -> list[Row]:
    return list(compared(quick))


def compared(quick: bool) -> Iterator[Row]:
    kinds = available()
    if "llvm" not in kinds:
        yield judged("llvm against scalar", "llvm works here", "", 0.0, 0.0, reference=1.0)
        return
    rng = np.random.default_rng(1)
    bodies = scenes(quick)
    n = 2000 if quick else 25_000
    for aim, judge in ((rays, True), (grazing, False)):
        queries = {name: aim(body, n, rng) for name, body in bodies.items()}
        yield from compared_on(
            kinds, bodies, queries, "rays" if judge else "rays at outlines", judge
        )


def compared_on(
    kinds: tuple[str, ...],
    bodies: dict[str, rt.Ellipsoids],
    queries: dict[str, tuple[Array, Array]],
    what: str,
    judge: bool,
) -> Iterator[Row]:
    # One backend after the other, because scenes belong to their backend.
    answers = {
        kind: {name: trace(kind, body, *queries[name]) for name, body in bodies.items()}
        for kind in kinds
    }
    total = f"{sum(len(origins) for origins, _ in queries.values())} {what}"
    exact = {name: first_of_triangles(body, *queries[name]) for name, body in bodies.items()}
    for kind in kinds:
        parts = {name: hits.part for name, hits in answers[kind].items()}
        if kind != "scalar":
            claim, scalar = f"{kind} against scalar, {total}", answers["scalar"]
            yield from differences(
                claim,
                bodies,
                queries,
                parts,
                {name: hits.part for name, hits in scalar.items()},
                judge,
            )
            apart = [
                np.abs(hits.distance[same] - scalar[name].distance[same])
                for name, hits in answers[kind].items()
                for same in [(hits.part == scalar[name].part) & (hits.part >= 0)]
            ]
            yield reported(
                claim,
                "places met, largest difference",
                "m",
                float(np.concatenate(apart).max()),
            )
        yield from differences(
            f"{kind} against float64, {total}", bodies, queries, parts, exact, judge
        )
        smooth = [
            trace_ellipsoids(kind, body, *queries[name]) != first_of_smooth(body, *queries[name])
            for name, body in bodies.items()
        ]
        row = judged if judge else reported
        limit = (MOST_UNLIKE_SMOOTH,) if judge else ()
        yield row(
            f"ellipsoids on {kind} against float64, {total}",
            "fraction of rays that meet another part",
            "",
            float(np.mean(smooth)),
            *limit,
            says=f"ellipsoids on {kind} against float64: fraction of rays that meet another part",
        )


def differences(
    claim: str,
    bodies: dict[str, rt.Ellipsoids],
    queries: dict[str, tuple[Array, Array]],
    ours: dict[str, NDArray[np.int64]],
    others: dict[str, NDArray[np.int64]],
    judge: bool,
) -> Iterator[Row]:
    different, worst = 0, 0.0
    versus = claim.partition(",")[0]
    for name, body in bodies.items():
        triangles = Triangles(body)
        apart = np.flatnonzero(ours[name] != others[name])
        different += len(apart)
        for ray in apart:
            origin, target = (points[ray] for points in queries[name])
            direction = (target - origin) / np.linalg.norm(target - origin)
            worst = max(
                worst,
                triangles.clearance(
                    int(ours[name][ray]), int(others[name][ray]), origin, direction
                ),
            )
    fraction = different / sum(len(parts) for parts in ours.values())
    # The limits asked for are one ray in ten thousand, and those within 10 um of an edge; float32
    # resolves 0.1 um of a metre.
    quantity = "fraction of rays that meet another part"
    rays = sum(len(parts) for parts in ours.values())
    says = f"{versus}: fraction of rays that meet another part"
    if judge:
        yield judged(claim, quantity, "", fraction, MOST_DIFFERENT, says=says, cases=rays)
    else:
        yield reported(claim, quantity, "", fraction)
    says = f"{versus}: distance of those rays from an edge"
    yield judged(
        claim,
        f"farthest from an edge of these {different}",
        "m",
        worst,
        NEAREST_EDGE_M,
        says=says,
        cases=different,
    )


if __name__ == "__main__":
    sys.exit(main("The tracing backends against each other.", measure))
