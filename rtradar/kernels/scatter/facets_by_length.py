"""The physical-optics integral over facets that move fast, shared among echoes of fixed spacing.

The integral is that of `rtradar.kernels.scatter.facets`, with the exact phase at each chirp. What a
facet returns is shared between the two echoes whose lengths are next to its path, by weights that
add up to 1 and change smoothly. Each share is turned back to the length of its echo, so that their
sum is exact at every frequency where it is computed, and little phase is left over the sweep. A
facet over which the path changes so much that its phase varies over the sweep is taken apart into
its edges, and an edge into its ends: the mean of exp(-jk p) over a triangle with p = a <= b <= c at
its corners is

    2 j / (k (c - a)) * (E(b, c) - E(a, b)),  E(x, y) = exp(-jk (x + y) / 2) sinc(k (y - x) / 2)
                                                      = j (exp(-jky) - exp(-jkx)) / (k (y - x)).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import dot, fast_phasor, smoothstep
from rtradar.kernels.jit import compiled, inlined
from rtradar.kernels.scatter.triangles import (
    FAST,
    SERIES,
    by_series,
    excess_paths,
    mean_of_phasor,
)

Array = NDArray[np.float64]

_MOST_TURN = 1.0
"""Phase [rad] that may change over half the sweep between the ends of one piece of a facet."""

_OVER_ROOT_PI = 1 / math.sqrt(math.pi)

_BOWED = 0.75
"""Part of the bow of a path over a triangle, from its corners to its middle, in the mean path."""


class RigidFacets(NamedTuple):
    """Facets of a rigid mesh in its own axes, about a point of reference.

    ``vertices (3, vertex)`` [m], of which the last are the middles of the facets in their order;
    ``faces (facet, 3)`` int64; ``normals (facet, 3)``; ``planes (facet,)``, the product of normal
    and any of the corners [m]; ``areas (facet,)`` [m^2]. With ``both_sides`` they are a sheet.
    """

    vertices: Array
    faces: NDArray[np.int64]
    normals: Array
    planes: Array
    areas: Array
    both_sides: bool


class RigidViews(NamedTuple):
    """Tasks: a Tx and its Rx at one instant, in the axes of the mesh [m].

    ``tx (task, 3)``, ``rx (task, rx, 3)``. Between the keyframes ``before (task,)`` and ``after
    (task,)`` the task is at ``fraction (task,)``; ``seen (keyframe, place, facet)`` float32 is the
    visibility from places of the array, whose weights in the antennas are ``tx_weight (task,
    place)`` and ``rx_weight (task, rx, place)``; ``factor (keyframe, 3, facet)`` is what the
    material, walls and antennas make of the field of a conductor at the three wavenumbers.
    """

    tx: Array
    rx: Array
    before: NDArray[np.int64]
    after: NDArray[np.int64]
    fraction: Array
    seen: NDArray[np.float32]
    tx_weight: Array
    rx_weight: Array
    factor: NDArray[np.complex128]


class LengthGrid(NamedTuple):
    """Echoes: paths ``(first + number) * step`` longer than that over the point of reference [m].

    ``wavenumber (3,)`` [rad/m] are evenly spaced; ``sweep`` is half the sweep over its middle, and
    ``back (3,)`` exp(-jk step).
    """

    first: int
    step: float
    wavenumber: Array
    sweep: float
    back: NDArray[np.complex128]


@inlined(fastmath=FAST)
def _put(out, path, grid, value):
    """Share the fields ``value (3,)`` exp(-jk path) between two echoes of ``out (3, echo)``.

    They are added as conjugates, turned back to the lengths of the echoes. The three wavenumbers
    are evenly spaced.
    """
    # The echo whose length is next below the path, and the share of the one above.
    place = path / grid.step - grid.first
    cell = math.floor(place)
    after = smoothstep(place - cell)
    beyond = (place - cell) * grid.step
    # The field turned back to the length of the lower echo, at the middle wavenumber; for the other
    # two by the difference of the wavenumbers.
    re, im = fast_phasor(grid.wavenumber[1] * beyond)
    turn = complex(re, im)
    re, im = fast_phasor((grid.wavenumber[2] - grid.wavenumber[1]) * beyond)
    apart = complex(re, im)
    for node in range(3):
        own = turn * value[node].conjugate()
        own *= apart.conjugate() if node == 0 else (apart if node == 2 else 1.0 + 0.0j)
        out[node, cell] += (1 - after) * own
        out[node, cell + 1] += after * grid.back[node] * own


@inlined(fastmath=FAST)
def _put_edge(out, low, high, grid, apart, value, field):
    """Do the same for ``value (3,)`` E(low, high), taken ``apart`` into its ends or whole."""
    for node in range(3):
        # The ends radiate as the difference of two exponentials, the whole edge as a sinc.
        k = grid.wavenumber[node]
        if apart:
            field[node] = value[node] * complex(0.0, 1.0 / (k * (high - low)))
        else:
            half = 0.5 * k * (high - low)
            field[node] = value[node] * (math.sin(half) / half if half > 1e-6 else 1.0)
    if apart:
        _put(out, high, grid, field)
        for node in range(3):
            field[node] = -field[node]
        _put(out, low, grid, field)
    else:
        _put(out, 0.5 * (low + high), grid, field)


@inlined(fastmath=FAST)
def _put_facet(out, mean, u, v, grid, strength, factor, field, value):
    """Share the field of a facet (3, echo): its mean path, and those of two corners less it.

    Its strength is that of a conductor, to be multiplied by ``factor (3,)``; ``field`` and ``value
    (3,)`` are room to work in.
    """
    w, spread = -u - v, u * u + u * v + v * v
    low, high = min(u, min(v, w)), max(u, max(v, w))
    middle = -low - high
    # By how many radians the phase of a path changes over half the sweep, over what is allowed.
    many = grid.wavenumber[1] * grid.sweep / _MOST_TURN
    # The path changes little over the facet: its field is one term, of the mean path.
    if (high - low) * many <= 1.0:
        for node in range(3):
            k = grid.wavenumber[node]
            if spread * k * k < SERIES:
                re, im = by_series(-k * u, -k * v)
            else:
                re, im = mean_of_phasor(k * u, k * v, k * w)
            field[node] = factor[node] * complex(-im * k, re * k) * (strength * _OVER_ROOT_PI)
        _put(out, mean, grid, field)
        return
    for node in range(3):
        # j k times 2 j / (k (high - low)).
        value[node] = factor[node] * (-2.0 * strength * _OVER_ROOT_PI / (high - low))
    # Each of the two edges is taken apart in turn if the path still changes much over it.
    upper, lower = (high - middle) * many > 1.0, (middle - low) * many > 1.0
    _put_edge(out, mean + middle, mean + high, grid, upper, value, field)
    for node in range(3):
        value[node] = -value[node]
    _put_edge(out, mean + low, mean + middle, grid, lower, value, field)


@inlined(fastmath=FAST)
def _blend(before, after, fraction, weight, out):
    """Fill ``out (facet,)`` with the weighted visibility (place, facet) between two keyframes."""
    for f in range(len(out)):
        out[f] = 0.0
    for place in range(len(weight)):
        if weight[place] != 0:
            for f in range(len(out)):
                seen = before[place, f] + fraction * (after[place, f] - before[place, f])
                out[f] += weight[place] * seen


@compiled()
def facets_by_length(begin, end, facets, views, grid, spreading, out):
    """Add to ``out (task, rx, node, echo)`` amplitudes as in `Echoes` [m], from begin to end."""
    n_facets, n_vertices = len(facets.faces), facets.vertices.shape[1]
    middle, (x, y, z) = n_vertices - n_facets, facets.vertices
    field, value = np.empty(3, dtype=np.complex128), np.empty(3, dtype=np.complex128)
    to_tx, to_rx = np.empty(n_vertices), np.empty(n_vertices)
    open_tx, open_rx, facing = np.empty(n_facets), np.empty(n_facets), np.empty(n_facets)
    factor, lit = np.empty((n_facets, 3), np.complex128), np.empty(n_facets, np.int64)
    for task in range(begin, end):
        # The visibility from Tx, and the facets that it lights, are the same for all receivers.
        fraction = smoothstep(views.fraction[task])
        before, after = views.seen[views.before[task]], views.seen[views.after[task]]
        first, last = views.factor[views.before[task]], views.factor[views.after[task]]
        tx = views.tx[task]
        far_tx = excess_paths(tx, x, y, z, to_tx)
        _blend(before, after, fraction, views.tx_weight[task], open_tx)
        count = 0
        for f in range(n_facets):
            normal = facets.normals[f]
            height = dot(normal, tx) - facets.planes[f]
            if open_tx[f] > 0 and (height > 0 or facets.both_sides):
                facing[f] = height / (far_tx + to_tx[middle + f])
                # What walls, material and antennas make of a conductor's field, between both
                # keyframes.
                for node in range(3):
                    begins = first[node, f]
                    factor[f, node] = begins + fraction * (last[node, f] - begins)
                lit[count] = f
                count += 1
        for r in range(views.rx.shape[1]):
            rx = views.rx[task, r]
            far_rx = excess_paths(rx, x, y, z, to_rx)
            _blend(before, after, fraction, views.rx_weight[task, r], open_rx)
            for f in lit[:count]:
                normal, far_r = facets.normals[f], far_rx + to_rx[middle + f]
                along = (dot(normal, rx) - facets.planes[f]) / far_r
                # Tx and Rx are on one side of the facet, which is the outside of a closed mesh.
                if open_rx[f] <= 0 or along * facing[f] <= 0:
                    continue
                # The reciprocal obliquity; a facet returns no more than the antenna that sees less
                # of it.
                size = abs(along + facing[f]) / 2 * min(open_tx[f], open_rx[f]) * facets.areas[f]
                if spreading:
                    size /= (far_tx + to_tx[middle + f]) * far_r
                # The paths over the corners are taken as linear, and the middle of the facet gives
                # their bow.
                a, b, c = facets.faces[f, 0], facets.faces[f, 1], facets.faces[f, 2]
                first_path, second_path = to_tx[a] + to_rx[a], to_tx[b] + to_rx[b]
                mean = (first_path + second_path + to_tx[c] + to_rx[c]) / 3
                bow = _BOWED * (to_tx[middle + f] + to_rx[middle + f] - mean)
                u, v = first_path - mean, second_path - mean
                own = factor[f]
                _put_facet(out[task, r], mean + bow, u, v, grid, size, own, field, value)
