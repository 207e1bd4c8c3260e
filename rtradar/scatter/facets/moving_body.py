"""A moving body as facets: what the models `physical-optics` and `reference` share."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import sweep_nodes
from rtradar.scatter.common.polarization import copolar
from rtradar.scatter.facets.integral import facet_integral
from rtradar.scatter.facets.shadows import FacetShadows, Shares
from rtradar.scatter.facets.surfaces import body_facets, ellipsoid_facets, subdivisions_for
from rtradar.trace.backends.backend import select, use
from rtradar.trace.facet_visibility import FacetTracer


class FacetBody:
    """The facets of a body, and what hides them.

    Parameters
    ----------
    radar : Radar
    body : Body
    variant : {"auto", "cpu", "llvm", "scalar", "cuda"}
        Mitsuba's backend.
    spreading : bool
        Whether amplitudes hold 1 / (R1 R2).
    facets : int, optional
        Least number per part; None: by the wavelength, see `body_facets`.
    nodes : int
        Frequencies over the sweep.

    Attributes
    ----------
    variant : str
        Kind of the backend in use.
    frequency : (node,) float64
        [Hz].
    """

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str,
        spreading: bool,
        facets: int | None,
        nodes: int,
    ) -> None:
        self._radar, self._semi_axes, self._spreading = radar, body.semi_axes, spreading
        count = body_facets(body.semi_axes, radar.centre_frequency_hz) if facets is None else facets
        self._facets = ellipsoid_facets(body.semi_axes, subdivisions_for(count))
        self.frequency = sweep_nodes(radar, nodes)
        backend = select(variant)
        self.variant = backend.kind
        self._shadows = FacetShadows(
            FacetTracer(use(backend), body.semi_axes), self._facets, body.semi_axes
        )

    def seen(
        self,
        centres: NDArray[np.float64],
        frames: NDArray[np.float64],
        antennas: NDArray[np.float64],
        parts: NDArray[np.int64],
    ) -> Shares:
        """Shares of facets of these parts (n,) that antennas (antenna, 3) see, in one pose."""
        return self._shadows.shares(centres, frames, antennas, parts)

    def amplitude(
        self,
        centres: NDArray[np.float64],
        frames: NDArray[np.float64],
        antennas: NDArray[np.float64],
        pairs: NDArray[np.integer],
        length: NDArray[np.float64],
        seen: Shares,
        index: NDArray[np.integer],
        parts: NDArray[np.int64],
    ) -> NDArray[np.complex128]:
        """Amplitude of `Echoes` for poses and pairs of antennas.

        Parameters
        ----------
        centres, frames : (pose, part, 3), (pose, part, 3, 3) float64
            World [m].
        antennas : (pose, antenna, 3) float64
            World [m].
        pairs : (pair, 2) int
            Tx and Rx, among the antennas of a pose.
        length : (pose, pair, n) float64
            Carriers [m].
        seen : Shares
            From `seen`, for some antennas and these parts.
        index : (pose, antenna) int
            Which of those antennas each is.
        parts : (n,) int64
            Which parts.

        Returns
        -------
        (node, pose, pair, n) complex128
            [m].
        """
        poses, n = len(centres), len(parts)
        chosen = centres[:, parts]
        local = np.einsum(
            "tpji,tpaj->tpai", frames[:, parts], antennas[:, None] - chosen[:, :, None]
        )
        field = facet_integral(
            self._facets,
            np.tile(parts, poses),
            local.reshape(poses * n, *local.shape[2:]),
            np.swapaxes(seen.row[index], 1, 2).reshape(poses * n, index.shape[1]),
            seen.share,
            pairs,
            np.swapaxes(length, 1, 2).reshape(poses * n, len(pairs)),
            np.broadcast_to(
                2 * np.pi * self.frequency / SPEED_OF_LIGHT_MPS, (poses * n, len(self.frequency))
            ),
            spreading=self._spreading,
        )
        field = np.moveaxis(
            field.reshape(poses, n, len(pairs), len(self.frequency)), (3, 0, 2, 1), (0, 1, 2, 3)
        )
        to_tx, to_rx = (antennas[:, pairs[:, side], None] - chosen[:, None] for side in (0, 1))
        return np.asarray(
            np.conj(field) * copolar(to_tx, to_rx, self._radar.polarization), dtype=np.complex128
        )
