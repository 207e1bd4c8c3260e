"""Kernels of fields, as complex vectors: what slabs and conducting bodies make of them."""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import cross, dot, least_axis, minus, plus, scaled, with_length
from rtradar.kernels.jit import compiled, inlined

_NORMAL_INCIDENCE = 1e-9
"""Sine of incidence below which the plane of incidence has no direction of its own."""


class SlabPass(NamedTuple):
    """One term of what a slab with a unit ``normal (3,)`` does, at the frequencies of some nodes.

    ``eta (node,)`` complex is its relative permittivity, infinite for a perfect conductor,
    ``wavenumber (node,)`` that of air [rad/m]; ``passes`` and ``rest`` are those of
    `rtradar.scene.slab.slab_passes`. ``thickness`` and ``roughness`` are in metres, the latter
    counts in reflection alone. With ``index_squared`` the phase of the delay is taken out, with 0
    that of the same way through air.
    """

    normal: NDArray[np.float64]
    eta: NDArray[np.complex128]
    wavenumber: NDArray[np.float64]
    thickness: float
    roughness: float
    index_squared: float
    passes: int
    rest: bool


@inlined()
def _term(face, once, slab):
    """Term of the series from the reflection of a face and the factor of one pass."""
    number = slab.passes if slab.passes else 2
    power = once
    for _ in range(number - 1):
        power *= -face * once
    term = (1 - face * face) * power
    if slab.rest:
        loop = 1 - face * face * once * once
        # Exactly grazing, a slab of whole half waves is transparent.
        if loop == 0:
            return once if slab.passes == 1 else 0j
        term /= loop
    if slab.passes == 0:
        return face + term if slab.rest else face
    return term


@inlined()
def _coefficients(cosine, node, slab):
    """TE and TM coefficient of a slab, without the phase that is taken out."""
    eta, wavenumber, odd = slab.eta[node], slab.wavenumber[node], slab.passes % 2
    rough = 0.0 if odd else wavenumber * slab.roughness * cosine
    lost = math.exp(-2 * rough * rough)
    if cmath.isinf(eta):
        return (-lost + 0j, lost + 0j) if slab.passes == 0 else (0j, 0j)
    inner = cmath.sqrt(eta - 1 + cosine * cosine)
    if inner.imag > 0:
        inner = -inner
    total, of_tm = cosine + inner, eta * cosine + inner
    te = (cosine - inner) / total if total != 0 else 0j
    tm = (eta * cosine - inner) / of_tm if of_tm != 0 else 0j
    once = cmath.exp(-1j * wavenumber * slab.thickness * inner)
    extra = slab.thickness * cosine * odd
    if slab.index_squared > 0:
        within = math.sqrt(slab.index_squared - 1 + cosine * cosine)
        extra = slab.passes * slab.thickness * within
    taken = lost * cmath.exp(1j * wavenumber * extra)
    return _term(te, once, slab) * taken, _term(tm, once, slab) * taken


@compiled()
def slab_fields(field, ways, slab, out):
    """Fill ``out (node, wave, 3)`` complex128 with fields after one `SlabPass`.

    The incident ``field (node, wave, 3)`` travels along the unit vectors ``ways (wave, 3)``. Even
    numbers of passes reflect it, odd ones let it through.
    """
    nodes, waves, _ = out.shape
    normal = slab.normal
    # At normal incidence both coefficients do the same: any direction across the ray serves.
    spare, _ = with_length(cross(normal, least_axis(normal)))
    for wave in range(waves):
        way = ways[wave]
        along = dot(way, normal)
        leaving = minus(way, scaled(normal, 2 * along if slab.passes % 2 == 0 else 0.0))
        across, sine = with_length(cross(way, normal))
        across = across if sine > _NORMAL_INCIDENCE else spare
        up, up_after = cross(across, way), cross(across, leaving)
        for node in range(nodes):
            te, tm = _coefficients(min(abs(along), 1.0), node, slab)
            te *= dot(field[node, wave], across)
            tm *= dot(field[node, wave], up)
            for i in range(3):
                out[node, wave, i] = te * across[i] + tm * up_after[i]


@compiled()
def received_from_conductors(start, stop, sent, received, to_tx, to_rx, out):
    """Fill ``out (node, keyframe, line, tx_end, rx_end, echo)`` with what conductors send back.

    Keyframes ``start`` to ``stop`` are filled. The field ``sent (node, keyframe, line, tx_end,
    echo, 3)`` arrives, ``received (node, keyframe, line, rx_end, echo, 3)`` is what the receiver
    would send; ``to_tx (keyframe, line, tx_end, echo, 3)`` and ``to_rx (keyframe, line, rx_end,
    echo, 3)`` are unit vectors towards where they come from. A conductor across the bisector n of
    both returns 2 (n.E) n - E; where they are opposite, n is 0.
    """
    nodes, _, lines, tx_ends, rx_ends, echoes = out.shape
    for keyframe in range(start, stop):
        for line in range(lines):
            for one in range(tx_ends):
                for other in range(rx_ends):
                    for echo in range(echoes):
                        a, b = to_tx[keyframe, line, one, echo], to_rx[keyframe, line, other, echo]
                        normal = plus(a, b)
                        square = dot(normal, normal)
                        scale = 2 / square if square > 1e-24 else 0.0
                        for node in range(nodes):
                            e = sent[node, keyframe, line, one, echo]
                            f = received[node, keyframe, line, other, echo]
                            value = scale * dot(e, normal) * dot(f, normal) - dot(e, f)
                            out[node, keyframe, line, one, other, echo] = value
