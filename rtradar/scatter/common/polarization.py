"""Polarisation and patterns: what antennas send and receive, and what surfaces do to it.

A surface multiplies the TE and the TM part of a field by one coefficient each. The body's surface
is a perfect conductor, or a half-space such as skin. In free space the echoes of any model go over
legs that have these patterns, and reflect off these materials.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, TypeGuard

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.front_end import Antenna
from rtradar.radar import Radar
from rtradar.scatter.common.poses import ChirpPoses, EchoModel, account_of, chirp_poses
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
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(np.where(size > 1e-12, vectors / np.where(size > 1e-12, size, 1.0), 0.0))


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
    across the direction, h is across both. Where the direction is along up, its boresight is used
    in place of that with ``x_for_steep``; else the field is 0 there.
    """
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

    It is the root of the power pattern, relative to its peak (...); no antenna is isotropic.
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
    eta = eta.reshape(-1, *(1,) * cosine.ndim)
    te, tm = (reflection(eta, cosine, kind) for kind in POLARIZATIONS)
    onward = directions - 2 * np.sum(directions * normals, axis=-1, keepdims=True) * normals
    return apply_te_tm(field, directions, onward, normals, te, tm)


def material_factor(to_tx: Array, to_rx: Array, eta: Field, polarization: Polarization) -> Field:
    """Compute the co-polar echo over that of a perfect conductor of the same shape.

    ``to_tx`` and ``to_rx (..., 3)`` are vectors from the specular point to the antennas, of any
    length; ``eta (node,)`` is the relative permittivity of the body. The factor (node, ...) is for
    exp(+j omega t); amplitudes of `Echoes` take its conjugate.
    """
    tx, rx = (way / np.linalg.norm(way, axis=-1, keepdims=True) for way in (to_tx, to_rx))
    sent, received = antenna_field(-tx, polarization), antenna_field(-rx, polarization)
    field = np.broadcast_to(sent.astype(np.complex128), (len(eta), *sent.shape))
    back = -np.sum(received * body_reflection(field, -tx, bisector(tx, rx), eta), axis=-1)
    return over_copolar(back, tx, rx, polarization)


def over_copolar(field: Field, to_tx: Array, to_rx: Array, polarization: Polarization) -> Field:
    """Divide a co-polar field (node, ...) by that of a conductor; 1 where that has none."""
    own = copolar(to_tx, to_rx, polarization)
    known = np.abs(own) > 1e-6
    return np.asarray(np.where(known, field / np.where(known, own, 1.0), 1.0))


class Surfaces:
    """The surfaces of parts, each a perfect conductor or skin.

    ``materials (part,)`` are their names. An `InputError` is raised for other names, and if a
    material is not known over the radar's sweep.
    """

    def __init__(self, materials: Sequence[str], radar: Radar) -> None:
        ends = radar.start_frequency_hz + np.array([0.0, radar.bandwidth_hz])
        self._of_part = np.array(materials)
        self._kinds = {name: body_material(name, ends) for name in dict.fromkeys(materials)}
        # Over a sweep the reflection of skin changes by a few hundredths: that at its middle
        # serves for all of it.
        self._centre_hz = np.array([radar.centre_frequency_hz])
        self._kind = radar.polarization

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

    def factor(self, at: ChirpPoses) -> NDArray[np.complex128]:
        """Compute amplitudes (chirp, part) of `Echoes` over those of conductors.

        The angle of incidence is that at the centre of each part, for the middle of the receivers:
        a line of them is short, and so near the normal a degree changes the reflection by less than
        0.1 %.
        """
        to_tx = at.tx[:, None] - at.centres
        to_rx = at.rx.mean(axis=1)[:, None] - at.centres
        out = np.ones(to_tx.shape[:2], dtype=np.complex128)
        for name, kind in self._kinds.items():
            if not kind.conducts:
                own = np.flatnonzero(self._of_part == name)
                ways, eta = (to_tx[:, own], to_rx[:, own]), kind.eta(self._centre_hz)
                sent = Polarization(self._kind, at.axes)
                out[:, own] = material_factor(*ways, eta, sent)[0].conj()
        return out


# -- legs in free space ----------------------------------------------------------------------------


def specular_points(at: ChirpPoses) -> NDArray[np.float64]:
    """Points (chirp, rx, part, 3) whose normals bisect Tx and Rx, as seen from the centres [m].

    The specular point but for terms of the part's size over its distance, and what is seen of a
    part lies about it.
    """
    tx, rx = (
        unit(antenna - at.centres[:, None]) for antenna in (at.tx[:, None, None], at.rx[:, :, None])
    )
    normal = np.einsum("tpji,trpj->trpi", at.frames, tx + rx) * at.semi_axes
    # A normal of a unit sphere that is stretched to the ellipsoid.
    local = at.semi_axes * unit(normal)
    return np.asarray(at.centres[:, None] + np.einsum("tpij,trpj->trpi", at.frames, local))


def leg_gain(radar: Radar, at: ChirpPoses) -> NDArray[np.float64]:
    """Amplitude (chirp, rx, part) that both antennas leave, relative to their patterns' peaks.

    The square root of the power pattern of the Tx in the direction of the part, times that of the
    Rx.
    """
    points, polarization = specular_points(at), Polarization(radar.polarization, at.axes)
    sent = pattern_of(radar.tx_antenna, points - at.tx[:, None, None], polarization)
    return sent * pattern_of(radar.rx_antenna, points - at.rx[:, :, None], polarization)


def over_legs(
    model: EchoModel, radar: Radar, body: Body, materials: Sequence[str] = ()
) -> EchoModel:
    """Wrap the model of a conductor before isotropic antennas by what legs in free space do.

    These are the patterns of the antennas, and the reflection of the body's ``materials (part,)``,
    which are perfect conductors if they are left out.
    """
    surfaces = Surfaces(materials or (CONDUCTOR,) * len(body.part_names), radar)
    plain = not (is_shaped(radar.tx_antenna) or is_shaped(radar.rx_antenna))
    return model if plain and surfaces.conduct else _OverLegs(model, radar, body, surfaces)


class _OverLegs:
    """Echoes of several bounces are given the directions of the part they bounce off last.

    Each part reflects with one coefficient, that of the angle at its specular point: what comes
    from far beside it, and bounces at other angles, are approximated so.
    """

    def __init__(self, model: EchoModel, radar: Radar, body: Body, surfaces: Surfaces) -> None:
        self._model, self._radar, self._body, self._surfaces = model, radar, body, surfaces
        self.traces = bool(getattr(model, "traces", False))

    @property
    def variant(self) -> str | None:
        """Backend that traced, or None."""
        return self._model.variant

    def account(self) -> dict[str, Any] | None:
        """Report what the model did."""
        return account_of(self._model)

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        echoes = self._model.echoes(chirps)
        at = chirp_poses(self._radar, self._body, chirps)
        amplitude = echoes.amplitude
        if is_shaped(self._radar.tx_antenna) or is_shaped(self._radar.rx_antenna):
            amplitude = amplitude * leg_gain(self._radar, at)[..., echoes.part]
        if not self._surfaces.conduct:
            factor = self._surfaces.factor(at)[:, echoes.part] ** echoes.bounces
            amplitude = amplitude * factor[:, None]
        return dataclasses.replace(echoes, amplitude=amplitude)
