"""Fresnel zones on ellipsoids: their cells, points on them, and sums over what is visible of them.

Round the specular point p0 the excess path dL = |T - p| + |R - p| - |T - p0| - |R - p0| grows as
x.H x / 2 with the Hessian H of `rtradar.scatter.specular_point.solver`. So x = rho sqrt(2/k)
H^(-1/2) (cos, sin) makes k dL about rho^2: circles of rho are the borders of Fresnel zones. A place
(x, y) in the plane of rho goes to the ellipsoid along a great circle of the unit sphere that
A = frame diag(semi_axes) stretches to it. The zones reach to `RIM`, or to where the lit side ends.

They are added up over `CELLS` cells along each of `MERIDIANS` meridians. Which fraction of a cell
is open is for `rtradar.kernels.scatter.zones.zone_edges`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import (
    apply,
    apply_transposed,
    dot,
    hermite_weights,
    normalize,
    phasor,
    subtract,
)
from rtradar.kernels.jit import compiled, inlined

RIM = 7.0
"""Largest sqrt(k dL) of the zones that are added up: 7.8 wavelengths of excess path."""

MERIDIANS, CELLS = 24, 48
"""Meridians, and cells along each, over which the zones are added up."""

_TAPER = 0.4
"""Fraction of the way to the rim up to which the window is 1."""

_MOST = 2.0
"""Bound of |V|: a round hole that leaves the first Fresnel zone alone open doubles the free field,
and no single opening does more (a straight edge 1.17, a slit 1.34, a rectangle 1.80). More comes
out for parts about as small as the wavelength: their free sum, by which the lost one is divided,
has not settled where their lit side ends."""


class ZoneMaps(NamedTuple):
    """Maps from the plane of rho to ellipsoids, one a zone.

    ``stretch`` A and ``back`` its inverse (zone, 3, 3); ``centre (zone, 3)`` [m]; ``pole (zone,
    3)``, the specular point on the unit sphere; ``along (zone, 2, 3)``, the tangents there of two
    steps of rho = 1, a right angle apart; ``caps (zone, 2, 3)``, both antennas in the axes of the
    unit sphere; ``rim (zone, meridian)``, rho where each meridian ends; ``exists (zone,)``, whether
    there is a specular point at all.
    """

    stretch: NDArray[np.float64]
    back: NDArray[np.float64]
    centre: NDArray[np.float64]
    pole: NDArray[np.float64]
    along: NDArray[np.float64]
    caps: NDArray[np.float64]
    rim: NDArray[np.float64]
    exists: NDArray[np.bool_]

    @classmethod
    def empty(cls, zones: int) -> ZoneMaps:
        """Room for so many zones."""
        shapes = (3, 3), (3, 3), (3,), (3,), (2, 3), (2, 3), (MERIDIANS,)
        arrays = [np.empty((zones, *shape)) for shape in shapes]
        return cls._make([*arrays, np.empty(zones, dtype=np.bool_)])


@inlined()
def _axes_of_zone(tx, rx, centre, frame, axes, point, wavenumber, stretch, back, pole, along):
    """Fill in the map of one zone; False where there is no specular point."""
    for i in range(3):
        for j in range(3):
            stretch[i, j] = frame[i, j] * axes[j]
            back[j, i] = frame[i, j] / axes[j]
    work = np.empty((7, 3))
    normal, e, f, way_t, way_r = work[0], work[1], work[2], work[3], work[4]
    curve_e, curve_f = work[5], work[6]
    # The specular point on the unit sphere, and the unit normal of the ellipsoid there.
    subtract(point, centre, normal)
    apply(back, normal, pole)
    normalize(pole)
    apply_transposed(back, pole, normal)
    gradient = normalize(normal)
    # Tangents that rotate with nothing but the normal, so that the pattern does not jump: one
    # level.
    e[0], e[1], e[2] = -normal[1], normal[0], 0.0
    if normal[0] ** 2 + normal[1] ** 2 < 1e-8:
        e[0], e[1], e[2] = 0.0, normal[2], -normal[1]
    normalize(e)
    f[0] = normal[1] * e[2] - normal[2] * e[1]
    f[1] = normal[2] * e[0] - normal[0] * e[2]
    f[2] = normal[0] * e[1] - normal[1] * e[0]
    # The Hessian of the path in these tangents.
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
    # Square root of H^-1 = (h_ff, -h_ef; -h_ef, h_ee) / det, by
    # M^(1/2) = (M + sqrt(det M)) / sqrt(tr M + 2 sqrt(det M)).
    root = 1 / math.sqrt(determinant)
    scale = math.sqrt(2 / wavenumber) / math.sqrt((h_ee + h_ff) / determinant + 2 * root)
    s_ee, s_ff = (h_ff / determinant + root) * scale, (h_ee / determinant + root) * scale
    s_ef = -h_ef / determinant * scale
    for i in range(3):
        along[0, i] = s_ee * curve_e[i] + s_ef * curve_f[i]
        along[1, i] = s_ef * curve_e[i] + s_ff * curve_f[i]
    return True


@inlined()
def _meridian(angle, pole, along, caps, step):
    """Fill in a meridian's direction on the unit sphere; return radians per rho, and its rim."""
    for i in range(3):
        step[i] = math.cos(angle) * along[0, i] + math.sin(angle) * along[1, i]
    pace = normalize(step)
    # An antenna at T lights the cap u.T' > 1, T' = A^-1 (T - centre).
    end = math.inf
    for cap in range(2):
        ahead, aside = dot(caps[cap], pole), dot(caps[cap], step)
        half = math.acos(min(1.0, 1 / math.hypot(ahead, aside)))
        end = min(end, math.atan2(aside, ahead) + half)
    return pace, min(RIM, end / pace)


@compiled()
def lay_zones(tx, rx, centres, frames, semi_axes, points, wavenumber, maps):
    """Fill in the `ZoneMaps` of zones of the pair tx, rx (zone, 3) round ``points (zone, 3)`` [m].

    The ellipsoids are ``centres (zone, 3)``, ``frames (zone, 3, 3)``, ``semi_axes (zone, 3)`` [m],
    the wavenumbers (zone,) [rad/m].
    """
    way, step = np.empty(3), np.empty(3)
    for zone in range(len(points)):
        pole, along, caps = maps.pole[zone], maps.along[zone], maps.caps[zone]
        back = maps.back[zone]
        maps.centre[zone] = centres[zone]
        maps.exists[zone] = _axes_of_zone(
            tx[zone],
            rx[zone],
            centres[zone],
            frames[zone],
            semi_axes[zone],
            points[zone],
            wavenumber[zone],
            maps.stretch[zone],
            back,
            pole,
            along,
        )
        if not maps.exists[zone]:
            along[:] = 0.0
            maps.rim[zone] = 0.0
            continue
        subtract(tx[zone], centres[zone], way)
        apply(back, way, caps[0])
        subtract(rx[zone], centres[zone], way)
        apply(back, way, caps[1])
        for m in range(MERIDIANS):
            _, maps.rim[zone, m] = _meridian(m * 2 * math.pi / MERIDIANS, pole, along, caps, step)


@inlined()
def zone_point(maps, zone, x, y, u, out):
    """Fill in the point (3,) on the ellipsoid at a place of a zone; ``u (3,)`` is overwritten."""
    pole, along = maps.pole[zone], maps.along[zone]
    for i in range(3):
        u[i] = x * along[0, i] + y * along[1, i]
    turn = math.sqrt(dot(u, u))
    scale = math.sin(turn) / turn if turn > 0 else 1.0
    for i in range(3):
        u[i] = math.cos(turn) * pole[i] + scale * u[i]
    apply(maps.stretch[zone], u, out)
    for i in range(3):
        out[i] += maps.centre[zone, i]


@compiled()
def zone_points(maps, zone, x, y, out):
    """Fill in the points (n, 3) on ellipsoids at places x, y of zones (n,) in the plane of rho."""
    u = np.empty(3)
    for n in range(len(zone)):
        zone_point(maps, zone[n], x[n], y[n], u, out[n])


@inlined(fastmath={"reassoc", "contract", "nsz"})
def _add(weight, facing_t, facing_r, re_t, im_t, re_r, im_r, open_t, open_r, sums):
    """Add one meridian to ``sums``: free real and imaginary, lost real and imaginary, open."""
    free_re, free_im, lost_re, lost_im, open_ = 0.0, 0.0, 0.0, 0.0, 0.0
    for j in range(len(weight)):
        strength = weight[j] * (facing_t[j] + facing_r[j])
        re = strength * (re_t[j] * re_r[j] - im_t[j] * im_r[j])
        im = strength * (re_t[j] * im_r[j] + im_t[j] * re_r[j])
        # Tx and Rx are side by side and see the same edge: the smaller fraction, not the product.
        fraction = min(open_t[j], open_r[j])
        free_re += re
        free_im += im
        lost_re += (1 - fraction) * re
        lost_im += (1 - fraction) * im
        open_ += fraction
    sums[0] += free_re
    sums[1] += free_im
    sums[2] += lost_re
    sums[3] += lost_im
    sums[4] += open_


@inlined()
def _cell_weights(pace, rim, area, cosine, sine, weight):
    """Fill in the middles of a meridian's cells, and their areas under the window."""
    turn = rim * pace / CELLS
    for j in range(CELLS):
        cosine[j], sine[j] = math.cos((j + 0.5) * turn), math.sin((j + 0.5) * turn)
        weight[j] = sine[j] * turn * area / (pace * pace)
        fraction = (j + 0.5) / CELLS
        if fraction > _TAPER:
            weight[j] *= math.cos(0.5 * math.pi * (fraction - _TAPER) / (1 - _TAPER)) ** 2


@inlined()
def _leg(antenna, maps, zone, step, cosine, sine, normals, length, facing):
    """Fill in the lengths from an antenna to the middles of a meridian's cells, and (n.s)."""
    up, side = np.empty(3), np.empty(3)
    apply(maps.stretch[zone], maps.pole[zone], up)
    apply(maps.stretch[zone], step, side)
    apply_transposed(maps.back[zone], maps.pole[zone], normals[0])
    apply_transposed(maps.back[zone], step, normals[1])
    centre = maps.centre[zone]
    x0, y0, z0 = antenna[0] - centre[0], antenna[1] - centre[1], antenna[2] - centre[2]
    # On the ellipsoid itself normal . point is 1.
    level = normals[0, 0] * x0 + normals[0, 1] * y0 + normals[0, 2] * z0
    aside = normals[1, 0] * x0 + normals[1, 1] * y0 + normals[1, 2] * z0
    for j in range(CELLS):
        x = x0 - cosine[j] * up[0] - sine[j] * side[0]
        y = y0 - cosine[j] * up[1] - sine[j] * side[1]
        z = z0 - cosine[j] * up[2] - sine[j] * side[2]
        length[j] = math.sqrt(x * x + y * y + z * z)
        facing[j] = (cosine[j] * level + sine[j] * aside - 1) / length[j]


@inlined()
def _spherical_wave(turns_per_metre, near, length, facing, real, imaginary):
    """Fill in exp(-jk (length - near)) / length where the surface faces the antenna."""
    for j in range(CELLS):
        c, s = phasor(turns_per_metre * (length[j] - near))
        scale = 1 / length[j] if facing[j] > 0 else 0.0
        real[j], imaginary[j] = scale * c, -scale * s


@compiled()
def zone_sums(maps, points, antennas, pairs, wavenumber, fractions, out):
    """Fill in V of zones, ``out (zone, frequency, pair)``.

    ``points (zone, 3)``, ``antennas (zone, antenna, 3)`` [m], ``pairs (pair, 2)``, ``wavenumber
    (zone, frequency)`` [rad/m], ``fractions`` of `open_fractions`.
    """
    frequencies, n_pairs, n_antennas = out.shape[1], out.shape[2], antennas.shape[1]
    step, normals, weight = np.empty(3), np.empty((2, 3)), np.empty(CELLS)
    cosine, sine, length = np.empty(CELLS), np.empty(CELLS), np.empty(CELLS)
    facing, near = np.empty((n_antennas, CELLS)), np.empty(n_antennas)
    real = np.empty((frequencies, n_antennas, CELLS))
    imaginary = np.empty((frequencies, n_antennas, CELLS))
    sums = np.empty((frequencies, n_pairs, 5))
    for zone in range(len(points)):
        pole, along = maps.pole[zone], maps.along[zone]
        # Area of a cell, without what changes along a meridian.
        y0, y1 = along[0], along[1]
        area = pole[0] * (y0[1] * y1[2] - y0[2] * y1[1])
        area += pole[1] * (y0[2] * y1[0] - y0[0] * y1[2])
        area = abs(area + pole[2] * (y0[0] * y1[1] - y0[1] * y1[0]))
        for a in range(n_antennas):
            subtract(antennas[zone, a], points[zone], step)
            near[a] = math.sqrt(dot(step, step))
        sums[:] = 0.0
        for m in range(MERIDIANS):
            # The middles of the cells between this meridian and the next, and the waves there.
            angle = (m + 0.5) * 2 * math.pi / MERIDIANS
            pace, rim = _meridian(angle, pole, along, maps.caps[zone], step)
            _cell_weights(pace, rim, area, cosine, sine, weight)
            for a in range(n_antennas):
                own = antennas[zone, a]
                _leg(own, maps, zone, step, cosine, sine, normals, length, facing[a])
                for f in range(frequencies):
                    turns = wavenumber[zone, f] / (2 * math.pi)
                    re, im = real[f, a], imaginary[f, a]
                    _spherical_wave(turns, near[a], length, facing[a], re, im)
            for f in range(frequencies):
                for pair in range(n_pairs):
                    t, r = pairs[pair, 0], pairs[pair, 1]
                    _add(
                        weight,
                        facing[t],
                        facing[r],
                        real[f, t],
                        imaginary[f, t],
                        real[f, r],
                        imaginary[f, r],
                        fractions[zone, t, m],
                        fractions[zone, r, m],
                        sums[f, pair],
                    )
        # What is lost of the free sum; exactly 1 in full view, and 0 where nothing is open.
        for f in range(frequencies):
            for pair in range(n_pairs):
                one = sums[f, pair]
                out[zone, f, pair] = 1.0
                if one[4] == 0:
                    out[zone, f, pair] = 0.0
                elif one[2] != 0 or one[3] != 0:
                    left = 1 - complex(one[2], one[3]) / complex(one[0], one[1])
                    out[zone, f, pair] = left / max(1.0, abs(left) / _MOST)


@compiled()
def blend_fractions(nodes, slopes, fine, where, spread, inside, out):
    """Interpolate fractions by cubics in time, then by the polynomials over the array.

    ``nodes``, ``slopes (node, frequency, pair, part)``, of which those parts that are not ``fine
    (part,)`` have the first and the last alone; ``where (chirp,)``, in units of nodes; ``spread
    (chirp, rx, pair)``; filled are the rows ``inside (chirp,)`` of ``out (frequency, row, rx,
    part)``.
    """
    frequencies, pairs, parts = nodes.shape[1:]
    last = nodes.shape[0] - 1
    value = np.empty(pairs, dtype=np.complex128)
    for f in range(frequencies):
        for part in range(parts):
            # Where nothing changes the value is taken as it is: the polynomials add up to 1 only
            # nearly.
            still = True
            for node in range(last + 1):
                if node == 0 or node == last or fine[part]:
                    for pair in range(pairs):
                        value_here, slope = nodes[node, f, pair, part], slopes[node, f, pair, part]
                        still &= value_here == nodes[0, f, 0, part] and slope == 0
            for i in range(len(inside)):
                if still:
                    out[f, inside[i], :, part] = nodes[0, f, 0, part]
                    continue
                width = 1 if fine[part] else last
                first = min(int(where[i]), last - 1) if fine[part] else 0
                h0, h1, g0, g1 = hermite_weights((where[i] - first) / width, width)
                begin, end = nodes[first, f], nodes[first + width, f]
                rise, fall = slopes[first, f], slopes[first + width, f]
                for pair in range(pairs):
                    value[pair] = h0 * begin[pair, part] + h1 * end[pair, part]
                    value[pair] += g0 * rise[pair, part] + g1 * fall[pair, part]
                for receiver in range(out.shape[2]):
                    total = 0j
                    for pair in range(pairs):
                        if spread[i, receiver, pair] != 0:
                            total += spread[i, receiver, pair] * value[pair]
                    out[f, inside[i], receiver, part] = total
