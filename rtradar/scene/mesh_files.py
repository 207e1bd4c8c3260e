"""Triangle meshes, which may be anybody's, from files or not: checked in one place, closed or known to be open."""

from __future__ import annotations

import codecs
import io
import os
import re
import struct
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.scene.mesh_headers import refuse_hostile_header
from rtradar.system.checks import shown
from rtradar.system.files import open_regular, read_bytes

MESH_ENDINGS = (".ply", ".obj", ".stl", ".glb")
MOST_FACES = 2_000_000
MOST_BYTES = 200_000_000
_STL_HEADER_BYTES, _STL_FACE_BYTES = 84, 50
_TO_ASCII = bytes(range(128)).ljust(256, b"?")
_FARTHEST = 1e9
"""In units of the file: a kilometre in micrometres."""
_MOST_INWARD = 100
"""Pieces of a mesh that are wound the other way round than the whole, each of which is a cavity or is turned."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """A mesh, read-only.

    Parameters
    ----------
    vertices : (vertex, 3) float64
        [m]; each place once.
    faces : (face, 3) int64
        Anticlockwise seen from outside where the mesh is closed.
    closed : bool
        Whether it encloses a body; if not, it is a thin sheet.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    closed: bool

    @property
    def corners(self) -> NDArray[np.float64]:
        """Corners of each triangle, (face, 3, 3) [m]."""
        return self.vertices[self.faces]

    def holds(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Whether points (..., 3) lie inside a closed mesh; shape (...).

        Parameters
        ----------
        points : (..., 3) float64
            World [m].

        Returns
        -------
        (...) bool
        """
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        inside = np.asarray(self.closed & ((points >= low) & (points <= high)).all(axis=-1))
        corners = self.corners
        for place in np.argwhere(inside):
            inside[tuple(place)] = _winding(corners - points[tuple(place)]) > 0.5
        return inside

    def distance_m(self, point: NDArray[np.float64]) -> float:
        """From a point (3,) to the nearest point of the surface [m]; 0 inside a closed mesh.

        Parameters
        ----------
        point : (3,) float64
            World [m].

        Returns
        -------
        float
            [m].
        """
        from trimesh import triangles  # slow to import

        find: Any = triangles.closest_point  # has no types
        corners = self.corners
        nearest = find(corners, np.broadcast_to(point, (len(corners), 3)))
        if self.closed and _winding(corners - point) > 0.5:
            return 0.0
        return float(np.linalg.norm(nearest - point, axis=1).min())


def meshes_folder() -> Path:
    """Folder of the meshes that come with rtradar: inside the installed package, or at the top of a checkout."""
    installed = Path(str(resources.files("rtradar"))) / "meshes"
    return installed if installed.is_dir() else Path(__file__).resolve().parents[2] / "meshes"


def mesh_names() -> tuple[str, ...]:
    """Meshes that come with rtradar."""
    return tuple(sorted(file.stem for file in meshes_folder().glob("*.ply")))


def read_mesh(path: Path) -> Triangles:
    """A mesh in the units of its file; kept, and read again only where the file changes.

    Raises
    ------
    InputError
        Where the file cannot be read, is too large, has no triangles, a vertex that is not finite, or faces that do not
        agree which side is outside.
    """
    where = f"mesh '{path}'"
    if path.suffix.lower() not in MESH_ENDINGS:
        raise InputError(f"{where}: unknown kind of file; allowed: {', '.join(MESH_ENDINGS)}")
    try:
        with open_regular(path) as file:
            status = os.fstat(file.fileno())
    except OSError as error:
        raise InputError(f"{where}: {error.strerror}") from None
    if status.st_size > MOST_BYTES:
        raise InputError(
            f"{where} has {status.st_size / 1e6:.0f} MB; {MOST_BYTES / 1e6:.0f} MB are allowed"
        )
    return _read(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=32)
def _read(path: Path, changed_ns: int, size: int) -> Triangles:
    where, ending = f"mesh '{path}'", path.suffix.lower()
    try:
        content = read_bytes(path, MOST_BYTES)
    except (OSError, ValueError) as error:
        raise InputError(f"{where}: {getattr(error, 'strerror', None) or error}") from None
    content = _in_ascii(content, ending)
    refuse_hostile_header(where, ending, content, MOST_FACES)
    return checked_triangles(where, *_load(where, ending, content))


def _in_ascii(content: bytes, ending: str) -> bytes:
    """The same mesh with ``?`` for every byte of its text that is not ASCII, and without a byte order mark.

    Only names and comments hold such bytes. Nothing here asks for them, but trimesh would have to know their encoding.
    """
    content = content.removeprefix(codecs.BOM_UTF8)
    if ending == ".obj":
        text = len(content)
    elif ending == ".stl":
        (count,) = (
            struct.unpack_from("<I", content, _STL_HEADER_BYTES - 4)
            if len(content) >= _STL_HEADER_BYTES
            else (0,)
        )
        # What tells a binary file from one of text, which may both begin with "solid".
        text = 0 if len(content) == _STL_HEADER_BYTES + _STL_FACE_BYTES * count else len(content)
    elif ending == ".ply":
        text = (
            len(content)
            if re.match(rb"ply\s+format\s+ascii", content)
            else content.find(b"end_header")
        )
    else:  # the text of a glb is JSON, which is UTF-8
        text = 0
    return content[:text].translate(_TO_ASCII) + content[text:] if text > 0 else content


def _load(where: str, ending: str, content: bytes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    import trimesh  # slow to import

    try:
        # No resolver: a file may name others (materials, buffers, pictures), and none of them is opened.
        with np.errstate(all="ignore"):
            loaded = trimesh.load_scene(
                io.BytesIO(content),
                file_type=ending[1:],
                resolver=None,
                process=False,
                skip_materials=True,
            )
            pieces = _pieces(where, loaded)
    except InputError:
        raise
    except ImportError as error:  # trimesh looks for some packages only where a file needs them
        raise InputError(
            f"{where}: to read it takes the Python package '{error.name}'; install that, or save the mesh as binary PLY"
        ) from None
    except Exception as error:  # what trimesh raises at broken files is of any type
        reason = shown(str(error))[1:-1] or type(error).__name__
        raise InputError(f"{where} is broken or is no {ending[1:]} file: {reason}") from None
    if not pieces:
        raise InputError(f"{where} has no triangles")
    starts = np.cumsum([0, *(len(vertices) for vertices, _ in pieces)])
    return (
        np.concatenate([vertices for vertices, _ in pieces]),
        np.concatenate(
            [faces + start for (_, faces), start in zip(pieces, starts[:-1], strict=True)]
        ),
    )


def _pieces(where: str, loaded: Any) -> list[tuple[NDArray[np.float64], NDArray[np.int64]]]:
    """Vertices and faces of every mesh of a scene, as often as it stands in it."""
    placed = [(name, *loaded.graph[name]) for name in loaded.graph.nodes_geometry]
    meshes = [(loaded.geometry[geometry], matrix) for _, matrix, geometry in placed]
    solid = [(mesh, matrix) for mesh, matrix in meshes if hasattr(mesh, "faces")]
    count = sum(len(mesh.faces) for mesh, _ in solid)
    if count > MOST_FACES:
        raise InputError(f"{where} has {count} triangles; {MOST_FACES} are allowed")
    pieces = []
    for mesh, matrix in solid:
        vertices = np.asarray(mesh.vertices, dtype=np.float64)
        faces = np.asarray(mesh.faces, dtype=np.int64)
        # A mirror turns the faces round with the body.
        faces = faces[:, ::-1] if np.linalg.det(matrix[:3, :3]) < 0 else faces
        pieces.append((vertices @ np.asarray(matrix)[:3, :3].T + np.asarray(matrix)[:3, 3], faces))
    return pieces


def checked_triangles(
    where: str, vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> Triangles:
    """A mesh, checked: each place once, no triangle without area, and, where it is closed, normals outward.

    Parameters
    ----------
    where : str
        What messages begin with.
    vertices : (vertex, 3) float64
        In any unit.
    faces : (face, 3) int64
        Numbers of vertices.

    Returns
    -------
    Triangles
        In the same unit.

    Raises
    ------
    InputError
        Where there are no triangles or too many, none has an area, a vertex is not finite or is not there, or faces do not
        agree which side is outside.
    """
    import trimesh  # slow to import

    if (
        vertices.ndim != 2
        or vertices.shape[1] != 3
        or faces.ndim != 2
        or (len(faces) and faces.shape[1] != 3)
    ):
        raise InputError(
            f"{where}: vertices {vertices.shape} and faces {faces.shape}; they must be (vertex, 3) and (face, 3)"
        )
    if not np.all(np.abs(vertices) <= _FARTHEST):
        raise InputError(f"{where}: a vertex is not finite, or more than {_FARTHEST:g} units away")
    if len(faces) == 0:
        raise InputError(f"{where} has no triangles; give a surface")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(
            f"{where}: a triangle names a vertex that is not there; there are {len(vertices)}, counted from 0"
        )
    places, which = np.unique(vertices + 0.0, axis=0, return_inverse=True)
    faces = which.reshape(-1)[faces]
    a, b, c = (places[faces[:, k]] for k in range(3))
    faces = faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0]
    if len(faces) == 0:
        raise InputError(f"{where} has no triangle with an area; give a surface")
    if len(faces) > MOST_FACES:
        raise InputError(f"{where} has {len(faces)} triangles; {MOST_FACES} are allowed")
    mesh = trimesh.Trimesh(places, faces, process=False)
    closed = bool(mesh.is_watertight)
    if closed and not mesh.is_winding_consistent:
        raise InputError(
            f"{where}: its triangles do not agree which side is outside; make their normals consistent"
        )
    if closed:
        faces = _outward(where, mesh)
    used, faces = np.unique(faces, return_inverse=True)
    places, faces = (
        np.ascontiguousarray(places[used]),
        np.ascontiguousarray(faces.reshape(-1, 3), dtype=np.int64),
    )
    places.setflags(write=False)
    faces.setflags(write=False)
    return Triangles(places, faces, closed)


def _outward(where: str, mesh: Any) -> NDArray[np.int64]:
    """Faces of a closed mesh, each of its pieces wound outward; but a piece inside another may be a cavity, and stays."""
    from trimesh import graph

    faces, corners = np.array(mesh.faces), np.asarray(mesh.triangles - mesh.vertices.mean(axis=0))
    label: Any = graph.connected_component_labels  # has no types
    piece = label(mesh.face_adjacency, node_count=len(faces))
    volume = np.bincount(
        piece, np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    )
    if volume.sum() < 0:
        faces, corners, volume = faces[:, ::-1], corners[:, ::-1], -volume
    inward = np.flatnonzero(volume < 0)
    if len(inward) > _MOST_INWARD:
        raise InputError(
            f"{where}: {len(inward)} of its pieces are inside out; make their normals consistent"
        )
    for number in inward:
        own = piece == number
        if _winding(corners[~own] - corners[own][0, 0]) < 0.5:
            faces[own] = faces[own, ::-1]
    return faces


def _winding(corners: NDArray[np.float64]) -> float:
    """How often triangles (face, 3, 3) wind round the origin (van Oosterom and Strackee 1983)."""
    a, b, c = (corners[:, k] for k in range(3))
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    over = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = [np.einsum("ij,ij->i", first, second) for first, second in ((a, b), (b, c), (c, a))]
    under = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return float(np.sum(2 * np.arctan2(over, under)) / (4 * np.pi))
