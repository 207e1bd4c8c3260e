"""The scene: walls and furniture around the person, and their materials.

Meshes are read by trimesh, which is imported when the first mesh is read.
"""

from rtradar.scene.materials import MATERIALS, Material, material, own_material
from rtradar.scene.mesh_files import Triangles
from rtradar.scene.moving import FollowingPath, Object, Swinging, Turning
from rtradar.scene.objects import Furniture, Surface, Wall, room_walls
from rtradar.scene.scene import Scene
from rtradar.scene.slab import reflection, slab

__all__ = [
    "MATERIALS",
    "FollowingPath",
    "Furniture",
    "Material",
    "Object",
    "Scene",
    "Surface",
    "Swinging",
    "Triangles",
    "Turning",
    "Wall",
    "material",
    "own_material",
    "reflection",
    "room_walls",
    "slab",
]
