"""Shooting and bouncing rays: tubes from one Tx, and what their footprints send to each receiver.

A tube is a facet seen from the Tx: three corner rays and a middle one, traced by Mitsuba. What the
middle ray meets, the tube meets. The corner rays are intersected with that same surface in float64:
the smooth ellipsoid, or the plane of the face, which has no border. So a tube meets a surface whole
or not at all. Each ray reflects by the smooth normal where it is, and so tubes spread as curved
mirrors spread them. The field follows from the power in the tube, which does not change.

Where its rays meet different things, or its path bends too much across its footprint, a tube is
split in four, at the Tx, up to `MOST_SPLITS` times. A corner ray that even then misses the surface
goes on to the tangent plane of the middle's place. A tube is dropped if its footprint is stretched
out of all proportion by that, or if it leaves beyond a horizon.

Ling, Chou, Lee, IEEE Trans. Antennas Propag. 37 (1989) 194: Shooting and bouncing rays.

**What the last footprints send** follows from vector physical optics. A footprint is the triangle
of a surface that a tube lights. The field reflected there, E_r = 2 (n.E) n - E, taken as a source
on the triangle (Huygens' principle), sends to a receiver in direction r, of polarisation p,

    F = jk/sqrt(pi) Int a exp(-jk (path in + path out)) dS,
    a = ((p.E) (n.r - n.d) + (p.d) (n.E) - (r.E) (n.p)) / 2,

with d the direction in which the field arrives: the mean of what the current 2 n x H sends and of
the same with Tx and Rx swapped. Where Tx and Rx are one and there is one bounce, this is scalar
physical optics, a = n.r; at a specular point it is cos(i) p.(E - 2 (n.E) n), the sign by which a
conducting sphere returns +sqrt(pi) a.

Where light comes from one side and is received on another, a breaks off at the horizons of both,
which sends waves that no real body sends. If tapered, a is multiplied by
4 (n.r) (-n.d) / (n.r - n.d)^2: 1 at specular points, 0 at horizons.

The phase is taken from the exact paths over the corners, and over the triangle it is linear. The
mean of exp(-j phase) is then a divided difference, see `rtradar.kernels.scatter.triangles`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from rtradar.front_end import Antenna
from rtradar.kernels.scatter.triangles import Tubes, radiate_tubes
from rtradar.scatter.common.polarization import Polarization, sent_field
from rtradar.scatter.target import Grid
from rtradar.system.threads import in_threads
from rtradar.trace.tracers import Surfaces

Array = NDArray[np.float64]

_TASKS = 32
"""Tasks that threads take: some receivers, and a part of the tubes that is summed on its own."""


@dataclass(frozen=True)
class Footprints:
    """Triangles where tubes end, and the field that arrives there.

    ``places (tube, 4, 3)`` are the ends of the three corner rays and the middle ray, world [m]; on
    a curved surface the middle is off the triangle. ``path (tube, 4)`` is the length of each ray
    from the Tx over all bounces before [m], ``directions (tube, 4, 3)`` the unit vectors along
    which the rays arrive, ``normals (tube, 4, 3)`` the normals of the surface there, on the side
    that is lit. ``field (tube, 3)`` is the field at the middle without its phase, for a Tx whose
    field is 1 at 1 m [1/m], and ``surface (tube,)`` the part or face.
    """

    places: Array
    path: Array
    directions: Array
    normals: Array
    field: Array
    surface: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.surface)

    def take(self, which: NDArray[np.bool_] | NDArray[np.int64]) -> Footprints:
        """Return some of them."""
        return Footprints(*(getattr(self, field.name)[which] for field in fields(self)))

    def width(self) -> Array:
        """Area of each tube across its rays (tube,) [m^2], over which its power is spread."""
        p = self.places
        # The vector area of the triangle; its part along the middle ray is what the tube is wide.
        area = np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]) / 2
        return np.abs((area * self.directions[:, 3]).sum(axis=1))

    def mean_paths(self, group: NDArray[np.int64], rx: Array, otherwise: Array) -> Array:
        """Mean path from the Tx to each Rx over each group (rx, group) [m].

        ``group (tube,)`` are the groups of the tubes, which count by their power. The mean is
        ``otherwise (rx, group)`` for groups without power.
        """
        # The mean of the paths over the middle rays, each weighted by the power of its tube.
        power, count = self.power(), otherwise.shape[1]
        total = np.bincount(group, weights=power, minlength=count)
        means = otherwise.copy()
        for antenna, mean in zip(rx, means, strict=True):
            path = self.path[:, 3] + np.linalg.norm(antenna - self.places[:, 3], axis=1)
            weighted = np.bincount(group, weights=power * path, minlength=count)
            np.divide(weighted, total, out=mean, where=total > 0)
        return means

    def power(self) -> Array:
        """Power of each tube (tube,), for a Tx whose field is 1 at 1 m."""
        return np.asarray((self.field**2).sum(axis=1) * self.width())


def radiate(
    footprints: Footprints,
    visible: NDArray[np.bool_],
    rx: Array,
    wavenumber: Array,
    length: Array,
    *,
    polarization: Polarization,
    spreading: bool = True,
    tapered: bool = False,
) -> NDArray[np.complex128]:
    """Sum of what footprints send to receivers, (node, rx, group) complex128.

    It is a scattering length for exp(+j omega t), over R2 with ``spreading`` [m]. ``visible (rx,
    tube)`` says whether the last leg to a receiver ``rx (rx, 3)`` [m] is free; ``wavenumber
    (node,)`` [1/m]; ``length (rx, group)`` is the path whose phase is taken out [m]. Footprints are
    summed by their surface, or all together if there is one group. ``polarization`` is that of the
    receivers; if ``tapered``, the integral fades toward the horizons.
    """
    # Each receiver is a task of its own, and with few receivers the tubes are parted as well.
    chunks = math.ceil(_TASKS / len(rx))
    parts = np.zeros((chunks, len(wavenumber), *length.shape), dtype=np.complex128)
    if len(footprints):
        f = footprints
        # Each surface is a group, unless all is to be one sum.
        group = np.zeros_like(f.surface) if length.shape[1] == 1 else f.surface
        arrays = (f.places, f.path, f.directions[:, 3], f.normals[:, 3], f.field, group)
        tubes = Tubes._make(np.ascontiguousarray(array) for array in arrays)
        others = visible, rx, polarization.axes, wavenumber, length
        given = (np.ascontiguousarray(array) for array in others)
        options = polarization.kind == "h", spreading, tapered
        in_threads(radiate_tubes, chunks * len(rx), tubes, *given, *options, parts)
    # The factor in front of the integral.
    return 1j * np.asarray(wavenumber)[:, None, None] / np.sqrt(np.pi) * parts.sum(axis=0)


# -- shooting --------------------------------------------------------------------------------------


MOST_SPLITS = 3
"""A tube becomes 64 at most."""
_BOW_RAD = 0.2
"""Phase by which a footprint may leave the plane through its corners; 3/4 of it is corrected."""
_INSET = 0.01
"""Fraction of the way to the middle at which corner rays begin: on a crease it is not known which
surface they leave."""
_GRAZING = 0.02
"""A tube that meets a surface at less than a degree, and still does when split, is dropped."""


@dataclass(frozen=True, kw_only=True)
class Shooter:
    """A target, and how rays are shot at it.

    Rays are aimed at a ``grid`` and meet ``surfaces``, with up to so many ``bounces``;
    ``wavenumber`` is the largest that the footprints have to serve [1/m], ``polarization`` that of
    the transmitting ``antenna``, isotropic if there is none. With ``spreading`` the first leg's
    1 / R1 is in the field; ``two_sided`` facets are lit from behind as well.
    """

    surfaces: Surfaces
    grid: Grid
    bounces: int
    wavenumber: float
    polarization: Polarization
    antenna: Antenna | None = None
    spreading: bool = True
    two_sided: bool = False

    def shoot(self, tx: Array) -> list[Footprints]:
        """Footprints of all tubes from ``tx (3,)`` [m], a set for each number of bounces from 1."""
        grid = self.grid
        # Footprints of one bounce follow from the facets themselves: only what comes after them may
        # need finer tubes.
        first, lit = self._launch(grid, tx)
        found: list[list[Footprints]] = [[] for _ in range(self.bounces - 1)]
        start = first
        for split in range(MOST_SPLITS + 1):
            # Tubes that are rough, by what they meet or by how their path bends, are shot again
            # from the quarters of their facets. At the last split all are kept.
            chain, rough = self._follow(start)
            last = split == MOST_SPLITS
            for hop, (footprints, origin) in enumerate(chain):
                found[hop].append(footprints if last else footprints.take(~rough[origin]))
            if last or not rough.any():
                break
            grid = grid.split(lit[rough])
            start, lit = self._launch(grid, tx)
        return [first, *(_joined(sets, first) for sets in found)]

    def _launch(self, grid: Grid, tx: Array) -> tuple[Footprints, NDArray[np.int64]]:
        """Tubes that the Tx sees, at their first footprint, and their numbers."""
        tubes = grid.tubes
        # The facets that face the Tx, or either side of a sheet, and whose middles nothing hides.
        steepness = np.einsum("ti,ti->t", tx - tubes.places[:, 3], tubes.normals[:, 3])
        lit = np.flatnonzero(steepness != 0 if self.two_sided else steepness > 0)
        middles = tubes.places[lit, 3]
        lit = lit[
            self.surfaces.sees(np.broadcast_to(tx, middles.shape), middles, tubes.surface[lit])
        ]
        places, normals = tubes.places[lit], tubes.normals[lit]
        if self.two_sided:
            normals = normals * np.sign(steepness[lit])[:, None, None]
        # The field at the middle ray, without the phase of its path.
        directions = places - tx
        path = np.linalg.norm(directions, axis=-1)
        directions /= path[..., None]
        ahead = directions[:, 3]
        field = sent_field(self.antenna, ahead, self.polarization, x_for_steep=True)
        if self.spreading:
            field = field / path[:, 3:]
        return Footprints(places, path, directions, normals, field, tubes.surface[lit]), lit

    def _follow(
        self, start: Footprints
    ) -> tuple[list[tuple[Footprints, NDArray[np.int64]]], NDArray[np.bool_]]:
        """Footprints after 2, 3, ... bounces, the tubes they come from, and which to split."""
        # Bounce by bounce; ``origin`` is the first tube that each footprint comes from.
        rough = np.zeros(len(start), dtype=bool)
        here, origin, chain = start, np.arange(len(start)), []
        for _ in range(self.bounces - 1):
            if len(here) == 0:
                break
            here, origin = _bounce(self.surfaces, here, origin, rough, self.wavenumber)
            chain.append((here, origin))
        return chain, rough


def exits(surfaces: Surfaces, footprints: Footprints, rx: Array) -> NDArray[np.bool_]:
    """Whether the last leg from each footprint to each of ``rx (rx, 3)`` is free, (rx, tube)."""
    # Only receivers before the surface are asked about.
    middles, normals = footprints.places[:, 3], footprints.normals[:, 3]
    visible = rx @ normals.T > (middles * normals).sum(axis=1)
    receiver, tube = np.nonzero(visible)
    visible[receiver, tube] = surfaces.sees(rx[receiver], middles[tube], footprints.surface[tube])
    return visible


def _bounce(
    surfaces: Surfaces,
    here: Footprints,
    origin: NDArray[np.int64],
    rough: NDArray[np.bool_],
    wavenumber: float,
) -> tuple[Footprints, NDArray[np.int64]]:
    """Footprints one bounce on, and the tubes they come from; marks ``rough`` ones."""
    # Each ray is reflected at its own normal, and a conductor reverses the field along the surface.
    against = np.einsum("tci,tci->tc", here.directions, here.normals)
    onward = here.directions - 2 * against[..., None] * here.normals
    normal = here.normals[:, 3]
    field = 2 * np.einsum("ti,ti->t", normal, here.field)[:, None] * normal - here.field
    met, traced = _trace(surfaces, here, onward)
    # A tube whose middle ray meets nothing, but a corner ray does, is too coarse.
    rough[origin[(met[:, 3] < 0) & (met[:, :3] >= 0).any(axis=1)]] = True
    # The tube meets what its middle ray meets: all four rays are intersected with that surface, in
    # float64.
    landing = np.repeat(met[:, 3:], 4, axis=1)
    distance = surfaces.distance(landing, here.places, onward)
    landed = np.flatnonzero((landing[:, 3] >= 0) & (distance[:, 3] > 0))
    here, met, landing, traced = here.take(landed), met[landed], landing[landed], traced[landed]
    origin, field, against = origin[landed], field[landed], against[landed]
    distance, onward = distance[landed], onward[landed]
    places = here.places + distance[..., None] * onward
    normals = surfaces.normal(landing, places, onward)
    # A corner ray that misses has the distance NaN, which fails every comparison; a corner on the
    # crease of two faces has 0, up to rounding.
    lands = (distance > -1e-9) & (np.einsum("tci,tci->tc", onward, normals) < 0)
    # A corner that misses goes to the tangent plane at the middle's place: tubes land whole.
    normals = np.where(lands[..., None], normals, normals[:, 3:])
    steepness = np.einsum("tci,tci->tc", onward, normals)
    height = np.einsum("tci,tci->tc", places[:, 3:] - here.places, normals)
    distance = np.where(
        lands, distance, height / np.where(steepness < -_GRAZING, steepness, np.nan)
    )
    places = here.places + distance[..., None] * onward
    # A corner that lands far behind or beyond all others, or leaves beyond a horizon, drops the
    # tube.
    size = np.linalg.norm(here.places - here.places[:, 3:], axis=-1)
    whole = ((np.abs(distance) < 3 * (distance[:, 3:] + size)) & (against < 0)).all(axis=1)
    # The middle of the footprint tells how much the path bows over the corners.
    path = here.path + distance
    bow = path[:, 3] - path[:, :3].mean(axis=1)
    # Corners that meet another surface do not matter if they would travel nearly as far to it.
    together = ((met == landing) | (wavenumber * np.abs(traced - distance) < _BOW_RAD)).all(axis=1)
    rough[
        origin[~(whole & lands.all(axis=1) & together & (wavenumber * np.abs(bow) < _BOW_RAD))]
    ] = True
    # The power of a tube stays the same, so the field grows as the tube narrows.
    there = Footprints(places, path, onward, normals, field, landing[:, 3]).take(whole)
    before, after = here.width()[whole], there.width()
    # A tube seen edge-on, or with its waist just here, has a footprint without width, which sends
    # nothing.
    ratio = np.sqrt(before / np.where(after > 0, after, np.inf))
    return replace(there, field=there.field * ratio[:, None]), origin[whole]


def _trace(surfaces: Surfaces, here: Footprints, onward: Array) -> tuple[NDArray[np.int64], Array]:
    """What the four rays of each tube meet, (tube, 4), and how far; -1 and infinity for nothing."""
    inward = here.places + _INSET * (here.places[:, 3:] - here.places)
    met, distance = surfaces.meets(
        inward.reshape(-1, 3),
        here.normals.reshape(-1, 3),
        onward.reshape(-1, 3),
        np.repeat(here.surface, 4),
    )
    return met.reshape(-1, 4), distance.reshape(-1, 4)


def _joined(parts: list[Footprints], like: Footprints) -> Footprints:
    if not parts:
        return like.take(np.zeros(len(like), dtype=bool))
    names = Footprints.__dataclass_fields__
    return Footprints(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))
