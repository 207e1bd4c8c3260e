"""Kernels of fields, as complex vectors: what slabs and conducting bodies make of them."""

from __future__ import annotations

import cmath
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.kernels.elementary import dot
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


@inlined()
def _cross(a, b, out):
    out[0] = a[1] * b[2] - a[2] * b[1]
    out[1] = a[2] * b[0] - a[0] * b[2]
    out[2] = a[0] * b[1] - a[1] * b[0]


@compiled()
def slab_fields(field, ways, slab, out):
    """Fill ``out (node, wave, 3)`` complex128 with fields after one `SlabPass`.

    The incident ``field (node, wave, 3)`` travels along the unit vectors ``ways (wave, 3)``. Even
    numbers of passes reflect it, odd ones let it through.
    """
    nodes, waves, _ = out.shape
    # Rows of one array are of one type: for each other Numba would compile `_cross` again.
    normal, way, across, up, leaving, up_after, axis, spare = np.zeros((8, 3))
    least = 0
    for i in range(3):
        normal[i] = slab.normal[i]
        if abs(normal[i]) < abs(normal[least]):
            least = i
    # At normal incidence both coefficients do the same: any direction across the ray serves.
    axis[least] = 1
    _cross(normal, axis, spare)
    size = math.sqrt(dot(spare, spare))
    for wave in range(waves):
        for i in range(3):
            way[i] = ways[wave, i]
        along = dot(way, normal)
        bend = 2 * along if slab.passes % 2 == 0 else 0.0
        for i in range(3):
            leaving[i] = way[i] - bend * normal[i]
        _cross(way, normal, across)
        sine = math.sqrt(dot(across, across))
        for i in range(3):
            across[i] = across[i] / sine if sine > _NORMAL_INCIDENCE else spare[i] / size
        _cross(across, way, up)
        _cross(across, leaving, up_after)
        for node in range(nodes):
            te, tm = _coefficients(min(abs(along), 1.0), node, slab)
            own = field[node, wave]
            te *= own[0] * across[0] + own[1] * across[1] + own[2] * across[2]
            tm *= own[0] * up[0] + own[1] * up[1] + own[2] * up[2]
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
    normal = np.empty(3)
    for keyframe in range(start, stop):
        for line in range(lines):
            for one in range(tx_ends):
                for other in range(rx_ends):
                    for echo in range(echoes):
                        a, b = to_tx[keyframe, line, one, echo], to_rx[keyframe, line, other, echo]
                        for i in range(3):
                            normal[i] = a[i] + b[i]
                        square = dot(normal, normal)
                        scale = 2 / square if square > 1e-24 else 0.0
                        for node in range(nodes):
                            e = sent[node, keyframe, line, one, echo]
                            f = received[node, keyframe, line, other, echo]
                            straight = e[0] * f[0] + e[1] * f[1] + e[2] * f[2]
                            of_e = e[0] * normal[0] + e[1] * normal[1] + e[2] * normal[2]
                            of_f = f[0] * normal[0] + f[1] * normal[1] + f[2] * normal[2]
                            value = scale * of_e * of_f - straight
                            out[node, keyframe, line, one, other, echo] = value
