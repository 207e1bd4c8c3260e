"""The echo model `reference`: physical optics over every facet, at every chirp and receiver."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.common.poses import BuiltInModel, chirp_poses, one_echo_a_part
from rtradar.scatter.facets.skin import facets_of_people
from rtradar.scatter.facets.target import facet_scattering
from rtradar.scatter.specular_point.solver import solve_specular_points

NODES = 7
"""Frequencies over the sweep. What is left of a part whose specular point is occluded comes from
beside it, and its phase changes over the sweep: three frequencies would not follow it."""


class Reference(BuiltInModel):
    """`reference`: all facets at every chirp.

    The other levels are compared with it.

    Occlusion: facet by facet. Each Tx and Rx is asked in every TDM cycle which corners it sees. In
    one cycle of the paper's radars a limb at 5 m/s goes 4 mm, less than a facet.

    Parameters
    ----------
    facets : int, optional
        Least number per part, 20 to 1 310 720; None: by the wavelength, 5120 at 12 GHz and 20 480
        at 77 GHz for a grown person. A mesh is always divided by the wavelength.
    """

    accepts_meshes = True
    scattering = staticmethod(facet_scattering)
    relative_cost = 200.0

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str = "auto",
        spreading: bool = True,
        facets: int | None = None,
    ) -> None:
        self._radar, self._body = radar, body
        self._surface = facets_of_people(
            "reference",
            radar,
            body,
            variant=variant,
            spreading=spreading,
            nodes=NODES,
            facets=facets,
            look_s=radar.cycle_duration_s,
        )
        self.variant: str | None = self._surface.variant

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        chirps = np.asarray(chirps, dtype=np.int64)
        at = chirp_poses(self._radar, self._body, chirps)
        length, _, _ = solve_specular_points(at)
        amplitude = self._surface.at_chirps(chirps, at, length)
        return one_echo_a_part(at.tx_index, length, amplitude, self._surface.frequency)
