"""Snapshots of body, room and echoes, the file ``view.npz`` that ``rtradar view`` needs."""

# ruff: noqa: RUF009 - the calls in the dataclass make its fields
from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rtradar.errors import InputError
from rtradar.system.checks import printable
from rtradar.system.files import atomic_file, read_arrays

_FORMAT = 2
_MAX_BYTES = 200_000_000  # far more than the 2 MB that a run writes

_LARGEST = 1e9

DAMAGE = (OSError, ValueError, KeyError, IndexError, TypeError, RuntimeError, OverflowError)
"""Errors that damaged files and arrays cause."""


def _array(kind: str, *axes: str | int, into: str | None = None) -> Any:
    """Field of `Snapshots`: NumPy's code of its type, and the names or lengths of its axes.

    Its values are indices along the axis ``into``.
    """
    return field(metadata={"kind": kind, "axes": axes, "into": into})


@dataclass(frozen=True, kw_only=True, eq=False)
class Snapshots:
    """Snapshots of a capture at the centres of some frames, stored by field in ``view.npz``.

    ``times`` [s] since the start of the capture ascend; ``window`` are the indices of the frames
    along ``time`` of ``maps.h5``. ``poses`` are the centre of each part, then its three semi-axes
    as vectors, in world coordinates [m], as all other places are.

    ``path_names`` are walls and body in the order in which the wave meets them, such as ``floor >
    body``; the direct path is ``body``. ``echo_path``, ``echo_part`` and ``echo_bounces`` are path
    index, part index and number of reflections of each echo. ``range_m`` and ``velocity_mps`` are
    half the path length from Tx to Rx and its rate, positive receding, means over receivers
    weighted by power; ``power_m2`` is |amplitude|^2, mean over receivers, 0 if occluded, even just
    before or after. ``corners`` are the reflection points of the echo on its path from the centre
    of the array and back [m]: points in walls and the specular point on the part, NaN after the
    last one and if the path is unknown.

    ``walls`` are the corners of their front faces, ``furniture_vertices`` those of all pieces,
    ``furniture_faces`` indices into them, and ``furniture_piece`` the piece of each vertex.

    ``part_person`` is the person of each part; ``person_position`` and ``person_speed`` are place
    and speed of the root of each person [m, m/s]. Meshes that move are those of objects and of
    people whose body is one: ``mesh_source`` is the person's index, or after all people that of the
    object, as in clouds. A vertex is a sum of ``mesh_rows``, which are bones of a person or the
    axes and the place of an object, by the weights ``blend_weight`` of the rows ``blend_row`` of
    the vertices ``blend_vertex``. ``mesh_part`` is the part of each vertex, -1 of objects.
    InputError if the shapes do not fit each other, a value is not finite, or an index is out of
    range.
    """

    times: NDArray[np.float64] = _array("f8", "step")
    window: NDArray[np.int64] = _array("i8", "step")
    part_names: NDArray[np.str_] = _array("U", "part")
    poses: NDArray[np.float32] = _array("f4", "step", "part", 4, 3)
    path_names: NDArray[np.str_] = _array("U", "path")
    echo_path: NDArray[np.int64] = _array("i8", "echo", into="path")
    echo_part: NDArray[np.int64] = _array("i8", "echo", into="part")
    echo_bounces: NDArray[np.int64] = _array("i8", "echo")
    range_m: NDArray[np.float64] = _array("f8", "step", "echo")
    velocity_mps: NDArray[np.float64] = _array("f8", "step", "echo")
    power_m2: NDArray[np.float64] = _array("f8", "step", "echo")
    corners: NDArray[np.float32] = _array("f4", "step", "echo", "corner", 3)
    wall_names: NDArray[np.str_] = _array("U", "wall")
    walls: NDArray[np.float64] = _array("f8", "wall", 4, 3)
    furniture_names: NDArray[np.str_] = _array("U", "piece")
    furniture_vertices: NDArray[np.float32] = _array("f4", "vertex", 3)
    furniture_faces: NDArray[np.int64] = _array("i8", "face", 3, into="vertex")
    furniture_piece: NDArray[np.int64] = _array("i8", "vertex", into="piece")
    part_person: NDArray[np.int64] = _array("i8", "part", into="person")
    person_names: NDArray[np.str_] = _array("U", "person")
    person_position: NDArray[np.float64] = _array("f8", "step", "person", 3)
    person_speed: NDArray[np.float64] = _array("f8", "step", "person")
    object_names: NDArray[np.str_] = _array("U", "object")
    mesh_source: NDArray[np.int64] = _array("i8", "mesh")
    mesh_faces: NDArray[np.int64] = _array("i8", "mesh face", 3, into="mesh vertex")
    mesh_of_vertex: NDArray[np.int64] = _array("i8", "mesh vertex", into="mesh")
    mesh_part: NDArray[np.int64] = _array("i8", "mesh vertex")
    mesh_rows: NDArray[np.float32] = _array("f4", "step", "row", 3)
    blend_vertex: NDArray[np.int64] = _array("i8", "blend", into="mesh vertex")
    blend_row: NDArray[np.int64] = _array("i8", "blend", into="row")
    blend_weight: NDArray[np.float32] = _array("f4", "blend")

    def __post_init__(self) -> None:
        sizes: dict[str, int] = {}
        for one in fields(self):
            kind, axes = one.metadata["kind"], one.metadata["axes"]
            given = getattr(self, one.name), sizes, kind, axes
            array = checked(one.name, *given, may_be_nan=one.name == "corners")
            object.__setattr__(self, one.name, array)
        if not sizes["step"]:
            raise InputError("view: there is no snapshot; at least one is needed")
        for one in fields(self):
            name, axis, index = one.name, one.metadata["into"], getattr(self, one.name)
            if axis and index.size and not 0 <= index.min() <= index.max() < sizes[axis]:
                allowed = f"it must be from 0 to {sizes[axis] - 1}"
                raise InputError(f"{name} points at a {axis} that is not there; {allowed}")
        of, part = self.mesh_source, self.mesh_part
        if ((of < 0) | (of >= len(self.sources))).any() or (
            (part < -1) | (part >= sizes["part"])
        ).any():
            raise InputError("view: a mesh points at a person, an object or a part that is none")
        if (np.diff(self.times) <= 0).any() or (self.power_m2 < 0).any():
            raise InputError("view: times must ascend, and power_m2 must not be negative")

    @property
    def direct(self) -> NDArray[np.bool_]:
        """Whether each echo has a single reflection, that on the body, (echo,)."""
        return self.echo_bounces == 1

    @property
    def sources(self) -> list[str]:
        """Names of who returns echoes: all people, then all objects."""
        return [*self.person_names.tolist(), *self.object_names.tolist()]

    @property
    def drawn_parts(self) -> NDArray[np.bool_]:
        """Whether each part is drawn as an ellipsoid, (part,), and not as part of a mesh."""
        return ~np.isin(self.part_person, self.mesh_source)

    def mesh_vertices(self, step: int) -> NDArray[np.float64]:
        """Place the vertices of the moving meshes, (mesh vertex, 3) [m]."""
        out = np.zeros((len(self.mesh_of_vertex), 3))
        rows = self.mesh_rows[step].astype(np.float64)[self.blend_row]
        np.add.at(out, self.blend_vertex, self.blend_weight[:, None] * rows)
        return out

    def every(self, number: int) -> Snapshots:
        """Return a copy with every ``number``-th snapshot, from the first on."""
        stepped = (one.name for one in fields(self) if one.metadata["axes"][0] == "step")
        return replace(self, **{name: getattr(self, name)[::number] for name in stepped})

    def stride(self, most_steps: int, rate_hz: float) -> int:
        """Return the number for `every` that leaves at most so many, and no more a second."""
        rate = (len(self.times) - 1) / max(float(self.times[-1] - self.times[0]), 1e-9)
        return max(math.ceil(len(self.times) / most_steps), math.ceil(rate / rate_hz - 1e-6), 1)

    def nearest(self, time_s: float) -> int:
        """Return the index of the snapshot nearest to this time [s]."""
        return int(np.abs(self.times - time_s).argmin())


def checked(
    name: str,
    values: Any,
    sizes: dict[str, int],
    kind: str,
    axes: tuple[str | int, ...],
    may_be_nan: bool = False,
) -> NDArray[Any]:
    """Return an array of a file as one of its type, ``kind``, with these axes.

    ``sizes`` collects the lengths of named axes. InputError if it is another, or a value is too
    large, or not finite unless it ``may_be_nan``.
    """
    array = np.asarray(values)
    if kind == "U" and array.size == 0:
        array = array.astype("U")  # an empty list has no string type
    odd = array.dtype in (np.float16, np.longdouble)
    if odd or array.dtype.kind != np.dtype(kind).kind:
        raise InputError(f"{name} holds {array.dtype}; it must hold {np.dtype(kind).name}")
    shape = f"{name} has shape {array.shape}"
    if array.ndim != len(axes):
        raise InputError(f"{shape}; its axes must be ({', '.join(map(str, axes))})")
    for axis, length in zip(axes, array.shape, strict=True):
        wanted = axis if isinstance(axis, int) else sizes.setdefault(axis, length)
        if length != wanted:
            raise InputError(f"{shape}; its axis {axis} must have length {wanted}")
    if kind == "U":
        if not all(word.isprintable() for word in array.ravel().tolist()):
            raise InputError(f"{name} holds what is no line of text")
        return array
    if not may_be_nan and not np.isfinite(array).all():
        raise InputError(f"{name} holds NaN or infinity; every value must be finite")
    if kind[0] == "f" and (np.abs(array) > _LARGEST).any():
        raise InputError(f"{name} holds a value above {_LARGEST:g}; none is so large")
    return array.astype(kind)


def save_snapshots(path: str | Path, snapshots: Snapshots) -> None:
    """Write snapshots as a NumPy archive; InputError if the file cannot be written."""
    with atomic_file(path) as file:
        np.savez_compressed(file, format=np.array(_FORMAT), **vars(snapshots))


def load_snapshots(path: str | Path) -> Snapshots:
    """Read snapshots; InputError if the file is missing, damaged or of another kind.

    Files of version 0.1 have one person, whose place is taken from the lower torso.
    """
    try:
        arrays = read_arrays(Path(path), _MAX_BYTES)
        if arrays["format"].tolist() == 1:
            arrays |= _of_one_person(arrays)
        if arrays["format"].tolist() != _FORMAT:
            raise InputError("it is of another version of rtradar")
        return Snapshots(**{one.name: arrays[one.name] for one in fields(Snapshots)})
    except DAMAGE as error:
        raise refused(path, error) from None


def refused(path: str | Path, error: Exception) -> InputError:
    """Return what is said of a file of a run that is missing, damaged or refused."""
    if isinstance(error, InputError):
        why = str(error)
    elif isinstance(error, FileNotFoundError):
        why = "it is not there"
    else:
        said = printable(" ".join(str(error).split()))[:100]
        why = f"it is damaged, or of another kind ({said})"
    return InputError(f"'{path}': {why}; make it anew with: rtradar run")


_LATER = {
    *("part_person", "object_names", "mesh_source", "mesh_faces", "mesh_of_vertex", "mesh_part"),
    *("mesh_rows", "blend_vertex", "blend_row", "blend_weight"),
}
"""Fields that files of the first format lack, all of them empty or 0 there."""


def _of_one_person(arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Return what files of the first format lack: one person, at the lower torso, and no meshes."""
    times, parts = arrays["times"], arrays["part_names"].tolist()
    # Of what such a file has, the centre of the lower torso is nearest to the root.
    place = arrays["poses"][:, parts.index("lower torso"), 0].astype(np.float64)
    moved = np.gradient(place, times, axis=0) if len(times) > 1 else np.zeros_like(place)
    found = {
        "format": np.array(_FORMAT),
        "person_names": np.array(["person"]),
        "person_position": place[:, None],
        "person_speed": np.linalg.norm(moved, axis=1)[:, None],
    }
    sizes = {"step": len(times), "part": len(parts)}
    for one in fields(Snapshots):
        if one.name in _LATER:
            axes, kind = one.metadata["axes"], one.metadata["kind"]
            shape = [axis if isinstance(axis, int) else sizes.get(axis, 0) for axis in axes]
            found.setdefault(one.name, np.zeros(shape, kind))
    return found
