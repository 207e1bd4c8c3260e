"""Extremes: each gives the right finite answer, or a clear refusal or warning; never NaN, a hang or an abort.

A case says what is expected, and gives back what it got or fails. Right is told by closed forms written down here: a sphere
seen from one place at the distance R from its surface has |F| D^2 / R^2 sqrt(pi) / (1/a + 1/R), D the distance of its centre,
and along a symmetry axis an ellipsoid has the same with both of its radii of curvature. The tests run the same cases.

    python validation/extremes.py [--quick] [--json FILE]
"""

from __future__ import annotations

import dataclasses
import re
import sys
import tempfile
import warnings
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rows import Row, judged, main

import rtradar as rt
import rtradar.body
from rtradar.body.body import Poses
from rtradar.echoes import Echoes
from rtradar.motion import place
from rtradar.pipeline.survey import survey
from rtradar.scatter import build_rung

Array = NDArray[np.float64]
C = 299_792_458.0
RUNGS = ("analytic", "specular")
TRACED = ("specular", "fresnel", "physical-optics", "rays")
BESIDE = np.array([0.0, 0.1, 0.0])


class Case(NamedTuple):
    """One extreme; ``run`` gives back what it got, and raises AssertionError where that is wrong."""

    name: str
    expected: str
    run: Callable[[], str]
    slow: bool = False


CASES: list[Case] = []


def case(name: str, expected: str, *, slow: bool = False) -> Callable[[Callable[[], str]], Callable[[], str]]:
    def add(run: Callable[[], str]) -> Callable[[], str]:
        CASES.append(Case(name, expected, run, slow))
        return run

    return add


# -- helpers --------------------------------------------------------------------------------------------------------


def refused(work: Callable[[], object], words: str) -> str:
    """The message of the refusal, which must be one line that holds ``words``, a regular expression."""
    try:
        found = work()
    except rt.InputError as error:
        message = str(error)
        assert "\n" not in message, message
        assert re.search(words, message), message
        return f"refused: {message}"
    raise AssertionError(f"not refused, but {found!r}"[:200])


def warned(work: Callable[[], Any], words: str) -> tuple[Any, str]:
    """What it gave, and the warning that holds ``words``."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = work()
    said = [str(warning.message) for warning in caught if re.search(words, str(warning.message))]
    assert said, f"no warning with '{words}', but {[str(w.message) for w in caught]}"
    return found, said[0]


def alone(*axes: float, centre: object = (0.0, 0.0, 0.0), frame: object = None) -> rt.Ellipsoids:
    return rt.Ellipsoids([centre], [np.eye(3) if frame is None else frame], [axes])


def together(*targets: rt.Ellipsoids) -> rt.Ellipsoids:
    return rt.Ellipsoids(*(np.concatenate([getattr(t, name) for t in targets]) for name in ("centres", "frames", "semi_axes")))


def along_axis(half_length: float, radii: tuple[float, float], gap: float, frequency: float) -> complex:
    """F [m] seen along a symmetry axis from ``gap`` before the surface, whose principal radii there are ``radii``."""
    distance = half_length + gap
    size = (distance / gap) ** 2 * np.sqrt(np.pi / ((1 / radii[0] + 1 / gap) * (1 / radii[1] + 1 / gap)))
    return complex(size * np.exp(2j * 2 * np.pi * frequency / C * half_length))


def worst_error(pairs: list[tuple[complex, complex]], limit: float) -> str:
    errors = [abs(ours / reference - 1) for ours, reference in pairs]
    assert np.isfinite(errors).all(), errors
    assert max(errors) < limit, errors
    return f"right to {max(errors):.1e}"


@dataclasses.dataclass(frozen=True)
class Ball:
    """A sphere that flies along x; all that a rung asks of a body."""

    speed: float = 0.0
    radius: float = 0.2
    place: tuple[float, float, float] = (0.0, 0.0, 1.0)
    part_names: tuple[str, ...] = ("ball",)
    duration_s: float = 0.2

    @property
    def semi_axes(self) -> Array:
        return np.full((1, 3), self.radius)

    def at(self, times: Array) -> Poses:
        times = np.atleast_1d(times)
        centres = np.tile(np.asarray(self.place, dtype=np.float64), (len(times), 1, 1))
        centres[:, 0, 0] += self.speed * times
        return Poses(centres, np.broadcast_to(np.eye(3), (len(times), 1, 3, 3)), self.semi_axes)


def small_radar(**changes: Any) -> rt.Radar:
    values: dict[str, Any] = {
        "name": "small",
        "tx_y": 2,
        "tx_z": 0,
        "rx_y": 4,
        "rx_z": 0,
        "chirp_duration_s": 250e-6,
        "samples_per_chirp": 128,
        "frame_duration_s": 0.05,
    }
    return rt.Radar(**(values | changes))


@cache
def motion() -> rt.Motion:
    return rt.synthetic_motion("kick", seed=1, duration_s=0.6)


def chain(radar: rt.Radar | None = None, what: rt.Motion | None = None, **options: Any) -> tuple[rt.Result, list[str]]:
    """The whole chain, and its warnings; every number of its summary is finite, or it could not have been written."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        values: dict[str, Any] = {"fidelity": "analytic", "duration_s": 0.12}
        result = rt.run(what or motion(), radar or small_radar(), out=Path(folder, "out"), **(values | options))
    assert np.isfinite(result.points).all()
    assert np.isfinite(result.survey.power_at).all()
    return result, [str(warning.message) for warning in caught]


def spectrum(radar: rt.Radar, body: Ball, rung: str = "analytic") -> Any:
    """Range-Doppler of one window of a sphere."""
    chirps = np.arange(radar.chirps_per_frame)
    # The rung asks a body for its poses, its parts and its duration: this one has them.
    echoes = build_rung(rung, radar, body).echoes(chirps)  # type: ignore[arg-type]
    return rt.process.range_doppler(rt.signal.synthesize(echoes, radar, radar.chirp_times(len(chirps))), radar)


# -- frequency, distance, size, shape -------------------------------------------------------------------------------


@case("1, 12, 77, 300 GHz: a sphere of 0.5 m, both rungs", "near-field closed form, phase and all")
def _() -> str:
    pairs = []
    for frequency in (1e9, 12e9, 77e9, 300e9):
        reference = along_axis(0.5, (0.5, 0.5), 4.0, frequency)
        pairs.append((complex(rt.scattering_length(alone(0.5, 0.5, 0.5), [4.5, 0, 0], [4.5, 0, 0], frequency)[0]), reference))
        far = rt.scattering_length(alone(0.5, 0.5, 0.5), [1e6, 0, 0], [1e6, 0, 0], frequency, "analytic")[0]
        pairs.append((complex(far), along_axis(0.5, (0.5, 0.5), 1e6, frequency)))
    return worst_error(pairs, 1e-5)  # the analytic rung has no near field: 0.5 m in 1000 km


@case("whole chain at 1 and 300 GHz", "finite; 1 GHz warns of radii below a wavelength")
def _() -> str:
    low, said = chain(small_radar(start_frequency_hz=1e9, bandwidth_hz=0.5e9, rx_spacing_wavelengths=0.5))
    assert any("radius of curvature" in message for message in said), said
    high, _ = chain(small_radar(start_frequency_hz=300e9, chirp_duration_s=20e-6))
    return f"{low.summary['detections']} and {high.summary['detections']} detections; 1 GHz: {said[0][:60]}..."


@case("a sphere at 0.1 m, 4 m, 1 km and 10 km", "near-field closed form at each")
def _() -> str:
    return worst_error(
        [
            (
                complex(rt.scattering_length(alone(0.1, 0.1, 0.1), [gap + 0.1, 0, 0], [gap + 0.1, 0, 0], 77e9)[0]),
                along_axis(0.1, (0.1, 0.1), gap, 77e9),
            )
            for gap in (0.1, 4.0, 1e3, 1e4)
        ],
        1e-6,
    )


@case("a person 0.1 m from the radar", "refused: 0.3 m at least")
def _() -> str:
    return refused(lambda: chain(small_radar(position_m=(-0.35, 0.0, 1.0))), r"at least 0\.3 m is allowed")


@case("a person 10 km from the radar", "refused: beyond its range")
def _() -> str:
    return refused(lambda: chain(small_radar(position_m=(-1e4, 0.0, 1.0))), "never within the range")


@case("a person 10 km from a radar that reaches so far", "finite, at the right range")
def _() -> str:
    radar = small_radar(position_m=(-9e3, 0.0, 1.0), bandwidth_hz=2e6, samples_per_chirp=256)
    values = np.abs(spectrum(radar, Ball()).values)
    read = float(np.argmax(values.sum(axis=(1, 2)))) * radar.range_bin_m
    assert np.isfinite(values).all()
    assert abs(read - 9e3) < radar.range_bin_m, read
    return f"{read:.0f} m of 9000 m, bins of {radar.range_bin_m:.0f} m"


@case("ka 0.01 to 10 000: sphere, GO, PO, Mie", "finite; Rayleigh's 9 pi a^2 (ka)^4 at 0.01, GO at 10 000")
def _() -> str:
    k = 2 * np.pi * 12e9 / C
    ka = np.geomspace(0.01, 1e4, 31)
    for method in ("go", "po", "mie"):
        assert np.isfinite(rt.rcs.sphere(ka / k, 12e9, method)).all()  # type: ignore[arg-type]
    small, large = (abs(complex(rt.rcs.sphere(x / k, 12e9, "mie"))) ** 2 / (np.pi * (x / k) ** 2) for x in (0.01, 1e4))
    assert abs(small / (9 * 0.01**4) - 1) < 1e-3, small
    assert abs(large - 1) < 1e-3, large
    return f"Rayleigh to {abs(small / (9 * 0.01**4) - 1):.0e}, GO to {abs(large - 1):.0e}"


@case("specular and analytic below ka = 5", "a warning, and the optical answer")
def _() -> str:
    said = ""
    for rung in RUNGS:
        field, said = warned(
            lambda rung=rung: rt.scattering_length(alone(1e-4, 1e-4, 1e-4), [4.0, 0, 0], [4.0, 0, 0], 1e9, rung),  # type: ignore[misc]
            "radius of curvature",
        )
        assert np.isfinite(field).all()
    return f"warned: {said}"


@case("needles and discs, 1000:1, along each axis, both rungs", "closed form, finite everywhere else")
def _() -> str:
    pairs = []
    rng = np.random.default_rng(0)
    sight = rng.normal(size=(50, 3))
    sight *= 4 / np.linalg.norm(sight, axis=1, keepdims=True)
    for axes in ((1e-3, 1e-3, 1.0), (0.5, 0.5, 5e-4), (1e-3, 0.03, 1.0)):
        for rung in RUNGS:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", rt.ValidityWarning)
                assert np.isfinite(rt.scattering_length(alone(*axes), sight, sight + BESIDE, 77e9, rung)).all()
        for axis in range(3):
            others = [axes[i] ** 2 / axes[axis] for i in range(3) if i != axis]
            antenna = np.zeros(3)
            antenna[axis] = axes[axis] + 4.0
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", rt.ValidityWarning)
                ours = complex(rt.scattering_length(alone(*axes), antenna, antenna, 77e9)[0])
            pairs.append((ours, along_axis(axes[axis], (others[0], others[1]), 4.0, 77e9)))
    return worst_error(pairs, 1e-6)


@case("physical optics and rays: 1 to 300 GHz, ka 5 to 400", "the closed form of physical optics, 0.1 dB")
def _() -> str:
    worst = 0.0
    for frequency in (1e9, 12e9, 77e9, 300e9):
        k = 2 * np.pi * frequency / C
        for ka in (5.01, 50.0):
            far = [1e5 * ka / k, 0.0, 0.0]
            reference = abs(complex(rt.rcs.sphere(ka / k, frequency, "po")))
            for rung in ("physical-optics", "rays"):
                field = rt.scattering_length(alone(*[ka / k] * 3), far, far, frequency, rung)[0]
                worst = max(worst, abs(20 * np.log10(abs(field) / reference)))
    assert worst < 0.1, worst
    return f"within {worst:.2f} dB"


@case("physical optics above ka = 400, without a say on facets", "refused")
def _() -> str:
    return refused(
        lambda: rt.scattering_length(alone(1.0, 1.0, 1.0), [1e3, 0, 0], [1e3, 0, 0], 77e9, "physical-optics"), "facets"
    )


@case("physical optics, rays and fresnel at 0.1 m and 10 km", "finite; at 10 km the closed form, phase and all, 2 %")
def _() -> str:
    for rung in ("physical-optics", "rays", "fresnel"):
        fields = []
        for gap in (0.1, 1e4):
            antenna = [gap + 0.05, 0.0, 0.0]
            fields.append(complex(rt.scattering_length(alone(0.05, 0.05, 0.05), antenna, antenna, 24e9, rung)[0]))
        assert np.isfinite(fields).all(), (rung, fields)
        expected = rt.rcs.sphere(0.05, 24e9, "go" if rung == "fresnel" else "po")
        # 0.02: facets; their phase at 10 km, where float32 would know it to 0.5 rad.
        assert abs(fields[1] / complex(expected) - 1) < 0.02, (rung, fields[1], expected)
    return "finite; phase and all to 2 % at 10 km"


@case("needles and discs, 1000:1, physical optics and rays", "finite, or refused")
def _() -> str:
    sight = np.array([[4.0, 0, 0], [0, 0, 4.0], [2.0, 1.0, 3.0]])
    said = []
    for axes in ((1e-3, 1e-3, 1.0), (0.3, 0.3, 3e-4)):
        for rung in ("fresnel", "physical-optics", "rays"):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", rt.ValidityWarning)
                try:
                    field = rt.scattering_length(alone(*axes), sight, sight + BESIDE, 12e9, rung)
                except rt.InputError as error:
                    said.append(f"{rung} refused: {error}")
                else:
                    assert np.isfinite(field).all(), (rung, axes, field)
    return f"finite; {said[0]}" if said else "finite"


@case("a mesh of 1.3 million triangles, physical optics", "the sphere's closed form, 0.1 dB", slow=True)
def _() -> str:
    import trimesh

    vertices, faces = rt.body.unit_sphere(8)
    mesh = trimesh.Trimesh(0.1 * vertices, faces, process=False)
    reference = complex(rt.rcs.sphere(0.1, 12e9, "po"))
    ratio = complex(rt.scattering_length(mesh, [1e4, 0, 0], [1e4, 0, 0], 12e9, "physical-optics")[0]) / reference
    assert abs(20 * np.log10(abs(ratio))) < 0.1, ratio
    return f"{len(faces)} triangles, {20 * np.log10(abs(ratio)):+.4f} dB"


# -- bodies ---------------------------------------------------------------------------------------------------------


@case("a bone of no length", "refused, by the name of its part")
def _() -> str:
    whole = motion()
    offsets = whole.offsets.copy()
    joint = next(index for index, name in enumerate(whole.joints) if "knee" in name)
    offsets[joint] = 0.0
    return refused(lambda: rt.Body.from_motion(dataclasses.replace(whole, offsets=offsets)), "(thigh|shank).*length")


@case("an ellipsoid of no thickness", "refused")
def _() -> str:
    return refused(lambda: alone(0.1, 0.1, 0.0), "positive")


@case("parts inside parts, every traced rung", "the outer one alone")
def _() -> str:
    outer = alone(0.2, 0.3, 0.4)
    inner = alone(0.05, 0.1, 0.1, centre=(0.05, 0.05, 0.05))
    worst = 0.0
    for rung in TRACED:
        for antenna in ([4.0, 0, 0], [-3.0, 2.0, 1.0], [0, 0, -5.0]):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", rt.ValidityWarning)  # the inner one alone would be small for 3 GHz
                whole, one = (
                    rt.scattering_length(target, antenna, antenna, 3e9, rung)[0] for target in (together(outer, inner), outer)
                )
            worst = max(worst, abs(whole / one - 1))
    assert worst < 1e-12, worst
    return f"the same to {worst:.0e}"


@case("an antenna inside a part, every rung", "refused")
def _() -> str:
    ball = alone(0.2, 0.2, 0.2)
    for rung in ("analytic", *TRACED):
        said = refused(
            lambda rung=rung: rt.scattering_length(ball, [0.1, 0, 0], [4.0, 0, 0], 12e9, rung),  # type: ignore[misc]
            "is inside ellipsoid 0",
        )
    return said


@case("the radar inside the person", "refused")
def _() -> str:
    return refused(lambda: chain(small_radar(position_m=(0.0, 0.0, 1.0))), r"0\.3 m")


@case("Tx at Rx, and a nanometre from it", "the same, and the closed form")
def _() -> str:
    tx = np.array([4.1, 0.0, 0.0])
    there, beside = (rt.scattering_length(alone(0.1, 0.1, 0.1), tx, tx + d * BESIDE, 77e9)[0] for d in (0.0, 1e-8))
    reference = along_axis(0.1, (0.1, 0.1), 4.0, 77e9)
    return worst_error([(complex(there), reference), (complex(beside), reference)], 1e-6)


@case("Tx and Rx on opposite sides of the body, every rung", "nothing comes back: 0")
def _() -> str:
    for rung in ("analytic", *TRACED):
        field = rt.scattering_length(alone(0.1, 0.1, 0.1), [4.0, 0, 0], [-4.0, 0, 0], 12e9, rung)
        assert field[0] == 0, field
    return "0"


@case("nobody there: no ellipsoids, no frames", "refused")
def _() -> str:
    said = refused(lambda: rt.Ellipsoids(np.empty((0, 3)), np.empty((0, 3, 3)), np.empty((0, 3))), "at least 1")
    empty = {"root_positions": motion().root_positions[:0], "rotations": motion().rotations[:0]}
    refused(lambda: dataclasses.replace(motion(), **empty), "shape")
    return said


@case("nobody visible", "a warning; noise relative to 1 m^2 at the origin")
def _() -> str:
    radar = small_radar()

    class Silence:
        variant = None

        def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
            seen = build_rung("analytic", radar, Ball()).echoes(chirps)  # type: ignore[arg-type]
            return dataclasses.replace(seen, amplitude=seen.amplitude * 0)

    found, said = warned(lambda: survey(Silence(), radar, Ball(), 400), "nobody is visible")  # type: ignore[arg-type]
    distance = float(np.linalg.norm(radar.position_m))
    assert not found.visible
    assert abs(found.power * distance**4 - 1) < 1e-12, found.power
    return f"warned: {said}"


@case("radar and person 10 km from the origin of coordinates", "as at the origin, on each of analytic, specular, fresnel")
def _() -> str:
    far = np.array([1e4, -3e3, 50.0])
    body = rt.Body.from_motion(place(motion(), duration_s=0.12))
    moved = rt.Body.from_motion(place(motion(), duration_s=0.12).shifted(far))
    radar = rt.Radar.preset("paper-77ghz")
    there = dataclasses.replace(radar, position_m=tuple((np.asarray(radar.position_m) + far).tolist()))
    chirps = np.arange(0, 4000, 401)
    worst_length = worst_amplitude = 0.0
    for rung in (*RUNGS, "fresnel"):
        here, away = (build_rung(rung, r, b).echoes(chirps) for r, b in ((radar, body), (there, moved)))
        worst_length = max(worst_length, float(np.abs(here.length - away.length).max()))
        largest = float(np.abs(here.amplitude).max())
        worst_amplitude = max(worst_amplitude, float(np.abs(here.amplitude - away.amplitude).max()) / largest)
    # 10 km has rounding of 2e-12 m; a part that is just hidden in one place must be hidden in the other.
    assert worst_length < 1e-10, worst_length
    assert worst_amplitude < 1e-6, worst_amplitude
    return f"lengths within {worst_length:.0e} m, amplitudes within {worst_amplitude:.0e}"


@case("a recording made 10 km from its own origin", "placed before the radar, as one made at the origin")
def _() -> str:
    poses = [rt.Body.from_motion(place(m, duration_s=0.12)).at([0.06]) for m in (motion(), motion().shifted([1e4, -3e3, 0.0]))]
    error = float(np.abs(poses[0].centres - poses[1].centres).max())
    assert error < 1e-10, error
    return f"within {error:.0e} m"


# -- motion ---------------------------------------------------------------------------------------------------------


@case("0 m/s", "all power at Doppler 0 and its window's two neighbours")
def _() -> str:
    power = (np.abs(spectrum(small_radar(), Ball()).values) ** 2).sum(axis=(0, 2))
    middle = len(power) // 2
    beside = 1 - power[middle - 1 : middle + 2].sum() / power.sum()
    assert abs(beside) < 1e-12, beside
    return f"{abs(beside):.0e} of it elsewhere"


@case("100 m/s", "a warning of motion inside a chirp; finite")
def _() -> str:
    body = Ball(speed=100.0)
    found, said = warned(lambda: spectrum(small_radar(chirp_duration_s=500e-6), body, "specular"), "inside one chirp")
    assert np.isfinite(found.values).all()
    return f"warned: {said}"


@case("100 m/s, chirps of 12.5 us", "the known alias, to a bin")
def _() -> str:
    radar = small_radar(chirp_duration_s=12.5e-6, tx_y=1, frame_duration_s=0.01, samples_per_chirp=256)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", rt.ValidityWarning)
        found = spectrum(radar, Ball(speed=100.0, place=(-0.5, 1.0, 1.0)))
    power = (np.abs(found.values) ** 2).sum(axis=(0, 2))
    read = float(np.sum(found.velocity * power) / power.sum())
    expected = (100.0 + radar.max_velocity_mps) % (2 * radar.max_velocity_mps) - radar.max_velocity_mps
    assert abs(read - expected) < radar.velocity_bin_mps, (read, expected)
    return f"{read:.2f} m/s, the alias is {expected:.2f} m/s"


@case("one frame", "its pose at time 0; the chain refuses it")
def _() -> str:
    whole = motion()
    one = dataclasses.replace(
        whole, root_positions=whole.root_positions[:1], rotations=whole.rotations[:1], first_frame_s=0.0, length_s=None
    )
    assert np.isfinite(rt.Body.from_motion(one).at([0.0]).centres).all()
    return refused(lambda: chain(what=one, duration_s=None), "no whole frame")


@case("NaN in the motion", "refused")
def _() -> str:
    roots = motion().root_positions.copy()
    roots[3, 1] = np.nan
    return refused(lambda: dataclasses.replace(motion(), root_positions=roots), "NaN")


@case("rotations that are none", "refused")
def _() -> str:
    return refused(lambda: dataclasses.replace(motion(), rotations=motion().rotations * 0), "unit quaternions")


@case("one time asked for twice, and times out of order", "the same poses")
def _() -> str:
    body = rt.Body.from_motion(motion())
    found, straight = body.at([0.3, 0.1, 0.3]), body.at([0.1, 0.3])
    assert np.array_equal(found.centres, straight.centres[[1, 0, 1]])
    return "the same to the last bit"


BVH = """HIERARCHY
ROOT Hips
{{
  OFFSET 0 0 0
  CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation
  End Site
  {{
    OFFSET 0 10 0
  }}
}}
MOTION
Frames: 2
Frame Time: {time}
0 0 0 0 0 0
0 0 0 0 0 {last}
"""


def bvh(time: str, last: str) -> rt.Motion:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, "m.bvh")
        path.write_text(BVH.format(time=time, last=last))
        return rt.load_motion(path)


@case("a recording whose frames all have one time", "refused")
def _() -> str:
    return refused(lambda: bvh("0", "0"), "[Ff]rame [Tt]ime")


@case("a recording with NaN", "refused, with the line")
def _() -> str:
    return refused(lambda: bvh("0.01", "nan"), r"(?i)line 1\d.*nan|nan.*line 1\d")


# -- radar and processing -------------------------------------------------------------------------------------------


@case("one Tx, one Rx", "finite, without angles")
def _() -> str:
    result, _ = chain(small_radar(tx_y=1, rx_y=1, chirp_duration_s=500e-6), fidelity="specular")
    assert result.summary["detections"] > 0
    assert result.summary["xyz_points"] == 0
    return f"{result.summary['detections']} detections, no point in the room"


@case("one chirp a frame", "finite: one Doppler bin")
def _() -> str:
    radar = small_radar(tx_y=1, chirp_duration_s=20e-3, frame_duration_s=20e-3)
    result, said = chain(radar)
    return f"{result.summary['windows']} windows, {result.summary['detections']} detections" + (f"; {said[0]}" if said else "")


@case("one sample a chirp", "the person is beyond the range of one bin: refused")
def _() -> str:
    return refused(lambda: chain(small_radar(samples_per_chirp=1)), "never within the range")


@case("one sample a chirp, bins of 15 m", "finite: one range bin")
def _() -> str:
    result, said = chain(small_radar(samples_per_chirp=1, bandwidth_hz=10e6))
    return f"{result.summary['windows']} windows, {result.summary['detections']} detections" + (f"; {said[0]}" if said else "")


@case("every rung: one Tx, one Rx, one chirp, one sample, 0 and 100 m/s", "finite echoes and spectrum")
def _() -> str:
    radars = [
        small_radar(tx_y=1, rx_y=1, samples_per_chirp=1, bandwidth_hz=10e6),
        small_radar(tx_y=1, chirp_duration_s=50e-3),
        small_radar(tx_y=2, rx_y=1, chirp_duration_s=1e-3),
    ]
    for rung in ("analytic", *TRACED, "reference"):
        for radar in radars:
            for speed in (0.0, 100.0):
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", rt.ValidityWarning)
                    values = spectrum(radar, Ball(speed=speed, radius=0.1, place=(-2.5, 0.0, 1.0)), rung).values
                assert np.isfinite(values).all(), (rung, radar, speed)
                assert np.abs(values).max() > 0, (rung, radar, speed)
    return "finite, and not empty"


@case("SNR of -60 dB", "finite; noise alone, or a warning that nothing was detected")
def _() -> str:
    result, said = chain(snr_db=-60.0)
    assert result.summary["detections"] < 20, result.summary["detections"]
    return f"{result.summary['detections']} detections" + (f"; {said[-1]}" if said else "")


@case("SNR of infinity", "no noise at all")
def _() -> str:
    result, _ = chain(snr_db=np.inf)
    assert result.summary["noise_power_m2"] == 0
    assert result.summary["detections"] > 0
    return f"{result.summary['detections']} detections"


@case("SNR of NaN or -infinity", "refused")
def _() -> str:
    refused(lambda: chain(snr_db=np.nan), "snr_db")
    return refused(lambda: chain(snr_db=-np.inf), "snr_db")


@case("recording and frames that do not divide", "whole cycles, windows on cycle boundaries")
def _() -> str:
    radar = small_radar(chirp_duration_s=237e-6, frame_duration_s=0.0473, frame_hop_s=0.0131)
    result, _ = chain(radar, duration_s=0.1239)
    cycles = int(0.1239 / (2 * 237e-6))
    starts = radar.window_starts(2 * cycles)
    assert result.summary["chirps"] == 2 * cycles
    assert result.summary["windows"] == len(starts)
    assert starts[-1] + radar.cycles_per_frame <= cycles
    return f"{cycles} cycles, {len(starts)} windows"


# -- as rows --------------------------------------------------------------------------------------------------------


def outcome(one: Case) -> tuple[bool, str]:
    try:
        return True, one.run()
    except AssertionError as wrong:
        return False, f"WRONG: {wrong}"
    except Exception as error:
        return False, f"{type(error).__name__}: {error}"


def measure(quick: bool) -> list[Row]:
    rows = []
    print(f"{'case':62}  {'expected':62}  got")
    for one in CASES:
        if quick and one.slow:
            continue
        good, got = outcome(one)
        print(f"{one.name:62}  {one.expected:62}  {got}", flush=True)
        quantity = one.expected if good else f"{one.expected}; got: {got}"
        says = "extremes: not the right finite answer, nor a refusal, nor a warning (1: so)"
        rows.append(judged(one.name, quantity, "", 0.0 if good else 1.0, 0.0, says=says))
    return rows


if __name__ == "__main__":
    sys.exit(main("Extremes: the right finite answer, a refusal or a warning.", measure))
