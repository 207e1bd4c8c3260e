"""The echo model `specular`: bistatic near-field geometric optics per chirp, with traced occlusion of the specular point."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from rtradar.body import Body
from rtradar.echoes import Echoes
from rtradar.radar import Radar
from rtradar.scatter.common.body_material import Surface
from rtradar.scatter.common.poses import BuiltInModel, chirp_poses, one_echo_a_part
from rtradar.scatter.specular_point.solver import solve_specular_points
from rtradar.scatter.specular_point.visibility import SpecularVisibility
from rtradar.trace.backends.backend import select, use
from rtradar.trace.body_tracer import BodyTracer


class Specular(BuiltInModel):
    """`specular`: lengths and returns in float64 at every chirp, occlusion from Mitsuba.

    Parameters
    ----------
    radar : Radar
    body : Body
    variant : {"auto", "cpu", "llvm", "scalar", "cuda"}
        Mitsuba's backend.
    spreading : bool
        Whether amplitudes hold 1 / (R1 R2).
    material : {"perfect-conductor", "skin"}
        Material of the body's surface.

    Raises
    ------
    InputError
        Where a body is not made of that, or it is not known over the sweep.
    """

    supports_rooms = True
    relative_cost = 1.5

    def __init__(
        self,
        radar: Radar,
        body: Body,
        *,
        variant: str = "auto",
        spreading: bool = True,
        material: str = "perfect-conductor",
    ) -> None:
        self._radar, self._body, self._spreading = radar, body, spreading
        self._surface = Surface(material, radar)
        backend = select(variant)
        self.variant: str | None = backend.kind
        self.visibility = SpecularVisibility(radar, body, BodyTracer(use(backend), body.semi_axes))

    def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
        """Echoes at these chirps."""
        at = chirp_poses(self._radar, self._body, chirps)
        weight, start = self.visibility.at(chirps)
        length, amplitude, _ = solve_specular_points(
            at, start=start, polarization=self._radar.polarization, spreading=self._spreading
        )
        echo = self._surface.echo(at, amplitude * weight)
        return one_echo_a_part(at.tx_index, length, echo, self._radar.centre_frequency_hz)
