"""`Body`: one ellipsoid a bone, posed at any time by the motion; `Ellipsoids`: one such pose."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.body.human import HumanMesh
from rtradar.errors import InputError
from rtradar.kernels.motion import pose_ellipsoids
from rtradar.motion.motion import Motion
from rtradar.motion.skeleton import NODES, to_nodes
from rtradar.settings import Breathing

_Array = NDArray[np.float64]

_SAME = 1e-4
"""Distance of two parts, relative to the least semi-axis, at which rays find the same surface."""

_PARTS: Mapping[str, tuple[str, float]] = tomllib.loads(
    Path(__file__).with_name("parts.toml").read_text(encoding="utf-8")
)

PART_NAMES: tuple[str, ...] = tuple(_PARTS[node][0] for node in NODES[1:])
"""The 21 parts, in the order of the nodes that they end in."""

PART_RADII_M: tuple[float, ...] = tuple(_PARTS[node][1] for node in NODES[1:])
"""Semi-axes a = b of each part of a body of girth 1."""

_CHEST = [PART_NAMES.index(f"{place} torso") for place in ("middle", "upper")]
"""Parts that breath moves."""


class Poses(NamedTuple):
    """Ellipsoids at several times: world = centre + frame @ local.

    Attributes
    ----------
    centres : (time, part, 3) float64
        Centres of the ellipsoids, world [m].
    frames : (time, part, 3, 3) float64
        Proper rotations; the columns are the directions of the semi-axes, the third along the bone.
    semi_axes : (part, 3) float64
        a, b, c [m].
    """

    centres: NDArray[np.float64]
    frames: NDArray[np.float64]
    semi_axes: NDArray[np.float64]


@dataclass(frozen=True)
class Ellipsoids:
    """One pose of ellipsoids.

    Parameters
    ----------
    centres : (part, 3) float64
        Centres, world [m].
    frames : (part, 3, 3) float64
        Proper rotations: world = centre + frame @ local, so the COLUMNS are the directions of the
        semi-axes.
    semi_axes : (part, 3) float64
        Lengths a, b, c of the semi-axes [m].

    Raises
    ------
    InputError
        Where shapes do not fit, a value is not finite, a semi-axis is not positive, or a frame is
        no rotation.
    """

    centres: NDArray[np.float64]
    frames: NDArray[np.float64]
    semi_axes: NDArray[np.float64]

    def __init__(self, centres: ArrayLike, frames: ArrayLike, semi_axes: ArrayLike) -> None:
        given = {"centres": centres, "frames": frames, "semi_axes": semi_axes}
        arrays = {name: np.asarray(value, np.float64) for name, value in given.items()}
        parts = arrays["centres"].shape[:1]
        # All three agree on the number of parts, and none is empty.
        for name, array in arrays.items():
            axes = (3, 3) if name == "frames" else (3,)
            if array.shape != (*parts, *axes) or not array.size:
                raise InputError(
                    f"Ellipsoids.{name} has shape {array.shape}; it must be {('part', *axes)}, "
                    "alike and at least 1 in part"
                )
            if not np.isfinite(array).all():
                raise InputError(f"Ellipsoids.{name} holds NaN or infinity; it must be finite")
            object.__setattr__(self, name, array)
        least, turned = arrays["semi_axes"].min(), arrays["frames"]
        if not least > 0:
            raise InputError(f"Ellipsoids.semi_axes: the least is {least} m; it must be positive")
        # A rotation: columns of length 1 at right angles, and no mirror image.
        error = np.abs(np.swapaxes(turned, 1, 2) @ turned - np.eye(3)).max()
        if error > 1e-6 or (np.linalg.det(turned) < 0).any():
            raise InputError(
                "Ellipsoids.frames: not proper rotations; columns must be orthonormal and "
                "right-handed"
            )

    def without_repeats(self) -> Ellipsoids:
        """Leave out each part that coincides with one before it.

        Two of those are one body: whichever of them rays meet first is an accident of rounding.

        Returns
        -------
        Ellipsoids
        """
        # x.S^-1 x = 1 on the surface about the centre: frames that differ in signs or order of axes
        # make the same S.
        stretch = self.frames * self.semi_axes[:, None]
        shape = stretch @ np.swapaxes(stretch, 1, 2)
        kept: list[int] = []
        for part, least in enumerate(self.semi_axes.min(axis=1)):
            away = np.linalg.norm(self.centres[kept] - self.centres[part], axis=-1)
            # S differs by 2 a da where a semi-axis a differs by da.
            differs = np.abs(shape[kept] - shape[part]).max(axis=(1, 2), initial=0.0)
            if not ((away <= _SAME * least) & (differs <= 2 * _SAME * least**2)).any():
                kept.append(part)
        if len(kept) == len(self.centres):
            return self
        return Ellipsoids(self.centres[kept], self.frames[kept], self.semi_axes[kept])


@dataclass(frozen=True, eq=False)
class Body:
    """21 ellipsoids on the bones of a moving skeleton.

    Parameters
    ----------
    motion : Motion
        On the 22 nodes of `rtradar.motion.skeleton.NODES`; `from_motion` takes any other.
    semi_axes : (part, 3) float64
        a, b across the bone and c along it [m].
    breathing : Breathing, optional
        Breath, which moves the upper and the middle torso forward and back, across the bone and the
        line of the shoulders, by ``amplitude_mm * sin(2 pi rate_hz t + phase_deg)``. The parts move
        as a whole: of the front that is the motion of a chest wall; behind, where a real back
        hardly moves, it is too much.
    material : str
        Name of the material of the surface.
    mesh : HumanMesh, optional
        Mesh of human shape on the same motion, which then scatters in place of the ellipsoids;
        these still hide what is behind the person.

    Raises
    ------
    InputError
        Where the motion is not on the nodes, or a semi-axis is not positive.
    """

    motion: Motion
    semi_axes: NDArray[np.float64]
    breathing: Breathing | None = None
    material: str = "perfect-conductor"
    mesh: HumanMesh | None = None

    def __post_init__(self) -> None:
        if self.motion.joints != NODES:
            raise InputError("Body: the motion is not on the 22 nodes; use Body.from_motion")
        axes = np.ascontiguousarray(self.semi_axes, dtype=np.float64)
        if axes.shape != (len(PART_NAMES), 3):
            raise InputError(
                f"Body: semi_axes have shape {axes.shape}; semi_axes must be ({len(PART_NAMES)}, 3)"
            )
        wrong = ~(np.isfinite(axes) & (axes > 0)).all(axis=1)
        if wrong.any():
            part = int(wrong.argmax())
            raise InputError(
                f"Body: the {PART_NAMES[part]}, which ends in {NODES[1 + part]!r}, has semi-axes "
                f"of {axes[part].tolist()} m; semi_axes must be positive and finite: give the bone "
                "a length"
            )
        object.__setattr__(self, "semi_axes", axes)

    @classmethod
    def from_motion(
        cls,
        motion: Motion,
        breathing: Breathing | None = None,
        material: str = "perfect-conductor",
    ) -> Body:
        """Put ellipsoids on a skeleton: c is half the bone, a = b are `PART_RADII_M`.

        Parameters
        ----------
        motion : Motion
            Motion of any known kind of skeleton (`rtradar.motion.skeleton.to_nodes`); its ``girth``
            multiplies the radii.
        breathing : Breathing, optional
            Breath of the person.
        material : str
            Name of the material of the surface.

        Returns
        -------
        Body

        Raises
        ------
        InputError
            Where the skeleton is not understood, or a part comes out without an extent.
        """
        # The length of a part is that of its bone; across it everyone has the radii of the table,
        # times the girth.
        nodes = to_nodes(motion)
        radii = np.array(PART_RADII_M) * nodes.girth
        lengths = np.linalg.norm(nodes.offsets[1:], axis=1)
        return cls(nodes, np.stack([radii, radii, lengths / 2], axis=1), breathing, material)

    @property
    def people(self) -> tuple[Body, ...]:
        """The people whose parts these are: this one alone; `Bodies` has several."""
        return (self,)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of the `people`."""
        return (self.motion.name,)

    @cached_property
    def owner(self) -> NDArray[np.int64]:
        """Index of the person that each part (part,) belongs to."""
        return np.zeros(len(self.semi_axes), dtype=np.int64)

    @cached_property
    def materials(self) -> tuple[str, ...]:
        """Name of the material of each part."""
        return (self.material,) * len(self.semi_axes)

    @cached_property
    def part_names(self) -> tuple[str, ...]:
        """Names of the 21 parts."""
        return PART_NAMES

    @cached_property
    def duration_s(self) -> float:
        """End of the motion [s]; it begins at 0."""
        return self.motion.duration_s

    def at(self, times: ArrayLike) -> Poses:
        """Pose the ellipsoids at any times from 0 to `duration_s`.

        The frames are fixed in the bones: they rotate with them and never flip.

        Parameters
        ----------
        times : (time,) array_like
            Times since the start of the motion [s].

        Returns
        -------
        Poses

        Raises
        ------
        InputError
            Where a time lies outside the motion.
        """
        return self._posed(times, times)

    def _posed(self, times: ArrayLike, breath_times: ArrayLike) -> Poses:
        """Poses at times of the motion; who rests after its end goes on breathing."""
        positions, quaternions = self.motion.at(times)
        shape = len(positions), len(self.semi_axes), 3
        centres, frames = np.empty(shape), np.empty((*shape, 3))
        parents = np.array(self.motion.parents)
        pose_ellipsoids(positions, quaternions, parents, self._rest_frames, centres, frames)
        if self.breathing is not None:
            centres[:, _CHEST] += _breath(self.breathing, positions, frames, breath_times)
        return Poses(centres, frames, self.semi_axes)

    def skin(self, times: ArrayLike, divisions: int = 0) -> _Array:
        """Pose the vertices of the mesh at any times; past the end of the motion it rests.

        Parameters
        ----------
        times : (time,) array_like
            Times since the start of the motion, not negative [s].
        divisions : int
            Number of times that each triangle of the mesh is divided in four, 0 to 4.

        Returns
        -------
        (time, vertex, 3) float64
            World [m].

        Raises
        ------
        InputError
            Where the body has no mesh.
        """
        if self.mesh is None:
            raise InputError(f"body of {self.motion.name}: it has no mesh; give one as mesh=")
        # The pose rests past the end, and breath goes on: each vertex moves as far as it belongs to
        # the chest.
        instants = np.asarray(times, np.float64)
        moving = np.minimum(instants, self.duration_s)
        vertices = self.mesh.vertices(moving, divisions)
        if self.breathing is not None:
            poses = self._posed(moving, moving)
            positions = self.motion.at(moving)[0]
            moved = _breath(self.breathing, positions, poses.frames, instants)
            vertices += np.einsum("vp,tpx->tvx", self.mesh.weights(divisions)[:, _CHEST], moved)
        return vertices

    def ellipsoids(self, time: float) -> Ellipsoids:
        """Pose the ellipsoids at one time.

        Parameters
        ----------
        time : float
            Time since the start of the motion [s].

        Returns
        -------
        Ellipsoids
        """
        poses = self.at([time])
        return Ellipsoids(poses.centres[0], poses.frames[0], poses.semi_axes)

    @cached_property
    def _rest_frames(self) -> NDArray[np.float64]:
        """Frames (part, 3, 3) of the ellipsoids in the axes of their bones."""
        along = self.motion.offsets[1:] / (2 * self.semi_axes[:, 2:])
        along = along / np.linalg.norm(along, axis=1, keepdims=True)
        # Any direction across will do, because a = b, but it must be the same at all times: the
        # axis most across the bone.
        across = np.cross(np.eye(3)[np.argmin(np.abs(along), axis=1)], along)
        across /= np.linalg.norm(across, axis=1, keepdims=True)
        return np.stack([across, np.cross(along, across), along], axis=2)


def _breath(breathing: Breathing, positions: _Array, frames: _Array, times: ArrayLike) -> _Array:
    """Displacement (time, 2, 3) of the `_CHEST` by breath [m]."""
    # Forward is across the shoulders and across the bone of the torso.
    left = positions[:, NODES.index("l_shoulder")] - positions[:, NODES.index("r_shoulder")]
    ahead = np.cross(left[:, None], frames[:, _CHEST][..., 2])
    ahead /= np.linalg.norm(ahead, axis=2, keepdims=True)
    turned = 2 * np.pi * np.asarray(times, np.float64)
    breath = np.sin(breathing.rate_hz * turned + np.radians(breathing.phase_deg))
    heart = np.sin(breathing.heart_hz * turned)
    moved_mm = breathing.amplitude_mm * breath + breathing.heart_mm * heart
    return np.asarray(1e-3 * moved_mm[:, None, None] * ahead)


# -- meshes ----------------------------------------------------------------------------------------

MAXIMUM_SUBDIVISIONS = 8
"""20 x 4^8 is 1.3 million triangles a part: more is a mistake."""


def unit_sphere(subdivisions: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Make a geodesic sphere of 20 x 4^subdivisions triangles, closed, with the mean radius 1.

    Its vertices lie a little outside the unit sphere, so that the mean of ``|x|^2`` over its
    surface is 1.

    Parameters
    ----------
    subdivisions : int
        0 to `MAXIMUM_SUBDIVISIONS`.

    Returns
    -------
    vertices : (vertex, 3) float64
        Read-only, because they are kept.
    faces : (face, 3) int64
        Anticlockwise seen from outside; read-only.

    Raises
    ------
    InputError
        Where ``subdivisions`` is out of range.
    """
    if not 0 <= subdivisions <= MAXIMUM_SUBDIVISIONS:
        raise InputError(
            f"unit_sphere: subdivisions = {subdivisions}; allowed are 0 to {MAXIMUM_SUBDIVISIONS}"
        )
    return geodesic_sphere(2**subdivisions)


@lru_cache(maxsize=16)
def geodesic_sphere(frequency: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Make the `unit_sphere` of 20 frequency^2 triangles: an icosahedron with its edges so divided.

    Parameters
    ----------
    frequency : int
        Parts of each edge, 1 or more.

    Returns
    -------
    vertices : (10 frequency^2 + 2, 3) float64
        Read-only, because they are kept.
    faces : (20 frequency^2, 3) int64
        Anticlockwise seen from outside; read-only.
    """
    import trimesh  # slow to import

    # Points of an even grid on each of the 20 faces, row by row.
    solid = trimesh.creation.icosahedron()
    rows, places = np.tril_indices(frequency + 1)
    weights = np.stack([frequency - rows, rows - places, places], axis=1) / frequency
    points = (weights @ np.asarray(solid.vertices)[solid.faces]).reshape(-1, 3)
    # Below each point but the last row's a triangle, and beside it one that stands on its head.
    first = np.flatnonzero(rows < frequency)
    below = first + rows[first] + 1
    upright = np.stack([first, below, below + 1], axis=1)
    inner = first[places[first] < rows[first]]
    turned = np.stack([inner, inner + rows[inner] + 2, inner + 1], axis=1)
    faces = np.concatenate([upright, turned])
    faces = faces + len(weights) * np.arange(20)[:, None, None]
    # Neighbouring faces of the icosahedron have the points of their edge in common.
    unique_rows: Any = trimesh.grouping.unique_rows
    chosen, number = unique_rows(points, digits=9)
    vertices, faces = points[chosen], number[faces.reshape(-1, 3)].astype(np.int64)
    # Out to the sphere, and then so far that facets stand for it in the mean.
    vertices = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    # Mean of |x|^2 over a triangle: (|a|^2 + |b|^2 + |c|^2 + |a + b + c|^2) / 12.
    means = (np.sum(a * a + b * b + c * c, axis=1) + np.sum((a + b + c) ** 2, axis=1)) / 12
    vertices /= np.sqrt(np.sum(areas * means) / np.sum(areas))
    vertices.setflags(write=False)
    faces.setflags(write=False)
    return vertices, faces


def ellipsoid_meshes(
    ellipsoids: Ellipsoids, subdivisions: int = 3
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """One closed mesh a part, all with the same faces.

    Parameters
    ----------
    ellipsoids : Ellipsoids
        One pose.
    subdivisions : int
        Subdivisions of the `unit_sphere` that each part is made from.

    Returns
    -------
    vertices : (part, vertex, 3) float64
        Positions of the vertices, world [m].
    faces : (face, 3) int64
        Anticlockwise seen from outside, the same for every part.
    """
    # The sphere, stretched along the semi-axes, turned, and moved.
    sphere, faces = unit_sphere(subdivisions)
    local = sphere * ellipsoids.semi_axes[:, None, :]
    return ellipsoids.centres[:, None, :] + local @ np.swapaxes(ellipsoids.frames, 1, 2), faces
