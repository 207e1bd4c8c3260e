"""Rotations of the body models SMPL, SMPL+H and SMPL-X, as AMASS has them, on a mean skeleton.

An archive holds ``trans`` (frame, 3) [m] and, about each joint of the tree, axis times angle [rad]:
``poses`` (frame, 3 x joint), or ``root_orient``, ``pose_body`` and others. The 22 joints of the
body come first and are the same in all of these models; ``body_models.toml`` has them. The joint at
the root is at ``trans`` plus where it is in the rest pose.

Shape (``betas``) and the files of the models, which have a licence of their own, are not read: the
skeleton is that of the models' mean person.

References
----------
M. Loper, N. Mahmood, J. Romero, G. Pons-Moll, M. J. Black, SMPL: A skinned multi-person linear
model, ACM Transactions on Graphics 34, 2015. N. Mahmood, N. Ghorbani, N. F. Troje, G. Pons-Moll,
M. J. Black, AMASS: Archive of motion capture as surface shapes, ICCV 2019.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from rtradar.errors import InputError

Array = NDArray[np.float64]

_RATES = ("mocap_framerate", "mocap_frame_rate", "fps", "rate_hz")


def holds_rotations(arrays: Mapping[str, NDArray[Any]]) -> bool:
    """Whether an archive holds rotations of a body model."""
    return "positions" not in arrays and bool({"poses", "root_orient", "pose_body"} & set(arrays))


def as_positions(path: Path, arrays: Mapping[str, NDArray[Any]]) -> dict[str, NDArray[Any]]:
    """Positions (frame, joint, 3) of the joints, in the axes of the file [m], and the rate.

    Under the keys that an archive of joint positions has.
    """
    with Path(__file__).with_suffix(".toml").open("rb") as file:
        person = tomllib.load(file)
    joints = person["joints"]
    turned = _rotations(path, arrays, len(joints))
    trans = arrays.get("trans", np.empty(0))
    if trans.shape != (len(turned), 3) or trans.dtype.kind not in "fiu":
        what = f"{trans.dtype} of shape {trans.shape}" if trans.size else "missing"
        raise InputError(f"{path}: trans is {what}; it must be ({len(turned)}, 3), as in AMASS")
    for name, values in (("trans", trans), ("rotations", turned)):
        for frame in np.flatnonzero(~np.isfinite(values).all(axis=1)):
            raise InputError(f"{path}: {name} are not finite in frame {frame + 1}; mend them")
    kind = "smplx" if "x" in str(arrays.get("surface_model_type", "")) else "others"
    places, world = dict[str, Array](), dict[str, Rotation]()
    for number, (joint, own) in enumerate(joints.items()):
        local, above = Rotation.from_rotvec(turned[:, 3 * number : 3 * number + 3]), own["parent"]
        if above:
            places[joint] = places[above] + world[above].apply(own["offset"])
            world[joint] = world[above] * local
        else:
            places[joint], world[joint] = trans + np.array(person["pelvis"][kind]), local
    found = {"positions": np.stack(list(places.values()), axis=1), "joints": np.array(list(joints))}
    rates = [arrays[name] for name in _RATES if name in arrays]
    return found | ({"rate_hz": rates[0]} if rates else {})


def _rotations(path: Path, arrays: Mapping[str, NDArray[Any]], joints: int) -> Array:
    """Axis times angle (frame, 3 a joint) of the joints of the body [rad]."""
    given = arrays.get("poses", np.empty(0))
    if "poses" not in arrays:
        parts = [arrays.get(name, np.empty(0)) for name in ("root_orient", "pose_body")]
        if all(part.ndim == 2 and len(part) == len(parts[0]) for part in parts):
            given = np.concatenate(parts, axis=1)
    if given.ndim != 2 or given.shape[1] < 3 * joints or given.dtype.kind not in "fiu":
        raise InputError(
            f"{path}: poses are {given.dtype} of shape {given.shape}; they, or root_orient and "
            f"pose_body, must be (frame, {3 * joints}) or more: axis times angle of {joints} "
            "joints, as SMPL, SMPL+H and SMPL-X have them"
        )
    return given[:, : 3 * joints].astype(np.float64)
