"""Sets of echoes: some of them, several together, and their amplitudes at other frequencies."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.echoes import Echoes
from rtradar.scatter.common.interpolation import interpolation_weights

Array = NDArray[np.float64]


def at_nodes(amplitude: NDArray[Any], frequency: Array, nodes: Array) -> NDArray[Any]:
    """Evaluate amplitudes (node, ...), polynomials through a frequency (node,), at others [Hz]."""
    if len(frequency) == 1:
        return np.broadcast_to(amplitude, (len(nodes), *amplitude.shape[1:]))
    if np.array_equal(frequency, nodes):
        return amplitude
    weights = interpolation_weights(frequency, nodes).astype(amplitude.real.dtype)
    # Not by BLAS, whose threads cost more than these few sums.
    pairs = zip(weights.T, amplitude, strict=True)
    return np.asarray(sum(np.multiply.outer(weight, own) for weight, own in pairs))


def take(echoes: Echoes, which: NDArray[np.int64]) -> Echoes:
    """Return some of the echoes, each as often as ``which (echo,)`` names it.

    Of neighbours the arrays are views.
    """
    side_by_side = len(which) > 0 and bool(np.all(np.diff(which) == 1))
    some = slice(int(which[0]), int(which[-1]) + 1) if side_by_side else which
    return dataclasses.replace(
        echoes,
        length=echoes.length[..., some],
        amplitude=echoes.amplitude[..., some],
        part=echoes.part[some],
        bounces=echoes.bounces[some],
        path=echoes.path[some],
    )


def weakest(power: Array, most: float) -> NDArray[np.bool_]:
    """Whether each is among the weakest, whose powers (echo,) add up to at most so much [m^2]."""
    order = np.argsort(power)
    among = np.empty(len(power), dtype=bool)
    among[order] = np.cumsum(power[order], dtype=np.float64) <= most
    return among


def times_factor(echoes: Echoes, frequency: Array, factor: NDArray[Any]) -> Echoes:
    """Multiply amplitudes by a factor (node, chirp, rx, echo), a polynomial through a frequency.

    The nodes of the product are the more numerous of both: what walls and a body change over the
    sweep is little.
    """
    nodes = max(echoes.frequency, frequency, key=len)
    own = at_nodes(echoes.amplitude, echoes.frequency, nodes)
    return dataclasses.replace(
        echoes, amplitude=own * at_nodes(factor, frequency, nodes), frequency=nodes
    )


def together(several: Sequence[Echoes]) -> Echoes:
    """Put echoes of the same chirps one after the other, at the most numerous of their nodes.

    The polynomials of the others are evaluated there, which changes nothing. Parts keep their
    numbers.
    """
    first, nodes = several[0], max((own.frequency for own in several), key=len)
    amplitudes = [at_nodes(own.amplitude, own.frequency, nodes) for own in several]
    return Echoes(
        length=np.concatenate([own.length for own in several], axis=2),
        amplitude=np.concatenate(amplitudes, axis=3),
        frequency=nodes,
        tx=first.tx,
        part=np.concatenate([own.part for own in several]),
        bounces=np.concatenate([own.bounces for own in several]),
        path=np.concatenate([own.path for own in several]),
    )
