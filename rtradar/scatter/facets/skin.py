"""Facets of people as meshes that bend, and what antennas see of them.

Facets are triangles of the skin. Their corners move with it, so that what they add stays coherent
from pose to pose, however the skin bends. They are so small that their sag is 0.1 rad of phase.
Mitsuba decides what antennas see past all people's skins, at the middles of the facets, on the mesh
that is coarser by one division. Facets that face away from an antenna are not lit by it, but
radiate to it through what is behind them, if Tx and Rx are far apart.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body, unit_sphere
from rtradar.body.body import Poses
from rtradar.body.human import MOST_DIVISIONS, loop_subdivision
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.kernels.scatter.facets import Facets
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import shadow_nodes, sweep_nodes
from rtradar.scatter.common.polarization import Polarization
from rtradar.scatter.common.poses import ChirpPoses, KeyframeCache, has_mesh
from rtradar.scatter.facets.body import FacetBody
from rtradar.scatter.facets.radiation import (
    NEAR,
    Links,
    Seen,
    as_amplitude,
    body_facets,
    directions_apart,
    facet_normals,
    joined,
    one_after_the_other,
    radiated,
    smooth_bend,
)
from rtradar.scatter.specular_points import solve_specular_points
from rtradar.scatter.target import in_four
from rtradar.trace.backend import select, use
from rtradar.trace.tracers import MeshTracer

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_SAME = 1e-5
"""Fraction of the people's extent: what is met nearer to a facet than that is the facet."""

_KEPT = 48
"""Keyframes of visibility that are kept, 0.6 MB each at 12 GHz and 2.6 MB at 77 GHz."""


class Skin(NamedTuple):
    """The skin of one person: a coarse mesh, and a fine one with four triangles for each of those.

    ``coarse (face, 3)`` and ``fine (4 face, 3)`` are triangles; ``part (face,)`` the person's parts
    in ascending order; ``posed(time)`` gives the vertices of both [m], world.
    """

    coarse: Indices
    fine: Indices
    part: Indices
    posed: Callable[[float], tuple[Array, Array]]


class _Piece(NamedTuple):
    """A part's fine facets: which of all facets, which vertices of all, and faces among these."""

    facets: slice
    vertices: Indices
    faces: Indices


def skin_of(person: Body, frequency_hz: float) -> Skin:
    """Return the skin of a person at this frequency [Hz]: their mesh, or all their ellipsoids'."""
    mesh = person.mesh
    if mesh is None:
        return _skin_of_ellipsoids(person, frequency_hz)
    # Each triangle of the mesh becomes four with each division; parts follow one another in order.
    divisions = min(MOST_DIVISIONS, max(1, mesh.divisions_for(frequency_hz)))
    part = np.repeat(mesh.part, 4 ** (divisions - 1))
    order = np.argsort(part, kind="stable")

    def posed(time: float) -> tuple[Array, Array]:
        return tuple(person.skin([time], level)[0] for level in (divisions - 1, divisions))

    coarse, fine = mesh.faces(divisions - 1), mesh.faces(divisions).reshape(-1, 4, 3)
    return Skin(coarse[order], fine[order].reshape(-1, 3), part[order], posed)


def _skin_of_ellipsoids(person: Body, frequency_hz: float) -> Skin:
    # The sphere of each ellipsoid has as many facets as the largest part needs.
    wavenumber = 2 * np.pi * frequency_hz / SPEED_OF_LIGHT_MPS
    facets = int(body_facets(person.semi_axes, wavenumber).max())
    levels = math.ceil(math.log(facets / 20, 4))
    # The coarse sphere, and the fine one whose four triangles belong to each coarse one.
    sphere, faces = unit_sphere(levels - 1)
    smooth, finer = loop_subdivision(faces, len(sphere))
    fine = smooth @ sphere
    # Vertices are as far out as those of ellipsoids are where nobody has a mesh.
    radius = float(np.linalg.norm(unit_sphere(levels)[0], axis=1).mean())
    fine *= radius / np.linalg.norm(fine, axis=1, keepdims=True)
    parts = len(person.semi_axes)

    def posed(time: float) -> tuple[Array, Array]:
        pose = person.at([min(time, person.duration_s)])
        stretched = np.swapaxes(pose.frames[0] * pose.semi_axes[:, None], 1, 2)
        places = (own @ stretched + pose.centres[0][:, None] for own in (sphere, fine))
        return tuple(own.reshape(-1, 3) for own in places)

    everywhere, everywhere_fine = (
        one_after_the_other([own] * parts, [len(points)] * parts)
        for own, points in ((faces, sphere), (finer, fine))
    )
    return Skin(everywhere, everywhere_fine, np.repeat(np.arange(parts), len(faces)), posed)


class SkinFacets:
    """The facets of all people's skins; ``frequency (node,)`` [Hz], ``variant`` the backend.

    What is seen is asked for every ``look_s`` [s], and fades in between.
    """

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str,
        spreading: bool,
        nodes: int,
        look_s: float,
    ) -> None:
        self._radar, self._spreading, self._look_s = radar, spreading, look_s
        backend = select(variant)
        self.variant, self._mi = backend.kind, use(backend)
        self.frequency = sweep_nodes(radar, nodes)
        stop_hz = radar.start_frequency_hz + radar.bandwidth_hz
        self._skins = [skin_of(person, stop_hz) for person in body.people]
        parts = [len(person.semi_axes) for person in body.people]
        # The skins of all people as one mesh, with all parts numbered in turn.
        fine = one_after_the_other(
            [skin.fine for skin in self._skins],
            [int(skin.fine.max()) + 1 for skin in self._skins],
        )
        part = one_after_the_other([skin.part for skin in self._skins], parts)
        self._pieces = [_piece(fine, part, own) for own in range(sum(parts))]
        self._tracing = threading.Lock()
        self._looks: KeyframeCache[int, NDArray[np.bool_]] = KeyframeCache(0, _KEPT)

    def carriers(self, at: Geometry | ChirpPoses) -> tuple[Array, Array]:
        """Path [m] over the specular point of each part's ellipsoid, and 1 / (R1 R2) of its middle.

        Both (chirp, rx, part); 1 without spreading.
        """
        length, _, _ = solve_specular_points(at)
        if not self._spreading:
            return length, np.ones_like(length)
        to_tx, to_rx = (
            np.linalg.norm(place - at.centres[:, None], axis=-1)
            for place in (at.tx[:, None, None], at.rx[:, :, None])
        )
        return length, 1 / (to_tx * to_rx)

    def field(
        self,
        time: float,
        pose: Poses,
        antennas: Array,
        pairs: Indices,
        length: Array,
        parts: Indices,
    ) -> NDArray[np.complex128]:
        """Amplitude (node, pair, n) of parts (n,) in one pose, for paths (pair, n) [m].

        See `FacetBody.field`; lengths are reckoned about the middles of the ``pose``.
        """
        centres = pose.centres[0]
        vertices = np.concatenate([skin.posed(time)[1] for skin in self._skins])
        seen, radar = self._seen(time), self._radar.at(time)
        polarization = Polarization(radar.polarization, radar.axes)
        # Each antenna takes the visibility of the eye that is nearest to it.
        apart = np.linalg.norm(antennas[:, None] - shadow_nodes(radar)[0], axis=2)
        index = np.argmin(apart, axis=1)[None]
        k = 2 * np.pi * self.frequency[None] / SPEED_OF_LIGHT_MPS
        to_tx, to_rx = (antennas[pairs[:, side]] - centres[parts, None] for side in (0, 1))
        wide = bool((directions_apart(to_tx, to_rx) > NEAR).any())
        given = k, polarization, self._spreading
        # The fine facets of the parts that are asked for, about the middle of each part.
        pieces = [self._pieces[part] for part in parts]
        faces, ends = joined([(piece.vertices, piece.faces) for piece in pieces])
        own = vertices[np.concatenate([piece.vertices for piece in pieces])]
        own -= np.repeat(centres[parts], np.diff(ends[:, 0]), axis=0)
        normals, areas = facet_normals(own, faces)
        # Where the currents count, they do not fall to nothing at the edge of the lit side: it is
        # softened over the bend of the smooth surface.
        bend = smooth_bend(own, faces) if wide else np.zeros_like(areas)
        facets = Facets(own, faces, normals, areas, bend, np.zeros_like(areas), ends)
        # The facets are posed already: their axes are the world's.
        unturned = centres[None, parts], np.broadcast_to(np.eye(3), (1, len(parts), 3, 3))
        links = Links(antennas[None], pairs, length[None], *given, shadow=False)
        lit = Seen(np.array([piece.facets.start for piece in pieces]), seen)
        field = radiated(facets, np.arange(len(parts)), unturned, links, lit, index)
        return as_amplitude(field)[:, 0]

    def _seen(self, time: float) -> NDArray[np.float32]:
        """Fraction of each facet (eye, facet) that is seen at a time [s]."""
        # The two looks around this time; the tracer serves one thread at a time.
        look, fraction = divmod(time / self._look_s, 1.0)
        with self._tracing:
            before = self._looks.get(int(look), lambda: self._look(look * self._look_s))
            if fraction == 0:
                return before.astype(np.float32)
            number = int(look) + 1
            after = self._looks.get(number, lambda: self._look(number * self._look_s))
        weight = np.float32(fraction)
        return np.asarray((1 - weight) * before + weight * after, dtype=np.float32)

    def _look(self, time: float) -> NDArray[np.bool_]:
        """Which facets (eye, facet) are seen past all skins at a time [s].

        If the eyes are far apart, a facet that faces away from an eye is seen by it from where the
        line to it leaves the facet's own skin.
        """
        posed = [skin.posed(time)[0] for skin in self._skins]
        eyes = shadow_nodes(self._radar.at(time))[0]
        # Each skin has a scene about its own middle, so that float32 rounds alike whoever else is
        # there.
        scenes = [
            MeshTracer(self._mi, vertices[skin.coarse], same=_SAME)
            for skin, vertices in zip(self._skins, posed, strict=True)
        ]
        ways = eyes[:, None] - np.array([vertices.mean(axis=0) for vertices in posed])
        wide = bool((directions_apart(ways[:, None], ways[None]) > NEAR).any())
        found = []
        for skin, vertices, own in zip(self._skins, posed, scenes, strict=True):
            corners = vertices[skin.coarse]
            normals, _ = facet_normals(vertices, skin.coarse)
            # The middles of the quarters at the corners, in their order, then of the one between.
            middles = in_four(corners).mean(axis=1).reshape(-1, 4, 3)[:, [0, 2, 1, 3]]
            seen = np.zeros((len(eyes), len(corners), 4), dtype=bool)
            # Facets that face the eye are asked at their middles.
            for eye, place in enumerate(eyes):
                faces = np.sum(normals * (place - corners[:, 0]), axis=1) > 0
                facing, away = np.flatnonzero(faces), np.flatnonzero(~faces)
                points, whose = middles[facing].reshape(-1, 3), np.repeat(facing, 4)
                seen[eye, facing] = _clear(place, points, whose, own, scenes).reshape(-1, 4)
                # Facets that face away radiate through their skin: they are asked from where the
                # line leaves it.
                if wide:
                    inside, whose = middles[away].reshape(-1, 3), np.repeat(away, 4)
                    inward = -np.repeat(normals[away], 4, axis=0)
                    exits, whose = own.way_out(inside, inward, place, whose)
                    seen[eye, away] = _clear(place, exits, whose, own, scenes).reshape(-1, 4)
            found.append(seen.reshape(len(eyes), -1))
        return np.concatenate(found, axis=1)


def _clear(
    eye: Array, points: Array, whose: Indices, own: MeshTracer, scenes: Sequence[MeshTracer]
) -> NDArray[np.bool_]:
    """Whether nothing hides points (n, 3), on the faces (n,) of their own mesh, from the eye."""
    clear, start = np.ones(len(points), dtype=bool), np.broadcast_to(eye, points.shape)
    for scene in scenes:
        clear &= scene.sees(start, points, whose if scene is own else np.full_like(whose, -1))
    return clear


def _piece(fine: Indices, part: Indices, own: int) -> _Piece:
    # The parts are in order, so the facets of one are a slice.
    first, last = np.searchsorted(part, [own, own + 1])
    facets = slice(4 * int(first), 4 * int(last))
    vertices, faces = np.unique(fine[facets], return_inverse=True)
    return _Piece(facets, vertices, faces.reshape(-1, 3))


def facets_of_people(
    level: str, radar: Radar, body: Body, *, facets: int | None, look_s: float, **common: Any
) -> FacetBody | SkinFacets:
    """Return the facets of ellipsoids, or of all skins where somebody has a mesh.

    ``common`` are the parameters of both, ``look_s`` [s] is for skins. Raises `InputError` where a
    number of facets is given for a mesh.
    """
    if not has_mesh(body):
        return FacetBody(radar, body, facets=facets, **common)
    if facets is not None:
        raise InputError(
            f"{level}: facets = {facets}; a mesh is divided by the wavelength: leave facets out, "
            "or take body = 'ellipsoids'"
        )
    return SkinFacets(radar, body, look_s=look_s, **common)
