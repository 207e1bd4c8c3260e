"""Extreme cases and what they share: small radars and bodies, closed forms, refusals, warnings."""

from __future__ import annotations

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

import rtradar as rt
import rtradar.body
from rtradar.scatter import build_model

sys.path.append(str(Path(__file__).resolve().parents[1]))

from helpers import MovingEllipsoid

Array = NDArray[np.float64]
C = 299_792_458.0
MODELS = ("analytic", "specular")
TRACED = ("specular", "physical-optics", "rays")
BESIDE = np.array([0.0, 0.1, 0.0])


class Case(NamedTuple):
    """One extreme; ``run`` returns what it found, and raises AssertionError where that is wrong."""

    name: str
    expected: str
    run: Callable[[], str]
    slow: bool = False


def collector() -> tuple[list[Case], Callable[..., Any]]:
    """A list of cases, and the decorator that adds a function with its name and expectation."""
    cases: list[Case] = []

    def case(
        name: str, expected: str, *, slow: bool = False
    ) -> Callable[[Callable[[], str]], Callable[[], str]]:
        def add(run: Callable[[], str]) -> Callable[[], str]:
            cases.append(Case(name, expected, run, slow))
            return run

        return add

    return cases, case


def refused(work: Callable[[], object], words: str) -> str:
    """Message of the refusal, which must be one line that matches ``words``."""
    try:
        found = work()
    except rt.InputError as error:
        message = str(error)
        assert "\n" not in message, message
        assert re.search(words, message), message
        return f"refused: {message}"
    raise AssertionError(f"not refused, but {found!r}"[:200])


def warned(work: Callable[[], Any], words: str) -> tuple[Any, str]:
    """Result of a call, and its warning that matches ``words``."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = work()
    said = [str(warning.message) for warning in caught if re.search(words, str(warning.message))]
    assert said, f"no warning with '{words}', but {[str(w.message) for w in caught]}"
    return found, said[0]


def alone(*axes: float, centre: object = (0.0, 0.0, 0.0), frame: object = None) -> rt.Ellipsoids:
    return rt.Ellipsoids([centre], [np.eye(3) if frame is None else frame], [axes])


def together(*targets: rt.Ellipsoids) -> rt.Ellipsoids:
    return rt.Ellipsoids(
        *(
            np.concatenate([getattr(t, name) for t in targets])
            for name in ("centres", "frames", "semi_axes")
        )
    )


def along_axis(
    half_length: float, radii: tuple[float, float], gap: float, frequency: float
) -> complex:
    """F [m] along a symmetry axis from ``gap`` before a surface of principal radii ``radii``."""
    distance = half_length + gap
    size = (distance / gap) ** 2 * np.sqrt(
        np.pi / ((1 / radii[0] + 1 / gap) * (1 / radii[1] + 1 / gap))
    )
    return complex(size * np.exp(2j * 2 * np.pi * frequency / C * half_length))


def worst_error(pairs: list[tuple[complex, complex]], limit: float) -> str:
    errors = [abs(ours / reference - 1) for ours, reference in pairs]
    assert np.isfinite(errors).all(), errors
    assert max(errors) < limit, errors
    return f"right to {max(errors):.1e}"


def ball(
    speed: float = 0.0, radius: float = 0.2, place: tuple[float, float, float] = (0.0, 0.0, 1.0)
) -> MovingEllipsoid:
    """A sphere that flies along x."""
    return MovingEllipsoid(place, (radius,) * 3, (speed, 0.0, 0.0), duration_s=0.2)


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


def chain(
    radar: rt.Radar | None = None, what: rt.Motion | None = None, **options: Any
) -> tuple[rt.Result, list[str]]:
    """A whole run and its warnings; all numbers of its summary are finite, or writing it fails."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        values: dict[str, Any] = {"fidelity": "analytic", "duration_s": 0.12}
        result = rt.run(
            what or motion(), radar or small_radar(), out=Path(folder, "out"), **(values | options)
        )
    assert np.isfinite(result.points).all()
    assert np.isfinite(result.link_budget.power_at).all()
    return result, [str(warning.message) for warning in caught]


def spectrum(radar: rt.Radar, body: MovingEllipsoid, fidelity: str = "analytic") -> Any:
    """Range-Doppler spectrum of one frame of a sphere."""
    chirps = np.arange(radar.chirps_per_frame)
    # A model needs the poses, the parts and the duration of a body, which this one has.
    echoes = build_model(fidelity, radar, body).echoes(chirps)
    return rt.process.range_doppler(
        rt.signal.synthesize(echoes, radar, radar.chirp_times(len(chirps))), radar
    )
