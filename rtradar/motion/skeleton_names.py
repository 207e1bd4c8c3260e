"""The 22 nodes of the paper's body, and the names of their joints in each kind of skeleton.

HDM05 and CMU have 31 joints. The 24-joint chain (`CHAIN_24`, that of SMPL) leaves out the thumbs,
and the joints inside what moves as one: upper neck, ball of the foot, radius, hand. Its neck and
collars are not separated in HDM05, they are all at the thorax; without the three and with the top
of the head added, 22 nodes and 21 bones remain, one a body part.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

_LEGS_AND_ARMS = {
    side: (
        {
            f"{side}_hip": "root",
            f"{side}_knee": f"{side}_hip",
            f"{side}_ankle": f"{side}_knee",
            f"{side}_toe": f"{side}_ankle",
        },
        {
            f"{side}_shoulder": "thorax",
            f"{side}_elbow": f"{side}_shoulder",
            f"{side}_wrist": f"{side}_elbow",
            f"{side}_hand": f"{side}_wrist",
        },
    )
    for side in ("l", "r")
}

NODE_PARENT: Mapping[str, str] = {
    **_LEGS_AND_ARMS["l"][0],
    **_LEGS_AND_ARMS["r"][0],
    "lowerback": "root",
    "upperback": "lowerback",
    "thorax": "upperback",
    "neck": "thorax",
    "head": "neck",
    **_LEGS_AND_ARMS["l"][1],
    **_LEGS_AND_ARMS["r"][1],
}
"""Parent of each node but the root, parents first: the 21 bones."""

NODES: tuple[str, ...] = ("root", *NODE_PARENT)
"""The paper's 22 nodes."""

CHAIN_24: Mapping[str, str] = {
    "pelvis": "root",
    "l_hip": "lhipjoint",
    "r_hip": "rhipjoint",
    "spine1": "lowerback",
    "l_knee": "lfemur",
    "r_knee": "rfemur",
    "spine2": "upperback",
    "l_ankle": "ltibia",
    "r_ankle": "rtibia",
    "spine3": "thorax",
    "l_foot": "ltoes",
    "r_foot": "rtoes",
    "neck": "thorax",
    "l_collar": "thorax",
    "r_collar": "thorax",
    "head": "lowerneck",
    "l_shoulder": "lclavicle",
    "r_shoulder": "rclavicle",
    "l_elbow": "lhumerus",
    "r_elbow": "rhumerus",
    "l_wrist": "lwrist",
    "r_wrist": "rwrist",
    "l_hand": "lfingers",
    "r_hand": "rfingers",
}
"""The 24-joint chain and the HDM05 joint (end of the ASF bone of this name) of each."""

_NODE_OF_24 = {
    "pelvis": "root",
    "spine1": "lowerback",
    "spine2": "upperback",
    "spine3": "thorax",
    "head": "neck",
} | {f"{side}_foot": f"{side}_toe" for side in ("l", "r")}
_NOT_SEPARATED = ("neck", "l_collar", "r_collar")

ASF_JOINTS: Mapping[str, str] = {
    **{
        _NODE_OF_24.get(name, name): joint
        for name, joint in CHAIN_24.items()
        if name not in _NOT_SEPARATED
    },
    "head": "head",
}
"""HDM05 joint of each of the 22 nodes."""


@dataclass(frozen=True)
class Convention:
    """Joint names of one kind of skeleton by node, as `plain` gives them.

    ``lowerback`` and ``upperback`` are not named: they are found along the chain from root to
    thorax. The first name that is there counts. Where ``open_ended``, hands, head and toes may lack
    an end and are then extended.
    """

    name: str
    joints: Mapping[str, tuple[str, ...]]
    open_ended: bool


def _both(
    left: Mapping[str, tuple[str, ...]], left_word: str, right_word: str
) -> dict[str, tuple[str, ...]]:
    """Names of both sides, from templates with ``@`` in place of the side."""
    return {
        f"{side}_{node}": tuple(name.replace("@", word) for name in names)
        for side, word in (("l", left_word), ("r", right_word))
        for node, names in left.items()
    }


CONVENTIONS: tuple[Convention, ...] = (
    Convention(
        "ASF (HDM05, CMU)",
        {
            node: (joint,)
            for node, joint in ASF_JOINTS.items()
            if node not in ("lowerback", "upperback")
        },
        open_ended=False,
    ),
    Convention(
        "Bandai-Namco BVH",
        {"root": ("hips",), "thorax": ("neck",), "neck": ("head",), "head": ("headend",)}
        | _both(
            {
                "hip": ("upperleg@",),
                "knee": ("lowerleg@",),
                "ankle": ("foot@",),
                "toe": ("toes@end", "toes@"),
                "shoulder": ("upperarm@",),
                "elbow": ("lowerarm@",),
                "wrist": ("hand@",),
                "hand": ("hand@end",),
            },
            "l",
            "r",
        ),
        open_ended=True,
    ),
    Convention(
        "CMU BVH, MotionBuilder, Mixamo",
        {
            "root": ("hips",),
            "thorax": ("neck",),
            "neck": ("neck1", "head"),
            "head": ("headtopend", "headend"),
        }
        | _both(
            {
                "hip": ("@upleg",),
                "knee": ("@leg",),
                "ankle": ("@foot",),
                "toe": ("@toebaseend", "@toeend", "@toebase"),
                "shoulder": ("@arm",),
                "elbow": ("@forearm",),
                "wrist": ("@hand",),
                "hand": (
                    "@handmiddle3",
                    "@handmiddle2",
                    "@handmiddle1",
                    "@handindex1end",
                    "@handindex1",
                    "@handend",
                ),
            },
            "left",
            "right",
        ),
        open_ended=True,
    ),
    Convention(
        "Poser BVH",
        {"root": ("hips", "hip"), "thorax": ("neck",), "neck": ("head",), "head": ("headend",)}
        | _both(
            {
                "hip": ("@hip",),
                "knee": ("@knee",),
                "ankle": ("@ankle",),
                "toe": ("@toe", "@ankleend"),
                "shoulder": ("@shoulder",),
                "elbow": ("@elbow",),
                "wrist": ("@wrist",),
                "hand": ("@wristend",),
            },
            "left",
            "right",
        ),
        open_ended=True,
    ),
)
"""Every kind of skeleton that is understood."""


def plain(name: str) -> str:
    """A joint's name without namespace (``mixamorig:``), case, spaces and underscores."""
    return re.sub(r"[^a-z0-9]", "", re.sub(r"^(.*:|mixamorig\d*)", "", name).lower())
