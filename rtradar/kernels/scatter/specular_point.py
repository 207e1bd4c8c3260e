"""Specular points of ellipsoids in the near field, by Newton's method from a starting point.

In the ellipsoid's own axes the specular point makes the path |T - p| + |R - p| over the surface
stationary (least, because the point faces both antennas). Newton's method on the tangent plane
finds it. The determinant of the matrix that the method needs,

    H = sum over T, R of (I - s s^T) / R + (s_T + s_R).n S,     S the shape operator,

also gives the return by stationary phase:

    |F| = 2 sqrt(pi) cos(i) / sqrt(det H),    divided by R1 R2 for the spreading of both legs.

The matrix holds the curvature of both wavefronts, so that the near field is exact to this order of
optics. Source: Born and Wolf, *Principles of Optics*, appendix III (stationary phase of double
integrals). Everything is float64.

In the far field the normal at the specular point is the bisector of both ways (`far_field`).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import cross, dot, minus, scaled, turned, turned_back
from rtradar.kernels.jit import compiled, inlined

Array = NDArray[np.float64]

_MAX_STEPS = 60
_STEP_TOLERANCE = 1e-7
"""Last step over the least semi-axis. It leaves 1e-7 in amplitude, nothing in length."""

_LANES, _LANE_STEPS = 8, 3
ROOT_PI = math.sqrt(math.pi)


class Geometry(NamedTuple):
    """Antennas and ellipsoids chirp by chirp, float64, world [m].

    ``tx (chirp, 3)``, ``rx (chirp, rx, 3)``, ``centres (chirp, part, 3)``, ``frames (chirp, part,
    3, 3)`` whose columns are the directions of the semi-axes, ``semi_axes (part, 3)``.
    """

    tx: Array
    rx: Array
    centres: Array
    frames: Array
    semi_axes: Array

    @classmethod
    def of(cls, at: Any) -> Geometry:
        """Return what has these fields as arrays that `solve` takes."""
        return cls(*(np.ascontiguousarray(getattr(at, name), np.float64) for name in cls._fields))


class Options(NamedTuple):
    """What an amplitude holds: the co-polar fraction (of v, or of h), and 1 / (R1 R2)."""

    horizontal: bool
    spreading: bool


class Plane(NamedTuple):
    """Unit normal and two tangents at a point; ee, ff and ef of the shape operator."""

    normal: tuple[float, float, float]
    e: tuple[float, float, float]
    f: tuple[float, float, float]
    curvature: tuple[float, float, float]


class Leg(NamedTuple):
    """Way from a point to an antenna: slopes along both tangents; ee, ff, ef of (I - s s^T) / R."""

    distance: float
    direction: tuple[float, float, float]
    slope: tuple[float, float]
    facing: float
    hessian: tuple[float, float, float]


class Step(NamedTuple):
    """Newton's step along both tangents, what it takes off the path, and det H."""

    e: float
    f: float
    drop: float
    determinant: float


@inlined(fastmath={"contract"})
def _tangent_plane(x, y, z, inverse_squares):
    """Tangent plane of an ellipsoid at a point, in its own axes."""
    ia, ib, ic = inverse_squares
    # The unit normal, along the gradient of x^2 / a^2 + y^2 / b^2 + z^2 / c^2.
    n0, n1, n2 = x * ia, y * ib, z * ic
    flat = 1 / math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    n0, n1, n2 = n0 * flat, n1 * flat, n2 * flat
    # Orthonormal tangents that never degenerate (Duff et al., 2017).
    sign = math.copysign(1.0, n2)
    u = -1 / (sign + n2)
    v = n0 * n1 * u
    e0, e1, e2 = 1 + sign * n0 * n0 * u, sign * v, -sign * n0
    f0, f1, f2 = v, sign + n1 * n1 * u, -n1
    # The shape operator is the Hessian of the same function over the length of its gradient.
    ia, ib, ic = ia * flat, ib * flat, ic * flat
    ee = e0 * e0 * ia + e1 * e1 * ib + e2 * e2 * ic
    ff = f0 * f0 * ia + f1 * f1 * ib + f2 * f2 * ic
    ef = e0 * f0 * ia + e1 * f1 * ib + e2 * f2 * ic
    return Plane((n0, n1, n2), (e0, e1, e2), (f0, f1, f2), (ee, ff, ef))


@inlined(fastmath={"contract"})
def leg(x, y, z, plane):
    """The leg along a vector from a point on the plane to an antenna."""
    distance = math.sqrt(x * x + y * y + z * z)
    near = 1 / distance
    direction = (x * near, y * near, z * near)
    # Slope and curvature of the distance along both tangents.
    e, f = dot(direction, plane.e), dot(direction, plane.f)
    hessian = ((1 - e * e) * near, (1 - f * f) * near, -e * f * near)
    return Leg(distance, direction, (e, f), dot(direction, plane.normal), hessian)


@inlined(fastmath={"contract"})
def newton(plane, out, back):
    """One step toward where both slopes cancel."""
    # Newton's matrix: the curvature of both waves, and that of the surface.
    facing, (ee, ff, ef) = out.facing + back.facing, plane.curvature
    h_ee = out.hessian[0] + back.hessian[0] + facing * ee
    h_ff = out.hessian[1] + back.hessian[1] + facing * ff
    h_ef = out.hessian[2] + back.hessian[2] + facing * ef
    determinant = h_ee * h_ff - h_ef * h_ef
    slope_e, slope_f = out.slope[0] + back.slope[0], out.slope[1] + back.slope[1]
    e = (h_ff * slope_e - h_ef * slope_f) / determinant
    f = (h_ee * slope_f - h_ef * slope_e) / determinant
    return Step(e, f, 0.5 * (slope_e * e + slope_f * f), determinant)


@inlined(fastmath={"contract"})
def look(x, y, z, tx, rx, inverse_squares):
    """Tangent plane, both legs and Newton's step at a point of the surface, all in its axes."""
    plane = _tangent_plane(x, y, z, inverse_squares)
    out = leg(tx[0] - x, tx[1] - y, tx[2] - z, plane)
    back = leg(rx[0] - x, rx[1] - y, rx[2] - z, plane)
    return plane, out, back, newton(plane, out, back)


@inlined(fastmath={"contract"})
def moved(x, y, z, plane, step, inverse_squares):
    """The point after a step, brought back to the surface."""
    x += step.e * plane.e[0] + step.f * plane.f[0]
    y += step.e * plane.e[1] + step.f * plane.f[1]
    z += step.e * plane.e[2] + step.f * plane.f[2]
    return on_surface(x, y, z, inverse_squares)


@inlined(fastmath={"contract"})
def on_surface(x, y, z, inverse_squares):
    """Bring a point to the surface, along the line from the centre."""
    ia, ib, ic = inverse_squares
    scale = 1 / math.sqrt(x * x * ia + y * y * ib + z * z * ic)
    return x * scale, y * scale, z * scale


@inlined(fastmath={"contract"})
def _copolar(t, r, n, up, horizontal):
    """Co-polar fraction of E_r = 2 (n.E) n - E_i; 1 for ``up`` of no length.

    Each polarisation is across its own line of sight.
    """
    p = cross(up, t) if horizontal else minus(up, scaled(t, dot(up, t)))
    s = cross(up, r) if horizontal else minus(up, scaled(r, dot(up, r)))
    size = math.sqrt(dot(p, p) * dot(s, s))
    return (dot(p, s) - 2 * dot(p, n) * dot(s, n)) / size if size > 1e-12 else 1.0


@inlined(fastmath={"contract"})
def _amplitude(plane, out, back, step, up, options):
    """Return by stationary phase."""
    copolar = _copolar(out.direction, back.direction, plane.normal, up, options.horizontal)
    facing, ranges = out.facing + back.facing, out.distance * back.distance
    # A ray that only grazes has no reflection of this order; the matrix is singular there, or
    # worse.
    there = facing > 0 and step.determinant > 0
    value = ROOT_PI * facing / math.sqrt(step.determinant) * copolar if there else 0.0
    return value / ranges if options.spreading else value


@inlined()
def _search(tx, rx, axes, up, options, start, out):
    """Find the specular point of one Tx, one Rx and one ellipsoid, all in the ellipsoid's axes.

    ``start`` is a first guess on the surface, or NaN for none; one that faces away is not used.
    ``out``: length, amplitude, and the point's x, y, z.
    """
    inverse_squares = (1 / axes[0] ** 2, 1 / axes[1] ** 2, 1 / axes[2] ** 2)
    ia, ib, ic = inverse_squares
    x, y, z = start[0], start[1], start[2]
    lit = min(
        x * ia * (tx[0] - x) + y * ib * (tx[1] - y) + z * ic * (tx[2] - z),
        x * ia * (rx[0] - x) + y * ib * (rx[1] - y) + z * ic * (rx[2] - z),
    )
    if not lit > 0:  # NaN too
        # Without a guess: in the axes where the ellipsoid is the unit sphere, the point below the
        # place where the line from Tx to Rx comes nearest. Both antennas see it, and so they see a
        # specular point; where the line goes through the body there is none.
        t0, t1, t2 = tx[0] / axes[0], tx[1] / axes[1], tx[2] / axes[2]
        r0, r1, r2 = rx[0] / axes[0] - t0, rx[1] / axes[1] - t1, rx[2] / axes[2] - t2
        span = r0 * r0 + r1 * r1 + r2 * r2
        along = min(1.0, max(0.0, -(t0 * r0 + t1 * r1 + t2 * r2) / span)) if span > 0 else 0.0
        x, y, z = t0 + along * r0, t1 + along * r1, t2 + along * r2
        inside = x * x + y * y + z * z <= 1
        x, y, z = x * axes[0], y * axes[1], z * axes[2]
        if inside:
            out[0] = math.sqrt((rx[0] - tx[0]) ** 2 + (rx[1] - tx[1]) ** 2 + (rx[2] - tx[2]) ** 2)
            out[1], out[2], out[3], out[4] = 0.0, x, y, z
            return
    x, y, z = on_surface(x, y, z, inverse_squares)
    old_x, old_y, old_z, best = x, y, z, math.inf
    tolerance = (_STEP_TOLERANCE * min(axes[0], min(axes[1], axes[2]))) ** 2
    for _ in range(_MAX_STEPS):
        plane, there, back, step = look(x, y, z, tx, rx, inverse_squares)
        length = there.distance + back.distance
        if length > best * (1 + 4e-16) or not there.facing + back.facing > 0:
            # The step went past the minimum (at a needle's tip seen from near) or round to the dark
            # side, where a flat body seen from near has a minimum too: take half of the step.
            x, y, z = 0.5 * (x + old_x), 0.5 * (y + old_y), 0.5 * (z + old_z)
            x, y, z = on_surface(x, y, z, inverse_squares)
        else:
            best = length
            if step.e * step.e + step.f * step.f < tolerance:
                break
            old_x, old_y, old_z = x, y, z
            x, y, z = moved(x, y, z, plane, step, inverse_squares)
    # The last step is not taken, but what it would take off the path is.
    out[0] = length - step.drop
    out[1] = _amplitude(plane, there, back, step, up, options)
    out[2], out[3], out[4] = x, y, z


@inlined(fastmath={"contract"})
def _in_lanes(tx, rx, axes, up, options, start, out):
    """Search for up to `_LANES` receivers ``rx (3, rx)`` side by side, from near all their points.

    ``out (6, rx)``: length, amplitude, the point's x, y, z, and a number that is positive where the
    search has settled on the side that both antennas see. In so few steps it may not have.
    """
    inverse_squares = (1 / axes[0] ** 2, 1 / axes[1] ** 2, 1 / axes[2] ** 2)
    tolerance = (_STEP_TOLERANCE * min(axes[0], min(axes[1], axes[2]))) ** 2
    source, above = (tx[0], tx[1], tx[2]), (up[0], up[1], up[2])
    # One array of a known size, because several could overlap for all that the compiler knows.
    lanes = np.empty((9, _LANES))
    # Lanes beyond the last receiver repeat it, so that loops have a constant length.
    for i in range(_LANES):
        receiver = min(i, rx.shape[1] - 1)
        for k in range(3):
            lanes[k, i], lanes[3 + k, i] = start[k], rx[k, receiver]
    # A fixed number of steps: no lane waits for another.
    for _ in range(_LANE_STEPS):
        for i in range(_LANES):
            x, y, z = lanes[0, i], lanes[1, i], lanes[2, i]
            antenna = (lanes[3, i], lanes[4, i], lanes[5, i])
            plane, _, _, step = look(x, y, z, source, antenna, inverse_squares)
            x, y, z = moved(x, y, z, plane, step, inverse_squares)
            lanes[0, i], lanes[1, i], lanes[2, i] = x, y, z
    # Length and amplitude at the points found, and whether each search has settled.
    for i in range(_LANES):
        x, y, z = lanes[0, i], lanes[1, i], lanes[2, i]
        antenna = (lanes[3, i], lanes[4, i], lanes[5, i])
        plane, there, back, step = look(x, y, z, source, antenna, inverse_squares)
        lanes[6, i] = there.distance + back.distance - step.drop
        lanes[7, i] = _amplitude(plane, there, back, step, above, options)
        settled = tolerance - (step.e * step.e + step.f * step.f)
        lanes[8, i] = min(min(min(there.facing, back.facing), step.determinant), settled)
    for i in range(rx.shape[1]):
        out[0, i], out[1, i], out[5, i] = lanes[6, i], lanes[7, i], lanes[8, i]
        out[2, i], out[3, i], out[4, i] = lanes[0, i], lanes[1, i], lanes[2, i]


@inlined()
def search_all(tx, rx, axes, up, options, guess, one, out):
    """Search for all receivers ``rx (3, rx)`` from one guess, or NaN; ``out`` as in `_in_lanes`."""
    receivers = rx.shape[1]
    if math.isnan(guess[0]):
        # Without a guess the first receiver is searched for alone; the others begin at its point.
        _search(tx, rx[:, 0], axes, up, options, guess, one)
        # Number by number: a slice takes seconds to compile, because of the text of an error.
        for i in range(3):
            guess[i] = one[2 + i]
    # All receivers start from that point, in lanes.
    for first in range(0, receivers, _LANES):
        some = slice(first, min(first + _LANES, receivers))
        _in_lanes(tx, rx[:, some], axes, up, options, guess, out[:, some])
    # Those that have not settled in so few steps are searched for one by one, with all precautions.
    for receiver in range(receivers):
        if not out[5, receiver] > 0:
            _search(tx, rx[:, receiver], axes, up, options, guess, one)
            for i in range(5):
                out[i, receiver] = one[i]
        # Neighbouring receivers have neighbouring specular points.
        guess[0], guess[1], guess[2] = out[2, receiver], out[3, receiver], out[4, receiver]


@compiled()
def solve(begin, end, at, above, start, options, length, amplitude, point):
    """Fill length, amplitude (chirp, rx, part) and, unless empty, point (chirp, rx, part, 3) [m].

    The chirps from ``begin`` to ``end`` of a `Geometry` are computed; the antennas' up is ``above
    (chirp, 3)``, 0 for amplitudes without regard to polarisation. The search starts at ``start
    (chirp, part, 3)`` in the ellipsoid's axes, NaN where nothing is known. `Options` say what
    amplitudes hold.
    """
    # Unpacked here: taking an array out of a tuple counts a reference, which takes time in loops.
    tx, rx, centres, frames, semi_axes = at
    receivers, parts = rx.shape[1], centres.shape[1]
    one, out, guess = np.empty(5), np.empty((6, receivers)), np.empty(3)
    local = np.empty((3, receivers))
    for chirp in range(begin, end):
        for part in range(parts):
            # Antennas, and their up, in the axes of the part.
            frame, centre = frames[chirp, part], centres[chirp, part]
            source = turned_back(frame, minus(tx[chirp], centre))
            up = turned_back(frame, above[chirp])
            for receiver in range(receivers):
                antenna = turned_back(frame, minus(rx[chirp, receiver], centre))
                local[0, receiver], local[1, receiver], local[2, receiver] = antenna
            for i in range(3):
                guess[i] = start[chirp, part, i]
            search_all(source, local, semi_axes[part], up, options, guess, one, out)
            for receiver in range(receivers):
                length[chirp, receiver, part] = out[0, receiver]
                amplitude[chirp, receiver, part] = out[1, receiver]
                if point.shape[0] > 0:
                    place = turned(frame, (out[2, receiver], out[3, receiver], out[4, receiver]))
                    for j in range(3):
                        point[chirp, receiver, part, j] = centre[j] + place[j]


_NO_BISECTOR = 1e-24
"""Square of the sum of two opposite unit vectors, as rounding leaves it."""


@compiled(fastmath={"contract"})
def far_field(start, stop, at, spreading, length, amplitude):
    """Fill length and amplitude (chirp, rx, part) [m] for a `specular_point.Geometry`.

    Chirps ``start`` to ``stop`` are filled.
    """
    tx, rx, centres, frames, semi_axes = at
    _, receivers, parts = length.shape
    for chirp in range(start, stop):
        # Receivers side by side: the vector to each of them in the axes of the part, then length
        # and amplitude. They are in one array of a known size, because several arrays could overlap
        # for all that the compiler knows.
        lanes = np.empty((5, _LANES))
        for part in range(parts):
            # The transmitter in the axes of the part.
            centre, frame = centres[chirp, part], frames[chirp, part]
            a, b, c = semi_axes[part, 0], semi_axes[part, 1], semi_axes[part, 2]
            t0, t1, t2 = turned_back(frame, minus(tx[chirp], centre))
            norm_tx = math.sqrt(t0 * t0 + t1 * t1 + t2 * t2)
            u0, u1, u2 = t0 / norm_tx, t1 / norm_tx, t2 / norm_tx
            root_volume = math.sqrt(math.pi) * a * b * c
            for first in range(0, receivers, _LANES):
                # The receivers in the axes of the part.
                count = min(_LANES, receivers - first)
                for k in range(_LANES):
                    receiver = first + min(k, count - 1)
                    away = turned_back(frame, minus(rx[chirp, receiver], centre))
                    for i in range(3):
                        lanes[i, k] = away[i]
                for k in range(_LANES):
                    # |A n| for the unit normal n is the support function h; the surface point with
                    # that normal is A^2 n / h.
                    r0, r1, r2 = lanes[0, k], lanes[1, k], lanes[2, k]
                    norm = math.sqrt(r0 * r0 + r1 * r1 + r2 * r2)
                    inverse = 1 / norm
                    # The bisector of both ways, as the centre sees them, is the normal; it is not
                    # of unit length.
                    n0, n1, n2 = u0 + r0 * inverse, u1 + r1 * inverse, u2 + r2 * inverse
                    squared = n0 * n0 + n1 * n1 + n2 * n2
                    support = a * a * n0 * n0 + b * b * n1 * n1 + c * c * n2 * n2
                    scale = 1 / math.sqrt(support)
                    s0, s1, s2 = a * a * n0 * scale, b * b * n1 * scale, c * c * n2 * scale
                    range_tx = math.sqrt(
                        (t0 - s0) * (t0 - s0) + (t1 - s1) * (t1 - s1) + (t2 - s2) * (t2 - s2)
                    )
                    range_rx = math.sqrt(
                        (r0 - s0) * (r0 - s0) + (r1 - s1) * (r1 - s1) + (r2 - s2) * (r2 - s2)
                    )
                    # Square root of the cross-section, pi (abc)^2 / h^4: that of
                    # `rtradar.rcs.ellipsoid` without its angles.
                    root = root_volume * squared * (scale * scale)
                    if spreading:
                        root /= range_tx * range_rx
                    # Straight through there is no bisector, and no reflection.
                    there = squared >= _NO_BISECTOR
                    lanes[3, k] = range_tx + range_rx if there else norm_tx + norm
                    lanes[4, k] = root if there else 0.0
                for k in range(count):
                    length[chirp, first + k, part] = lanes[3, k]
                    amplitude[chirp, first + k, part] = lanes[4, k]
