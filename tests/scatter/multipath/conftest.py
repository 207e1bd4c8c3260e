"""Bodies, walls and radars of the tests of echoes over walls."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.body.body import Poses
from rtradar.radar import Radar
from rtradar.scatter import build_model
from rtradar.scene import Furniture, Scene, Wall, material

Array = NDArray[np.float64]
SIDES = {
    "floor": ((-10.0, -10.0, 0.0), (20.0, 0.0, 0.0), (0.0, 20.0, 0.0)),
    "left": ((-10.0, 2.5, -10.0), (20.0, 0.0, 0.0), (0.0, 0.0, 20.0)),
}


@dataclass(frozen=True)
class Still:
    """Parts that stand where they are, or go with one velocity."""

    centres: Array
    axes: Array
    frames: Array
    velocity: tuple[float, float, float] = (0.0, 0.0, 0.0)
    duration_s: float = 1.0

    @property
    def part_names(self) -> tuple[str, ...]:
        return tuple(f"part {i}" for i in range(len(self.centres)))

    @property
    def semi_axes(self) -> Array:
        return self.axes

    @property
    def owner(self) -> NDArray[np.int64]:
        return np.zeros(len(self.semi_axes), dtype=np.int64)

    @property
    def materials(self) -> tuple[str, ...]:
        return ("perfect-conductor",) * len(self.semi_axes)

    def at(self, times: Array) -> Poses:
        moved = self.centres + np.asarray(times)[:, None, None] * np.array(self.velocity)
        return Poses(
            moved, np.broadcast_to(self.frames, (len(times), *self.frames.shape)), self.axes
        )


class Rooms:
    """What tests make rooms of."""

    still = Still

    @staticmethod
    def one(
        axes: tuple[float, float, float] = (0.1, 0.15, 0.3),
        centre: tuple[float, ...] = (0.0, 0.3, 1.2),
        **more: Any,
    ) -> Still:
        """One part."""
        frame = Rotation.from_euler("xyz", [0.3, -0.2, 0.5]).as_matrix()
        return Still(np.array([centre]), np.array([axes]), frame[None], **more)

    @staticmethod
    def wall(side: str, name: str = "perfect-conductor", thickness: float = 0.1) -> Wall:
        """One of `SIDES`."""
        corner, u, v = SIDES[side]
        edges = {"corner_m": corner, "edge_u_m": u, "edge_v_m": v}
        return Wall(name=side, material=material(name), thickness_m=thickness, **edges)

    @staticmethod
    def single(**fields: Any) -> Radar:
        """One Tx, one Rx, both at one place."""
        return Radar(
            **({"tx_y": 1, "tx_z": 0, "rx_y": 1, "rx_z": 0, "chirp_duration_s": 1e-3} | fields)
        )

    @staticmethod
    def room(
        radar: Radar,
        body: Any,
        *walls: Wall,
        fidelity: str = "specular",
        furniture: tuple[Furniture, ...] = (),
        **options: Any,
    ) -> Any:
        """`specular`, or another level, between walls and furniture."""
        scene = Scene(walls=walls, furniture=furniture)
        return build_model(fidelity, radar, body, scene=scene, **options)


@pytest.fixture
def make() -> type[Rooms]:
    return Rooms
