"""The scene: what stands around the person, and how Mitsuba is told of all of it."""

from rtradar.scene.scene import Scene

__all__ = ["Scene"]
