"""Extremes of what is seen: frequency, distance, size, shape, and bodies."""

from __future__ import annotations

import dataclasses
import math
import warnings

import numpy as np
from extreme_cases import (
    BESIDE,
    MODELS,
    TRACED,
    C,
    alone,
    along_axis,
    ball,
    chain,
    collector,
    motion,
    refused,
    small_radar,
    spectrum,
    together,
    warned,
    worst_error,
)
from numpy.typing import NDArray

import rtradar as rt
import rtradar.body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.echoes import Echoes
from rtradar.motion import place
from rtradar.scatter import build_model
from rtradar.scatter.link_budget import link_budget

CASES, case = collector()


# -- frequency, distance, size, shape --------------------------------------------------------------


@case("1, 12, 77, 300 GHz: a sphere of 0.5 m, both models", "near-field closed form, phase and all")
def _() -> str:
    pairs = []
    for frequency in (1e9, 12e9, 77e9, 300e9):
        reference = along_axis(0.5, (0.5, 0.5), 4.0, frequency)
        pairs.append(
            (
                complex(
                    rt.scattering_length(alone(0.5, 0.5, 0.5), [4.5, 0, 0], [4.5, 0, 0], frequency)[
                        0
                    ]
                ),
                reference,
            )
        )
        far = rt.scattering_length(
            alone(0.5, 0.5, 0.5), [1e6, 0, 0], [1e6, 0, 0], frequency, "analytic"
        )[0]
        pairs.append((complex(far), along_axis(0.5, (0.5, 0.5), 1e6, frequency)))
    return worst_error(pairs, 1e-5)  # the analytic model has no near field: 0.5 m in 1000 km


@case("whole chain at 1 and 300 GHz", "finite; 1 GHz warns of radii below a wavelength")
def _() -> str:
    low, said = chain(
        small_radar(start_frequency_hz=1e9, bandwidth_hz=0.5e9, rx_spacing_wavelengths=0.5)
    )
    assert any("radius of curvature" in message for message in said), said
    high, _ = chain(small_radar(start_frequency_hz=300e9, chirp_duration_s=20e-6))
    few, many = (found.summary["detections"] for found in (low, high))
    return f"{few} and {many} detections; 1 GHz: {said[0][:60]}..."


@case("a sphere at 0.1 m, 4 m, 1 km and 10 km", "near-field closed form at each")
def _() -> str:
    return worst_error(
        [
            (
                complex(
                    rt.scattering_length(
                        alone(0.1, 0.1, 0.1), [gap + 0.1, 0, 0], [gap + 0.1, 0, 0], 77e9
                    )[0]
                ),
                along_axis(0.1, (0.1, 0.1), gap, 77e9),
            )
            for gap in (0.1, 4.0, 1e3, 1e4)
        ],
        1e-6,
    )


@case("a person 0.1 m from the radar", "refused: 0.3 m at least")
def _() -> str:
    return refused(
        lambda: chain(small_radar(position_m=(-0.35, 0.0, 1.0))), r"at least 0\.3 m is allowed"
    )


@case("a person 10 km from the radar", "refused: beyond its range")
def _() -> str:
    return refused(
        lambda: chain(small_radar(position_m=(-1e4, 0.0, 1.0))), "never within the range"
    )


@case("a person 10 km from a radar that reaches so far", "finite, at the right range")
def _() -> str:
    radar = small_radar(position_m=(-9e3, 0.0, 1.0), bandwidth_hz=2e6, samples_per_chirp=256)
    values = np.abs(spectrum(radar, ball()).values)
    read = float(np.argmax(values.sum(axis=(1, 2)))) * radar.range_bin_m
    assert np.isfinite(values).all()
    assert abs(read - 9e3) < radar.range_bin_m, read
    return f"{read:.0f} m of 9000 m, bins of {radar.range_bin_m:.0f} m"


@case(
    "ka 0.01 to 10 000: sphere, GO, PO, Mie",
    "finite; Rayleigh's 9 pi a^2 (ka)^4 at 0.01, GO at 10 000",
)
def _() -> str:
    k = 2 * np.pi * 12e9 / C
    ka = np.geomspace(0.01, 1e4, 31)
    for method in ("go", "po", "mie"):
        assert np.isfinite(rt.rcs.sphere(ka / k, 12e9, method)).all()
    small, large = (
        abs(complex(rt.rcs.sphere(x / k, 12e9, "mie"))) ** 2 / (np.pi * (x / k) ** 2)
        for x in (0.01, 1e4)
    )
    assert abs(small / (9 * 0.01**4) - 1) < 1e-3, small
    assert abs(large - 1) < 1e-3, large
    return f"Rayleigh to {abs(small / (9 * 0.01**4) - 1):.0e}, GO to {abs(large - 1):.0e}"


@case("specular and analytic below ka = 5", "a warning, and the optical answer")
def _() -> str:
    said = ""
    for fidelity in MODELS:
        field, said = warned(
            lambda fidelity=fidelity: rt.scattering_length(
                alone(1e-4, 1e-4, 1e-4), [4.0, 0, 0], [4.0, 0, 0], 1e9, fidelity
            ),
            "radius of curvature",
        )
        assert np.isfinite(field).all()
    return f"warned: {said}"


@case(
    "needles and discs, 1000:1, along each axis, both models", "closed form, finite everywhere else"
)
def _() -> str:
    pairs = []
    rng = np.random.default_rng(0)
    sight = rng.normal(size=(50, 3))
    sight *= 4 / np.linalg.norm(sight, axis=1, keepdims=True)
    for axes in ((1e-3, 1e-3, 1.0), (0.5, 0.5, 5e-4), (1e-3, 0.03, 1.0)):
        for fidelity in MODELS:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", rt.ValidityWarning)
                assert np.isfinite(
                    rt.scattering_length(alone(*axes), sight, sight + BESIDE, 77e9, fidelity)
                ).all()
        for axis in range(3):
            others = [axes[i] ** 2 / axes[axis] for i in range(3) if i != axis]
            antenna = np.zeros(3)
            antenna[axis] = axes[axis] + 4.0
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", rt.ValidityWarning)
                ours = complex(rt.scattering_length(alone(*axes), antenna, antenna, 77e9)[0])
            pairs.append((ours, along_axis(axes[axis], (others[0], others[1]), 4.0, 77e9)))
    return worst_error(pairs, 1e-6)


@case(
    "physical optics and rays: 1 to 300 GHz, ka 5 to 400",
    "the closed form of physical optics, 0.1 dB",
)
def _() -> str:
    worst = 0.0
    for frequency in (1e9, 12e9, 77e9, 300e9):
        k = 2 * np.pi * frequency / C
        for ka in (5.01, 50.0):
            far = [1e5 * ka / k, 0.0, 0.0]
            reference = abs(complex(rt.rcs.sphere(ka / k, frequency, "po")))
            for fidelity in ("physical-optics", "rays"):
                field = rt.scattering_length(alone(*[ka / k] * 3), far, far, frequency, fidelity)[0]
                worst = max(worst, abs(20 * np.log10(abs(field) / reference)))
    assert worst < 0.1, worst
    return f"within {worst:.2f} dB"


@case("physical optics above ka = 400, without a number of facets", "refused")
def _() -> str:
    return refused(
        lambda: rt.scattering_length(
            alone(1.0, 1.0, 1.0), [1e3, 0, 0], [1e3, 0, 0], 77e9, "physical-optics"
        ),
        "facets",
    )


@case(
    "physical optics, rays and specular at 0.1 m and 10 km",
    "finite; at 10 km the closed form, phase and all, 2 %",
)
def _() -> str:
    for fidelity in ("physical-optics", "rays", "specular"):
        fields = []
        for gap in (0.1, 1e4):
            antenna = [gap + 0.05, 0.0, 0.0]
            fields.append(
                complex(
                    rt.scattering_length(alone(0.05, 0.05, 0.05), antenna, antenna, 24e9, fidelity)[
                        0
                    ]
                )
            )
        assert np.isfinite(fields).all(), (fidelity, fields)
        expected = rt.rcs.sphere(0.05, 24e9, "go" if fidelity == "specular" else "po")
        # 0.02 is the error of facets; float32 would know their phase at 10 km to 0.5 rad only.
        assert abs(fields[1] / complex(expected) - 1) < 0.02, (fidelity, fields[1], expected)
    return "finite; phase and all to 2 % at 10 km"


@case("needles and discs, 1000:1, physical optics and rays", "finite, or refused")
def _() -> str:
    sight = np.array([[4.0, 0, 0], [0, 0, 4.0], [2.0, 1.0, 3.0]])
    said = []
    for axes in ((1e-3, 1e-3, 1.0), (0.3, 0.3, 3e-4)):
        for fidelity in ("specular", "physical-optics", "rays"):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", rt.ValidityWarning)
                try:
                    field = rt.scattering_length(
                        alone(*axes), sight, sight + BESIDE, 12e9, fidelity
                    )
                except rt.InputError as error:
                    said.append(f"{fidelity} refused: {error}")
                else:
                    assert np.isfinite(field).all(), (fidelity, axes, field)
    return f"finite; {said[0]}" if said else "finite"


@case(
    "a mesh of 1.3 million triangles, physical optics",
    "the sphere's closed form, 0.1 dB",
    slow=True,
)
def _() -> str:
    import trimesh

    vertices, faces = rt.body.unit_sphere(8)
    mesh = trimesh.Trimesh(0.1 * vertices, faces, process=False)
    reference = complex(rt.rcs.sphere(0.1, 12e9, "po"))
    ratio = (
        complex(rt.scattering_length(mesh, [1e4, 0, 0], [1e4, 0, 0], 12e9, "physical-optics")[0])
        / reference
    )
    assert abs(20 * np.log10(abs(ratio))) < 0.1, ratio
    return f"{len(faces)} triangles, {20 * np.log10(abs(ratio)):+.4f} dB"


# -- bodies ----------------------------------------------------------------------------------------


@case("a bone of no length", "refused, by the name of its part")
def _() -> str:
    whole = motion()
    offsets = whole.offsets.copy()
    joint = next(index for index, name in enumerate(whole.joints) if "knee" in name)
    offsets[joint] = 0.0
    return refused(
        lambda: rt.Body.from_motion(dataclasses.replace(whole, offsets=offsets)),
        "(thigh|shank).*length",
    )


@case("an ellipsoid of no thickness", "refused")
def _() -> str:
    return refused(lambda: alone(0.1, 0.1, 0.0), "positive")


@case("parts inside parts, every traced model", "the outer one alone")
def _() -> str:
    outer = alone(0.2, 0.3, 0.4)
    inner = alone(0.05, 0.1, 0.1, centre=(0.05, 0.05, 0.05))
    worst = 0.0
    for fidelity in TRACED:
        for antenna in ([4.0, 0, 0], [-3.0, 2.0, 1.0], [0, 0, -5.0]):
            with warnings.catch_warnings():
                warnings.simplefilter(
                    "ignore", rt.ValidityWarning
                )  # the inner one alone would be small for 3 GHz
                whole, one = (
                    rt.scattering_length(target, antenna, antenna, 3e9, fidelity)[0]
                    for target in (together(outer, inner), outer)
                )
            worst = max(worst, abs(whole / one - 1))
    assert worst < 1e-12, worst
    return f"the same to {worst:.0e}"


@case("an antenna inside a part, every model", "refused")
def _() -> str:
    ball = alone(0.2, 0.2, 0.2)
    for fidelity in ("analytic", *TRACED):
        said = refused(
            lambda fidelity=fidelity: rt.scattering_length(
                ball, [0.1, 0, 0], [4.0, 0, 0], 12e9, fidelity
            ),
            "is inside ellipsoid 0",
        )
    return said


@case("the radar inside the person", "refused")
def _() -> str:
    return refused(lambda: chain(small_radar(position_m=(0.0, 0.0, 1.0))), r"0\.3 m")


@case("Tx at Rx, and a nanometre from it", "the same, and the closed form")
def _() -> str:
    tx = np.array([4.1, 0.0, 0.0])
    there, beside = (
        rt.scattering_length(alone(0.1, 0.1, 0.1), tx, tx + d * BESIDE, 77e9)[0]
        for d in (0.0, 1e-8)
    )
    reference = along_axis(0.1, (0.1, 0.1), 4.0, 77e9)
    return worst_error([(complex(there), reference), (complex(beside), reference)], 1e-6)


@case(
    "Tx and Rx on opposite sides of the body, every model",
    "0 of what is reflected; by physical optics the shadow of a disc within 1 %",
)
def _() -> str:
    frequency, far = 12e9, 40.0
    pair = [far, 0, 0], [-far, 0, 0]
    # Kirchhoff's field on the axis behind a disc: as much as it takes away from that of Tx.
    wavenumber = 2 * math.pi * frequency / SPEED_OF_LIGHT_MPS
    phase = wavenumber * 0.1**2 / (2 * far)
    disc = wavenumber * math.sqrt(math.pi) * 0.1**2 * math.sin(phase) / phase
    off = 0.0
    for fidelity in ("analytic", *TRACED):
        field = abs(rt.scattering_length(alone(0.1, 0.1, 0.1), *pair, frequency, fidelity)[0])
        if fidelity in ("physical-optics", "reference"):
            off = max(off, abs(field / disc - 1))
        else:
            assert field == 0, (fidelity, field)
    assert off < 0.01, off
    return f"0; shadow within {100 * off:.2f} %"


@case("nobody there: no ellipsoids, no frames", "refused")
def _() -> str:
    said = refused(
        lambda: rt.Ellipsoids(np.empty((0, 3)), np.empty((0, 3, 3)), np.empty((0, 3))), "at least 1"
    )
    empty = {"root_positions": motion().root_positions[:0], "rotations": motion().rotations[:0]}
    refused(lambda: dataclasses.replace(motion(), **empty), "shape")
    return said


@case("nobody visible", "a warning; noise relative to 1 m^2 at the origin")
def _() -> str:
    radar = small_radar()

    class Silence:
        variant = None

        def echoes(self, chirps: NDArray[np.int64]) -> Echoes:
            seen = build_model("analytic", radar, ball()).echoes(chirps)
            return dataclasses.replace(seen, amplitude=seen.amplitude * 0)

    found, said = warned(lambda: link_budget(Silence(), radar, ball(), 400), "nobody is visible")
    distance = float(np.linalg.norm(radar.position_m))
    assert not found.visible
    assert abs(found.power * distance**4 - 1) < 1e-12, found.power
    return f"warned: {said}"


@case(
    "radar and person 10 km from the origin of coordinates",
    "as at the origin, on each of analytic, specular, sharp and gradual",
)
def _() -> str:
    far = np.array([1e4, -3e3, 50.0])
    body = rt.Body.from_motion(place(motion(), duration_s=0.12))
    moved = rt.Body.from_motion(place(motion(), duration_s=0.12).shifted(far))
    radar = rt.Radar.preset("paper-77ghz")
    there = dataclasses.replace(
        radar, position_m=tuple((np.asarray(radar.position_m) + far).tolist())
    )
    chirps = np.arange(0, 4000, 401)
    worst_length = worst_amplitude = 0.0
    levels = [(fidelity, {}) for fidelity in MODELS] + [("specular", {"visibility": "gradual"})]
    for fidelity, options in levels:
        here, away = (
            build_model(fidelity, r, b, **options).echoes(chirps)
            for r, b in ((radar, body), (there, moved))
        )
        worst_length = max(worst_length, float(np.abs(here.length - away.length).max()))
        largest = float(np.abs(here.amplitude).max())
        worst_amplitude = max(
            worst_amplitude, float(np.abs(here.amplitude - away.amplitude).max()) / largest
        )
    # Rounding at 10 km is 2e-12 m; a part that is just occluded in one place is so in the other.
    assert worst_length < 1e-10, worst_length
    assert worst_amplitude < 1e-6, worst_amplitude
    return f"lengths within {worst_length:.0e} m, amplitudes within {worst_amplitude:.0e}"


@case(
    "a recording made 10 km from its own origin",
    "placed before the radar, as one made at the origin",
)
def _() -> str:
    poses = [
        rt.Body.from_motion(place(m, duration_s=0.12)).at([0.06])
        for m in (motion(), motion().shifted([1e4, -3e3, 0.0]))
    ]
    error = float(np.abs(poses[0].centres - poses[1].centres).max())
    assert error < 1e-10, error
    return f"within {error:.0e} m"
