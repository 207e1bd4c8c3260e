"""What is given by a name or a path in place of a motion, a radar or a scene."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

from rtradar.body import Person
from rtradar.errors import InputError
from rtradar.motion import Motion, load_motion, synthetic_motion
from rtradar.radar import Radar
from rtradar.recordings import ACTOR_S, SYNTHETIC
from rtradar.scene import Object, Scene
from rtradar.settings import RunSettings
from rtradar.system.checks import brief

Movers: TypeAlias = Sequence[Motion | Person | Object]
"""Who and what moves, once files are read."""

Moving: TypeAlias = Motion | Person | str | Path | Sequence[Motion | Person | Object | str | Path]
"""Who and what moves: one or several; a bare motion is a person where the scene puts them."""


def given_parts(
    moving: Moving,
    radar: Radar | str | Path,
    scene: Scene | str | Path | None,
    settings: RunSettings,
) -> tuple[list[Motion | Person | Object], Radar, Scene]:
    """Load what is given by names and paths, and check what is given as it is.

    Parameters
    ----------
    moving : Motion, Person, str, path, or sequence of them and of Object
        Who and what moves; text is the path of a recording, or ``synthetic:`` and an activity.
    radar : Radar, str or path
        Radar, or what `Radar.load` takes.
    scene : Scene, str or path, optional
        Scene, or what `Scene.load` takes; free space if left out.
    settings : RunSettings
        Seed and interval, which actors by name follow.

    Returns
    -------
    tuple
        Those who and what move, the radar, and the scene.

    Raises
    ------
    InputError
        Where there is no such name, a file cannot be read, or something is none of these.
    """
    several = (
        [moving] if isinstance(moving, str | Path) or not isinstance(moving, Sequence) else moving
    )
    found = [
        load_mover(one, number, settings) if isinstance(one, str | Path) else one
        for number, one in enumerate(several)
    ]
    radar = Radar.load(radar) if isinstance(radar, str | Path) else radar
    scene = Scene() if scene is None else scene
    scene = Scene.load(scene) if isinstance(scene, str | Path) else scene
    if not isinstance(radar, Radar):
        raise InputError(
            f"radar = {brief(radar)}; it must be a Radar, such as rt.Radar.preset('paper-12ghz'), "
            "or the name or path of one"
        )
    if not isinstance(scene, Scene):
        raise InputError(
            f"scene = {brief(scene)}; it must be a Scene, such as rt.Scene.load('living-room'), or "
            "the name or path of one"
        )
    return found, radar, scene


def load_mover(source: str | Path, number: int, settings: RunSettings, **reading: Any) -> Motion:
    """Load a motion by the path of a recording, or ``synthetic:`` and an activity.

    Parameters
    ----------
    source : str or path
        Recording or actor.
    number : int
        Number of the person, which makes actors differ.
    settings : RunSettings
        Seed and interval, which actors follow.
    **reading
        What `load_motion` takes.

    Returns
    -------
    Motion

    Raises
    ------
    InputError
        Where there is no such actor, or the recording cannot be read.
    """
    text = str(source)
    if not text.startswith(SYNTHETIC):
        return load_motion(source, **reading)
    duration_s = ACTOR_S if settings.duration_s is None else settings.duration_s
    return synthetic_motion(
        text.removeprefix(SYNTHETIC),
        seed=settings.seed + number,
        duration_s=settings.start_s + duration_s,
    )
