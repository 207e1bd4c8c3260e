"""The scene: what stands around the person, of which materials, and how Mitsuba is told of the body.

Meshes are read by trimesh, which loads when the first one is.
"""

from rtradar.scene.furniture import Furniture
from rtradar.scene.materials import MATERIALS, Material, material, own_material
from rtradar.scene.mesh_files import Triangles
from rtradar.scene.scene import Scene
from rtradar.scene.slab import reflection, slab
from rtradar.scene.walls import Surface, Wall, room_walls

__all__ = [
    "MATERIALS",
    "Furniture",
    "Material",
    "Scene",
    "Surface",
    "Triangles",
    "Wall",
    "material",
    "own_material",
    "reflection",
    "room_walls",
    "slab",
]
