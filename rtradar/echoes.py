"""`Echoes`: what every echo model returns, and all that the signal stage knows of the scene."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, kw_only=True)
class Echoes:
    """Echoes of a block of chirps, which :eq:`received-spectrum` and :eq:`if-signal` define.

    Parameters
    ----------
    length : (chirp, rx, echo) float64
        Length of the whole path from Tx to Rx at the centre of the chirp [m].
    amplitude : (node, chirp, rx, echo) complex
        Conjugate of the scattering length, the phase of ``length`` taken out, spreading included
        [m]; it is 0 where the echo is occluded.
    frequency : (node,) float64
        Frequencies [Hz] at which ``amplitude`` is given: the polynomial through the nodes; one node
        means constant.
    tx : (chirp,) int64
        Transmitter of each chirp.
    part : (echo,) int64
        Body part (or wall) that each echo comes from.
    bounces : (echo,) int64
        Reflections on the way.

    Raises
    ------
    ValueError
        Where the shapes do not fit each other.
    """

    length: NDArray[np.float64]
    amplitude: NDArray[np.complexfloating]
    frequency: NDArray[np.float64]
    tx: NDArray[np.int64]
    part: NDArray[np.int64]
    bounces: NDArray[np.int64]

    def __post_init__(self) -> None:
        for field, kind in (("length", np.float64), ("amplitude", None), ("frequency", np.float64)):
            object.__setattr__(self, field, np.asarray(getattr(self, field), dtype=kind))
        for field in ("tx", "part", "bounces"):
            object.__setattr__(self, field, np.asarray(getattr(self, field), dtype=np.int64))
        if self.length.ndim != 3:
            raise ValueError(
                f"Echoes.length has shape {self.length.shape}; it must be (chirp, rx, echo)"
            )
        chirps, _, echoes = self.length.shape
        expected = {
            "amplitude": (*self.frequency.shape, *self.length.shape),
            "frequency": (max(1, self.frequency.size),),
            "tx": (chirps,),
            "part": (echoes,),
            "bounces": (echoes,),
        }
        for field, shape in expected.items():
            if getattr(self, field).shape != shape:
                raise ValueError(
                    f"Echoes.{field} has shape {getattr(self, field).shape}; with this length it "
                    f"must be {shape}"
                )
        if len(set(self.frequency.tolist())) < self.frequency.size:
            raise ValueError(
                "Echoes.frequency names a node twice; the nodes of a polynomial must differ"
            )
