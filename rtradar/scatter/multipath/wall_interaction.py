"""What walls do to a wave: mirror images, and the field after a reflection or a passage, as a vector.

Walls are rectangles in float64, so nothing of this is traced. A wave carries its electric field as a complex 3-vector, for
exp(+j omega t), without the phase of its straight path through air: a wall splits it into TE and TM by the plane of incidence
and multiplies each by the coefficient of its slab. Edges are sharp: they send no diffracted wave.

A wall has two faces. Its front is the rectangle itself; waves that come from behind meet the back, one thickness deeper.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.scatter.common.polarization import apply_te_tm
from rtradar.scatter.multipath.slab_series import WHOLE, Term, WallSeries
from rtradar.scene import Scene, Wall
from rtradar.scene.slab import Polarization

Array = NDArray[np.float64]
Field = NDArray[np.complex128]
Series = Sequence[WallSeries]
Waves = list["Wave"]
_POLARIZATIONS: tuple[Polarization, ...] = ("te", "tm")


def height(wall: Wall, points: Array, *, back: bool = False) -> Array:
    """Height of points (..., 3) [m] above the front, or above the back, away from the slab; (...) [m]."""
    above = (np.asarray(points) - np.array(wall.corner_m)) @ wall.normal
    return np.asarray(-above - wall.thickness_m if back else above)


def image(wall: Wall, points: Array, *, back: bool = False) -> Array:
    """Mirror images (..., 3) of points (..., 3) in the plane of the front, or of the back [m].

    Equation :eq:`image` of the theory page.
    """
    normal = -wall.normal if back else wall.normal
    return np.asarray(points - 2 * height(wall, points, back=back)[..., None] * normal)


def inside(wall: Wall, points: Array, margin_m: float = 0.0) -> NDArray[np.bool_]:
    """Whether points (..., 3) [m], dropped onto the front along its normal, lie within the rectangle, or so near to it."""
    away = np.asarray(points) - np.array(wall.corner_m)
    within = np.ones(away.shape[:-1], dtype=bool)
    for edge in (np.array(wall.edge_u_m), np.array(wall.edge_v_m)):
        length = np.linalg.norm(edge)
        along = away @ (edge / length)
        within &= (along >= -margin_m) & (along <= length + margin_m)
    return within


def specular_point(
    wall: Wall, origins: Array, targets: Array, *, back: bool = False
) -> tuple[Array, NDArray[np.bool_]]:
    """Where a wave from an origin to a target is reflected.

    Parameters
    ----------
    wall : Wall
    origins, targets : (..., 3) float64
        World [m]; they broadcast.
    back : bool
        Whether the back reflects, in place of the front.

    Returns
    -------
    point : (..., 3) float64
        On the plane of that face [m]; NaN where the two are on different sides of it.
    valid : (...) bool
        Whether both stand before that face and the point lies in the rectangle.
    """
    origins, targets = np.broadcast_arrays(origins, targets)
    first, second = height(wall, origins, back=back), height(wall, targets, back=back)
    before = (first > 0) & (second > 0)
    share = np.where(before, first, np.nan) / np.where(before, first + second, 1.0)
    point = origins + share[..., None] * (image(wall, targets, back=back) - origins)
    return point, before & inside(wall, point)


def crossed(wall: Wall, origins: Array, targets: Array) -> NDArray[np.bool_]:
    """Whether straight legs, ``origins`` to ``targets`` (..., 3) [m], pass through the slab; (...).

    They do where their ends are on different sides of its middle plane, so a leg that ends on a face does not cross.
    """
    first, second = np.broadcast_arrays(height(wall, origins), height(wall, targets))
    across = (first + wall.thickness_m / 2) * (second + wall.thickness_m / 2) < 0
    if across.any():
        # Where they pass the front: the fronts of a room meet without a gap, the middle planes of its slabs do not.
        starts, ends = (
            np.broadcast_to(places, (*across.shape, 3))[across] for places in (origins, targets)
        )
        share = first[across] / (first - second)[across]
        across[across] = inside(wall, starts + share[:, None] * (ends - starts))
    return across


def reflect(
    wall: Wall, field: Field, directions: Array, frequency_hz: ArrayLike, term: Term = WHOLE[0]
) -> Field:
    """The field after reflection, at the face that it meets.

    Parameters
    ----------
    wall : Wall
        Its roughness takes exp(-2 (k s cos)^2) off the field (Ament, Proc. IRE 41 (1953) 142).
    field : (node, ..., 3) complex
        That arrives; (..., 3) stands for all nodes.
    directions : (..., 3) float64
        Unit vectors along which it travels.
    frequency_hz : (node,) float64
        [Hz].
    term : Term
        What of the slab's coefficient is meant; the phase of its extra length is left to whoever asks.

    Returns
    -------
    (node, ..., 3) complex128
        It travels along ``directions`` mirrored in the wall, without the phase of its path.
    """
    normal = wall.normal
    against = directions @ normal
    onward = directions - 2 * against[..., None] * normal
    cosine, frequency = np.minimum(np.abs(against), 1.0), _nodes(frequency_hz, against)
    te, tm = (term.coefficient(wall, cosine, frequency, kind) for kind in _POLARIZATIONS)
    lost = np.exp(
        -2 * (2 * np.pi * frequency / SPEED_OF_LIGHT_MPS * wall.roughness_m * cosine) ** 2
    )
    return apply_te_tm(field, directions, onward, normal, te * lost, tm * lost)


def transmit(
    wall: Wall, field: Field, directions: Array, frequency_hz: ArrayLike, term: Term = WHOLE[1]
) -> Field:
    """The field behind the wall, in place of the same way through air; arguments as those of `reflect`.

    The ray goes straight on: the small shift to the side is left out, its phase is not.
    """
    cosine = np.minimum(np.abs(directions @ wall.normal), 1.0)
    frequency = _nodes(frequency_hz, cosine)
    te, tm = (term.coefficient(wall, cosine, frequency, kind) for kind in _POLARIZATIONS)
    return apply_te_tm(field, directions, directions, wall.normal, te, tm)


class Passage(NamedTuple):
    """A wall that a wave has met on a piece of its way, and the passes through its slab that count for its delay."""

    wall: int
    piece: int
    passes: int


class Wave(NamedTuple):
    """One of the terms in which a wave has come so far.

    ``met`` the passages that tell it from others; ``extra_m (...)`` what they add to its way [m]; ``field (node, ..., 3)``
    complex, without the phase of both, and 0 where it went another way.
    """

    met: tuple[Passage, ...]
    extra_m: Array
    field: Field


def reflected(
    scene: Scene,
    series: Series,
    number: int,
    piece: int,
    waves: Waves,
    directions: Array,
    frequency: Array,
) -> Waves:
    """Waves after reflection by a wall, each once for each term of its slab.

    Parameters
    ----------
    scene : Scene
    series : sequence of WallSeries
        Slab series of all walls of the room.
    number : int
        Index of the wall that reflects.
    piece : int
        Index of the leg that follows the reflection.
    waves : list of Wave
    directions : (..., 3) float64
        Unit vectors along which they arrive.
    frequency : (node,) float64
        [Hz].

    Returns
    -------
    list of Wave
    """
    wall = scene.walls[number]
    cosine = np.minimum(np.abs(directions @ wall.normal), 1.0)
    out = []
    for met, extra, field in waves:
        for term in series[number].terms[0]:
            sent = reflect(wall, field, directions, frequency, term)
            # What the face itself sends back comes without a delay.
            passage = (Passage(number, piece, term.passes),) if term.passes else ()
            out.append(Wave((*met, *passage), extra + term.extra_m(wall.thickness_m, cosine), sent))
    return out


def through_walls(
    scene: Scene,
    series: Series,
    piece: int,
    waves: Waves,
    origins: Array,
    targets: Array,
    frequency: Array,
) -> Waves:
    """Waves at the end of straight legs, through all walls on the way.

    Parameters
    ----------
    scene : Scene
    series : sequence of WallSeries
        Slab series of all walls of the room.
    piece : int
        Index of the leg, which selects the walls that it passes.
    waves : list of Wave
    origins, targets : (..., 3) float64
        Ends of the legs, world [m]; they broadcast to the shape of the waves. A leg that ends on a face of a wall does not
        cross it.
    frequency : (node,) float64
        [Hz].

    Returns
    -------
    list of Wave
        Without spreading and without the phase of the leg's length; 0 behind metal.
    """
    origins, targets = np.broadcast_arrays(
        np.asarray(origins, dtype=np.float64), np.asarray(targets, dtype=np.float64)
    )
    for number, wall in enumerate(scene.walls):
        legs = crossed(wall, origins, targets)
        if not legs.any():
            continue
        ways = targets[legs] - origins[legs]
        ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
        cosine = np.minimum(np.abs(ways @ wall.normal), 1.0)
        came, waves = waves, []
        for met, extra, field in came:
            # Those that do not cross go on as they are.
            past = np.where(legs[..., None], 0.0, field)
            for term in series[number].terms[1]:
                passed = past if term.whole else np.zeros_like(field)
                passed[:, legs] = transmit(wall, field[:, legs], ways, frequency, term)
                if not term.whole:
                    longer = extra.copy()
                    longer[legs] += term.extra_m(wall.thickness_m, cosine)
                    waves.append(Wave((*met, Passage(number, piece, term.passes)), longer, passed))
            if past.any():
                waves.append(Wave(met, extra, past))
    return waves


def setting_out(field: Array, nodes: int) -> Waves:
    """A wave at its antenna, of a field (..., 3) that is the same at all nodes."""
    shape = np.shape(field)
    return [
        Wave(
            (),
            np.zeros(shape[:-1]),
            np.array(np.broadcast_to(field, (nodes, *shape)), dtype=np.complex128),
        )
    ]


def _nodes(frequency_hz: ArrayLike, like: Array) -> Array:
    """Frequencies (node, 1, ..., 1) for as many axes as ``like`` has."""
    frequency = np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64))
    return frequency.reshape(-1, *(1,) * like.ndim)
