"""The tables of people, radar, scene and settings: every value, as a TOML file holds it.

What no file holds, such as a mesh that was made in Python, is listed under ``missing``: a run file
that has this key cannot be run again.
"""

from __future__ import annotations

import copy
import dataclasses
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from rtradar.body import Person
from rtradar.radar import Radar
from rtradar.scene import MATERIALS, Material, Object, Scene
from rtradar.scene.materials import PowerLaw
from rtradar.scene.moving import kind_of
from rtradar.scene.objects import Furniture
from rtradar.settings import RunSettings

Plain = dict[str, Any]

KEPT_MOTION = re.compile(r"person-\d+\.motion")
"""Name of the file of a motion that no other file holds."""


def table_of(people: Sequence[Person], radar: Radar, scene: Scene, settings: RunSettings) -> Plain:
    """Describe a run, which gives the same again.

    Parameters
    ----------
    people : sequence of Person
        Everyone in the scene, those of the scene too.
    radar : Radar
        Radar.
    scene : Scene
        Scene, whose people are left out.
    settings : RunSettings
        Settings.

    Returns
    -------
    dict
        Tables ``people``, ``radar``, ``scene`` and ``settings`` with absolute paths, and the
        ``files`` that motions were read from. The motion of a person that no file holds is a
        `Motion`.
    """
    missing: list[str] = []
    found = {
        "people": [_person(person) for person in people],
        "radar": plain(radar),
        "scene": _scene(scene, missing),
        "settings": _settings(settings),
    }
    sources = [source for person in people if (source := person.motion.source) is not None]
    digests = {path: digest for source in sources for path, digest in source.files.items()}
    files = [{"path": path, "sha256": digest} for path, digest in digests.items()]
    found |= {"files": files} if files else {}
    return {"missing": missing, **found} if missing else found


def _settings(settings: RunSettings) -> Plain:
    found: Plain = plain(settings)
    # TOML has no word for nothing, which here is not what is left out.
    return found | ({"path_tolerance_db": -math.inf} if settings.path_tolerance_db is None else {})


def plain(value: Any) -> Any:
    """Return a dataclass as a table, without what is None, and its arrays and tuples as lists."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        given = ((field.name, getattr(value, field.name)) for field in dataclasses.fields(value))
        return {name: plain(own) for name, own in given if own is not None}
    if isinstance(value, dict):
        return {str(name): plain(own) for name, own in value.items() if own is not None}
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    if isinstance(value, list | tuple):
        return [plain(own) for own in value]
    # A count that follows another field is a kind of int, which TOML does not know.
    return next((kind(value) for kind in (bool, int, float, str) if isinstance(value, kind)), value)


def _person(person: Person) -> Plain:
    source = person.motion.source
    # What was kept beside another run is kept beside this one, too.
    lost = source is None or KEPT_MOTION.fullmatch(Path(source.keys["motion"]).name)
    made = {"motion": person.motion} if source is None or lost else copy.deepcopy(dict(source.keys))
    rest = (field for field in dataclasses.fields(person) if field.name != "motion")
    own = {field.name: plain(getattr(person, field.name)) for field in rest}
    return made | {name: value for name, value in own.items() if value is not None}


def _scene(scene: Scene, missing: list[str]) -> Plain:
    if scene.source is not None:
        found = copy.deepcopy(dict(scene.source))
        # People and radar have tables of their own, with their places.
        return {key: value for key, value in found.items() if key not in ("people", "radar")}
    person = {"position_m": plain(scene.person_position_m), "heading_deg": scene.heading_deg}
    found = {"name": scene.name, "description": scene.description, "person": person}
    materials: Plain = {}
    for key in ("walls", "furniture", "objects"):
        pieces = []
        for piece in getattr(scene, key):
            own = plain({field.name: getattr(piece, field.name) for field in _fields(piece)})
            own["material"] = _material(piece.material, materials, missing)
            if isinstance(piece, Furniture):
                own |= _shape(piece, missing)
            if isinstance(piece, Object) and piece.motion is not None:
                own["motion"] = {"kind": kind_of(piece.motion), **plain(piece.motion)}
                if own["motion"]["kind"] is None:
                    missing.append(f"the motion of object '{piece.name}'")
            pieces.append(own)
        found |= {key: pieces} if pieces else {}
    return found | ({"materials": materials} if materials else {})


def _fields(piece: Any) -> list[dataclasses.Field[Any]]:
    apart = ("material", "mesh", "motion")
    return [field for field in dataclasses.fields(piece) if field.name not in apart]


def _shape(piece: Furniture, missing: list[str]) -> Plain:
    if isinstance(piece.mesh, tuple | list):
        return {"box": plain(piece.mesh)}
    if hasattr(piece.mesh, "vertices"):
        missing.append(f"the mesh of object '{piece.name}', which was made in Python")
        return {"mesh": "in memory"}
    built_in = isinstance(piece.mesh, str) and piece.metres_per_unit is None
    return {"mesh": piece.mesh if built_in else str(piece.path.absolute())}


def _material(material: Material, materials: Plain, missing: list[str]) -> str:
    if MATERIALS.get(material.name) != material:
        (law, *others) = material.bands
        if others or not isinstance(law, PowerLaw):
            missing.append(f"material '{material.name}', which was made in Python")
        else:
            materials[material.name] = {"source": material.source, **plain(law)}
    return material.name
