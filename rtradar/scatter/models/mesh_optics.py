"""Echo models of people whose body is a mesh, a skin that bends.

`physical-optics` sums facets at keyframes, as for ellipsoids. `reference` sums them at every chirp.
`rays` that meet the skin once are the sum over all facets that both antennas see: on a mesh this
level is `physical-optics` with twice as many keyframes, and more of them where an echo bends by
less.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.radar import Radar
from rtradar.scatter.common.poses import BuiltInModel, EchoModel, chirp_poses, one_echo_a_part
from rtradar.scatter.facets.skin import SkinFacets
from rtradar.scatter.models.physical_optics import PhysicalOptics
from rtradar.scatter.models.reference import NODES


class MeshReference(BuiltInModel):
    """`reference` of people of whom some have a mesh: every facet at every chirp and receiver."""

    def __init__(
        self, radar: Radar, body: Body, *, variant: str = "auto", spreading: bool = True
    ) -> None:
        self._radar, self._body = radar, body
        self._surface = SkinFacets(
            radar,
            body,
            variant=variant,
            spreading=spreading,
            nodes=NODES,
            look_s=radar.cycle_duration_s,
        )
        self.variant: str | None = self._surface.variant

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        at = chirp_poses(self._radar, self._body, np.asarray(chirps, dtype=np.int64))
        length, _ = self._surface.carriers(at)
        times = self._radar.centres_of(chirps)
        receivers, parts = np.arange(1, 1 + at.rx.shape[1]), np.arange(length.shape[2])
        pairs = np.stack([np.zeros_like(receivers), receivers], axis=1)
        amplitude = np.stack(
            [
                self._surface.amplitude(
                    float(time),
                    at.centres[chirp],
                    np.concatenate([at.tx[chirp, None], at.rx[chirp]]),
                    pairs,
                    length[chirp],
                    parts,
                )
                for chirp, time in enumerate(times)
            ],
            axis=1,
        )
        return one_echo_a_part(at.tx_index, length, amplitude, self._surface.frequency)


_KINDS: dict[str, Callable[..., EchoModel]] = {
    "physical-optics": PhysicalOptics,
    "rays": partial(PhysicalOptics, anchor_s=5e-3, tolerance=0.02),
    "reference": MeshReference,
}


def mesh_model(fidelity: str) -> Callable[..., EchoModel]:
    """Return what makes a level for people of whom some have a mesh.

    Parameters
    ----------
    fidelity : str
        Name of the level.

    Returns
    -------
    callable

    Raises
    ------
    InputError
        Where the level takes ellipsoids only.
    """
    if fidelity not in _KINDS:
        raise InputError(
            f"fidelity '{fidelity}' takes people of ellipsoids, not body = 'mesh': it needs "
            f"curvature in closed form; allowed for a mesh: {', '.join(_KINDS)}"
        )
    return _KINDS[fidelity]
