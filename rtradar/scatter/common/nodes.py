"""Chebyshev nodes of the sweep, and the polynomial through values at nodes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.radar import Radar

Array = NDArray[np.float64]


def sweep_nodes(radar: Radar, count: int) -> Array:
    """Chebyshev nodes of the sweep, the zeros of the Chebyshev polynomial of that degree over it.

    Parameters
    ----------
    radar : Radar
    count : int
        Number of nodes.

    Returns
    -------
    (node,) float64
        Frequencies in ascending order [Hz].
    """
    place = -np.cos((np.arange(count) + 0.5) * np.pi / count)
    return np.asarray(radar.centre_frequency_hz + radar.bandwidth_hz / 2 * place)


def interpolation_weights(nodes: Array, places: Array) -> Array:
    """Values at some places of the Lagrange polynomials of nodes.

    Their product with values at the nodes is the polynomial through these. SciPy's barycentric form
    takes the nodes in a random order: its last bits would change from one run to the next.

    Parameters
    ----------
    nodes : (node,) float64
        All different, in any unit.
    places : (place,) float64
        Positions at which to interpolate, in the unit of the nodes.

    Returns
    -------
    (place, node) float64
    """
    others = ~np.eye(len(nodes), dtype=bool)
    columns = [
        np.prod((places[:, None] - nodes[own]) / (node - nodes[own]), axis=1)
        for node, own in zip(nodes, others, strict=True)
    ]
    return np.stack(columns, axis=1)
