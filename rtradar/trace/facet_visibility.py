"""Ask Mitsuba, for every vertex of every part that faces an antenna, which other part stands before it.

Float32 decides visibility only. Vertices with no other part near their line of sight need no ray. Rays start where they
enter the ball round the body, from the antenna toward the vertex: so that what is met first is the part that hides, and
a vertex's own part, which a convex body's facing side never hides from, comes last and does not count.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rtradar.trace.body_tracer import BodyTracer

_NEAR = 0.01
"""Lines of sight that pass a part by more than this share of its semi-axes are not traced: no triangle stands out as far."""


@njit(cache=True, error_model="numpy")
def _may_hide(antenna, part, other, centres, reach):  # type: ignore[no-untyped-def]
    """Whether the ball round one part comes near any line from the antenna to the ball round another."""
    along, span, square = 0.0, 0.0, 0.0
    for i in range(3):
        way, start = centres[part, i] - antenna[i], antenna[i] - centres[other, i]
        along += way * start
        span += way * way
        square += start * start
    nearest = min(1.0, max(0.0, -along / span))
    return square + nearest * (2 * along + nearest * span) < (reach[part] + reach[other]) ** 2


@njit(cache=True, error_model="numpy")
def _world(point, centre, frame, out):  # type: ignore[no-untyped-def]
    for i in range(3):
        out[i] = centre[i] + frame[i, 0] * point[0] + frame[i, 1] * point[1] + frame[i, 2] * point[2]


@njit(cache=True, error_model="numpy", fastmath=True)
def _narrow(gap, x, y, z, start, turn, shift):  # type: ignore[no-untyped-def]
    """Lower ``gap`` below 0 where the way to a vertex comes near the unit ball that a hider is in its own axes."""
    s0, s1, s2 = start[0], start[1], start[2]
    square = s0 * s0 + s1 * s1 + s2 * s2
    for vertex in range(len(x)):
        w0 = turn[0, 0] * x[vertex] + turn[0, 1] * y[vertex] + turn[0, 2] * z[vertex] + (shift[0] - s0)
        w1 = turn[1, 0] * x[vertex] + turn[1, 1] * y[vertex] + turn[1, 2] * z[vertex] + (shift[1] - s1)
        w2 = turn[2, 0] * x[vertex] + turn[2, 1] * y[vertex] + turn[2, 2] * z[vertex] + (shift[2] - s2)
        span = w0 * w0 + w1 * w1 + w2 * w2
        back = -(s0 * w0 + s1 * w1 + s2 * w2)
        # Least square of the distance along the way, times its span: no division.
        least = square * span - back * back if back < span else (square - 2 * back + span) * span
        gap[vertex] = min(gap[vertex], least - (1 + _NEAR) ** 2 * span)


@njit(cache=True, error_model="numpy")
def _choose(antennas, parts, centres, frames, semi_axes, vertices, margin, wanted):  # type: ignore[no-untyped-def]
    """Mark the vertices that face an antenna and have another part near their line of sight; count them."""
    every = len(centres)
    counts = np.zeros((len(parts), len(antennas)), dtype=np.int64)
    reach = np.empty(every)
    for part in range(every):
        reach[part] = max(semi_axes[part, 0], max(semi_axes[part, 1], semi_axes[part, 2])) * (1 + _NEAR)
    for task in range(len(parts) * len(antennas)):
        n, a = task // len(antennas), task % len(antennas)
        part = parts[n]
        turn, shift, start = np.empty((every, 3, 3)), np.empty((every, 3)), np.empty((every, 3))
        found = 0
        for other in range(every):
            if other != part and _may_hide(antennas[a], part, other, centres, reach):
                # From the axes of this part to those of the other, in which it is the unit ball.
                for i in range(3):
                    shift[found, i], start[found, i] = 0.0, 0.0
                    for j in range(3):
                        shift[found, i] += frames[other, j, i] * (centres[part, j] - centres[other, j]) / semi_axes[other, i]
                        start[found, i] += frames[other, j, i] * (antennas[a, j] - centres[other, j]) / semi_axes[other, i]
                        turn[found, i, j] = 0.0
                        for k in range(3):
                            turn[found, i, j] += frames[other, k, i] * frames[part, k, j] / semi_axes[other, i]
                found += 1
        local = np.empty(3)
        for i in range(3):
            local[i] = 0.0
            for j in range(3):
                local[i] += frames[part, j, i] * (antennas[a, j] - centres[part, j])
        # Hider by hider and coordinate by coordinate: these loops run in vector lanes.
        x, y, z = vertices[part, :, 0].copy(), vertices[part, :, 1].copy(), vertices[part, :, 2].copy()
        gap = np.ones(len(x))
        for k in range(found):
            _narrow(gap, x, y, z, start[k], turn[k], shift[k])
        wanted[n, a] = False
        for vertex in range(len(x)):
            if gap[vertex] >= 0:
                continue
            along, normal, distance = 0.0, 0.0, 0.0
            for i in range(3):
                away, slope = local[i] - vertices[part, vertex, i], vertices[part, vertex, i] / semi_axes[part, i] ** 2
                along += slope * away
                normal += slope * slope
                distance += away * away
            if along >= 0 or along * along <= margin * margin * normal * distance:
                wanted[n, a, vertex] = True
                counts[n, a] += 1
    return counts


@njit(cache=True, error_model="numpy")
def _aim(antennas, parts, centres, frames, vertices, wanted, middle, ball, firsts, starts, ways, slot, reach):  # type: ignore[no-untyped-def]
    """Rays to the vertices that are wanted, from where they enter the ball; where each answer belongs."""
    for task in range(len(parts) * len(antennas)):
        n, a = task // len(antennas), task % len(antennas)
        part = parts[n]
        point = np.empty(3)
        ray = firsts[n, a]
        for vertex in range(vertices.shape[1]):
            if not wanted[n, a, vertex]:
                continue
            _world(vertices[part, vertex], centres[part], frames[part], point)
            distance, along, square = 0.0, 0.0, 0.0
            for i in range(3):
                way, start = point[i] - antennas[a, i], antennas[a, i] - middle[i]
                distance += way * way
                along -= start * way
                square += start * start
            distance = math.sqrt(distance)
            along /= distance
            ahead = max(along - math.sqrt(max(ball * ball - square + along * along, 0.0)), 0.0)
            for i in range(3):
                ways[i, ray] = (point[i] - antennas[a, i]) / distance
                starts[i, ray] = antennas[a, i] - middle[i] + ahead * (point[i] - antennas[a, i]) / distance
            reach[ray] = distance - ahead
            slot[ray] = (a * len(parts) + n) * vertices.shape[1] + vertex
            ray += 1


class FacetTracer(BodyTracer):
    """A body in a Mitsuba scene that tells which part hides which vertex; made and posed as a `BodyTracer` is."""

    _posed: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None

    def pose(self, centres: NDArray[np.float64], frames: NDArray[np.float64]) -> None:
        """Pose the body: ``centres (part, 3)`` [m], ``frames (part, 3, 3)``, world axes; nothing to do where it stands so."""
        if self._posed is not None and np.array_equal(centres, self._posed[0]) and np.array_equal(frames, self._posed[1]):
            return
        self._posed = (np.array(centres), np.array(frames))
        super().pose(centres, frames)

    def occluders(
        self, antennas: NDArray[np.float64], parts: NDArray[np.int64], vertices: NDArray[np.float64], margin: float
    ) -> NDArray[np.int16]:
        """Part that stands before each vertex, as each antenna sees it.

        Parameters
        ----------
        antennas : (antenna, 3) float64
            World [m].
        parts : (n,) int64
            Which parts are asked about; all parts may hide them.
        vertices : (part, vertex, 3) float64
            Of every part of the body, on its ellipsoid, in its own axes [m].
        margin : float
            Vertices that face away by more than this sine are not asked about.

        Returns
        -------
        (antenna, n, vertex) int16
            Part that is met first, where it is another and nearer than the vertex; else -1.
        """
        if self._posed is None:
            raise RuntimeError("FacetTracer: pose the body before asking what hides it")
        posed = (np.ascontiguousarray(antennas, dtype=np.float64), np.asarray(parts, dtype=np.int64), *self._posed)
        hidden = np.full((len(antennas), len(parts), vertices.shape[1]), -1, dtype=np.int16)
        wanted = np.empty((len(parts), len(antennas), vertices.shape[1]), dtype=np.bool_)
        counts = _choose(*posed, self._semi_axes, vertices, float(margin), wanted)
        rays = int(counts.sum())
        if rays == 0:
            # Dr.Jit takes the process down over arrays without entries.
            return hidden
        firsts = (np.cumsum(counts) - counts.ravel()).reshape(counts.shape)
        starts, ways = np.empty((3, rays), dtype=np.float32), np.empty((3, rays), dtype=np.float32)
        slot, reach = np.empty(rays, dtype=np.int64), np.empty(rays, dtype=np.float32)
        _aim(*posed, vertices, wanted, self._centre, self._ball, firsts, starts, ways, slot, reach)
        met, distance = self._first_parts(starts, ways)
        own = np.repeat(np.asarray(parts), counts.sum(axis=1))
        before = (met != own) & (met >= 0) & (distance < reach * np.float32(1 - 1e-6))
        hidden.ravel()[slot[before]] = met[before]
        return hidden

    def _first_parts(self, starts: NDArray[np.float32], ways: NDArray[np.float32]) -> tuple[Any, Any]:
        if self._scalar:
            part, distance, _, _ = self._trace_scalar(starts.T.astype(np.float64), ways.T.astype(np.float64))
            return part, distance
        import drjit as dr

        mi = self._mi
        found = self._scene.ray_intersect_preliminary(mi.Ray3f(mi.Point3f(starts), mi.Vector3f(ways)), coherent=True)
        instance = dr.reinterpret_array(mi.UInt32, found.instance)
        dr.eval(found.t, instance)
        distance = found.t.numpy()
        return np.where(np.isfinite(distance), self._part_of[instance.numpy()], -1), distance
