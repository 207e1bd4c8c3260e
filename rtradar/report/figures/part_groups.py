"""Groups of body parts that share a colour."""

from __future__ import annotations

from collections.abc import Sequence

GROUPS = {
    "head, neck": "#cc79a7",
    "torso": "#3f7fd1",
    "left arm": "#56b4e9",
    "right arm": "#009e73",
    "left leg": "#e69f00",
    "right leg": "#d55e00",
    "no part near": "#8c8c94",
}
"""Names and colours of groups of parts; the last is of what belongs to none."""

_LIMBS = {"clavicle": "arm", "upper arm": "arm", "forearm": "arm", "hand": "arm"}


def group_of_parts(parts: Sequence[str]) -> list[int]:
    """Number of each part's group in `GROUPS`."""
    names = list(GROUPS)
    found = []
    for part in parts:
        side, _, limb = part.partition(" ")
        group = (
            f"{side} {_LIMBS.get(limb, 'leg')}"
            if side in ("left", "right")
            else "torso"
            if "torso" in part
            else "head, neck"
        )
        found.append(names.index(group))
    return found
