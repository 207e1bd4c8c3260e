"""Polarisation and patterns: what antennas send and receive, and what surfaces do to it.

A surface multiplies the TE and the TM part of a field by one coefficient each. The body's surface
is a perfect conductor, or a half-space such as skin.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, TypeGuard

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.front_end import Antenna
from rtradar.radar import Radar
from rtradar.scene import Material, material, reflection

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

CONDUCTOR = "perfect-conductor"
BODY_MATERIALS = (CONDUCTOR, "skin")

POLARIZATIONS: tuple[Literal["te"], Literal["tm"]] = ("te", "tm")

STEEP = 1e-9
"""Sine of the angle from the antenna's own up below which v has no direction of its own."""
_NORMAL_INCIDENCE = 1e-9
"""Sine of incidence below which the plane of incidence has no direction of its own."""


def unit(vectors: Array) -> Array:
    """Return unit vectors (..., 3); 0 for no direction."""
    # Coordinate by coordinate, because NumPy is ten times slower in adding along an axis of three.
    x, y, z = vectors[..., 0], vectors[..., 1], vectors[..., 2]
    size = np.sqrt(x * x + y * y + z * z)
    scale = np.where(size > 1e-12, 1 / np.maximum(size, 1e-12), 0.0)
    return np.asarray(vectors * scale[..., None])


class Polarization(NamedTuple):
    """How antennas are turned, and which way their field points.

    ``axes`` (3, 3) are their boresight, left and up in the world, as columns, by default the
    world's own. There may be one for each of the first indices of directions, (..., 3, 3).
    """

    kind: Literal["v", "h"]
    axes: Array = np.eye(3)

    @property
    def up(self) -> Array:
        """Unit vector (..., 3) across which h is, and along which v is as far as it can be."""
        return self.axes[..., 2]

    @property
    def ahead(self) -> Array:
        """Unit vector (..., 3) that takes the place of ``up`` in directions along that."""
        return self.axes[..., 0]

    def seen(self, directions: Array) -> Array:
        """Return directions of the world (..., 3) in the axes of the antennas."""
        flat = directions.reshape(*self.axes.shape[:-2], -1, 3)
        return np.asarray((flat @ self.axes).reshape(directions.shape))


def antenna_field(
    directions: Array, polarization: Polarization, *, x_for_steep: bool = False
) -> Array:
    """Compute the polarisation of the field that an antenna sends in some directions.

    The directions (..., 3) are unit vectors, and so is the result: v is the antenna's up projected
    across the direction, h is across both. Where the direction is along up, the boresight takes the
    place of up with ``x_for_steep``; else the field is 0 there.
    """
    # Each radar pose has one up, for all directions that share its first indices.
    missing = (1,) * (directions.ndim - polarization.up.ndim)
    up, ahead = (
        own.reshape(*own.shape[:-1], *missing, 3) for own in (polarization.up, polarization.ahead)
    )
    if x_for_steep:
        steep = np.linalg.norm(np.cross(directions, up), axis=-1, keepdims=True) < STEEP
        up = np.where(steep, ahead, up)
    along = np.sum(up * directions, axis=-1, keepdims=True)
    return unit(up - along * directions if polarization.kind == "v" else np.cross(directions, up))


def sent_field(
    antenna: Antenna | None,
    directions: Array,
    polarization: Polarization,
    *,
    x_for_steep: bool = False,
) -> Array:
    """Compute the field that an antenna sends, `antenna_field` times `pattern_of`."""
    field = antenna_field(directions, polarization, x_for_steep=x_for_steep)
    return field * pattern_of(antenna, directions, polarization)[..., None]


def pattern_of(antenna: Antenna | None, directions: Array, polarization: Polarization) -> Array:
    """Compute the amplitude that an antenna sends in directions (..., 3) of any length.

    It is the root of the power pattern, relative to its peak (...). None is an isotropic antenna.
    """
    if not is_shaped(antenna):
        return np.ones(directions.shape[:-1])
    return np.sqrt(antenna.relative(polarization.seen(directions), polarization.kind))


def is_shaped(antenna: Antenna | None) -> TypeGuard[Antenna]:
    """Whether the antenna looks more into some directions than into others."""
    return antenna is not None and antenna.pattern != "isotropic"


def bisector(to_tx: Array, to_rx: Array) -> Array:
    """Return the unit normals (..., 3) of a surface that reflects Tx into Rx.

    The arguments are unit vectors (..., 3) from the surface to the antennas. Where these are
    exactly opposite, the normal is 0.
    """
    return unit(to_tx + to_rx)


def apply_te_tm(
    field: NDArray[Any],
    arriving: Array,
    leaving: Array,
    normal: Array,
    te: NDArray[Any],
    tm: NDArray[Any],
) -> NDArray[Any]:
    """Multiply the TE and the TM part of a plane wave by a coefficient each.

    The field (node, ..., 3), which travels along the unit vectors ``arriving (..., 3)``, leaves
    along ``leaving`` a surface with the unit normal (3,) or (..., 3). ``te`` and ``tm`` are (node,
    ...).
    """
    # TE is across the plane of incidence; TM lies in it, and turns with the ray.
    across = np.cross(arriving, normal)
    sine = np.linalg.norm(across, axis=-1, keepdims=True)
    # At normal incidence both coefficients do the same: any direction across the ray serves.
    spare = unit(np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=-1)]))
    across = np.where(sine > _NORMAL_INCIDENCE, across / np.where(sine > 0, sine, 1.0), spare)
    in_te = np.einsum("...i,...i", field, across) * te
    in_tm = np.einsum("...i,...i", field, np.cross(across, arriving)) * tm
    return np.asarray(in_te[..., None] * across + in_tm[..., None] * np.cross(across, leaving))


def copolar(to_tx: Array, to_rx: Array, polarization: Polarization) -> Array:
    """Compute the co-polar fraction of the field that a conductor reflects from Tx to Rx.

    ``to_tx`` and ``to_rx (..., 3)`` are vectors from the target to the antennas, of any length. The
    fraction (...) is that of E_r = 2 (n.E) n - E_i between unit vectors of polarisation, n their
    bisector; it is 1 where Tx and Rx are one, where they are exactly opposite, and where v has no
    direction. On that surface the current of physical optics, 2 n x H, radiates just this times the
    scalar with the mean of n.s_T and n.s_R, once averaged with its own reciprocal.

    Equation :eq:`polarization` of the theory page.
    """
    tx, rx = unit(to_tx), unit(to_rx)
    normal = bisector(tx, rx)
    sent, received = antenna_field(tx, polarization), antenna_field(rx, polarization)
    fraction = np.sum(sent * received, axis=-1) - 2 * np.sum(sent * normal, axis=-1) * np.sum(
        received * normal, axis=-1
    )
    # Where one of these directions is missing the conductor counts as one that keeps polarisation.
    known = sent.any(axis=-1) & received.any(axis=-1) & normal.any(axis=-1)
    return np.asarray(np.where(known, fraction, 1.0))


def driven_currents(to_tx: Array, to_rx: Array, polarization: Polarization) -> tuple[Array, Array]:
    """Compute what the currents of physical optics radiate, as a function of the normal n.

    The current 2 n x H radiates the co-polar obliquity ``along (...)`` times n.s_T plus n times the
    vector ``across (..., 3)``: e_R.e_T and -(e_R.s_T) e_T for unit vectors of polarisation e and
    unit vectors s to the antennas. Where v has no direction it is n.s_T.
    """
    tx, rx = unit(to_tx), unit(to_rx)
    sent, received = antenna_field(tx, polarization), antenna_field(rx, polarization)
    known = sent.any(axis=-1) & received.any(axis=-1)
    along = np.where(known, np.sum(sent * received, axis=-1), 1.0)
    return along, -np.sum(received * tx, axis=-1, keepdims=True) * sent


# -- the body's surface ----------------------------------------------------------------------------


def body_material(name: str, frequency_hz: Array) -> Material:
    """Return the material of that name, if it is known at these frequencies.

    An `InputError` is raised if a body is not made of that, or a frequency is outside its limits.
    """
    if name not in BODY_MATERIALS:
        raise InputError(f"body material '{name}' is unknown; allowed: {', '.join(BODY_MATERIALS)}")
    chosen = material(name)
    chosen.eta(np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64)))
    return chosen


def body_reflection(field: Field, directions: Array, normals: Array, eta: Field) -> Field:
    """Compute the field right after reflection by a half-space, at the specular point.

    The incident field (node, ..., 3) travels along the unit vectors ``directions (..., 3)``; the
    unit normals are out of the body. ``eta (node,)`` is the relative permittivity, infinite for a
    perfect conductor, for which E_r = 2 (n.E) n - E_i. The divergence of curved surfaces is left
    out.
    """
    eta = np.asarray(eta, dtype=np.complex128)
    if np.isinf(eta).all():
        turned = 2 * np.einsum("...i,...i", field, normals)[..., None] * normals - field
        return np.asarray(turned, dtype=np.complex128)
    cosine = np.clip(-np.sum(directions * normals, axis=-1), 0.0, 1.0)
    # One coefficient for each node and angle, TE and TM apart.
    eta = eta.reshape(-1, *(1,) * cosine.ndim)
    te, tm = (reflection(eta, cosine, kind) for kind in POLARIZATIONS)
    onward = directions - 2 * np.sum(directions * normals, axis=-1, keepdims=True) * normals
    return apply_te_tm(field, directions, onward, normals, te, tm)


def over_copolar(field: Field, to_tx: Array, to_rx: Array, polarization: Polarization) -> Field:
    """Divide a co-polar field (node, ...) by that of a conductor; 1 where that has none."""
    own = copolar(to_tx, to_rx, polarization)
    known = np.abs(own) > 1e-6
    return np.asarray(np.where(known, field / np.where(known, own, 1.0), 1.0))


class Surfaces:
    """The surfaces of parts, each a perfect conductor or skin.

    ``materials (part,)`` are their names; ``straight (part,)`` are amplitudes of `Echoes` at normal
    incidence over those of conductors, at the middle of the sweep. An `InputError` is raised for
    other names, and if a material is not known over the radar's sweep.
    """

    def __init__(self, materials: Sequence[str], radar: Radar) -> None:
        ends = radar.start_frequency_hz + np.array([0.0, radar.bandwidth_hz])
        self._of_part = np.array(materials)
        self._kinds = {name: body_material(name, ends) for name in dict.fromkeys(materials)}
        # Over a sweep the reflection of skin changes by a few hundredths, so the one at its middle
        # serves for all of it. At normal incidence a conductor counts as +1.
        eta = [self._kinds[name].eta(np.array(radar.centre_frequency_hz)) for name in materials]
        self.straight = reflection(np.array(eta), 1.0, "tm").conj()

    @property
    def conduct(self) -> bool:
        """Whether all of them are perfect conductors."""
        return all(kind.conducts for kind in self._kinds.values())

    def reflected(
        self, part: NDArray[np.int64], field: Field, directions: Array, normals: Array, nodes: Array
    ) -> Field:
        """Compute fields after reflection by some parts (echo,), see `body_reflection`.

        The field is (node, ..., echo, 3) at the frequencies ``nodes (node,)`` [Hz].
        """
        # Parts of one material are reflected together.
        alike = [
            (np.flatnonzero(self._of_part[part] == name), kind.eta(nodes))
            for name, kind in self._kinds.items()
        ]
        if len(alike) == 1:
            return body_reflection(field, directions, normals, alike[0][1])
        shape = np.broadcast_shapes(field.shape, directions.shape, normals.shape)
        out = np.empty((len(nodes), *shape[1:]), dtype=np.complex128)
        for own, eta in alike:
            arriving, ways = field[..., own, :], directions[..., own, :]
            out[..., own, :] = body_reflection(arriving, ways, normals[..., own, :], eta)
        return out
