"""`Echoes`: what every echo model returns, and all that the signal stage knows of the scene."""

from __future__ import annotations

from dataclasses import dataclass, field

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
    path : (echo,) int64, optional
        Path over walls, a number among those of the model; 0, if left out, is the direct one.

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
    path: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))

    def __post_init__(self) -> None:
        for name, kind in (("length", np.float64), ("amplitude", None), ("frequency", np.float64)):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=kind))
        for name in ("tx", "part", "bounces", "path"):
            object.__setattr__(self, name, np.asarray(getattr(self, name), dtype=np.int64))
        if self.length.ndim != 3:
            raise ValueError(
                f"Echoes.length has shape {self.length.shape}; it must be (chirp, rx, echo)"
            )
        chirps, _, echoes = self.length.shape
        if not self.path.any():
            # Whoever takes some of the echoes need not say again that all are direct.
            object.__setattr__(self, "path", np.zeros(echoes, dtype=np.int64))
        # All arrays must agree in the numbers of chirps, receivers and echoes.
        expected = {
            "amplitude": (*self.frequency.shape, *self.length.shape),
            "frequency": (max(1, self.frequency.size),),
            "tx": (chirps,),
            "part": (echoes,),
            "bounces": (echoes,),
            "path": (echoes,),
        }
        for name, shape in expected.items():
            if getattr(self, name).shape != shape:
                raise ValueError(
                    f"Echoes.{name} has shape {getattr(self, name).shape}; with this length it "
                    f"must be {shape}"
                )
        if len(set(self.frequency.tolist())) < self.frequency.size:
            raise ValueError(
                "Echoes.frequency names a node twice; the nodes of a polynomial must differ"
            )
