"""Rotations of the body models SMPL, SMPL+H and SMPL-X, as AMASS has them, on a mean skeleton.

An archive holds ``trans`` (frame, 3) [m] and, about each joint of the tree, axis times angle [rad]:
``poses`` (frame, 3 x joint), or ``root_orient``, ``pose_body`` and others. In the rest pose, a T, y
is up and the person looks along z. The 22 joints of the body come first and are the same in all of
these models. The joint at the root is at ``trans`` plus where it is in the rest pose.

Shape (``betas``) and the files of the models, which have a licence of their own, are not read: the
skeleton is that of the models' mean person.

References
----------
M. Loper, N. Mahmood, J. Romero, G. Pons-Moll, M. J. Black, SMPL: A skinned multi-person linear
model, ACM Transactions on Graphics 34, 2015. N. Mahmood, N. Ghorbani, N. F. Troje, G. Pons-Moll,
M. J. Black, AMASS: Archive of motion capture as surface shapes, ICCV 2019.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError

Array = NDArray[np.float64]

_SIDED = {
    "hip": ("pelvis", (0.069, -0.091, -0.006)),
    "knee": ("hip", (0.036, -0.379, -0.007)),
    "ankle": ("knee", (-0.015, -0.398, -0.043)),
    "foot": ("ankle", (0.026, -0.052, 0.121)),
    "collar": ("spine3", (0.080, 0.120, -0.036)),
    "shoulder": ("collar", (0.094, 0.032, -0.009)),
    "elbow": ("shoulder", (0.257, -0.013, -0.024)),
    "wrist": ("elbow", (0.252, 0.008, -0.003)),
}
_MIDDLE = {
    "spine1": ("pelvis", (0.0, 0.109, -0.027)),
    "spine2": ("spine1", (0.0, 0.135, 0.001)),
    "spine3": ("spine2", (0.0, 0.053, 0.025)),
    "neck": ("spine3", (0.0, 0.214, -0.043)),
    "head": ("neck", (0.0, 0.065, 0.051)),
}
"""Parent of each joint, and its place from there in the rest pose of the mean person, to the left
on the left side [m]; the mean of both sides."""

_ORDER = (
    "pelvis", "@hip", "spine1", "@knee", "spine2", "@ankle", "spine3", "@foot", "neck", "@collar",
    "head", "@shoulder", "@elbow", "@wrist",
)  # fmt: skip

JOINTS = tuple(
    name.replace("@", side)
    for name in _ORDER
    for side in (("left_", "right_") if "@" in name else ("",))
)
"""The 22 joints of the body, in the order of the rotations."""

_PELVIS_M = {"smplx": (0.003, -0.351, 0.012), "": (-0.002, -0.223, 0.028)}
"""Place of the root in the rest pose [m], of SMPL-X and of the others."""

_RATES = ("mocap_framerate", "mocap_frame_rate", "fps", "rate_hz")


def holds_rotations(arrays: Mapping[str, NDArray[Any]]) -> bool:
    """Whether an archive holds rotations of a body model."""
    return "positions" not in arrays and bool({"poses", "root_orient", "pose_body"} & set(arrays))


def as_positions(path: Path, arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Positions (frame, joint, 3) of `JOINTS`, in the axes of the file [m], and what else it says.

    Under the keys that an archive of joint positions has.
    """
    found = {"positions": _positions(path, arrays), "joints": np.array(JOINTS)}
    rates = [arrays[name] for name in _RATES if name in arrays]
    return found | ({"rate_hz": rates[0]} if rates else {})


def _positions(path: Path, arrays: Mapping[str, NDArray[Any]]) -> Array:
    trans, turned = arrays.get("trans"), _rotations(path, arrays)
    if trans is None or trans.shape != (len(turned), 3) or trans.dtype.kind not in "fiu":
        what = "missing" if trans is None else f"{trans.dtype} of shape {trans.shape}"
        raise InputError(f"{path}: trans is {what}; it must be ({len(turned)}, 3), as in AMASS")
    for name, values in (("trans", trans), ("rotations", turned)):
        for frame in np.flatnonzero(~np.isfinite(values).all(axis=1)):
            raise InputError(f"{path}: {name} are not finite in frame {frame + 1}; mend them")
    kind = str(arrays.get("surface_model_type", ""))
    places = {"pelvis": trans + np.array(_PELVIS_M["smplx" if "x" in kind else ""])}
    world: dict[str, Rotation] = {}
    for number, joint in enumerate(JOINTS):
        own = Rotation.from_rotvec(turned[:, 3 * number : 3 * number + 3])
        side, _, plain = joint.rpartition("_")
        if joint == "pelvis":
            world[joint] = own
            continue
        above, offset = _SIDED[plain] if side else _MIDDLE[joint]
        parent = above if above in places else f"{side}_{above}"
        mirror = -1.0 if side == "right" else 1.0
        places[joint] = places[parent] + world[parent].apply([mirror * offset[0], *offset[1:]])
        world[joint] = world[parent] * own
    return np.stack([places[joint] for joint in JOINTS], axis=1)


def _rotations(path: Path, arrays: Mapping[str, NDArray[Any]]) -> Array:
    """Axis times angle (frame, 66) of the joints of the body [rad]."""
    if "poses" in arrays:
        given = arrays["poses"]
    else:
        parts = [arrays.get(name, np.empty((0, 0))) for name in ("root_orient", "pose_body")]
        if parts[0].ndim != 2 or parts[1].ndim != 2 or len(parts[0]) != len(parts[1]):
            raise InputError(
                f"{path}: root_orient is {parts[0].shape}, pose_body {parts[1].shape}; they must "
                "be (frame, 3) and (frame, 63), as in AMASS"
            )
        given = np.concatenate(parts, axis=1)
    if given.ndim != 2 or given.shape[1] < 3 * len(JOINTS) or given.dtype.kind not in "fiu":
        raise InputError(
            f"{path}: poses are {given.dtype} of shape {given.shape}; they must be (frame, 66) or "
            "more: axis times angle of 22 joints, as SMPL, SMPL+H and SMPL-X have them"
        )
    return given[:, : 3 * len(JOINTS)].astype(np.float64)
