"""Triangle meshes, from files or arrays, checked in one place.

Files may come from strangers: their sizes and headers are checked before a reader reserves memory.
"""

from __future__ import annotations

import codecs
import io
import json
import os
import re
import struct
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.system.checks import brief
from rtradar.system.files import open_regular, read_bytes, shipped_folder

MESH_ENDINGS = (".ply", ".obj", ".stl", ".glb")
MOST_FACES = 2_000_000
MOST_BYTES = 200_000_000
_STL_HEADER_BYTES, _STL_FACE_BYTES = 84, 50
_TO_ASCII = bytes(range(128)).ljust(256, b"?")
_MOST_PLY_HEADER = 65_536
_MOST_GLB_HEADER = 16_000_000

_NUMBERS_A_FACE = 12
"""Three corners with position, normal, texture and index each: a glb without shared vertices."""

_FARTHEST = 1e9
"""Largest coordinate in units of the file: a kilometre in micrometres."""

_MOST_INWARD = 100
"""Largest number of parts of a mesh that are wound the other way round than the whole."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """A triangle mesh, read-only.

    Parameters
    ----------
    vertices : (vertex, 3) float64
        Positions [m], each once.
    faces : (face, 3) int64
        Indices of vertices, anticlockwise seen from outside where the mesh is closed.
    closed : bool
        Whether the mesh encloses a volume; if not, it is a thin sheet.
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    closed: bool

    @property
    def corners(self) -> NDArray[np.float64]:
        """Corners of each triangle, (face, 3, 3) [m]."""
        return self.vertices[self.faces]

    def moved(self, vertices: NDArray[np.float64]) -> Triangles:
        """Return a mesh of the same triangles with other positions of its vertices.

        Parameters
        ----------
        vertices : (vertex, 3) float64
            Positions [m]; the array becomes read-only.

        Returns
        -------
        Triangles
        """
        vertices.setflags(write=False)
        return Triangles(vertices, self.faces, self.closed)

    def holds(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Tell whether points lie inside a closed mesh.

        Parameters
        ----------
        points : (..., 3) float64
            Points, world [m].

        Returns
        -------
        (...) bool
        """
        # Only points inside of the box of the mesh are looked at closely.
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        inside = np.asarray(self.closed & ((points >= low) & (points <= high)).all(axis=-1))
        corners = self.corners
        for place in np.argwhere(inside):
            inside[tuple(place)] = _winding(corners - points[tuple(place)]) > 0.5
        return inside

    def distance_m(self, point: NDArray[np.float64]) -> float:
        """Compute the distance from a point to the surface.

        Parameters
        ----------
        point : (3,) float64
            Point, world [m].

        Returns
        -------
        float
            Distance [m]; 0 inside a closed mesh.
        """
        from trimesh import triangles  # slow to import

        find: Any = triangles.closest_point  # has no types
        corners = self.corners
        nearest = find(corners, np.broadcast_to(point, (len(corners), 3)))
        inside = self.closed and _winding(corners - point) > 0.5
        return 0.0 if inside else float(np.linalg.norm(nearest - point, axis=1).min())


def mesh_names() -> tuple[str, ...]:
    """List the meshes that come with rtradar."""
    return tuple(sorted(file.stem for file in shipped_folder("meshes").glob("*.ply")))


def read_mesh(path: Path) -> Triangles:
    """Read a mesh in the units of its file; it is kept, and read again where the file changes."""
    where = f"mesh '{path}'"
    if path.suffix.lower() not in MESH_ENDINGS:
        raise InputError(f"{where}: unknown kind of file; allowed: {', '.join(MESH_ENDINGS)}")
    try:
        with open_regular(path) as file:
            status = os.fstat(file.fileno())
        return _read(path, status.st_mtime_ns, status.st_size)
    except OSError as error:
        raise InputError(f"{where}: {error.strerror}") from None


@lru_cache(maxsize=32)
def _read(path: Path, changed_ns: int, size: int) -> Triangles:
    # Kept by the time and the size of the file, so that a file that changes is read anew.
    where, ending = f"mesh '{path}'", path.suffix.lower()
    try:
        content = _in_ascii(read_bytes(path, MOST_BYTES), ending)
    except ValueError as error:
        raise InputError(f"{where} has {error}; no more are allowed") from None
    # Of the kinds of files only these two carry counts that a reader believes.
    if ending == ".ply":
        _check_ply_header(where, content)
    elif ending == ".glb":
        _check_glb_header(where, content)
    return checked_triangles(where, *_load(where, ending, content))


def _check_ply_header(where: str, content: bytes) -> None:
    """Refuse a PLY file that promises more elements than `MOST_FACES` faces could need."""
    head, end, _ = content[:_MOST_PLY_HEADER].partition(b"end_header")
    if not end:
        raise InputError(f"{where} is broken or is no ply file: its header has no end")
    for kind, count in re.findall(rb"element\s+(\S+)\s+(\d+)", head):
        most = MOST_FACES if kind == b"face" else 3 * MOST_FACES
        if len(count) > 12 or int(count) > most:
            name = brief(kind.decode("ascii", "replace"))
            raise InputError(f"{where} promises more elements {name} than the {most} allowed")


def _check_glb_header(where: str, content: bytes) -> None:
    """Refuse a glb file that promises more numbers than `MOST_FACES` faces could need."""
    broken = f"{where} is broken or is no glb file"
    # A glb begins with a header of 12 bytes, and the length and the kind of its JSON.
    length = struct.unpack("<I", content[12:16])[0] if len(content) >= 20 else 0
    if not 0 < length <= _MOST_GLB_HEADER:
        raise InputError(
            f"{broken}: its header has {length} bytes; 1 to {_MOST_GLB_HEADER} are allowed"
        )
    try:
        header = json.loads(content[20 : 20 + length])
        count = sum(abs(int(accessor["count"])) for accessor in header.get("accessors", []))
        outside = [one["uri"] for one in header.get("buffers", []) if "uri" in one]
    except (ValueError, TypeError, KeyError, AttributeError, OverflowError, RecursionError):
        raise InputError(f"{broken}: its header cannot be read") from None
    if outside and not str(outside[0]).startswith("data:"):
        raise InputError(
            f"{where} keeps its triangles in another file, {brief(outside[0])}; save it with all "
            "in one file"
        )
    # An accessor without data is filled with as many zeros as it names, and one whose rows overlap
    # grows.
    if count > _NUMBERS_A_FACE * MOST_FACES:
        raise InputError(
            f"{where} promises more data than the {MOST_FACES} triangles that are allowed could "
            "have"
        )


def _in_ascii(content: bytes, ending: str) -> bytes:
    """Replace every byte of the text that is not ASCII by ``?``, and remove a byte order mark.

    Such bytes are in names and comments, which are not used; trimesh would ask for their encoding.
    """
    content = content.removeprefix(codecs.BOM_UTF8)
    text = len(content) if ending != ".glb" else 0  # the text of a glb is JSON, which is UTF-8
    if ending == ".stl":
        head = content[_STL_HEADER_BYTES - 4 : _STL_HEADER_BYTES].ljust(4, b"\0")
        # The size tells a binary file from one of text; both may begin with "solid".
        if text == _STL_HEADER_BYTES + _STL_FACE_BYTES * struct.unpack("<I", head)[0]:
            text = 0
    elif ending == ".ply" and not re.match(rb"ply\s+format\s+ascii", content):
        text = content.find(b"end_header")
    return content[:text].translate(_TO_ASCII) + content[text:] if text > 0 else content


def _load(where: str, ending: str, content: bytes) -> tuple[NDArray[Any], NDArray[Any]]:
    """Read one mesh of all that is in a file: vertices and faces."""
    import trimesh  # slow to import

    try:
        # Without a resolver no other file that this one names (materials, buffers) is opened.
        with np.errstate(all="ignore"):
            loaded = trimesh.load_scene(
                io.BytesIO(content),
                file_type=ending[1:],
                resolver=None,
                process=False,
                skip_materials=True,
            )
            # Every instance of every mesh counts.
            names = [loaded.graph[node][1] for node in loaded.graph.nodes_geometry]
            count = sum(len(getattr(loaded.geometry[name], "faces", ())) for name in names)
            if not 0 < count <= MOST_FACES:
                raise InputError(f"{where} has {count} triangles; 1 to {MOST_FACES} are allowed")
            mesh = loaded.to_mesh()
    except InputError:
        raise
    except ImportError as error:  # trimesh looks for some packages only where a file needs them
        raise InputError(
            f"{where}: to read it takes the Python package '{error.name}'; install that, or save "
            "the mesh as binary PLY"
        ) from None
    except Exception as error:  # what trimesh raises at broken files is of any type
        reason = brief(str(error))[1:-1] or type(error).__name__
        raise InputError(f"{where} is broken or is no {ending[1:]} file: {reason}") from None
    return mesh.vertices, mesh.faces


def checked_triangles(where: str, vertices: NDArray[Any], faces: NDArray[Any]) -> Triangles:
    """Check a mesh, merge equal vertices, remove empty triangles and wind closed parts outward.

    Vertices may be in any unit; ``where`` begins the messages of each `InputError`.
    """
    import trimesh  # slow to import

    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
    if vertices.shape[1:] != (3,) or faces.ndim != 2 or (len(faces) and faces.shape[1] != 3):
        raise InputError(
            f"{where}: vertices {vertices.shape} and faces {faces.shape}; they must be (vertex, 3) "
            "and (face, 3)"
        )
    if not np.all(np.abs(vertices) <= _FARTHEST):
        raise InputError(f"{where}: a vertex is not finite, or more than {_FARTHEST:g} units away")
    if len(faces) == 0:
        raise InputError(f"{where} has no triangles; give a surface")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise InputError(
            f"{where}: a triangle names a vertex that is not there; there are {len(vertices)}, "
            "counted from 0"
        )
    # Equal vertices are one, and -0 is 0; triangles without an area have no normal.
    places, which = np.unique(vertices + 0.0, axis=0, return_inverse=True)
    faces = which.reshape(-1)[faces]
    a, b, c = (places[faces[:, k]] for k in range(3))
    faces = faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 0]
    if len(faces) == 0:
        raise InputError(f"{where} has no triangle with an area; give a surface")
    if len(faces) > MOST_FACES:
        raise InputError(f"{where} has {len(faces)} triangles; {MOST_FACES} are allowed")
    # Closed is a mesh in which each edge has two triangles; these must agree which side is outside.
    mesh = trimesh.Trimesh(places, faces, process=False)
    closed = bool(mesh.is_watertight)
    if closed and not mesh.is_winding_consistent:
        raise InputError(
            f"{where}: its triangles do not agree which side is outside; make their normals "
            "consistent"
        )
    if closed:
        faces = _outward(where, mesh)
    # Vertices that no triangle is left with go.
    used, faces = np.unique(faces, return_inverse=True)
    places = np.ascontiguousarray(places[used])
    faces = np.ascontiguousarray(faces.reshape(-1, 3), dtype=np.int64)
    places.setflags(write=False)
    faces.setflags(write=False)
    return Triangles(places, faces, closed)


def _outward(where: str, mesh: Any) -> NDArray[np.int64]:
    """Wind each part of a closed mesh outward, but for parts inside others, possible cavities."""
    from trimesh import graph

    faces, corners = np.array(mesh.faces), np.asarray(mesh.triangles - mesh.vertices.mean(axis=0))
    label: Any = graph.connected_component_labels  # has no types
    # Each connected part by itself: its signed volume is negative where it is wound inward.
    part = label(mesh.face_adjacency, node_count=len(faces))
    volumes = np.einsum("ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    volume = np.bincount(part, volumes)
    if volume.sum() < 0:
        faces, corners, volume = faces[:, ::-1], corners[:, ::-1], -volume
    # A part that is wound inward and lies in another is a cavity, and stays.
    inward = np.flatnonzero(volume < 0)
    if len(inward) > _MOST_INWARD:
        raise InputError(
            f"{where}: {len(inward)} of its parts are inside out; make their normals consistent"
        )
    for number in inward:
        own = part == number
        if _winding(corners[~own] - corners[own][0, 0]) < 0.5:
            faces[own] = faces[own, ::-1]
    return faces


def _winding(corners: NDArray[np.float64]) -> float:
    """Compute the winding number of triangles (face, 3, 3) about the origin.

    Sum of their solid angles over 4 pi (van Oosterom and Strackee 1983).
    """
    a, b, c = (corners[:, k] for k in range(3))
    la, lb, lc = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    over = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = [np.einsum("ij,ij->i", first, second) for first, second in ((a, b), (b, c), (c, a))]
    under = la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb
    return float(np.sum(2 * np.arctan2(over, under)) / (4 * np.pi))
