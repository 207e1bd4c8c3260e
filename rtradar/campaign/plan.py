"""From a specification to the recipes of all its samples, and what they are in numbers."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields, replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from rtradar import __version__
from rtradar.campaign.sample import Recipe, digest, scene_digest
from rtradar.campaign.spec import DRAWN, Actor, Recorded, Setting, Spec, check_samples
from rtradar.errors import InputError
from rtradar.motion import Motion, load_motion
from rtradar.radar import Radar
from rtradar.system.seeds import stream

_SYNTHETIC_LICENCE = "none: made by rtradar"
_PATIENCE_S = 2.0
"""What lasts longer shows a bar."""

_BODY = ("build", "height_m")
"""What a synthetic subject has for life, and is drawn with the subject."""
_LATER = (
    "multiplexing",
    "carrier_step_hz",
    "doppler_bands",
    "transmit_power_dbm",
    "noise_figure_db",
    "noise_temperature_k",
    "tx_antenna",
    "rx_antenna",
)
"""Radar fields added later, left out at their defaults, so that ids of older samples stay."""


class _Interval(NamedTuple):
    """Interval of a recording: parameters of the recording, drawn values, motion if recorded."""

    label: str
    parameters: dict[str, Any]
    drawn: Mapping[str, float]
    motion: Motion | None


def recipes(spec: Spec) -> list[Recipe]:
    """The recipes of all samples, in the order of their ids.

    Raises
    ------
    InputError
        If a recording cannot be read or is too short, two samples are equal, or there are too many.
    """
    intervals = [*(interval for actor in spec.actors for interval in _takes(spec, actor))]
    # Reading takes a second for a long recording.
    for recorded in tqdm(
        spec.recordings,
        desc="reading recordings",
        unit="file",
        disable=None if spec.recordings else True,
    ):
        motion = load_motion(recorded.path, skeleton=recorded.skeleton)
        check_samples(
            len(intervals) + recorded.windows.count(motion.duration_s), len(spec.settings)
        )
        intervals += _intervals(spec, recorded, motion)
    common = {"pfa": spec.pfa, "clutter_removal": spec.clutter_removal, "version": __version__}
    combinations = ((interval, setting) for interval in intervals for setting in spec.settings)
    total = len(intervals) * len(spec.settings)
    bar = tqdm(
        combinations,
        desc="planning samples",
        unit="sample",
        total=total,
        disable=None,
        leave=False,
        delay=_PATIENCE_S,
    )
    found = [_recipe(interval, setting, common) for interval, setting in bar]
    twice = [
        identity
        for identity, count in Counter(recipe.identity for recipe in found).items()
        if count > 1
    ]
    if twice:
        told = next(recipe.parameters for recipe in found if recipe.identity == twice[0])
        raise InputError(
            f"recording '{told['recording']}' from {told['start_s']:g} s stands there twice; "
            "leave one out"
        )
    return sorted(found, key=lambda recipe: recipe.identity)


def counts(found: Sequence[Recipe]) -> dict[str, dict[str, int]]:
    """How many samples there are of each label, source, subject, radar, scene, fidelity."""
    columns: dict[str, Counter[str]] = {"label": Counter(recipe.label for recipe in found)}
    for key in ("source", "radar", "scene", "fidelity", "subject"):
        columns[key] = Counter(str(recipe.parameters[key]) for recipe in found)
    return {key: dict(sorted(column.items())) for key, column in columns.items()}


def _takes(spec: Spec, actor: Actor) -> Iterator[_Interval]:
    take_s = spec.windows.needed_s
    assert take_s is not None  # the specification was checked
    for take in actor.seeds:
        subject = actor.subjects[take % len(actor.subjects)]
        seed = _seed(spec.seed, actor.label, take)
        drawn = {
            **_draw(spec, seed),
            **{key: _draw(spec, _seed("subject", subject))[key] for key in _BODY},
        }
        name = f"synthetic:{actor.label}:{spec.seed}:{take}"
        motion: dict[str, Any] = {
            "recording": name,
            "recording_digest": "",
            "source": "synthetic",
            "subject": f"synthetic-{subject}",
            "subject_seed": subject,
            "licence": _SYNTHETIC_LICENCE,
            "take": seed,
            "take_s": take_s,
            "side": "left" if _side(seed) else "right",
            **{key: drawn[key] for key in ("tempo", "amplitude", *_BODY)},
            "seed": seed,
        }
        for start_s, duration_s in spec.windows.of(name, take_s):
            yield _Interval(
                actor.label, {**motion, "start_s": start_s, "duration_s": duration_s}, drawn, None
            )


def _intervals(spec: Spec, recorded: Recorded, motion: Motion) -> Iterator[_Interval]:
    content = digest([path for path in (recorded.path, recorded.skeleton) if path is not None])
    for start_s, duration_s in recorded.windows.of(recorded.name, motion.duration_s):
        seed = _seed(spec.seed, content, start_s)
        parameters = {
            "recording": recorded.name,
            "recording_digest": content,
            "source": "recorded",
            "subject": recorded.subject,
            "licence": recorded.licence,
            "seed": seed,
            "start_s": start_s,
            "duration_s": duration_s,
        }
        yield _Interval(recorded.label, parameters, _draw(spec, seed), motion)


def _recipe(interval: _Interval, setting: Setting, common: Mapping[str, Any]) -> Recipe:
    drawn, scene = interval.drawn, setting.scene
    place = (
        scene.person_position_m[0] + drawn["offset_x_m"],
        scene.person_position_m[1] + drawn["offset_y_m"],
    )
    scene = replace(scene, person_position_m=place)
    radar = setting.radar
    parameters = {
        **interval.parameters,
        **common,
        "radar": radar.name,
        "radar_parameters": _radar_parameters(radar),
        "scene": scene.name,
        "scene_digest": scene_digest(scene),
        "fidelity": setting.fidelity,
        "heading_deg": drawn["heading_deg"] if setting.heading_deg is None else setting.heading_deg,
        "snr_db": drawn["snr_db"] if setting.snr_db is None else setting.snr_db,
        "person_position_m": list(place),
        "radar_position_m": list(scene.radar_position_m or radar.position_m),
    }
    return Recipe(interval.label, parameters, radar, scene, interval.motion)


@lru_cache(maxsize=16)
def _radar_parameters(radar: Radar) -> dict[str, Any]:
    told = asdict(radar)
    later = {field.name: field.default for field in fields(radar) if field.name in _LATER}
    told = {
        name: value for name, value in told.items() if name not in later or value != later[name]
    }
    return told | {"position_m": list(told["position_m"])}


def _draw(spec: Spec, seed: int) -> dict[str, float]:
    """Draw one value from every range, each independent of the other ranges."""
    places = np.random.default_rng(stream(seed, 0)).random(len(DRAWN))
    # Four decimals say it all, and read the same everywhere.
    return {
        key: round(low + (high - low) * float(place), 4)
        for (key, (low, high)), place in zip(spec.drawn.items(), places, strict=True)
    }


def _side(seed: int) -> bool:
    return bool(np.random.default_rng(stream(seed, 1)).integers(2))


def _seed(*told: object) -> int:
    """32 bits that follow from what is told, and show nothing of it."""
    return int.from_bytes(hashlib.sha256(repr(told).encode()).digest()[:4], "big")
