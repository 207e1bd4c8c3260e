"""Currents over the edges of flat triangles, and their products with the fields of antennas.

A current flows across each edge, from one triangle into the other (S. M. Rao, D. R. Wilton, A. W.
Glisson, IEEE Trans. Antennas Propag. 30, 1982).
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from rtradar.kernels.elementary import dot, fast_phasor, minus, turned_back
from rtradar.kernels.jit import compiled


class Triangles(NamedTuple):
    """Triangles, and the currents over their edges: edge i is opposite to corner i."""

    corners: Any  # (triangle, corner, 3) [m]
    faces: Any  # (triangle, corner) int64: which corners are one and the same
    normals: Any  # (triangle, 3), outward
    areas: Any  # (triangle,) [m^2]
    scales: Any  # (triangle, edge): length of the edge over twice the area, signed [1/m]


class Orbits(NamedTuple):
    """How the currents combine to ones of even or odd parity at the mirror planes."""

    tested: Any  # (tested,) int64: one triangle of each set of mirror images
    weights: Any  # (tested,): one over the number of reflections that keep it
    unknown: Any  # (triangle, edge) int64
    parity: Any  # (parity, triangle, edge): 1, -1, or 0 where there is no such current


class Rules(NamedTuple):
    """Quadrature of one triangle, and of two."""

    places: Any  # (point, corner): barycentric
    weights: Any  # (point,), their sum is 1
    pairs: Any  # four of (pair of points, 7): barycentric on both, and weights whose sum is 1, for
    # triangles that share nothing, a corner, an edge, or all


class Equation(NamedTuple):
    """Wavenumber [1/m], and the weight of the electric field beside the magnetic one."""

    wavenumber: float
    electric: float


@compiled(fastmath={"reassoc", "contract", "nsz", "arcp"})
def fill_moments(triangles, edge_of, rules, equation, antennas, out):
    """Add to ``out (2, antenna, edge)`` the products of each current with the field of a dipole.

    The ``antennas (antenna, 2, 3)`` are positions [m] and unit moments; their fields are those of
    `rtradar.full_wave.antennas.Dipole`. First is the product with the electric field, then that
    with the field that the equation has on its other side.
    """
    k, electric = equation.wavenumber, equation.electric
    for antenna in range(len(antennas)):
        position, moment = antennas[antenna, 0], antennas[antenna, 1]
        from_origin = math.sqrt(dot(position, position))
        for t in range(len(triangles.areas)):
            corners, normal = triangles.corners[t], triangles.normals[t]
            n_moment = dot(normal, moment)
            for p in range(len(rules.weights)):
                point = turned_back(corners, rules.places[p])
                away = minus(point, position)
                distance = math.sqrt(dot(away, away))
                # The path beyond that to the origin, without the cancellation of far antennas.
                squares = dot(point, point) - 2 * dot(point, position)
                cosine, sine = fast_phasor(-k * squares / (distance + from_origin))
                wave = complex(cosine, sine) * (from_origin / distance)
                inverse = 1 / (k * distance)
                n_unit, along = dot(normal, away) / distance, dot(moment, away) / distance
                # Parts along the moment and along the ray, of both fields.
                magnetic = (1 - electric) * complex(1.0, -inverse)
                by_moment = complex(1 - inverse**2, -inverse)
                by_ray = -along * complex(1 - 3 * inverse**2, -3 * inverse)
                weight = rules.weights[p] * triangles.areas[t]
                for i in range(3):
                    place = minus(point, corners[i])
                    m, u = dot(place, moment), dot(place, away) / distance
                    shape = wave * (weight * triangles.scales[t, i])
                    field = by_moment * m + by_ray * u
                    jump = magnetic * (u * n_moment - m * n_unit)
                    out[0, antenna, edge_of[t, i]] += shape * field
                    out[1, antenna, edge_of[t, i]] += shape * (electric * field + jump)
