"""Limits of validity: where optics ends, and what is too near, too fast, or inside of what else.

Parts of bodies may be inside of walls, furniture, objects and other people, and objects inside of
one another.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from rtradar.body import Body, Ellipsoids
from rtradar.body.body import Poses
from rtradar.conventions import MINIMUM_ANTENNA_DISTANCE_M, MINIMUM_KA, SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError, ValidityWarning
from rtradar.radar import Radar
from rtradar.rcs import ellipsoid_radii
from rtradar.scene import Furniture, Object, Scene, Wall
from rtradar.scene.mesh_files import Triangles

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

WARN_FRACTION = 0.05
"""Limits that concern less of the echo power than this are counted, without a Python warning."""

_BEAMS = 181
"""Sines from -1 to 1 in which the largest beam of an array is sought."""

_STEP_S = 1e-3
"""Interval over which the range rate of a part is measured [s]."""


@dataclass(frozen=True)
class Limit:
    """A limit of validity that the capture came near or went past.

    ``name`` is short, for machines, ``message`` one line for people. ``share``, so called in
    ``summary.json``, is the fraction that is concerned, 0 to 1: of the person's echo power, unless
    the message begins with something else.
    """

    name: str
    share: float
    message: str


def warn_of(limit: Limit) -> None:
    """Issue a `ValidityWarning` for a limit that concerns more than 5 % of the echo power."""
    if limit.share > WARN_FRACTION:
        warnings.warn(f"{limit.share:.0%} of the {limit.message}", ValidityWarning, stacklevel=3)


# -- curvature -------------------------------------------------------------------------------------


def smaller_radius(semi_axes: Array, direction: Array) -> Array:
    """Compute the smaller radius of curvature where the normal has a direction (..., part) [m].

    ``semi_axes (part, 3)`` are those of ellipsoids [m], directions (..., part, 3) are in their
    axes, of any length.
    """
    size = np.maximum(np.linalg.norm(direction, axis=-1, keepdims=True), 1e-12)
    x, y, z = np.moveaxis(direction / size, -1, 0)
    theta = np.arccos(np.clip(z, -1, 1))
    a, b, c = semi_axes.T
    return np.asarray(ellipsoid_radii(a, b, c, theta, np.arctan2(y, x))[0])


def warn_of_small_radii(
    target: Ellipsoids,
    tx: Array,
    rx: Array,
    wavenumber: Array,
    amplitude: Array,
    *,
    stacklevel: int = 2,
) -> None:
    """Warn where much of an echo comes from radii that are below `MINIMUM_KA` over the wavenumber.

    The antennas (n, 3) are given pair by pair [m], with their wavenumbers (n,) [1/m] and the
    amplitudes (n, part) of each part's echo, of which only the ratio counts. A `ValidityWarning` is
    issued if such radii, taken where the normal halves the angle between both antennas, give more
    than 5 % of the power. A radius counts less by the cosine of incidence, half the angle between
    both antennas. ``stacklevel`` is counted from the caller; see `warnings.warn`.

    Equation :eq:`validity` of the theory page.
    """
    # The bisector of both ways, in the axes of each part.
    normal = np.zeros((len(tx), *target.centres.shape))
    for antennas in (tx, rx):
        sight = np.einsum("pji,npj->npi", target.frames, antennas[:, None] - target.centres)
        normal += sight / np.linalg.norm(sight, axis=-1, keepdims=True)
    # Opposite antennas have no such normal, and no echo.
    cosine = np.linalg.norm(normal, axis=-1) / 2
    ka = wavenumber[:, None] * smaller_radius(target.semi_axes, normal) * cosine
    power, small = np.abs(amplitude) ** 2, ka < MINIMUM_KA
    concerned, whole = float(power[small].sum()), float(power.sum())
    if whole > 0 and concerned > WARN_FRACTION * whole:
        warnings.warn(
            f"{concerned / whole:.0%} of the echo power is from places whose wavenumber times "
            "radius of curvature times cosine of incidence is below "
            f"{MINIMUM_KA:g}, down to {float(ka[small].min()):.3g}, "
            "where optics is off by decibels; rtradar.rcs.sphere(method='mie') is exact",
            ValidityWarning,
            stacklevel=stacklevel + 1,
        )


def small_curvature(radar: Radar, body: Body, times: Array) -> NDArray[np.bool_]:
    """Whether the smaller radius at the specular point of the array's centre is too small.

    The result is (time, part), for ``times (time,)`` [s].
    """
    centres, frames, semi_axes = body.at(times)
    sight = np.einsum("tpji,tpj->tpi", frames, radar.poses_at(times)[1][:, None] - centres)
    wavenumber = 2 * np.pi * radar.start_frequency_hz / SPEED_OF_LIGHT_MPS
    return np.asarray(wavenumber * smaller_radius(semi_axes, sight) < MINIMUM_KA)


# -- velocity --------------------------------------------------------------------------------------


def too_fast(radar: Radar, body: Body, times: Array) -> NDArray[np.bool_]:
    """Whether the range rates of the parts' centres are ambiguous, (time, part)."""
    if body.duration_s < _STEP_S:
        return np.zeros((len(times), len(body.part_names)), dtype=bool)
    # The rate by two instants, the later of which is still within the recording.
    early = np.minimum(times, body.duration_s - _STEP_S)
    before, after = (
        np.linalg.norm(body.at(at).centres - radar.poses_at(at)[1][:, None], axis=-1)
        for at in (early, early + _STEP_S)
    )
    return np.asarray(np.abs(after - before) / _STEP_S > radar.max_velocity_mps)


def folded_angle_deg(radar: Radar) -> float:
    """Compute the angular error, at broadside, of an echo whose velocity is folded once [deg].

    With a range rate that is wrong by twice the unambiguous velocity, the phase of one Tx after the
    other is wrong by 1 / n_tx of a turn. On a line of Tx with spacing d this is the phase of a
    direction whose sine differs by lambda / (n_tx d). In a listed array the wrong phases are no
    plane wave: the direction is that of the largest beam, over the half space ahead. The error is 0
    if Tx do not take turns, or no line has two of them.
    """
    # Only Tx that transmit one after the other, and do not stand at one place, give a wrong
    # direction.
    taking_turns = radar.tx_delay_s[-1] > 0
    on_a_line = (radar.tx_y > 1 and radar.rx_y > 0) or (radar.tx_z > 1 and radar.rx_z > 0)
    if not (taking_turns and (on_a_line or not radar.is_cross)):
        return 0.0
    if not radar.is_cross:
        # Tx at one place are polarisations.
        return _beam_of_turns_deg(radar) if np.ptp(radar.tx_m, axis=0).any() else 0.0
    spacing_m = radar.tx_spacing_wavelengths * radar.start_wavelength_m
    return math.degrees(math.asin(min(1.0, radar.wavelength_m / (radar.n_tx * spacing_m))))


def _beam_of_turns_deg(radar: Radar) -> float:
    """Angle from broadside to the largest beam where each Tx is wrong by its share of a turn [deg].

    If two beams are alike, such as above and below an array without height, it is the nearer one.
    """
    # All directions ahead, by their sines along y and z.
    sines = np.linspace(-1, 1, _BEAMS)
    y, z = (axis.ravel() for axis in np.meshgrid(sines, sines, indexing="ij"))
    ahead = y**2 + z**2 <= 1
    y, z = y[ahead], z[ahead]
    # Each Tx has the wrong phase that the wrong velocity gives it by its turn in the cycle.
    order = np.argsort(radar.tx_order if radar.tx_order is not None else np.arange(radar.n_tx))
    turns = np.repeat(order / radar.n_tx, radar.n_channels // radar.n_tx)
    field = np.zeros(len(y), dtype=np.complex128)
    for place, turn in zip(radar.virtual_m / radar.wavelength_m, turns, strict=True):
        field += np.exp(2j * np.pi * (y * place[1] + z * place[2] - turn))
    power = np.abs(field)
    best = power > power.max() * (1 - 1e-3)
    return math.degrees(math.asin(float(np.sqrt((y[best] ** 2 + z[best] ** 2).min()))))


# -- distance --------------------------------------------------------------------------------------


def sampled(length: Array, radar: Radar) -> NDArray[np.bool_]:
    """Whether paths of these lengths (...) [m] are within the range that the sampling covers."""
    return np.asarray(length < 2 * radar.max_range_m)


def refuse_too_near(radar: Radar, body: Body, times: Array) -> None:
    """Raise an `InputError` if a part is nearer than `MINIMUM_ANTENNA_DISTANCE_M` to an antenna.

    The message names the part and the time, one of ``times`` [s].
    """
    centres, frames, semi_axes = body.at(times)
    antennas = np.concatenate(radar.antennas_at(times), axis=1)
    # The distance to a part is at least that to its centre less its largest semi-axis.
    away = np.linalg.norm(centres[:, None] - antennas[:, :, None], axis=-1)
    gap = away - semi_axes.max(axis=1)
    # Only for pairs that come so near the exact distance is computed.
    for time, antenna, part in np.argwhere(gap < MINIMUM_ANTENNA_DISTANCE_M):
        local = frames[time, part].T @ (antennas[time, antenna] - centres[time, part])
        distance = _distance(local, semi_axes[part])
        if distance < MINIMUM_ANTENNA_DISTANCE_M:
            raise InputError(
                f"at {times[time]:.2f} s the {body.part_names[part]} is {max(distance, 0):.2f} m "
                f"from an antenna of radar '{radar.name}'; at least {MINIMUM_ANTENNA_DISTANCE_M} m "
                "is allowed: move the radar (position_m) or choose another interval"
            )


def _distance(place: Array, semi_axes: Array) -> float:
    """Distance of a place in an ellipsoid's axes from its surface; 0 inside.

    The nearest point is a^2 x / (a^2 + t) with the root t of sum (a x / (a^2 + t))^2 = 1.
    """

    def beyond(t: float) -> float:
        return float(((semi_axes * place / (semi_axes**2 + t)) ** 2).sum()) - 1

    if beyond(0.0) <= 0:
        return 0.0
    # At this t the sum is below 1, so the root is between.
    t = brentq(beyond, 0.0, float(np.linalg.norm(semi_axes * place)))
    return float(np.linalg.norm(t * place / (semi_axes**2 + t)))


# -- what is inside of what ------------------------------------------------------------------------


REFUSED_FRACTION = 0.05
"""A part that sends more than this of the person's echo power must not be inside a wall."""

_PELVIS = ("left hip", "right hip", "lower torso")
"""Parts that must not be inside a wall."""

_TRUNK = (*_PELVIS, "middle torso", "upper torso", "neck", "head")
"""Parts that must not be inside another person; hands and feet may touch."""

_CONTACT_M = 0.02
"""Depth up to which the centre of a part touches a wall [m]: hands and feet in recordings do."""

_MESH_STEP = 10
"""Instants to one at which furniture and objects are tested: a mesh takes long."""

_INSTANTS = 10
"""Instants of a capture at which objects are looked for in one another."""

_PLACES = 50
"""Places of an object that are looked for, at most."""

_SHRUNK = 0.99
"""Size of an object whose places are looked for: what touches is not inside."""


class Inside:
    """Record of which parts were inside what else over a capture.

    Things are the walls of the scene, closed furniture, closed objects, and people, in this order.
    """

    def __init__(self, scene: Scene, body: Body) -> None:
        self._scene, self._names, self._owner = scene, body.part_names, body.owner
        self._trunk, self._pelvis = (
            np.array([name.endswith(ends) for name in body.part_names], dtype=bool)
            for ends in (_TRUNK, _PELVIS)
        )
        pieces = (*scene.furniture, *scene.objects)
        self._solids = [one for piece in pieces if (one := _Solid(piece)).mesh.closed]
        # A person who is alone is inside nobody else.
        people = body.names if len(body.names) > 1 else ()
        every = [wall.name for wall in scene.walls], [one.name for one in self._solids], people
        self._things = [name for names in every for name in names]
        self._people = range(len(self._things) - len(people), len(self._things))
        self._first_s = np.full((len(self._things), len(self._names)), np.inf)
        self._power = np.zeros(self._first_s.shape)
        self._instant = 0

    def look(self, times: Array, poses: Poses, power: Array) -> None:
        """Test the next instants.

        They are given by their times (time,) [s], the body's poses, and its echo power (time, part)
        [m^2]. An `InputError` is raised if the pelvis is inside a wall, or a trunk inside another.
        """
        for number, wall in enumerate(self._scene.walls):
            self._keep(number, times, _inside_wall(wall, poses), power)
            self._refuse(number, self._pelvis)
        # Meshes are tested at every tenth instant, counted over all blocks of the capture, and each
        # stands for ten.
        at = np.arange(-self._instant % _MESH_STEP, len(times), _MESH_STEP)
        self._instant += len(times)
        for number, solid in enumerate(self._solids, start=len(self._scene.walls)):
            held = np.zeros(power.shape, dtype=bool)
            held[at] = solid.holds(times[at], poses.centres[at])
            self._keep(number, times, held, power * _MESH_STEP)
        counted = np.zeros(power.shape, dtype=bool)
        for person, number in enumerate(self._people):
            held = self._inside_person(person, times, poses)
            # The power of a part that is inside of two others counts once.
            self._keep(number, times, held, power * ~counted)
            counted |= held

    def _keep(self, number: int, times: Array, held: Bools, power: Array) -> None:
        first = np.where(held, times[:, None], np.inf).min(axis=0, initial=np.inf)
        self._first_s[number] = np.minimum(self._first_s[number], first)
        self._power[number] += (power * held).sum(axis=0)

    def _inside_person(self, person: int, times: Array, poses: Poses) -> Bools:
        """Which parts (time, part) of others have their centres inside a person."""
        # The centres of other people's parts, in the axes where each part of this person is the
        # unit sphere.
        own, other = self._owner == person, np.flatnonzero(self._owner != person)
        away = poses.centres[:, other, None] - poses.centres[:, None, own]
        local = np.einsum("tqji,tpqj->tpqi", poses.frames[:, own], away)
        within = ((local / poses.semi_axes[own]) ** 2).sum(axis=-1) < 1
        # A trunk inside another trunk is an error, a hand is not.
        bad = (within & self._trunk[own]).any(axis=-1) & self._trunk[other]
        if bad.any():
            time, part = np.argwhere(bad)[0]
            raise InputError(
                f"at {times[time]:.2f} s the {self._names[other[part]]} is inside "
                f"'{self._things[self._people[person]]}'; move one of them (position_m, --at), or "
                "choose another interval (--start, --duration)"
            )
        held = np.zeros(poses.centres.shape[:2], dtype=bool)
        held[:, other] = within.any(axis=-1)
        return held

    def found(self, part_power: Array) -> list[tuple[str, float, str]]:
        """Return the name, power while inside [m^2] and message of each limit.

        ``part_power (part,)`` is the echo power of each part, over all instants [m^2]. An
        `InputError` is raised if a part with more than 5 % of that of its owner was inside a wall.
        """
        of_owner = np.bincount(self._owner, weights=part_power)[self._owner]
        walls = len(self._scene.walls)
        for number in range(walls):
            self._refuse(number, part_power > REFUSED_FRACTION * of_owner)
        # Which of the things are walls, furniture, objects and people.
        objects = walls + sum(one.moving is None for one in self._solids)
        people = len(self._things) - len(self._people)
        untouched = "taken as if it were not there"
        limits = []
        for name, what, first, last in (
            ("inside_wall", f"a wall, {untouched}", 0, walls),
            ("inside_furniture", f"furniture, {untouched}", walls, objects),
            ("inside_object", f"objects that move, {untouched}", objects, people),
            ("inside_person", "another person, in whom they are hidden", people, None),
        ):
            first_s, names = self._first_s[first:last], self._things[first:last]
            # Each part in each thing, with the first time that it was inside.
            said = [
                f"the {self._names[part]} in '{names[number]}' from {first_s[number, part]:.2f} s"
                for number, part in np.argwhere(np.isfinite(first_s))
            ]
            if said:
                power = float(self._power[first:last].sum())
                message = f"echo power from parts inside {what}: {', '.join(said)}"
                limits.append((name, power, message))
        return limits

    def _refuse(self, number: int, parts: Bools) -> None:
        """Raise InputError if any of some parts (part,) was inside a wall."""
        first_s = self._first_s[number]
        found = np.flatnonzero(parts & np.isfinite(first_s))
        if len(found):
            part = int(found[first_s[found].argmin()])
            raise InputError(
                f"scene '{self._scene.name}': at {first_s[part]:.2f} s the {self._names[part]} of "
                f"the person is inside wall '{self._things[number]}'; move the person (position_m, "
                "heading_deg) or the wall, or choose another interval (--start, --duration)"
            )


class _Solid:
    """Furniture or an object by its mesh, and its ``moving`` pose if it has one."""

    def __init__(self, piece: Furniture) -> None:
        self.name, self.moving = piece.name, piece if isinstance(piece, Object) else None
        self.mesh: Triangles = self.moving.shape if self.moving else piece.triangles()

    def holds(self, times: Array, points: Array) -> NDArray[np.bool_]:
        """Tell which of the points (time, point, 3) [m] are inside at their times (time,) [s]."""
        # In the axes of the object, where its mesh stands still.
        if self.moving is not None:
            rotation, place = self.moving.pose(times)
            points = np.einsum("tji,tpj->tpi", rotation, points - place[:, None])
        return self.mesh.holds(points)

    def places(self, times: Array) -> Array:
        """Return places (time, place, 3) of the body of an object [m]."""
        assert self.moving is not None
        # Corners and middles of faces, thinned to a few and moved in a little, so that touching
        # does not count.
        found = np.concatenate([self.mesh.vertices, self.mesh.corners.mean(axis=1)])
        found = found[:: -(-len(found) // _PLACES)]
        middle = (found.min(axis=0) + found.max(axis=0)) / 2
        rotation, place = self.moving.pose(times)
        shrunk = middle + _SHRUNK * (found - middle)
        return np.einsum("tij,pj->tpi", rotation, shrunk) + place[:, None]


def objects_inside(scene: Scene, duration_s: float) -> list[Limit]:
    """Return a limit if objects are inside one another or furniture during a capture."""
    times = np.linspace(0.0, duration_s, _INSTANTS)
    solids = [_Solid(piece) for piece in (*scene.furniture, *scene.objects)]
    said, share = [], np.zeros(_INSTANTS, dtype=bool)
    # Every object that moves against every closed piece.
    for one in solids:
        if one.moving is None:
            continue
        places = one.places(times)
        for other in solids:
            if other is not one and other.mesh.closed:
                held = other.holds(times, places).any(axis=1)
                share |= held
                if held.any():
                    said.append(f"'{one.name}' in '{other.name}' from {times[held][0]:.2f} s")
    if not said:
        return []
    message = "instants at which objects are inside one another, each taken as if it were alone: "
    return [Limit("objects_overlap", float(share.mean()), message + ", ".join(said))]


def _inside_wall(wall: Wall, poses: Poses) -> NDArray[np.bool_]:
    """Which parts (time, part) are inside a wall: those whose centre is in the slab.

    A slab that is thinner than a part counts where it runs through the part at half its size.
    """
    depth = wall.depth_m(poses.centres)
    # Half the extent of an ellipsoid along the normal.
    along = np.einsum("tpij,i->tpj", poses.frames, wall.normal) * poses.semi_axes
    core = np.linalg.norm(along, axis=-1) / 2
    within = (depth >= _CONTACT_M) & (depth <= wall.thickness_m)
    return np.asarray(within | ((depth - core <= 0) & (depth + core >= wall.thickness_m)))
