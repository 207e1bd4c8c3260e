"""Echoes over walls: envelopes, amplitudes, delays and fields, and blends of keyframes."""

from __future__ import annotations

import numpy as np

from references.cases import Pair, filled, kernel_case
from references.specular_point import geometry
from rtradar.kernels.elementary import add_blended, cubic_weights, hermite_weights, smoothstep
from rtradar.kernels.scatter.facets import fill_envelope
from rtradar.kernels.scatter.nearby_points import Ellipsoids
from rtradar.kernels.scatter.rooms import (
    Blend,
    EdgeBalls,
    LegAntennas,
    PartPoints,
    PathFactors,
    SlabDelays,
    delayed_lengths,
    outline_near,
    path_amplitudes,
    received_from_conductors,
)

PLACES = 8


# -- envelopes -------------------------------------------------------------------------------------


def _courses() -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """Three neighbouring intervals of an envelope, each known at some of the places."""
    rng, size = np.random.default_rng(0), (9, 3, 5, 21)
    known = rng.uniform(size=(3, 9, 21)) < 0.4
    known[:, [0, 8]] = True
    ratio = rng.normal(size=(3, *size)) + 1j * rng.normal(size=(3, *size))
    ratio[1:, 0] = ratio[:2, 8]
    return tuple((r * k[:, None, None], k) for r, k in zip(ratio, known, strict=True))


def fill_envelope_reference(chirps, fraction, tx, weights, course, strength):
    """Amplitude of `fill_envelope`, in plain NumPy."""
    ratio, slope, known = course
    amplitude = np.zeros((ratio.shape[1], *strength.shape), dtype=complex)
    for chirp, place in zip(chirps, fraction * PLACES, strict=True):
        for part in range(strength.shape[2]):
            places = np.flatnonzero(known[:, part])
            left = places[min(np.searchsorted(places, place, side="right"), len(places) - 1) - 1]
            right = places[places > left][0]
            h = hermite_weights((place - left) / (right - left), right - left)
            y, d = ratio[..., part], slope[..., part]
            value = h[0] * y[left] + h[1] * y[right] + h[2] * d[left] + h[3] * d[right]
            own = weights[tx[chirp]]
            amplitude[:, chirp, :, part] = value @ own.T * strength[chirp, :, part]
    return amplitude


@kernel_case(fill_envelope)
def _envelope() -> Pair:
    rng, (ratio, known) = np.random.default_rng(2), _courses()[1]
    course = ratio, rng.normal(size=ratio.shape) + 0j, known
    tx, weights = np.arange(21) % 6, rng.normal(size=(6, 3, 5))
    strength = rng.normal(size=(21, 3, 21))
    given = np.arange(21), np.arange(21) / 21, tx, weights, course, strength
    out = (np.empty((3, 21, 3, 21), dtype=np.complex128),)
    return filled(fill_envelope, *given, out=out), fill_envelope_reference(*given)


# -- paths -----------------------------------------------------------------------------------------


def path_amplitudes_reference(bare, before, after, at):
    """Amplitudes (node, chirp, rx, echo) of `path_amplitudes`, in plain NumPy."""
    which, line = at.interval, at.line
    fraction = at.fraction[:, None, None, None]
    smooth = smoothstep(fraction)
    seen = (1 - smooth) * before.seen[which, line] + smooth * after.seen[which, line]
    visible = np.einsum("cs,cre,cset->crt", at.tx_weight, at.rx_weight, seen)
    first, last = (np.moveaxis(end.factor, 1, -1)[which, line] for end in (before, after))
    factor = (1 - fraction[..., None]) * first + fraction[..., None] * last
    factor = np.einsum("cs,cre,csetn->ncrt", at.tx_weight, at.rx_weight, factor)
    return bare * visible * np.conj(factor)


@kernel_case(path_amplitudes, 1e-5)
def _path_amplitudes() -> Pair:
    rng, shape = np.random.default_rng(0), (2, 2, 4, 63)
    before, after = (
        PathFactors(
            rng.normal(size=(2, 3, *shape, 2)).astype(np.float32).view(np.complex64)[..., 0],
            rng.random((2, *shape)) > 0.2,
        )
        for _ in range(2)
    )
    interval, line = rng.integers(0, 2, (2, 41))
    ends = rng.random((41, 2)), rng.random((41, 3, 4))
    at = Blend(interval, rng.random(41), line, *ends)
    given, out = (rng.normal(size=(41, 3, 63)), before, after, at), (3, 41, 3, 63)
    found = filled(path_amplitudes, 0, 41, *given, out=(np.empty(out, dtype=np.complex64),))
    return found, path_amplitudes_reference(*given)


def delayed_lengths_reference(antennas, tx_index, points, bodies, delays, length):
    """Lengths (chirp, rx, column) of `delayed_lengths`, in plain NumPy."""
    part = points.part
    size = np.linalg.norm(points.local / bodies.semi_axes[part], axis=-1, keepdims=True)
    places = np.einsum("ceij,cej->cei", bodies.frames[:, part], points.local / size)
    places += bodies.centres[:, part]
    out = length[..., delays.echo].copy()
    for column, legs in enumerate(delays.legs):
        for own, (leg, first, last) in zip(
            (antennas.tx[:, :, None], antennas.rx), legs, strict=True
        ):
            way = places[:, None, delays.echo[column]] - own[leg, tx_index]
            for passes, slab in zip(
                delays.passes[first:last], delays.slabs[first:last], strict=True
            ):
                cosine = np.abs(way @ slab[:3]) / np.linalg.norm(way, axis=-1)
                inside = passes * np.sqrt(slab[4] - 1 + cosine**2)
                out[..., column] += slab[3] * (inside - passes % 2 * cosine)
    return out


@kernel_case(delayed_lengths)
def _delayed_lengths() -> Pair:
    rng, at = np.random.default_rng(0), geometry(21, 3, 21)
    antennas = LegAntennas(*(rng.normal(-5, 1, shape) for shape in ((2, 4, 3), (2, 4, 3, 3))))
    points = PartPoints(rng.normal(size=(21, 63, 3)), np.arange(63) % 21)
    slabs = [[1.0, 0, 0, 0.1, 4.0], [0, 0.6, 0.8, 0.2, 3.0], [0, 1.0, 0, 0.05, 2.5]]
    # Without a slab, with two of them on the way out, and with one on each way.
    legs = [[[0, 0, 0], [1, 0, 0]], [[0, 0, 2], [0, 2, 2]], [[1, 1, 2], [0, 2, 3]]] * 21
    passes = np.array([1, 2, 3])
    delays = SlabDelays(np.arange(63), np.array(legs), passes, np.array(slabs))
    bodies, tx = Ellipsoids(*at[2:]), rng.integers(0, 4, 21)
    given = antennas, tx, points, bodies, delays, 8 + rng.random((21, 3, 63))
    found = filled(delayed_lengths, 0, 21, *given, out=(np.empty((21, 3, 63)),))
    return found, delayed_lengths_reference(*given)


# -- edges of solids -------------------------------------------------------------------------------


def outline_near_reference(origins, ways, later_m, edges):
    """Legs and edges (2, pair) of `outline_near`, in plain NumPy."""
    square = (ways**2).sum(axis=1, keepdims=True)
    wide = np.sqrt(later_m * (2 * np.sqrt(square) + later_m)) / 2

    def beside(centres, radii):
        away = centres - origins[:, None]
        place = np.clip((away * ways[:, None]).sum(axis=2) / square, 0, 1)
        return np.linalg.norm(away - place[..., None] * ways[:, None], axis=2) < radii + wide

    near = beside(edges.centre[None], edges.radius) & beside(edges.middles, edges.radii)
    one, other = (ways @ edges.normals[:, face].T > 0 for face in range(2))
    return np.stack(np.nonzero(near & (one != other)))


@kernel_case(outline_near)
def _outline_near() -> Pair:
    rng = np.random.default_rng(0)
    middles, normals = rng.normal(size=(90, 3)), rng.normal(size=(90, 2, 3))
    edges = EdgeBalls(np.zeros(3), 2.0, middles, rng.uniform(0, 0.3, 90), normals)
    given = rng.normal(size=(900, 3)), 3 * rng.normal(size=(900, 3)), 0.075, edges
    found = outline_near(*given)
    assert 1024 < found.shape[1] < 900 * 90 / 4
    return found, outline_near_reference(*given)


# -- fields ----------------------------------------------------------------------------------------


def _unit_vectors(rng: np.random.Generator, *shape: int) -> np.ndarray:
    vectors = rng.normal(size=(*shape, 3))
    return vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)


def _fields(rng: np.random.Generator, *shape: int) -> np.ndarray:
    return rng.normal(size=(*shape, 3, 2)).view(np.complex128)[..., 0]


def received_from_conductors_reference(sent, received, to_tx, to_rx):
    """What `received_from_conductors` fills, in plain NumPy."""
    normals = to_tx[:, :, :, None] + to_rx[:, :, None]
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    straight = np.einsum("nkltec,nklrec->nkltre", sent, received)
    of_sent = np.einsum("nkltec,kltrec->nkltre", sent, normals)
    return 2 * of_sent * np.einsum("nklrec,kltrec->nkltre", received, normals) - straight


@kernel_case(received_from_conductors)
def _received_from_conductors() -> Pair:
    rng, ends = np.random.default_rng(0), (8, 2, 2, 63)
    given = *(_fields(rng, 3, *ends) for _ in "tr"), *(_unit_vectors(rng, *ends) for _ in "tr")
    out = (np.empty((3, 8, 2, 2, 2, 63), dtype=np.complex128),)
    found = filled(received_from_conductors, 0, 8, *given, out=out)
    return found, received_from_conductors_reference(*given)


# -- static clutter --------------------------------------------------------------------------------


def add_blended_reference(tx, weights, keyframes, whole):
    """`add_blended` to zeros."""
    return whole[tx] - np.einsum("ck,kcv->cv", weights, keyframes[:, tx])


@kernel_case(add_blended, 1e-5)
def _add_blended() -> Pair:
    rng = np.random.default_rng(0)
    fields = rng.normal(size=(5, 4, 301, 2)).view(np.complex128)[..., 0].astype(np.complex64)
    weights = cubic_weights(np.linspace(0, 1, 50)).astype(np.float32)
    given, out = (np.arange(50) % 4, weights, fields[:4], fields[4]), np.empty((50, 301), "c8")
    return filled(add_blended, *given, out=(out,), adds=True), add_blended_reference(*given)
