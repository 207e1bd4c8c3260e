"""How much of an ellipsoid's return is left where others stand before it: its Fresnel zones, added up.

On cells along the meridians of `rtradar.scatter.fresnel_zones.grid`

    V = sum w g vis exp(-jk dL) / sum w g exp(-jk dL),     g = (n.s_T + n.s_R) / (R_T R_R) dS,

with dL exact in float64 for each pair of antennas and w a window that falls to 0 at the rim: without it the rim itself
would diffract. Which parts stand before this one is for the tracer to say; where the outline of each cuts a meridian
`rtradar.scatter.fresnel_zones.outlines` says, to a share of a cell. So V changes smoothly as an edge wanders over the zones, and
is exactly 1 in full view and 0 behind.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.small_vectors import apply, apply_transposed, dot, subtract
from rtradar.scatter.facets.triangle_fraction import positive_share
from rtradar.scatter.fresnel_zones.grid import CELLS, MERIDIANS, axes_of_zone, from_centre, meridian
from rtradar.scatter.fresnel_zones.outlines import open_share, outlines
from rtradar.system.threads import in_threads

_TAPER = 0.4
"""Of the way to the rim the window stays 1."""

_MOST = 2.0
"""Bound of |V|: a round hole that leaves the first Fresnel zone alone open doubles the free field, and no single opening does
more (a straight edge 1.17, a slit 1.34, a rectangle 1.80). More comes out for parts about as small as the wavelength: their free
sum, by which the lost one is divided, has not settled where their lit side ends."""


@inlined()
def _exponential(turns, real, imaginary):
    """exp(-2 pi j turns) to 1e-7, in vector lanes, which the library's sine does not take."""
    for j in range(len(turns)):
        # Half the angle, at most a right angle, by its Taylor series; then doubled.
        half = math.pi * (turns[j] - math.floor(turns[j] + 0.5))
        x = half * half
        sine = half * (
            1 + x * (-1 / 6 + x * (1 / 120 + x * (-1 / 5040 + x * (1 / 362880 - x / 39916800))))
        )
        cosine = 1 + x * (
            -1 / 2
            + x * (1 / 24 + x * (-1 / 720 + x * (1 / 40320 + x * (-1 / 3628800 + x / 479001600))))
        )
        real[j], imaginary[j] = 1 - 2 * sine * sine, -2 * sine * cosine


@inlined(fastmath={"reassoc", "contract", "nsz"})
def _add(weight, facing_t, facing_r, re_t, im_t, re_r, im_r, share_t, share_r, sums):
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


@inlined()
def _zone_share(
    tx,
    rx,
    point,
    part,
    centres,
    frames,
    semi_axes,
    antennas,
    pairs,
    occluders,
    wavenumber,
    laid_for,
    out,
):
    """Share left of one part's return, ``out (frequency, pair)``."""
    frequencies, n_pairs = out.shape
    n_antennas = len(antennas)
    stretch, back, pole, along, step = (
        np.empty((3, 3)),
        np.empty((3, 3)),
        np.empty(3),
        np.empty((2, 3)),
        np.empty(3),
    )
    centre = centres[part]
    for f in range(frequencies):
        for pair in range(n_pairs):
            out[f, pair] = 1.0
    if not axes_of_zone(
        tx, rx, centre, frames[part], semi_axes[part], point, laid_for, stretch, back, pole, along
    ):
        return
    cap_t, cap_r, way = np.empty(3), np.empty(3), np.empty(3)
    from_centre(tx, centre, back, way, cap_t)
    from_centre(rx, centre, back, way, cap_r)
    clear = outlines(
        part, centres, frames, semi_axes, antennas, occluders, cap_t, cap_r, stretch, pole, along
    )

    # Area of a cell, without what changes along a meridian.
    y0, y1 = along[0], along[1]
    area = pole[0] * (y0[1] * y1[2] - y0[2] * y1[1])
    area = abs(
        area + pole[1] * (y0[2] * y1[0] - y0[0] * y1[2]) + pole[2] * (y0[0] * y1[1] - y0[1] * y1[0])
    )
    up, side, normal_up, normal_side = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    apply(stretch, pole, up)
    apply_transposed(back, pole, normal_up)
    share, facing = np.empty((n_antennas, CELLS)), np.empty((n_antennas, CELLS))
    length, turns, weight = np.empty(CELLS), np.empty(CELLS), np.empty(CELLS)
    real, imaginary = (
        np.empty((frequencies, n_antennas, CELLS)),
        np.empty((frequencies, n_antennas, CELLS)),
    )
    near = np.empty(n_antennas)
    for a in range(n_antennas):
        subtract(antennas[a], point, way)
        near[a] = math.sqrt(dot(way, way))
    sums = np.zeros((frequencies, n_pairs, 5))
    cosine, sine = np.empty(CELLS), np.empty(CELLS)
    for m in range(MERIDIANS):
        pace, end = meridian((m + 0.5) * 2 * math.pi / MERIDIANS, pole, along, cap_t, cap_r, step)
        turn = end * pace / CELLS
        for j in range(CELLS):
            cosine[j], sine[j] = math.cos((j + 0.5) * turn), math.sin((j + 0.5) * turn)
            weight[j] = sine[j] * turn * area / (pace * pace)
            way_share = (j + 0.5) / CELLS
            if way_share > _TAPER:
                weight[j] *= math.cos(0.5 * math.pi * (way_share - _TAPER) / (1 - _TAPER)) ** 2
        after = (m + 1) % MERIDIANS
        apply(stretch, step, side)
        apply_transposed(back, step, normal_side)
        for a in range(n_antennas):
            # The innermost cell has three corners.
            share[a, 0] = positive_share(clear[m, a, 0], clear[m, a, 1], clear[after, a, 1])
            for j in range(1, CELLS):
                share[a, j] = open_share(
                    clear[m, a, j], clear[m, a, j + 1], clear[after, a, j], clear[after, a, j + 1]
                )
            subtract(antennas[a], centre, way)
            # On the ellipsoid itself normal . point is 1.
            normal_1, normal_2 = dot(normal_up, way), dot(normal_side, way)
            for j in range(CELLS):
                x = way[0] - cosine[j] * up[0] - sine[j] * side[0]
                y = way[1] - cosine[j] * up[1] - sine[j] * side[1]
                z = way[2] - cosine[j] * up[2] - sine[j] * side[2]
                length[j] = math.sqrt(x * x + y * y + z * z)
                facing[a, j] = (cosine[j] * normal_1 + sine[j] * normal_2 - 1) / length[j]
            for f in range(frequencies):
                per_metre = wavenumber[f] / (2 * math.pi)
                for j in range(CELLS):
                    turns[j] = per_metre * (length[j] - near[a])
                _exponential(turns, real[f, a], imaginary[f, a])
                for j in range(CELLS):
                    scale = 1 / length[j] if facing[a, j] > 0 else 0.0
                    real[f, a, j] *= scale
                    imaginary[f, a, j] *= scale
        for f in range(frequencies):
            for pair in range(n_pairs):
                t, r = pairs[pair, 0], pairs[pair, 1]
                re, im = real[f], imaginary[f]
                _add(
                    weight,
                    facing[t],
                    facing[r],
                    re[t],
                    im[t],
                    re[r],
                    im[r],
                    share[t],
                    share[r],
                    sums[f, pair],
                )
    for f in range(frequencies):
        for pair in range(n_pairs):
            one = sums[f, pair]
            if one[4] == 0:
                out[f, pair] = 0.0
            elif one[2] != 0 or one[3] != 0:
                left = 1 - complex(one[2], one[3]) / complex(one[0], one[1])
                out[f, pair] = left / max(1.0, abs(left) / _MOST)


@compiled()
def _zone_shares(
    begin,
    end,
    tx,
    rx,
    points,
    part,
    pose,
    centres,
    frames,
    semi_axes,
    antennas,
    pairs,
    occluders,
    wavenumber,
    laid_for,
    out,
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
            occluders[zone],
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
    occluders: NDArray[np.bool_],
    wavenumber: NDArray[np.float64],
    laid_for: NDArray[np.float64],
) -> NDArray[np.complex128]:
    """Share V that is left of the return of each zone's part, for exp(+j omega t).

    Parameters
    ----------
    tx, rx, points : (zone, 3) float64
        The pair that the zone is laid out for, and its specular point [m].
    part, pose : (zone,) int64
        Which part of the body it is, in which pose.
    poses : (pose, part, 3), (pose, part, 3, 3), (part, 3) float64
        Centres, frames and semi-axes of the whole body [m].
    antennas : (zone, antenna, 3) float64
        [m].
    pairs : (pair, 2) int64
        Tx and Rx among the antennas.
    occluders : (zone, part) bool
        Which parts stand before the zone, for some antenna.
    wavenumber : (zone, frequency) float64
        Where V is wanted [rad/m].
    laid_for : (zone,) float64
        Wavenumber that the zones are laid out for [rad/m].

    Returns
    -------
    (zone, frequency, pair) complex128
        1 in full view, 0 hidden; in between its modulus may pass 1, as it does beyond any edge, but never 2.
    """
    floats = (tx, rx, points, *poses, antennas, wavenumber, laid_for)
    tx, rx, points, centres, frames, semi_axes, antennas, wavenumber, laid_for = (
        np.ascontiguousarray(a, dtype=np.float64) for a in floats
    )
    part, pose, pairs = (np.ascontiguousarray(a, dtype=np.int64) for a in (part, pose, pairs))
    out = np.empty((len(points), wavenumber.shape[1], len(pairs)), dtype=np.complex128)
    occluders = np.ascontiguousarray(occluders)

    def share(begin: int) -> None:
        end = min(begin + _ZONES_A_THREAD, len(points))
        body = centres, frames, semi_axes
        _zone_shares(
            begin,
            end,
            tx,
            rx,
            points,
            part,
            pose,
            *body,
            antennas,
            pairs,
            occluders,
            wavenumber,
            laid_for,
            out,
        )

    in_threads(share, range(0, len(points), _ZONES_A_THREAD))
    return out
