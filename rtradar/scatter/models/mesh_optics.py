"""Echo models of people whose body is a mesh: physical optics over a skin that bends.

`physical-optics` sums facets at keyframes, as for ellipsoids: the carrier goes by the specular
point of the ellipsoid that has the same bone, exact at every chirp, and the sum over the skin
against it is slow. `reference` sums them at every chirp. `rays` that meet the skin once are the
sum over all facets that both antennas see: on a mesh this level is `physical-optics` with twice as
many keyframes, and more of them where an echo bends by less.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.body.body import Poses
from rtradar.echoes import Echoes
from rtradar.errors import InputError
from rtradar.kernels.scatter.specular_point import Geometry
from rtradar.radar import Radar
from rtradar.scatter.common.interpolation import ArrayNodes
from rtradar.scatter.common.poses import (
    BuiltInModel,
    ChirpPoses,
    EchoModel,
    chirp_poses,
    one_echo_a_part,
)
from rtradar.scatter.facets.skin import SkinFacets
from rtradar.scatter.models.physical_optics import PhysicalOptics
from rtradar.scatter.specular_point.solver import solve_specular_points

Array = NDArray[np.float64]

_REFERENCE_NODES = 7


class MeshOptics(PhysicalOptics):
    """`physical-optics` of people of whom some have a mesh.

    Parameters
    ----------
    anchor_s : float
        Time between keyframes [s]; where the echo bends it comes down to an eighth of it.
    tolerance : float
        Bend of a part's echo, over the root of the power of the whole person, above which keyframes
        come closer.
    unevenness : float
        Change of a part's echo over the array, over the same, above which it is computed at more
        places of the array.
    frequencies : int
        Number of frequencies over the sweep.

    Raises
    ------
    InputError
        Where an option is out of range.
    """

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str = "auto",
        spreading: bool = True,
        anchor_s: float = 10e-3,
        tolerance: float = 0.05,
        unevenness: float = 0.02,
        frequencies: int = 3,
    ) -> None:
        # An edge that crosses a limb fades over half an interval, not a whole one.
        self._look_s = anchor_s / 2
        super().__init__(
            radar,
            body,
            variant=variant,
            spreading=spreading,
            anchor_s=anchor_s,
            tolerance=tolerance,
            unevenness=unevenness,
            frequencies=frequencies,
        )

    def _surface_of(self, variant: str, facets: int | None, nodes: int) -> SkinFacets:
        return SkinFacets(
            self._radar,
            self._body,
            variant=variant,
            spreading=self._spreading,
            nodes=nodes,
            look_s=self._look_s,
        )

    def _carriers(self, at: Geometry | ChirpPoses) -> tuple[Array, Array]:
        length, _, _ = solve_specular_points(at)
        return length, _spread(at) if self._spreading else np.ones_like(length)

    def _field(
        self, time: float, pose: Poses, nodes: ArrayNodes, length: Array, parts: NDArray[np.int64]
    ) -> NDArray[np.complex128]:
        assert isinstance(self._surface, SkinFacets)
        places = nodes.antennas, nodes.pairs
        return self._surface.amplitude(time, pose.centres[0], *places, length, parts)


class MeshRays(MeshOptics):
    """`rays` of people of whom some have a mesh, with one bounce.

    Parameters
    ----------
    anchor_s : float
        Time between keyframes [s]; where the echo bends it comes down to an eighth of it.

    Raises
    ------
    InputError
        Where an option is out of range.
    """

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str = "auto",
        spreading: bool = True,
        anchor_s: float = 5e-3,
    ) -> None:
        super().__init__(
            radar, body, variant=variant, spreading=spreading, anchor_s=anchor_s, tolerance=0.02
        )


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
            nodes=_REFERENCE_NODES,
            look_s=radar.cycle_duration_s,
        )
        self.variant: str | None = self._surface.variant

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        at = chirp_poses(self._radar, self._body, np.asarray(chirps, dtype=np.int64))
        length, _, _ = solve_specular_points(at)
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


_KINDS: dict[str, type[EchoModel]] = {
    "physical-optics": MeshOptics,
    "rays": MeshRays,
    "reference": MeshReference,
}


def mesh_model(fidelity: str) -> type[EchoModel]:
    """Return the class of a level for people of whom some have a mesh.

    Parameters
    ----------
    fidelity : str
        Name of the level.

    Returns
    -------
    type

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


def _spread(at: Geometry | ChirpPoses) -> Array:
    """1 / (R1 R2) over the middle of each part (chirp, rx, part)."""
    tx, rx = (
        np.linalg.norm(place - at.centres[:, None], axis=-1)
        for place in (at.tx[:, None, None], at.rx[:, :, None])
    )
    return np.asarray(1 / (tx * rx))
