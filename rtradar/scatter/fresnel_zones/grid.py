"""Fresnel zones laid out on an ellipsoid: meridians that leave the specular point, and the points on them that rays are sent to.

Round the specular point p0 the excess path dL = |T - p| + |R - p| - |T - p0| - |R - p0| grows as x.H x / 2 with the matrix H of
`rtradar.scatter.specular_point.solver`, so x = rho sqrt(2/k) H^(-1/2) (cos, sin) makes k dL about rho^2: circles of rho are the
borders of Fresnel zones. Meridians leave the specular point along x and run as great circles on the unit sphere that A = frame
diag(semi_axes) stretches to the ellipsoid, up to `RIM` or to where the lit side ends.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.small_vectors import apply, apply_transposed, dot, normalize, subtract

RIM = 7.0
"""Where the zones that count end at the latest, sqrt(k dL): 7.8 wavelengths of excess path."""

MERIDIANS, CELLS = 24, 48
"""Meridians, and cells along each, that the zones are added up on."""

_GOLDEN_ANGLE = math.pi * (3 - math.sqrt(5))


@inlined()
def from_centre(antenna, centre, back, way, out):
    """The antenna from the centre, in axes in which the ellipsoid is the unit sphere."""
    subtract(antenna, centre, way)
    apply(back, way, out)


@inlined()
def axes_of_zone(tx, rx, centre, frame, axes, point, wavenumber, stretch, back, pole, along):
    """Fill in the map of one zone; False where there is no specular point.

    ``stretch`` A (3, 3), ``back`` its inverse, ``pole`` (3,) the specular point on the unit sphere, ``along`` (2, 3) the
    tangents there that two steps of rho = 1, a right angle apart, have.
    """
    for i in range(3):
        for j in range(3):
            stretch[i, j] = frame[i, j] * axes[j]
            back[j, i] = frame[i, j] / axes[j]
    work = np.empty((7, 3))
    normal, e, f, way_t, way_r, curve_e, curve_f = (
        work[0],
        work[1],
        work[2],
        work[3],
        work[4],
        work[5],
        work[6],
    )
    subtract(point, centre, normal)
    apply(back, normal, pole)
    normalize(pole)
    apply_transposed(back, pole, normal)
    gradient = normalize(normal)
    # Tangents that turn with nothing but the normal, so that the pattern does not jump: level, and upward of it.
    e[0], e[1], e[2] = -normal[1], normal[0], 0.0
    if normal[0] ** 2 + normal[1] ** 2 < 1e-8:
        e[0], e[1], e[2] = 0.0, normal[2], -normal[1]
    normalize(e)
    f[0] = normal[1] * e[2] - normal[2] * e[1]
    f[1] = normal[2] * e[0] - normal[0] * e[2]
    f[2] = normal[0] * e[1] - normal[1] * e[0]
    subtract(tx, point, way_t)
    subtract(rx, point, way_r)
    range_t, range_r = normalize(way_t), normalize(way_r)
    facing = dot(way_t, normal) + dot(way_r, normal)
    apply(back, e, curve_e)
    apply(back, f, curve_f)
    bend = facing / gradient
    te, tf, re, rf = dot(way_t, e), dot(way_t, f), dot(way_r, e), dot(way_r, f)
    h_ee = (1 - te * te) / range_t + (1 - re * re) / range_r + bend * dot(curve_e, curve_e)
    h_ff = (1 - tf * tf) / range_t + (1 - rf * rf) / range_r + bend * dot(curve_f, curve_f)
    h_ef = -te * tf / range_t - re * rf / range_r + bend * dot(curve_e, curve_f)
    determinant = h_ee * h_ff - h_ef * h_ef
    if not (facing > 0 and determinant > 0):
        return False
    # Square root of H^-1 = (h_ff, -h_ef; -h_ef, h_ee) / det: M^(1/2) = (M + sqrt(det M)) / sqrt(tr M + 2 sqrt(det M)).
    root = 1 / math.sqrt(determinant)
    scale = math.sqrt(2 / wavenumber) / math.sqrt((h_ee + h_ff) / determinant + 2 * root)
    s_ee, s_ff, s_ef = (
        (h_ff / determinant + root) * scale,
        (h_ee / determinant + root) * scale,
        -h_ef / determinant * scale,
    )
    for i in range(3):
        along[0, i] = s_ee * curve_e[i] + s_ef * curve_f[i]
        along[1, i] = s_ef * curve_e[i] + s_ff * curve_f[i]
    return True


@inlined()
def meridian(angle, pole, along, cap_t, cap_r, step):
    """Direction of one meridian on the unit sphere into ``step (3,)``; its radians a unit of rho, and rho at its end."""
    for i in range(3):
        step[i] = math.cos(angle) * along[0, i] + math.sin(angle) * along[1, i]
    pace = normalize(step)
    # An antenna at T lights the cap u.T' > 1, T' = A^-1 (T - centre).
    end = math.inf
    for cap in (cap_t, cap_r):
        ahead, aside = dot(cap, pole), dot(cap, step)
        end = min(end, math.atan2(aside, ahead) + math.acos(min(1.0, 1 / math.hypot(ahead, aside))))
    return pace, min(RIM, end / pace)


@compiled()
def _lay_rays(tx, rx, centres, frames, semi_axes, points, wavenumber, out):
    zones, rays = out.shape[:2]
    stretch, back, pole, along, step = (
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty(3),
        np.empty((2, 3)),
        np.empty(3),
    )
    cap_t, cap_r, way = np.empty(3), np.empty(3), np.empty(3)
    for zone in range(zones):
        centre = centres[zone]
        there = axes_of_zone(
            tx[zone],
            rx[zone],
            centre,
            frames[zone],
            semi_axes[zone],
            points[zone],
            wavenumber[zone],
            stretch,
            back,
            pole,
            along,
        )
        from_centre(tx[zone], centre, back, way, cap_t)
        from_centre(rx[zone], centre, back, way, cap_r)
        for ray in range(rays):
            if not there:
                for i in range(3):
                    out[zone, ray, i] = points[zone, i]
                continue
            pace, end = meridian(ray * _GOLDEN_ANGLE, pole, along, cap_t, cap_r, step)
            turn = math.sqrt((ray + 0.5) / rays) * end * pace
            cosine, sine = math.cos(turn), math.sin(turn)
            for i in range(3):
                way[i] = cosine * pole[i] + sine * step[i]
            apply(stretch, way, out[zone, ray])
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
        Its specular point, world [m].
    wavenumber : (zone,) float64
        [rad/m].
    shadow_rays : int
        How many.

    Returns
    -------
    (zone, ray, 3) float64
        World [m]; the specular point itself where the pair sees no mirror image.
    """
    tx, rx, centres, frames, semi_axes, points, wavenumber = (
        np.ascontiguousarray(a, dtype=np.float64)
        for a in (tx, rx, centres, frames, semi_axes, points, wavenumber)
    )
    out = np.empty((len(points), shadow_rays, 3))
    _lay_rays(tx, rx, centres, frames, semi_axes, points, wavenumber, out)
    return out
