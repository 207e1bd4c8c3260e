"""At how many frequencies of the sweep the coefficients of walls must be known."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.radar import Radar
from rtradar.scene import Wall, slab
from rtradar.scene.slab import Polarization

_MOST_NODES = 3
_ENOUGH = 0.01
"""What the polynomial through the nodes may be off by, of an incident field of 1: a ghost's own error is larger."""


def frequency_nodes(walls: Sequence[Wall], radar: Radar) -> NDArray[np.float64]:
    """The fewest Chebyshev nodes through which a polynomial follows all coefficients of all walls over the sweep.

    Both faces of a slab reflect, so its coefficient ripples with c / 2nd: 7 GHz for plasterboard of 12.5 mm.

    Parameters
    ----------
    walls : sequence of Wall
    radar : Radar

    Returns
    -------
    (node,) float64
        [Hz]; the middle of the sweep alone where nothing changes. At most 3, for one pass of `synthesize` takes so many.
    """
    dense = chebyshev(radar, 33)
    wanted = _coefficients(walls, dense)
    for count in range(1, _MOST_NODES):
        nodes = chebyshev(radar, count)
        if np.abs(_through(nodes, dense) @ _coefficients(walls, nodes) - wanted).max(initial=0.0) < _ENOUGH:
            return nodes
    return chebyshev(radar, _MOST_NODES)


def chebyshev(radar: Radar, count: int) -> NDArray[np.float64]:
    """Chebyshev nodes in the sweep, ascending (node,) [Hz]."""
    place = -np.cos((np.arange(count) + 0.5) * math.pi / count)
    return np.asarray(radar.centre_frequency_hz + radar.bandwidth_hz / 2 * place)


def _coefficients(walls: Sequence[Wall], frequency: NDArray[np.float64]) -> NDArray[np.complex128]:
    """All of them at several angles of incidence, (node, coefficient)."""
    cosine = np.linspace(0.2, 1.0, 9)
    rows = [np.zeros((len(frequency), 0), dtype=np.complex128)]
    for wall in walls:
        if wall.material.conducts:
            continue
        eta = wall.material.eta(frequency)[:, None]
        air = np.exp(2j * np.pi * frequency[:, None] / SPEED_OF_LIGHT_MPS * wall.thickness_m * cosine)
        polarizations: tuple[Polarization, ...] = ("te", "tm")
        for kind in polarizations:
            reflected, transmitted = slab(eta, wall.thickness_m, frequency[:, None], cosine, kind)
            rows += [reflected, transmitted * air]
    return np.concatenate(rows, axis=1)


def _through(nodes: NDArray[np.float64], dense: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values (dense, node) of the Lagrange polynomials of the nodes."""
    others = ~np.eye(len(nodes), dtype=bool)
    columns = [np.prod((dense[:, None] - nodes[own]) / (nodes[i] - nodes[own]), axis=1) for i, own in enumerate(others)]
    return np.stack(columns, axis=1)
