"""Bistatic near-field geometric optics of an ellipsoid: where Tx sees Rx mirrored, how far, and how strongly.

Everything is float64. In the ellipsoid's own axes the specular point makes the path |T - p| + |R - p| over the surface
stationary (least, for it faces both). Newton's method on the tangent plane finds it, for the matrix it needs,

    H = sum over T, R of (I - s s^T) / R + (s_T + s_R).n S,     S the shape operator,

is the one whose determinant gives the return by stationary phase:

    |F| = 2 sqrt(pi) cos(i) / sqrt(det H),    divided by R1 R2 for the spreading of both legs.

The matrix holds the curvature of both wavefronts, so that the near field is exact to this order of optics. Source:
Born and Wolf, *Principles of Optics*, appendix III (stationary phase of double integrals).
"""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled, inlined
from rtradar.system.threads import in_threads

_MAX_STEPS = 60
# A last Newton step below this share of the smallest semi-axis leaves 1e-7 in amplitude and, squared, nothing in length.
_STEP_TOLERANCE = 1e-7
_LANES, _LANE_STEPS = 8, 3
ROOT_PI = math.sqrt(math.pi)


# Inlined, for only so do loops over it run in vector lanes.
@njit(error_model="numpy", fastmath={"contract"}, inline="always")
def _newton(x, y, z, tx0, tx1, tx2, rx0, rx1, rx2, inv_a, inv_b, inv_c):
    """One step toward the specular point, from a point on the surface, all in the ellipsoid's axes.

    Length of the path, what the step takes off it, the step and the square of its size; det H; unit vectors to Tx and Rx, the
    normal, and the product of both ranges.
    """
    t0, t1, t2, r0, r1, r2 = tx0 - x, tx1 - y, tx2 - z, rx0 - x, rx1 - y, rx2 - z
    range_t, range_r = (
        math.sqrt(t0 * t0 + t1 * t1 + t2 * t2),
        math.sqrt(r0 * r0 + r1 * r1 + r2 * r2),
    )
    near_t, near_r = 1 / range_t, 1 / range_r
    t0, t1, t2, r0, r1, r2 = (
        t0 * near_t,
        t1 * near_t,
        t2 * near_t,
        r0 * near_r,
        r1 * near_r,
        r2 * near_r,
    )
    n0, n1, n2 = x * inv_a, y * inv_b, z * inv_c
    flat = 1 / math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    n0, n1, n2 = n0 * flat, n1 * flat, n2 * flat
    # Orthonormal tangents e, f that never degenerate (Duff et al., 2017).
    sign = math.copysign(1.0, n2)
    u = -1 / (sign + n2)
    v = n0 * n1 * u
    e0, e1, e2 = 1 + sign * n0 * n0 * u, sign * v, -sign * n0
    f0, f1, f2 = v, sign + n1 * n1 * u, -n1
    bend = ((t0 + r0) * n0 + (t1 + r1) * n1 + (t2 + r2) * n2) * flat
    te, tf = t0 * e0 + t1 * e1 + t2 * e2, t0 * f0 + t1 * f1 + t2 * f2
    re, rf = r0 * e0 + r1 * e1 + r2 * e2, r0 * f0 + r1 * f1 + r2 * f2
    h_ee = (
        (1 - te * te) * near_t
        + (1 - re * re) * near_r
        + bend * (e0 * e0 * inv_a + e1 * e1 * inv_b + e2 * e2 * inv_c)
    )
    h_ff = (
        (1 - tf * tf) * near_t
        + (1 - rf * rf) * near_r
        + bend * (f0 * f0 * inv_a + f1 * f1 * inv_b + f2 * f2 * inv_c)
    )
    h_ef = (
        -te * tf * near_t
        - re * rf * near_r
        + bend * (e0 * f0 * inv_a + e1 * f1 * inv_b + e2 * f2 * inv_c)
    )
    determinant = h_ee * h_ff - h_ef * h_ef
    slope_e, slope_f = te + re, tf + rf
    step_e = (h_ff * slope_e - h_ef * slope_f) / determinant
    step_f = (h_ee * slope_f - h_ef * slope_e) / determinant
    d0, d1, d2 = step_e * e0 + step_f * f0, step_e * e1 + step_f * f1, step_e * e2 + step_f * f2
    drop, size = 0.5 * (slope_e * step_e + slope_f * step_f), step_e * step_e + step_f * step_f
    return (
        range_t + range_r,
        drop,
        d0,
        d1,
        d2,
        size,
        determinant,
        t0,
        t1,
        t2,
        r0,
        r1,
        r2,
        n0,
        n1,
        n2,
        range_t * range_r,
    )


@njit(error_model="numpy", fastmath={"contract"}, inline="always")
def _return(determinant, t0, t1, t2, r0, r1, r2, n0, n1, n2, up0, up1, up2, horizontal):
    """Co-polar return: the field is E_r = 2 (n.E) n - E_i, each polarisation drawn across its own line of sight."""
    along_t, along_r = up0 * t0 + up1 * t1 + up2 * t2, up0 * r0 + up1 * r1 + up2 * r2
    p0 = up1 * t2 - up2 * t1 if horizontal else up0 - along_t * t0
    p1 = up2 * t0 - up0 * t2 if horizontal else up1 - along_t * t1
    p2 = up0 * t1 - up1 * t0 if horizontal else up2 - along_t * t2
    s0 = up1 * r2 - up2 * r1 if horizontal else up0 - along_r * r0
    s1 = up2 * r0 - up0 * r2 if horizontal else up1 - along_r * r1
    s2 = up0 * r1 - up1 * r0 if horizontal else up2 - along_r * r2
    size = math.sqrt((p0 * p0 + p1 * p1 + p2 * p2) * (s0 * s0 + s1 * s1 + s2 * s2))
    share = (
        p0 * s0
        + p1 * s1
        + p2 * s2
        - 2 * (p0 * n0 + p1 * n1 + p2 * n2) * (s0 * n0 + s1 * n1 + s2 * n2)
    )
    polarization = share / size if size > 1e-12 else 1.0
    facing = (t0 + r0) * n0 + (t1 + r1) * n1 + (t2 + r2) * n2
    # A ray that only grazes has no reflection of this order; the matrix is singular there, or worse.
    there = facing > 0 and determinant > 0
    return ROOT_PI * facing / math.sqrt(determinant) * polarization if there else 0.0


@inlined()
def _solve(tx, rx, axes, up, horizontal, spreading, start, out):
    """Specular point of one Tx, one Rx and one ellipsoid, all in the ellipsoid's axes.

    ``start`` is a first guess on the surface, or NaN for none; one that faces away is not used. ``out``: length, amplitude,
    and the point's x, y, z.
    """
    inv_a, inv_b, inv_c = 1 / axes[0] ** 2, 1 / axes[1] ** 2, 1 / axes[2] ** 2
    x, y, z = start[0], start[1], start[2]
    lit = min(
        x * inv_a * (tx[0] - x) + y * inv_b * (tx[1] - y) + z * inv_c * (tx[2] - z),
        x * inv_a * (rx[0] - x) + y * inv_b * (rx[1] - y) + z * inv_c * (rx[2] - z),
    )
    if not lit > 0:  # NaN too
        # From cold: stretched to the unit sphere, the point below where the line from Tx to Rx comes nearest. Both see it,
        # and so they see a specular point; where the line goes through the body there is none.
        t0, t1, t2 = tx[0] / axes[0], tx[1] / axes[1], tx[2] / axes[2]
        r0, r1, r2 = rx[0] / axes[0] - t0, rx[1] / axes[1] - t1, rx[2] / axes[2] - t2
        span = r0 * r0 + r1 * r1 + r2 * r2
        share = min(1.0, max(0.0, -(t0 * r0 + t1 * r1 + t2 * r2) / span)) if span > 0 else 0.0
        x, y, z = t0 + share * r0, t1 + share * r1, t2 + share * r2
        if x * x + y * y + z * z <= 1:
            out[0] = math.sqrt((rx[0] - tx[0]) ** 2 + (rx[1] - tx[1]) ** 2 + (rx[2] - tx[2]) ** 2)
            out[1] = 0.0
            out[2], out[3], out[4] = x * axes[0], y * axes[1], z * axes[2]
            return
        x, y, z = x * axes[0], y * axes[1], z * axes[2]
    scale = 1 / math.sqrt(x * x * inv_a + y * y * inv_b + z * z * inv_c)
    x, y, z = x * scale, y * scale, z * scale
    old_x, old_y, old_z, best = x, y, z, math.inf
    tolerance = (_STEP_TOLERANCE * min(axes[0], min(axes[1], axes[2]))) ** 2
    for _ in range(_MAX_STEPS):
        length, drop, d0, d1, d2, size, determinant, t0, t1, t2, r0, r1, r2, n0, n1, n2, ranges = (
            _newton(x, y, z, tx[0], tx[1], tx[2], rx[0], rx[1], rx[2], inv_a, inv_b, inv_c)
        )
        if length > best * (1 + 4e-16) or not (t0 + r0) * n0 + (t1 + r1) * n1 + (t2 + r2) * n2 > 0:
            # The step went past the minimum (a needle's tip seen from near) or round to the dark side, where a flat body
            # seen from near has a minimum too: half of it does not.
            x, y, z = 0.5 * (x + old_x), 0.5 * (y + old_y), 0.5 * (z + old_z)
        else:
            best = length
            if size < tolerance:
                break
            old_x, old_y, old_z = x, y, z
            x, y, z = x + d0, y + d1, z + d2
        scale = 1 / math.sqrt(x * x * inv_a + y * y * inv_b + z * z * inv_c)
        x, y, z = x * scale, y * scale, z * scale
    out[0] = length - drop
    out[1] = _return(
        determinant, t0, t1, t2, r0, r1, r2, n0, n1, n2, up[0], up[1], up[2], horizontal
    )
    if spreading:
        out[1] /= ranges
    out[2], out[3], out[4] = x, y, z


@inlined(fastmath={"contract"})
def _in_lanes(tx, rx, axes, up, horizontal, spreading, start, out):
    """The same for up to `_LANES` receivers ``rx (3, rx)`` side by side, from a ``start`` near all of their specular points.

    ``out (6, rx)``: length, amplitude, the point's x, y, z, and a number that is positive where the search has settled on the
    side that both antennas see. It takes so few steps that it may not have.
    """
    inv_a, inv_b, inv_c = 1 / axes[0] ** 2, 1 / axes[1] ** 2, 1 / axes[2] ** 2
    tolerance = (_STEP_TOLERANCE * min(axes[0], min(axes[1], axes[2]))) ** 2
    t0, t1, t2, up0, up1, up2 = tx[0], tx[1], tx[2], up[0], up[1], up[2]
    # In one array of a size that is known beforehand: of many the compiler would have to fear that they overlap.
    lanes = np.empty((9, _LANES))
    for i in range(_LANES):
        receiver = min(i, rx.shape[1] - 1)
        for k in range(3):
            lanes[k, i], lanes[3 + k, i] = start[k], rx[k, receiver]
    for _ in range(_LANE_STEPS):
        for i in range(_LANES):
            x, y, z = lanes[0, i], lanes[1, i], lanes[2, i]
            _, _, d0, d1, d2, _, _, _, _, _, _, _, _, _, _, _, _ = _newton(
                x, y, z, t0, t1, t2, lanes[3, i], lanes[4, i], lanes[5, i], inv_a, inv_b, inv_c
            )
            x, y, z = x + d0, y + d1, z + d2
            scale = 1 / math.sqrt(x * x * inv_a + y * y * inv_b + z * z * inv_c)
            lanes[0, i], lanes[1, i], lanes[2, i] = x * scale, y * scale, z * scale
    for i in range(_LANES):
        length, drop, _, _, _, size, determinant, s0, s1, s2, r0, r1, r2, n0, n1, n2, ranges = (
            _newton(
                lanes[0, i],
                lanes[1, i],
                lanes[2, i],
                t0,
                t1,
                t2,
                lanes[3, i],
                lanes[4, i],
                lanes[5, i],
                inv_a,
                inv_b,
                inv_c,
            )
        )
        lanes[6, i] = length - drop
        returned = _return(
            determinant, s0, s1, s2, r0, r1, r2, n0, n1, n2, up0, up1, up2, horizontal
        )
        lanes[7, i] = returned / ranges if spreading else returned
        lit = min(s0 * n0 + s1 * n1 + s2 * n2, r0 * n0 + r1 * n1 + r2 * n2)
        lanes[8, i] = min(min(lit, determinant), tolerance - size)
    for i in range(rx.shape[1]):
        out[0, i], out[1, i], out[5, i] = lanes[6, i], lanes[7, i], lanes[8, i]
        out[2, i], out[3, i], out[4, i] = lanes[0, i], lanes[1, i], lanes[2, i]


@compiled()
def _mirror(
    begin,
    end,
    tx,
    rx,
    centres,
    frames,
    semi_axes,
    start,
    horizontal,
    spreading,
    length,
    amplitude,
    point,
):
    """Fill length, amplitude and, unless empty, point for the chirps from begin to end."""
    receivers, parts = rx.shape[1], centres.shape[1]
    one, out, guess = np.empty(5), np.empty((6, receivers)), np.empty(3)
    local_t, local_r, up = np.empty(3), np.empty((3, receivers)), np.empty(3)
    for chirp in range(begin, end):
        for part in range(parts):
            frame, centre, axes = frames[chirp, part], centres[chirp, part], semi_axes[part]
            for i in range(3):
                local_t[i] = 0.0
                local_r[i] = 0.0
                for j in range(3):
                    local_t[i] += frame[j, i] * (tx[chirp, j] - centre[j])
                    for receiver in range(receivers):
                        local_r[i, receiver] += frame[j, i] * (rx[chirp, receiver, j] - centre[j])
                up[i] = frame[2, i]
                guess[i] = start[chirp, part, i]
            if math.isnan(guess[0]):
                # From cold: the others begin where the first has it.
                _solve(local_t, local_r[:, 0], axes, up, horizontal, spreading, guess, one)
                # One by one: to assign a slice brings seconds of compiling, for the text of an error it could raise.
                for i in range(3):
                    guess[i] = one[2 + i]
            for first in range(0, receivers, _LANES):
                some = slice(first, min(first + _LANES, receivers))
                _in_lanes(
                    local_t, local_r[:, some], axes, up, horizontal, spreading, guess, out[:, some]
                )
            for receiver in range(receivers):
                if not out[5, receiver] > 0:
                    _solve(
                        local_t, local_r[:, receiver], axes, up, horizontal, spreading, guess, one
                    )
                    for i in range(5):
                        out[i, receiver] = one[i]
                length[chirp, receiver, part], amplitude[chirp, receiver, part] = (
                    out[0, receiver],
                    out[1, receiver],
                )
                # Neighbouring receivers have neighbouring specular points.
                guess[0], guess[1], guess[2] = out[2, receiver], out[3, receiver], out[4, receiver]
                if point.shape[0] > 0:
                    for j in range(3):
                        point[chirp, receiver, part, j] = (
                            centre[j]
                            + frame[j, 0] * guess[0]
                            + frame[j, 1] * guess[1]
                            + frame[j, 2] * guess[2]
                        )


_CHIRPS_A_THREAD = 64
"""For fewer, waking threads costs more than the work, all the more while Mitsuba's own are awake."""


def mirror(
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    centres: NDArray[np.float64],
    frames: NDArray[np.float64],
    semi_axes: NDArray[np.float64],
    *,
    start: NDArray[np.float64] | None = None,
    polarization: Literal["v", "h"] = "v",
    spreading: bool = True,
    points: bool = False,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Path length, specular amplitude and specular point of every ellipsoid, as if each stood alone.

    Parameters
    ----------
    tx : (chirp, 3) float64
        [m].
    rx : (chirp, rx, 3) float64
        [m].
    centres, frames : (chirp, part, 3), (chirp, part, 3, 3) float64
        Poses; columns of a frame are the directions of the semi-axes.
    semi_axes : (part, 3) float64
        [m].
    start : (chirp, part, 3) float64, optional
        Where to begin the search, in the ellipsoid's axes; NaN where nothing is known.
    polarization : {"v", "h"}
        Co-polar, v along world z.
    spreading : bool
        Whether the amplitude is divided by R1 R2, normalised to 1 m.
    points : bool
        Whether specular points are wanted; they are many.

    Returns
    -------
    length : (chirp, rx, part) float64
        |T - p| + |R - p| [m].
    amplitude : (chirp, rx, part) float64
        Scattering length, over R1 R2 with ``spreading`` [m].
    point : (chirp, rx, part, 3) float64
        World [m]; empty unless ``points``.

    Notes
    -----
    Equations :eq:`specular-point`, :eq:`mirror-matrix` and :eq:`mirror-return` of the theory page, times :eq:`polarization`.
    """
    tx, rx, centres, frames, semi_axes = (
        np.ascontiguousarray(a, dtype=np.float64) for a in (tx, rx, centres, frames, semi_axes)
    )
    shape = (*rx.shape[:2], centres.shape[1])
    length, amplitude = np.empty(shape), np.empty(shape)
    point = np.empty((*shape, 3)) if points else np.empty((0, 0, 0, 0))
    if start is None:
        start = np.full(centres.shape, np.nan)
    start = np.ascontiguousarray(start, dtype=np.float64)
    horizontal = polarization == "h"

    def solve(begin: int) -> None:
        end = min(begin + _CHIRPS_A_THREAD, len(tx))
        _mirror(
            begin,
            end,
            tx,
            rx,
            centres,
            frames,
            semi_axes,
            start,
            horizontal,
            spreading,
            length,
            amplitude,
            point,
        )

    in_threads(solve, range(0, len(tx), _CHIRPS_A_THREAD))
    return length, amplitude, point
