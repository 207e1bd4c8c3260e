"""How much of an ellipsoid's return is left where others stand before it: its Fresnel zones, laid out and added up.

Round the mirror point p0 the excess path dL = |T - p| + |R - p| - |T - p0| - |R - p0| grows as x.H x / 2 with the
matrix H of `rtradar.scatter.mirror`, so x = rho sqrt(2/k) H^(-1/2) (cos, sin) makes k dL about rho^2: circles of rho are
the borders of Fresnel zones. Meridians leave the mirror point along x and run as great circles on the unit sphere that
A = frame diag(semi_axes) stretches to the ellipsoid, up to `RIM` or to where the lit side ends. On cells along them

    V = sum w g vis exp(-jk dL) / sum w g exp(-jk dL),     g = (n.s_T + n.s_R) / (R_T R_R) dS,

with dL exact in float64 for each pair of antennas and w a window that falls to 0 at the rim: without it the rim itself
would diffract. Which parts stand before this one is for the tracer to say; where the outline of each cuts a meridian
follows from closed form, the clearance of the ray from the unit sphere in the occluder's own stretched axes, to a share
of a cell. So V changes smoothly as an edge wanders over the zones, and is exactly 1 in full view and 0 behind.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from rtradar.scatter.triangle_share import positive_share
from rtradar.threads import in_threads

RIM = 7.0
"""Where the window ends at the latest, sqrt(k dL): 7.8 wavelengths of excess path."""

_TAPER = 0.4  # of the way to the rim the window stays 1
_MERIDIANS, _CELLS = 24, 48
_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


# Three by three, one by one: products of small arrays call a library, and take seconds to compile.


@njit(cache=True, forceinline=True, error_model="numpy")
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@njit(cache=True, forceinline=True, error_model="numpy")
def _apply(matrix, vector, out):  # type: ignore[no-untyped-def]
    x, y, z = vector[0], vector[1], vector[2]
    for i in range(3):
        out[i] = matrix[i, 0] * x + matrix[i, 1] * y + matrix[i, 2] * z


@njit(cache=True, forceinline=True, error_model="numpy")
def _apply_transposed(matrix, vector, out):  # type: ignore[no-untyped-def]
    x, y, z = vector[0], vector[1], vector[2]
    for i in range(3):
        out[i] = matrix[0, i] * x + matrix[1, i] * y + matrix[2, i] * z


@njit(cache=True, forceinline=True, error_model="numpy")
def _less(a, b, out):  # type: ignore[no-untyped-def]
    for i in range(3):
        out[i] = a[i] - b[i]


@njit(cache=True, forceinline=True, error_model="numpy")
def _normalize(vector):  # type: ignore[no-untyped-def]
    """Make a unit vector of it; its length is returned."""
    length = math.sqrt(_dot(vector, vector))
    for i in range(3):
        vector[i] /= length
    return length


@njit(cache=True, forceinline=True, error_model="numpy")
def _cap(antenna, centre, back, way, out):  # type: ignore[no-untyped-def]
    """The antenna from the centre, in axes in which the ellipsoid is the unit sphere."""
    _less(antenna, centre, way)
    _apply(back, way, out)


@njit(cache=True, forceinline=True, error_model="numpy")
def _axes_of_zone(tx, rx, centre, frame, axes, point, wavenumber, stretch, back, pole, along):  # type: ignore[no-untyped-def]
    """Fill in the map of one zone; False where there is no mirror point.

    ``stretch`` A (3, 3), ``back`` its inverse, ``pole`` (3,) the mirror point on the unit sphere, ``along`` (2, 3) the
    tangents there that two steps of rho = 1, a right angle apart, have.
    """
    for i in range(3):
        for j in range(3):
            stretch[i, j] = frame[i, j] * axes[j]
            back[j, i] = frame[i, j] / axes[j]
    work = np.empty((7, 3))
    normal, e, f, way_t, way_r, curve_e, curve_f = work[0], work[1], work[2], work[3], work[4], work[5], work[6]
    _less(point, centre, normal)
    _apply(back, normal, pole)
    _normalize(pole)
    _apply_transposed(back, pole, normal)
    gradient = _normalize(normal)
    # Tangents that turn with nothing but the normal, so that the pattern does not jump: level, and upward of it.
    e[0], e[1], e[2] = -normal[1], normal[0], 0.0
    if normal[0] ** 2 + normal[1] ** 2 < 1e-8:
        e[0], e[1], e[2] = 0.0, normal[2], -normal[1]
    _normalize(e)
    f[0] = normal[1] * e[2] - normal[2] * e[1]
    f[1] = normal[2] * e[0] - normal[0] * e[2]
    f[2] = normal[0] * e[1] - normal[1] * e[0]
    _less(tx, point, way_t)
    _less(rx, point, way_r)
    range_t, range_r = _normalize(way_t), _normalize(way_r)
    facing = _dot(way_t, normal) + _dot(way_r, normal)
    _apply(back, e, curve_e)
    _apply(back, f, curve_f)
    bend = facing / gradient
    te, tf, re, rf = _dot(way_t, e), _dot(way_t, f), _dot(way_r, e), _dot(way_r, f)
    h_ee = (1 - te * te) / range_t + (1 - re * re) / range_r + bend * _dot(curve_e, curve_e)
    h_ff = (1 - tf * tf) / range_t + (1 - rf * rf) / range_r + bend * _dot(curve_f, curve_f)
    h_ef = -te * tf / range_t - re * rf / range_r + bend * _dot(curve_e, curve_f)
    determinant = h_ee * h_ff - h_ef * h_ef
    if not (facing > 0 and determinant > 0):
        return False
    # Square root of H^-1 = (h_ff, -h_ef; -h_ef, h_ee) / det: M^(1/2) = (M + sqrt(det M)) / sqrt(tr M + 2 sqrt(det M)).
    root = 1 / math.sqrt(determinant)
    scale = math.sqrt(2 / wavenumber) / math.sqrt((h_ee + h_ff) / determinant + 2 * root)
    s_ee, s_ff, s_ef = (h_ff / determinant + root) * scale, (h_ee / determinant + root) * scale, -h_ef / determinant * scale
    for i in range(3):
        along[0, i] = s_ee * curve_e[i] + s_ef * curve_f[i]
        along[1, i] = s_ef * curve_e[i] + s_ff * curve_f[i]
    return True


@njit(cache=True, forceinline=True, error_model="numpy")
def _meridian(angle, pole, along, cap_t, cap_r, step):  # type: ignore[no-untyped-def]
    """Direction of one meridian on the unit sphere into ``step (3,)``; its radians a unit of rho, and rho at its end."""
    for i in range(3):
        step[i] = math.cos(angle) * along[0, i] + math.sin(angle) * along[1, i]
    pace = _normalize(step)
    # An antenna at T lights the cap u.T' > 1, T' = A^-1 (T - centre).
    end = math.inf
    for cap in (cap_t, cap_r):
        ahead, aside = _dot(cap, pole), _dot(cap, step)
        end = min(end, math.atan2(aside, ahead) + math.acos(min(1.0, 1 / math.hypot(ahead, aside))))
    return pace, min(RIM, end / pace)


@njit(cache=True, error_model="numpy")
def _lay_rays(tx, rx, centres, frames, semi_axes, points, wavenumber, out):  # type: ignore[no-untyped-def]
    zones, rays = out.shape[:2]
    stretch, back, pole, along, step = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty((2, 3)), np.empty(3)
    cap_t, cap_r, way = np.empty(3), np.empty(3), np.empty(3)
    for zone in range(zones):
        centre = centres[zone]
        there = _axes_of_zone(
            tx[zone], rx[zone], centre, frames[zone], semi_axes[zone], points[zone], wavenumber[zone], stretch, back, pole, along
        )
        _cap(tx[zone], centre, back, way, cap_t)
        _cap(rx[zone], centre, back, way, cap_r)
        for ray in range(rays):
            if not there:
                for i in range(3):
                    out[zone, ray, i] = points[zone, i]
                continue
            pace, end = _meridian(ray * _GOLDEN_ANGLE, pole, along, cap_t, cap_r, step)
            turn = math.sqrt((ray + 0.5) / rays) * end * pace
            cosine, sine = math.cos(turn), math.sin(turn)
            for i in range(3):
                way[i] = cosine * pole[i] + sine * step[i]
            _apply(stretch, way, out[zone, ray])
            for i in range(3):
                out[zone, ray, i] += centre[i]


def zone_rays(
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    centres: NDArray[np.float64],
    frames: NDArray[np.float64],
    semi_axes: NDArray[np.float64],
    points: NDArray[np.float64],
    wavenumber: NDArray[np.float64],
    shadow_rays: int,
) -> NDArray[np.float64]:
    """Points of ellipsoids at which the tracer is asked what stands before them: an even spiral over the Fresnel zones.

    Parameters
    ----------
    tx, rx : (zone, 3) float64
        The pair whose zones they are [m].
    centres, frames, semi_axes : (zone, 3), (zone, 3, 3), (zone, 3) float64
        One ellipsoid a zone [m].
    points : (zone, 3) float64
        Its mirror point, world [m].
    wavenumber : (zone,) float64
        [rad/m].
    shadow_rays : int
        How many.

    Returns
    -------
    (zone, ray, 3) float64
        World [m]; the mirror point itself where the pair sees no mirror image.
    """
    tx, rx, centres, frames, semi_axes, points, wavenumber = (
        np.ascontiguousarray(a, dtype=np.float64) for a in (tx, rx, centres, frames, semi_axes, points, wavenumber)
    )
    out = np.empty((len(points), shadow_rays, 3))
    _lay_rays(tx, rx, centres, frames, semi_axes, points, wavenumber, out)
    return out


@njit(cache=True, forceinline=True, error_model="numpy")
def _clearance(antenna, o, u, t, cosine, sine, clear):  # type: ignore[no-untyped-def]
    """Lower ``clear`` to how far outside the unit sphere the ray from ``antenna`` to each o + cos u + sin t passes."""
    a0, a1, a2 = antenna[0], antenna[1], antenna[2]
    for j in range(len(cosine)):
        d0 = o[0] + cosine[j] * u[0] + sine[j] * t[0] - a0
        d1 = o[1] + cosine[j] * u[1] + sine[j] * t[1] - a1
        d2 = o[2] + cosine[j] * u[2] + sine[j] * t[2] - a2
        # Nearest to the middle of the sphere on the way from antenna to point.
        share = -(a0 * d0 + a1 * d1 + a2 * d2) / (d0 * d0 + d1 * d1 + d2 * d2)
        share = min(1.0, max(0.0, share))
        n0, n1, n2 = a0 + share * d0, a1 + share * d1, a2 + share * d2
        clear[j] = min(clear[j], math.sqrt(n0 * n0 + n1 * n1 + n2 * n2) - 1)


@njit(cache=True, forceinline=True, error_model="numpy")
def _open_share(a, b, c, d):  # type: ignore[no-untyped-def]
    """Share of a cell where a function is positive, from its values a, b and c, d at the ends of two opposite sides.

    As triangles, cut along one diagonal and along the other: no value at a corner can pass 0 and the share jump.
    """
    if min(min(a, b), min(c, d)) >= 0:
        return 1.0
    if max(max(a, b), max(c, d)) <= 0:
        return 0.0
    return (positive_share(a, b, c) + positive_share(d, b, c) + positive_share(a, b, d) + positive_share(a, c, d)) / 4


@njit(cache=True, forceinline=True, error_model="numpy")
def _exponential(turns, real, imaginary):  # type: ignore[no-untyped-def]
    """exp(-2 pi j turns) to 1e-7, in vector lanes, which the library's sine does not take."""
    for j in range(len(turns)):
        # Half the angle, at most a right angle, by its Taylor series; then doubled.
        half = math.pi * (turns[j] - math.floor(turns[j] + 0.5))
        x = half * half
        sine = half * (1 + x * (-1 / 6 + x * (1 / 120 + x * (-1 / 5040 + x * (1 / 362880 - x / 39916800)))))
        cosine = 1 + x * (-1 / 2 + x * (1 / 24 + x * (-1 / 720 + x * (1 / 40320 + x * (-1 / 3628800 + x / 479001600)))))
        real[j], imaginary[j] = 1 - 2 * sine * sine, -2 * sine * cosine


@njit(cache=True, forceinline=True, error_model="numpy", fastmath={"reassoc", "contract", "nsz"})
def _add(weight, facing_t, facing_r, re_t, im_t, re_r, im_r, share_t, share_r, sums):  # type: ignore[no-untyped-def]
    """Add one meridian to ``sums``: free real and imaginary, lost real and imaginary, open."""
    free_re, free_im, lost_re, lost_im, open_ = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(len(weight)):
        strength = weight[j] * (facing_t[j] + facing_r[j])
        re = strength * (re_t[j] * re_r[j] - im_t[j] * im_r[j])
        im = strength * (re_t[j] * im_r[j] + im_t[j] * re_r[j])
        # Tx and Rx stand side by side and see the same edge: the smaller share, not the product.
        share = min(share_t[j], share_r[j])
        free_re += re
        free_im += im
        lost_re += (1 - share) * re
        lost_im += (1 - share) * im
        open_ += share
    sums[0] += free_re
    sums[1] += free_im
    sums[2] += lost_re
    sums[3] += lost_im
    sums[4] += open_


@njit(cache=True, forceinline=True, error_model="numpy")
def _zone_share(  # type: ignore[no-untyped-def]
    tx, rx, point, part, centres, frames, semi_axes, antennas, pairs, hiders, wavenumber, laid_for, out
):
    """Share left of one part's return, ``out (frequency, pair)``."""
    frequencies, n_pairs = out.shape
    n_antennas = len(antennas)
    stretch, back, pole, along, step = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty((2, 3)), np.empty(3)
    centre = centres[part]
    for f in range(frequencies):
        for pair in range(n_pairs):
            out[f, pair] = 1.0
    if not _axes_of_zone(tx, rx, centre, frames[part], semi_axes[part], point, laid_for, stretch, back, pole, along):
        return
    cap_t, cap_r, way = np.empty(3), np.empty(3), np.empty(3)
    _cap(tx, centre, back, way, cap_t)
    _cap(rx, centre, back, way, cap_r)
    clear = _outlines(part, centres, frames, semi_axes, antennas, hiders, cap_t, cap_r, stretch, pole, along)

    # Area of a cell, without what changes along a meridian.
    y0, y1 = along[0], along[1]
    area = pole[0] * (y0[1] * y1[2] - y0[2] * y1[1])
    area = abs(area + pole[1] * (y0[2] * y1[0] - y0[0] * y1[2]) + pole[2] * (y0[0] * y1[1] - y0[1] * y1[0]))
    up, side, normal_up, normal_side = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    _apply(stretch, pole, up)
    _apply_transposed(back, pole, normal_up)
    share, facing = np.empty((n_antennas, _CELLS)), np.empty((n_antennas, _CELLS))
    length, turns, weight = np.empty(_CELLS), np.empty(_CELLS), np.empty(_CELLS)
    real, imaginary = np.empty((frequencies, n_antennas, _CELLS)), np.empty((frequencies, n_antennas, _CELLS))
    near = np.empty(n_antennas)
    for a in range(n_antennas):
        _less(antennas[a], point, way)
        near[a] = math.sqrt(_dot(way, way))
    sums = np.zeros((frequencies, n_pairs, 5))
    cosine, sine = np.empty(_CELLS), np.empty(_CELLS)
    for m in range(_MERIDIANS):
        pace, end = _meridian((m + 0.5) * 2 * math.pi / _MERIDIANS, pole, along, cap_t, cap_r, step)
        turn = end * pace / _CELLS
        for j in range(_CELLS):
            cosine[j], sine[j] = math.cos((j + 0.5) * turn), math.sin((j + 0.5) * turn)
            weight[j] = sine[j] * turn * area / (pace * pace)
            way_share = (j + 0.5) / _CELLS
            if way_share > _TAPER:
                weight[j] *= math.cos(0.5 * math.pi * (way_share - _TAPER) / (1 - _TAPER)) ** 2
        after = (m + 1) % _MERIDIANS
        _apply(stretch, step, side)
        _apply_transposed(back, step, normal_side)
        for a in range(n_antennas):
            # The innermost cell has three corners.
            share[a, 0] = positive_share(clear[m, a, 0], clear[m, a, 1], clear[after, a, 1])
            for j in range(1, _CELLS):
                share[a, j] = _open_share(clear[m, a, j], clear[m, a, j + 1], clear[after, a, j], clear[after, a, j + 1])
            _less(antennas[a], centre, way)
            # On the ellipsoid itself normal . point is 1.
            normal_1, normal_2 = _dot(normal_up, way), _dot(normal_side, way)
            for j in range(_CELLS):
                x = way[0] - cosine[j] * up[0] - sine[j] * side[0]
                y = way[1] - cosine[j] * up[1] - sine[j] * side[1]
                z = way[2] - cosine[j] * up[2] - sine[j] * side[2]
                length[j] = math.sqrt(x * x + y * y + z * z)
                facing[a, j] = (cosine[j] * normal_1 + sine[j] * normal_2 - 1) / length[j]
            for f in range(frequencies):
                per_metre = wavenumber[f] / (2 * math.pi)
                for j in range(_CELLS):
                    turns[j] = per_metre * (length[j] - near[a])
                _exponential(turns, real[f, a], imaginary[f, a])
                for j in range(_CELLS):
                    scale = 1 / length[j] if facing[a, j] > 0 else 0.0
                    real[f, a, j] *= scale
                    imaginary[f, a, j] *= scale
        for f in range(frequencies):
            for pair in range(n_pairs):
                t, r = pairs[pair, 0], pairs[pair, 1]
                re, im = real[f], imaginary[f]
                _add(weight, facing[t], facing[r], re[t], im[t], re[r], im[r], share[t], share[r], sums[f, pair])
    for f in range(frequencies):
        for pair in range(n_pairs):
            one = sums[f, pair]
            if one[4] == 0:
                out[f, pair] = 0.0
            elif one[2] != 0 or one[3] != 0:
                out[f, pair] = 1 - complex(one[2], one[3]) / complex(one[0], one[1])


@njit(cache=True, forceinline=True, error_model="numpy")
def _outlines(part, centres, frames, semi_axes, antennas, hiders, cap_t, cap_r, stretch, pole, along):  # type: ignore[no-untyped-def]
    """Least clearance of the rays from each antenna to the corners of the cells: (meridian, antenna, corner)."""
    n_antennas, n_others = len(antennas), 0
    others = np.empty(len(hiders), dtype=np.int64)
    for q in range(len(hiders)):
        if hiders[q]:
            others[n_others] = q
            n_others += 1
    inverse, o, u = np.empty((n_others, 3, 3)), np.empty((n_others, 3)), np.empty((n_others, 3))
    seen_from = np.empty((n_others, n_antennas, 3))
    up, side, way, other_side = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    _apply(stretch, pole, up)
    for i in range(n_others):
        q = others[i]
        for row in range(3):
            for column in range(3):
                inverse[i, row, column] = frames[q, column, row] / semi_axes[q, row]
        _cap(centres[part], centres[q], inverse[i], way, o[i])
        _apply(inverse[i], up, u[i])
        for a in range(n_antennas):
            _cap(antennas[a], centres[q], inverse[i], way, seen_from[i, a])
    step, cosine, sine = np.empty(3), np.empty(_CELLS + 1), np.empty(_CELLS + 1)
    clear = np.ones((_MERIDIANS, n_antennas, _CELLS + 1))
    for m in range(_MERIDIANS):
        pace, end = _meridian(m * 2 * math.pi / _MERIDIANS, pole, along, cap_t, cap_r, step)
        turn = end * pace / _CELLS
        for j in range(_CELLS + 1):
            cosine[j], sine[j] = math.cos(j * turn), math.sin(j * turn)
        _apply(stretch, step, side)
        for i in range(n_others):
            _apply(inverse[i], side, other_side)
            for a in range(n_antennas):
                _clearance(seen_from[i, a], o[i], u[i], other_side, cosine, sine, clear[m, a])
    return clear


@njit(cache=True, nogil=True, error_model="numpy")
def _zone_shares(  # type: ignore[no-untyped-def]
    begin, end, tx, rx, points, part, pose, centres, frames, semi_axes, antennas, pairs, hiders, wavenumber, laid_for, out
):
    for zone in range(begin, end):
        _zone_share(
            tx[zone],
            rx[zone],
            points[zone],
            part[zone],
            centres[pose[zone]],
            frames[pose[zone]],
            semi_axes,
            antennas[zone],
            pairs,
            hiders[zone],
            wavenumber[zone],
            laid_for[zone],
            out[zone],
        )


_ZONES_A_THREAD = 8
"""For fewer, waking threads costs more than the work."""


def zone_shares(
    tx: NDArray[np.float64],
    rx: NDArray[np.float64],
    points: NDArray[np.float64],
    part: NDArray[np.int64],
    pose: NDArray[np.int64],
    poses: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    antennas: NDArray[np.float64],
    pairs: NDArray[np.int64],
    hiders: NDArray[np.bool_],
    wavenumber: NDArray[np.float64],
    laid_for: NDArray[np.float64],
) -> NDArray[np.complex128]:
    """Share V that is left of the return of each zone's part, for exp(+j omega t).

    Parameters
    ----------
    tx, rx, points : (zone, 3) float64
        The pair that the zone is laid out for, and its mirror point [m].
    part, pose : (zone,) int64
        Which part of the body it is, in which pose.
    poses : (pose, part, 3), (pose, part, 3, 3), (part, 3) float64
        Centres, frames and semi-axes of the whole body [m].
    antennas : (zone, antenna, 3) float64
        [m].
    pairs : (pair, 2) int64
        Tx and Rx among the antennas.
    hiders : (zone, part) bool
        Which parts stand before the zone, for some antenna.
    wavenumber : (zone, frequency) float64
        Where V is wanted [rad/m].
    laid_for : (zone,) float64
        Wavenumber that the zones are laid out for [rad/m].

    Returns
    -------
    (zone, frequency, pair) complex128
        1 in full view, 0 hidden; in between its modulus may pass 1 a little, as it does beyond any edge.
    """
    floats = (tx, rx, points, *poses, antennas, wavenumber, laid_for)
    tx, rx, points, centres, frames, semi_axes, antennas, wavenumber, laid_for = (
        np.ascontiguousarray(a, dtype=np.float64) for a in floats
    )
    part, pose, pairs = (np.ascontiguousarray(a, dtype=np.int64) for a in (part, pose, pairs))
    out = np.empty((len(points), wavenumber.shape[1], len(pairs)), dtype=np.complex128)
    hiders = np.ascontiguousarray(hiders)

    def share(begin: int) -> None:
        end = min(begin + _ZONES_A_THREAD, len(points))
        body = centres, frames, semi_axes
        _zone_shares(begin, end, tx, rx, points, part, pose, *body, antennas, pairs, hiders, wavenumber, laid_for, out)

    in_threads(share, range(0, len(points), _ZONES_A_THREAD))
    return out
