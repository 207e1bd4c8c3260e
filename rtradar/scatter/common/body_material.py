"""What the surface of the body does to the polarisation: a perfect conductor, or a half-space such as skin."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.common.polarization import antenna_field, apply_te_tm, bisector, copolar
from rtradar.scatter.common.poses import ChirpPoses
from rtradar.scene import Material, material, reflection

Array = NDArray[np.float64]
Field = NDArray[np.complex128]

BODY_MATERIALS = ("perfect-conductor", "skin")


def body_material(name: str, frequency_hz: Array) -> Material:
    """The material of that name, if it is known at these frequencies.

    Raises
    ------
    InputError
        Where a body is not made of that, or a frequency lies outside its limits.
    """
    if name not in BODY_MATERIALS:
        raise InputError(f"body material '{name}' is unknown; allowed: {', '.join(BODY_MATERIALS)}")
    chosen = material(name)
    chosen.eta(np.atleast_1d(np.asarray(frequency_hz, dtype=np.float64)))
    return chosen


def body_reflection(field: Field, directions: Array, normals: Array, eta: Field) -> Field:
    """The field right after reflection by a half-space, at the point where it is reflected.

    Parameters
    ----------
    field : (node, ..., 3) complex
        That arrives.
    directions : (..., 3) float64
        Unit vectors along which it travels.
    normals : (..., 3) float64
        Unit normals, out of the body.
    eta : (node,) complex128
        Relative permittivity, as of `Material.eta`; infinite for a perfect conductor: E_r = 2 (n.E) n - E_i.

    Returns
    -------
    (node, ..., 3) complex128
        Without the divergence of curved surfaces.
    """
    eta = np.asarray(eta, dtype=np.complex128)
    if np.isinf(eta).all():
        turned = 2 * np.sum(field * normals, axis=-1, keepdims=True) * normals - field
        return np.asarray(turned, dtype=np.complex128)
    cosine = np.clip(-np.sum(directions * normals, axis=-1), 0.0, 1.0)
    eta = eta.reshape(-1, *(1,) * cosine.ndim)
    te, tm = (reflection(eta, cosine, kind) for kind in ("te", "tm"))
    onward = directions - 2 * np.sum(directions * normals, axis=-1, keepdims=True) * normals
    return apply_te_tm(field, directions, onward, normals, te, tm)


def material_factor(
    to_tx: Array, to_rx: Array, eta: Field, polarization: Literal["v", "h"]
) -> Field:
    """Co-polar echo over that of a perfect conductor of the same shape.

    Parameters
    ----------
    to_tx, to_rx : (..., 3) float64
        Ways from the specular point to the antennas, of any length.
    eta : (node,) complex128
        Relative complex permittivity of the body at each frequency node.
    polarization : {"v", "h"}

    Returns
    -------
    (node, ...) complex128
        For exp(+j omega t); amplitudes of `Echoes` take its conjugate.
    """
    tx, rx = (way / np.linalg.norm(way, axis=-1, keepdims=True) for way in (to_tx, to_rx))
    sent, heard = antenna_field(-tx, polarization), antenna_field(-rx, polarization)
    field = np.broadcast_to(sent.astype(np.complex128), (len(eta), *sent.shape))
    back = -np.sum(heard * body_reflection(field, -tx, bisector(tx, rx), eta), axis=-1)
    own = copolar(tx, rx, polarization)
    known = np.abs(own) > 1e-6
    return np.asarray(np.where(known, back / np.where(known, own, 1.0), 1.0))


class Surface:
    """The surface of the body in free space, for models whose amplitudes are those of a conductor.

    Parameters
    ----------
    material : {"perfect-conductor", "skin"}
    radar : Radar

    Raises
    ------
    InputError
        Where a body is not made of that, or it is not known over the sweep.
    """

    def __init__(self, material: str, radar: Radar) -> None:
        ends = radar.start_frequency_hz + np.array([0.0, radar.bandwidth_hz])
        chosen = body_material(material, ends)
        self._conducts = chosen.conducts
        # Over a sweep the reflection of skin changes by a few hundredths: its middle stands for it.
        self._eta = chosen.eta(np.array([radar.centre_frequency_hz]))
        self._polarization = radar.polarization

    def echo(self, at: ChirpPoses, amplitude: NDArray[Any]) -> NDArray[Any]:
        """Amplitudes (chirp, rx, part) of `Echoes` from those of a conductor.

        The angle of incidence is that at the centre of each part, for the middle of the receivers: a line of them is short, and
        so near the normal a degree changes the reflection by less than 0.1 %.
        """
        if self._conducts:
            return amplitude
        middle = at.rx.mean(axis=1)
        to_tx, to_rx = at.tx[:, None] - at.centres, middle[:, None] - at.centres
        factor = material_factor(to_tx, to_rx, self._eta, self._polarization)[0]
        return np.asarray(amplitude * factor.conj()[:, None])
