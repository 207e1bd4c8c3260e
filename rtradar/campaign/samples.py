"""Samples of a data set: their plans, which follow from a specification, their ids, and making."""

from __future__ import annotations

import hashlib
import itertools
import json
import warnings
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from functools import cache, cached_property, lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from rtradar import __version__
from rtradar.body import Person
from rtradar.campaign.intervals import vary
from rtradar.campaign.kept import capture_of
from rtradar.campaign.spec import (
    APART_M,
    DRAWN,
    RUN_KEYS,
    Actor,
    Combination,
    Others,
    Recorded,
    Spec,
    check_samples,
)
from rtradar.clouds.sample_files import FORMAT, Sample
from rtradar.errors import InputError, InputErrors, ValidityWarning
from rtradar.motion import Motion, cut, load_motion, synthetic_motion
from rtradar.motion.skeleton import NODES
from rtradar.radar import Radar
from rtradar.radar.schedule import FollowingCount
from rtradar.scene import Object, Scene
from rtradar.settings import RunSettings
from rtradar.system.clock import Moment
from rtradar.system.files import digest_of
from rtradar.system.seeds import stream

SPATIAL_POINTS = 3000
"""Largest number of points of the spatial cloud, a uniform sample if there are more."""

_ID_DIGITS = 20  # 80 bits: two of a million samples share an id once in 2e12 collections
_OTHERS_STREAM, _TRIES = 3, 1000
_SPATIAL_STREAM = 2  # differs from the random streams of noise and RDT cloud with the same seed
_SYNTHETIC_LICENCE = "none: made by rtradar"
_SLOW_BAR: Any = {"unit": "interval", "disable": None, "leave": False, "delay": 2.0}
_MOUNT = ("radar_up_m", "radar_pitch_deg", "noise_db")
_BODY = ("build", "height_m")  # drawn once for each synthetic subject
_LATER_FIELDS = (
    "multiplexing", "carrier_step_hz", "doppler_bands", "transmit_power_dbm", "noise_figure_db",
    "noise_temperature_k", "tx_antenna", "rx_antenna", "idle_s", "adc_start_s", "adc_rate_hz",
    "tx_positions_m", "rx_positions_m", "tx_order", "yaw_deg", "pitch_deg", "roll_deg",
    "frame_period_s", "cycle_period_s", "path_times_s",
    "path_m", "path_angles_deg", "receiver", "chip",
)  # fmt: skip
"""Radar fields added later, left out at their defaults, so that ids of older samples stay."""

_FIRST_KEYS = ("pfa", "clutter_removal")
"""Settings of a run that ids always contain; others are left out at their defaults."""


@dataclass(frozen=True)
class SamplePlan:
    """Everything that one sample follows from.

    ``parameters`` are plain JSON values, from which all else follows, and part of the provenance.
    ``motion`` is the recording, or None for a synthetic actor, made anew from the parameters.
    """

    label: str
    parameters: Mapping[str, Any]
    radar: Radar
    scene: Scene
    motion: Motion | None = None

    @cached_property
    def identity(self) -> str:
        """Id of the sample: a hash of the label, the parameters and the format of the file."""
        content = {"format": FORMAT, "label": self.label, "parameters": self.parameters}
        text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()[:_ID_DIGITS]

    @property
    def kind(self) -> tuple[str, str, str]:
        """Radar, scene and fidelity, on which the cost depends most."""
        return self.parameters["radar"], self.parameters["scene"], self.parameters["fidelity"]

    @property
    def interval_s(self) -> float:
        """Length of the interval [s], to which the cost is in proportion."""
        return float(self.parameters["duration_s"])

    def packed(self) -> SamplePlan:
        """Return a copy whose motion is cut to the interval, small enough to send to a worker."""
        if self.motion is None:
            return self
        # A faster copy takes a longer part of the recording.
        start_s, varied = self.parameters["start_s"], self.parameters.get("varied")
        length_s = self.interval_s * (varied["tempo"] if varied else 1.0)
        # An interval to the end is rounded, and may be a little longer than what is there.
        duration_s = min(length_s, self.motion.duration_s - start_s)
        return replace(self, motion=cut(self.motion, start_s, duration_s))

    def run_settings(self) -> RunSettings:
        """Return the settings of the run that makes the sample of a `packed` plan."""
        names = {field.name for field in fields(RunSettings)}
        given = {name: value for name, value in self.parameters.items() if name in names}
        if self.motion is not None:  # which is cut already
            given["start_s"] = 0.0
        return RunSettings(**given | {"variant": "cpu"})  # workers share the cores


class _Interval(NamedTuple):
    """Interval of a recording: parameters of the recording, drawn values, motion if recorded."""

    label: str
    parameters: dict[str, Any]
    drawn: Mapping[str, float]
    motion: Motion | None


def plan_samples(spec: Spec) -> list[SamplePlan]:
    """Plan all samples, or those of a shard, in the order of their ids.

    InputError if a recording cannot be read or is too short, two samples are equal, or there are
    too many.
    """
    # Intervals of actors and of recordings; those of recordings that are too short are told all at
    # once.
    intervals = [interval for actor in spec.actors for interval in _takes(spec, actor)]
    read = cache(load_motion)  # a recording of two activities is given twice
    hide, short = None if spec.recordings else True, list[str]()
    for recorded in tqdm(spec.recordings, "reading recordings", unit="file", disable=hide):
        motion = read(recorded.path, skeleton=recorded.skeleton, **recorded.said)
        if (text := recorded.intervals.lacks(recorded.name, motion.duration_s)) is not None:
            short.append(text)
            continue
        copies = 1 + (spec.augmented.copies if spec.augmented else 0)
        count = len(intervals) + copies * recorded.intervals.most(motion.duration_s)
        check_samples(count, len(spec.combinations))
        intervals += _intervals(spec, recorded, motion)
    if short and (not spec.skip_short or not intervals):
        raise InputErrors([f"{text}, or leave it out (skip_short = true)" for text in short])
    for text in short:
        warnings.warn(f"{text.partition(';')[0]}: left out", ValidityWarning, stacklevel=2)
    # Settings at their defaults are not part of a sample's identity, so that new settings leave
    # older ids as they are.
    run, usual = asdict(spec.run), asdict(RunSettings())
    common = {key: run[key] for key in RUN_KEYS if key in _FIRST_KEYS or run[key] != usual[key]}
    common = json.loads(json.dumps(common)) | {"version": __version__}  # tuples become lists
    later = {"keep": list(spec.keep), "angles": spec.angles, "clouds": spec.clouds}
    later = {key: value for key, value in later.items() if value not in ([], True)}
    common |= later | ({"whole_clouds": True} if spec.whole_clouds else {})
    # Every interval under every combination.
    planned = [
        _plan(interval, combination, spec, common)
        for interval in tqdm(intervals, "planning samples", **_SLOW_BAR)
        for combination in spec.combinations
    ]
    # The order of ids is as good as random: every shard has samples of all kinds.
    planned.sort(key=lambda plan: plan.identity)
    for plan, other in itertools.pairwise(planned):
        if plan.identity == other.identity:
            raise InputError(
                f"recording '{plan.parameters['recording']}' from {plan.parameters['start_s']:g} s "
                "is given twice; leave one out"
            )
    number, count = spec.shard
    if number > len(planned):
        raise InputError(f"shard {number} of {count} is empty: there are {len(planned)} samples")
    return planned[number - 1 :: count]


def counts(planned: Sequence[SamplePlan]) -> dict[str, dict[str, int]]:
    """Count the samples of each label, source, radar, scene, fidelity level and subject."""
    columns: dict[str, Counter[str]] = {"label": Counter(plan.label for plan in planned)}
    for key in ("source", "radar", "scene", "fidelity", "subject"):
        columns[key] = Counter(str(plan.parameters[key]) for plan in planned)
    return {key: dict(sorted(column.items())) for key, column in columns.items()}


def _takes(spec: Spec, actor: Actor) -> Iterator[_Interval]:
    # A take is made long enough for all its intervals. Its seed follows from label and number, its
    # body from the subject.
    take_s = spec.intervals.needed_s
    assert take_s is not None  # the specification was checked
    for take in actor.seeds:
        subject = actor.subjects[take % len(actor.subjects)]
        style = (actor.style,) if actor.style else ()
        seed = _seed(spec.run.seed, actor.label, take, *style)
        ranges = {**spec.drawn, **actor.drawn}
        body = _draw(ranges, _seed("subject", subject))
        drawn = _draw(ranges, seed) | {key: body[key] for key in _BODY}
        name = ":".join(map(str, ("synthetic", actor.label, *style, spec.run.seed, take)))
        motion: dict[str, Any] = {
            "recording": name,
            "recording_digest": "",
            "source": "synthetic",
            "subject": f"synthetic-{subject}",
            "subject_seed": subject,
            "licence": _SYNTHETIC_LICENCE,
            "take": seed,
            "take_s": take_s,
            **({"style": actor.style} if style else {}),
            "side": "left" if np.random.default_rng(stream(seed, 1)).integers(2) else "right",
            **{key: drawn[key] for key in ("tempo", "amplitude", *_BODY)},
            "seed": seed,
        }
        made = partial(_actor_motion, actor.label, motion)
        for start_s, duration_s in spec.intervals.of(name, take_s, seed, made):
            parameters = {**motion, "start_s": start_s, "duration_s": duration_s}
            yield _Interval(actor.label, parameters, drawn, None)


def _intervals(spec: Spec, recorded: Recorded, motion: Motion) -> Iterator[_Interval]:
    content = digest([path for path in (recorded.path, recorded.skeleton) if path is not None])
    places_seed = _seed(spec.run.seed, content)
    for start_s, duration_s in recorded.intervals.of(
        recorded.name, motion.duration_s, places_seed, lambda: motion
    ):
        # The seed follows from the content of the files, so that it stays when they are moved.
        seed = _seed(spec.run.seed, content, start_s)
        parameters = {
            "recording": recorded.name,
            **recorded.said,
            "recording_digest": content,
            "source": "recorded",
            "subject": recorded.subject,
            "licence": recorded.licence,
            "seed": seed,
            "start_s": start_s,
            "duration_s": duration_s,
        }
        yield _Interval(recorded.label, parameters, _draw(spec.drawn, seed), motion)
        for copy in range(spec.augmented.copies if spec.augmented else 0):
            assert spec.augmented is not None
            own = _seed(spec.run.seed, content, start_s, copy)
            drawn = spec.augmented.draw(own, start_s, duration_s, motion.duration_s)
            yield _Interval(
                recorded.label, parameters | {"seed": own} | drawn, _draw(spec.drawn, own), motion
            )


def _plan(
    interval: _Interval, each: Combination, spec: Spec, common: Mapping[str, Any]
) -> SamplePlan:
    drawn, seed, scene = interval.drawn, interval.parameters["seed"], each.scene
    x, y = scene.person_position_m
    # The room, the radar as it is turned there, and the person's place with its offset.
    if spec.random_rooms:
        scene = replace(Scene.random(_seed("room", seed)), name="random")
    radar = _mounted(scene.turn(each.radar), scene, drawn)
    place = (x + drawn["offset_x_m"], y + drawn["offset_y_m"])
    scene = replace(scene, person_position_m=place)
    # All that decides the sample, as plain values: its id is their hash.
    parameters = {
        **interval.parameters,
        **common,
        "radar": radar.name,
        "radar_parameters": _radar_parameters(radar),
        "scene": scene.name,
        "scene_digest": scene_digest(scene),
        "fidelity": each.fidelity,
        "heading_deg": drawn["heading_deg"] if each.heading_deg is None else each.heading_deg,
        "snr_db": drawn["snr_db"] if each.snr_db is None else each.snr_db,
        "person_position_m": list(place),
        "radar_position_m": list(scene.radar_place(radar)),
    }
    if spec.others is not None:
        parameters["others"] = _drawn_others(spec.others, seed, place)
    return SamplePlan(interval.label, parameters, radar, scene, interval.motion)


def _mounted(radar: Radar, scene: Scene, drawn: Mapping[str, float]) -> Radar:
    """Return a radar of this scene with what is drawn of its mount and its noise."""
    up_m, pitch_deg, noise_db = (drawn[key] for key in _MOUNT)
    if not (up_m or pitch_deg or noise_db):
        return radar
    x, y, z = scene.radar_place(radar)
    noise = None if radar.noise_figure_db is None else round(radar.noise_figure_db + noise_db, 4)
    return replace(
        radar,
        position_m=(x, y, round(z + up_m, 4)),
        pitch_deg=round(radar.pitch_deg + pitch_deg, 4),
        noise_figure_db=noise,
    )


def _drawn_others(others: Others, seed: int, place: tuple[float, float]) -> list[dict[str, Any]]:
    """Draw what others do, where, and how they are turned, as plain JSON values."""
    random = np.random.default_rng(stream(seed, _OTHERS_STREAM))
    low, high = np.transpose([others.x_m, others.y_m])
    places, found = [np.asarray(place)], []
    for _ in range(others.count):
        # Places are drawn until one is far enough from everyone.
        for _ in range(_TRIES):
            drawn = np.round(low + (high - low) * random.random(2), 4)
            if min(float(np.linalg.norm(drawn - other)) for other in places) >= APART_M:
                break
        else:
            raise InputError(
                f"[others] count = {others.count}: x_m and y_m hold no place {APART_M:g} m from "
                "everyone; widen them"
            )
        places.append(drawn)
        found.append(
            {
                "label": others.labels[int(random.integers(len(others.labels)))],
                "seed": int(random.integers(2**31)),
                "position_m": drawn.tolist(),
                "heading_deg": round(float(random.uniform(-180.0, 180.0)), 4),
            }
        )
    return found


@lru_cache(maxsize=16)
def _radar_parameters(radar: Radar) -> dict[str, Any]:
    values = asdict(radar)
    if isinstance(radar.chirps_per_frame, FollowingCount):
        del values["chirps_per_frame"]
    for field in fields(radar):
        if field.name in _LATER_FIELDS and values[field.name] == field.default:
            del values[field.name]
        elif isinstance(own := values.get(field.name), dict) and not any(
            own.get("angles_deg", [1])
        ):
            del own["angles_deg"]  # of an antenna that is not turned, as all were once
    return values | {"position_m": list(values["position_m"])}


def _draw(ranges: Mapping[str, tuple[float, float]], seed: int) -> dict[str, float]:
    """Draw one value from every range, each independent of the other ranges."""
    places = np.random.default_rng(stream(seed, 0)).random(len(DRAWN))
    # Four decimals are enough, and are read as the same number everywhere.
    return {
        key: round(low + (high - low) * float(place), 4)
        for (key, (low, high)), place in zip(ranges.items(), places, strict=True)
    }


def _seed(*values: object) -> int:
    """Derive a seed of 32 bits from values, which it does not reveal."""
    return int.from_bytes(hashlib.sha256(repr(values).encode()).digest()[:4], "big")


class Made(NamedTuple):
    """Sample, spatial cloud (m, 3) [m] of the same capture, time ``work_s`` without warm-up.

    ``maps`` are the arrays that the data set keeps beside the clouds.
    """

    sample: Sample
    spatial: NDArray[np.float64]
    work_s: float
    maps: Mapping[str, NDArray[Any]] = {}


def make_sample(plan: SamplePlan) -> Made:
    """Make the sample of a `packed` plan; InputError if the person cannot be where it says."""
    began = Moment.now().work_s
    motion, values = plan.motion, plan.parameters
    # The motion: an actor, a varied copy of a recording, or the recording.
    if motion is None:
        motion = _actor_motion(plan.label, values)
    elif "varied" in values:
        motion = vary(motion, values["varied"])
    settings: Any = vars(plan.run_settings())
    people: list[Motion | Person | Object] = [motion, *_others(values.get("others", ()), settings)]
    # Warnings go with the sample, because nobody reads those of a worker.
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ValidityWarning)
        clouds, maps, sources = capture_of(
            people,
            plan.radar,
            plan.scene,
            values.get("keep", ()),
            values.get("angles", True),
            values.get("clouds", True),
            **settings,
        )
    limits = {str(one.message) for one in caught if issubclass(one.category, ValidityWarning)}
    found = {
        "detections": clouds.rdt.n_voxels,
        "rdt_triangles": clouds.rdt.n_triangles,
        "xyz_points_found": clouds.n_spatial,
        "limits": sorted(limits),
    }
    if "joints" in maps:
        found["joint_names"] = list(NODES)  # of the body, whatever skeleton the recording has
    # A uniform sample of the spatial cloud, in the order of time, with who returned each point.
    places = clouds.spatial.points
    kept = np.arange(len(places))
    if values.get("whole_clouds"):
        maps |= {"spatial_time": clouds.spatial.time, "spatial_velocity": clouds.spatial.velocity}
    elif len(places) > SPATIAL_POINTS:
        random = np.random.default_rng(stream(values["seed"], _SPATIAL_STREAM))
        kept = np.sort(random.choice(len(places), SPATIAL_POINTS, replace=False))
    if sources and clouds.spatial.source is not None:
        found["source_names"] = list(sources)
        maps["spatial_source"] = clouds.spatial.source[kept]
    sample = Sample(clouds.rdt.points, plan.label, {**values, **found})
    return Made(sample, places[kept], Moment.now().work_s - began, maps)


def _actor_motion(label: str, values: Mapping[str, Any]) -> Motion:
    """Make the whole take, because the path of a walk depends on its length."""
    keys = ("height_m", "build", "tempo", "amplitude", "side", "take", "style")
    traits: dict[str, Any] = {key: values[key] for key in keys if key in values}
    return synthetic_motion(
        label, seed=values["subject_seed"], duration_s=values["take_s"], **traits
    )


def _others(others: Sequence[Mapping[str, Any]], settings: Mapping[str, Any]) -> list[Person]:
    """Make the people beside the one of the label, for a run with these settings."""
    end_s = settings["start_s"] + settings["duration_s"]
    return [
        Person(
            synthetic_motion(one["label"], seed=one["seed"], duration_s=end_s),
            one["position_m"],
            # The run turns everyone by its heading.
            (one["heading_deg"] - settings["heading_deg"] + 180.0) % 360.0 - 180.0,
        )
        for one in others
    ]


def scene_digest(scene: Scene) -> str:
    """Hash of a scene, including the content of its mesh files and what its people do."""

    def content(value: object) -> str:
        if isinstance(value, np.ndarray):
            return hashlib.sha256(value.tobytes()).hexdigest()
        if not isinstance(value, Path):
            return str(value)
        status = value.stat()
        return _mesh_digest(value, status.st_mtime_ns, status.st_size)

    # Scenes that have none keep the ids of before there were any.
    later = {key for key in ("objects", "people") if not getattr(scene, key)}
    table = {key: value for key, value in asdict(scene).items() if key not in later}
    text = json.dumps(table, sort_keys=True, default=content)
    return hashlib.sha256(text.encode()).hexdigest()[:_ID_DIGITS]


@lru_cache(maxsize=32)
def _mesh_digest(path: Path, changed_ns: int, size: int) -> str:
    """Hash a mesh file, which many samples share; it is read again only if it has changed."""
    return digest([path])


def digest(paths: list[Path]) -> str:
    """Hash of the content of files, one after the other."""
    found = b"".join(bytes.fromhex(digest_of(path)) for path in paths)
    return hashlib.sha256(found).hexdigest()[:_ID_DIGITS]
