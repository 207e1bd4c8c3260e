"""Co-polar reflection by a conductor, for models that integrate over surfaces as scalars."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray


def copolar(
    to_tx: NDArray[np.float64], to_rx: NDArray[np.float64], polarization: Literal["v", "h"]
) -> NDArray[np.float64]:
    """Share of the field that stays in its polarisation, reflected by a mirror whose normal halves the angle of Tx and Rx.

    Parameters
    ----------
    to_tx, to_rx : (..., 3) float64
        Ways from the target to the antennas, of any length, world axes.
    polarization : {"v", "h"}
        v is world z projected across each line of sight, h is across both.

    Returns
    -------
    (...) float64
        E_r = 2 (n.E) n - E_i between unit vectors of polarisation; 1 where Tx and Rx are one, where they are exactly
        opposite, and where v has no direction.

    Notes
    -----
    On that mirror the current of physical optics, 2 n x H, radiates just this times the scalar with the mean of n.s_T and
    n.s_R, once averaged with its own reciprocal.

    Equation :eq:`polarization` of the theory page.
    """
    tx, rx = (way / np.linalg.norm(way, axis=-1, keepdims=True) for way in (to_tx, to_rx))
    normal = tx + rx
    size = np.linalg.norm(normal, axis=-1, keepdims=True)
    normal = normal / np.where(size > 1e-12, size, 1.0)
    up = np.array([0.0, 0.0, 1.0])
    sent, heard = (
        np.cross(up, way) if polarization == "h" else up - way[..., 2:] * way for way in (tx, rx)
    )
    norms = np.linalg.norm(sent, axis=-1) * np.linalg.norm(heard, axis=-1)
    share = np.sum(sent * heard, axis=-1) - 2 * np.sum(sent * normal, axis=-1) * np.sum(
        heard * normal, axis=-1
    )
    known = (norms > 1e-12) & (size[..., 0] > 1e-12)
    return np.asarray(np.where(known, share / np.where(known, norms, 1.0), 1.0))
