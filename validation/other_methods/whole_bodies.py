"""Whole body: what every model receives against `reference`, four activities at 12 and 77 GHz.

The received spectrum H(f, t) is compared for the corner channels, the first and last Tx with the
first and last Rx of the y-line, at the first, middle and last frequency of the sweep, in every
fourth TDM cycle of one frame of 100 ms: rms |H - Href| over rms |Href|, and the power of that
frame. The frames are those in which limbs are fast and occlude each other; the occluded fraction is
reported. Physical optics is judged on the walk: 2 % at 12 GHz, 4 % at 77 GHz. A model with a
tolerance of frame power is judged by it. The others omit effects by design, and are reported.
`reference` itself is compared with itself with four times the facets.

    python validation/other_methods/whole_bodies.py [--quick] [--json FILE]
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.body import Body
from rtradar.conventions import SPEED_OF_LIGHT_MPS
from rtradar.motion import place
from rtradar.scatter import MODELS, EchoModel, build_model
from rtradar.validate import rows
from rtradar.validate.rows import Row, main

judged, reported = (partial(kind, key="body") for kind in (rows.judged, rows.reported))
PRESETS = ("paper-12ghz", "paper-77ghz")
# Activity and start of the frame [s], in which limbs are fast and occlude each other.
FRAMES = {"walk": 0.75, "kick": 0.45, "punch": 0.35, "jumping_jack": 0.4}
EVERY_CYCLES = 4
# Limits asked for of physical optics on a walking body.
MOST_ERROR = {("paper-12ghz", "walk"): 0.02, ("paper-77ghz", "walk"): 0.04}
# Tolerance of this model where none is given.
MOST_DECIBELS = {"auto": 0.5}
# These models evaluate each receiver on its own, so those between the ends of a line are left out.
BY_RECEIVER = ("reference", "rays")


@dataclass(frozen=True)
class Scene:
    """One activity before one radar, and the chirps that are compared."""

    preset: str
    activity: str
    every: int = EVERY_CYCLES

    @cached_property
    def radar(self) -> rt.Radar:
        return rt.Radar.preset(self.preset)

    @cached_property
    def body(self) -> Body:
        return Body.from_motion(place(rt.synthetic_motion(self.activity, seed=0, duration_s=1.2)))

    @cached_property
    def first_chirp(self) -> int:
        return round(FRAMES[self.activity] / self.radar.cycle_duration_s) * self.radar.n_tx

    @cached_property
    def chirps(self) -> NDArray[np.int64]:
        """Chirps of the first and last Tx of the y-line."""
        cycles = np.arange(0, self.radar.cycles_per_frame, self.every)
        return np.asarray(
            (
                self.first_chirp
                + cycles[:, None] * self.radar.n_tx
                + np.array([0, self.radar.tx_y - 1])
            ).ravel()
        )

    @cached_property
    def corner_radar(self) -> rt.Radar:
        """The radar with the receivers at the ends of each line only."""
        ends = (self.radar.rx_y - 1) * self.radar.rx_spacing_wavelengths
        return dataclasses.replace(self.radar, rx_y=2, rx_z=2, rx_spacing_wavelengths=ends)

    def spectrum(self, fidelity: str, **options: Any) -> NDArray[np.complex128]:
        """Received spectrum of a model (frequency, chirp, rx)."""
        radar = self.corner_radar if fidelity in BY_RECEIVER else self.radar
        return spectrum(build_model(fidelity, radar, self.body, **options), radar, self.chirps)

    @cached_property
    def reference(self) -> NDArray[np.complex128]:
        return self.spectrum("reference")

    def compared(self, found: NDArray[np.complex128]) -> tuple[float, float]:
        """Complex error, rms over rms, and power over that of the reference [dB]."""
        power = float((np.abs(self.reference) ** 2).mean())
        error = float(np.sqrt((np.abs(found - self.reference) ** 2).mean() / power))
        return error, float(10 * np.log10((np.abs(found) ** 2).mean() / power))


def spectrum(
    model: EchoModel, radar: rt.Radar, chirps: NDArray[np.int64]
) -> NDArray[np.complex128]:
    """Received spectrum (frequency, chirp, rx) at the first and last receiver of each line."""
    echoes = model.echoes(chirps)
    frequencies = radar.start_frequency_hz + radar.bandwidth_hz * np.array([0.0, 0.5, 1.0])
    nodes = echoes.frequency
    # The polynomial through the nodes, as the contract of `Echoes` says.
    weights = np.ones((len(frequencies), len(nodes)))
    for n, node in enumerate(nodes):
        for other in np.delete(nodes, n):
            weights[:, n] *= (frequencies - other) / (node - other)
    ends = [0, echoes.length.shape[1] - 1]
    amplitude = np.einsum("fn,ncre->fcre", weights, np.conj(echoes.amplitude[:, :, ends]))
    phase = (
        -2j * np.pi * frequencies[:, None, None, None] * echoes.length[:, ends] / SPEED_OF_LIGHT_MPS
    )
    return np.asarray((amplitude * np.exp(phase)).sum(axis=-1))


def scene_rows(scene: Scene) -> Iterator[Row]:
    case = f"{scene.preset}, {scene.activity}"
    hidden = build_model("specular", scene.radar, scene.body).echoes(scene.chirps).amplitude == 0
    yield reported(
        case,
        "fraction of part, time and channel whose specular point is occluded",
        "",
        float(hidden.mean()),
    )
    for fidelity in MODELS:
        if fidelity == "reference":
            continue
        found = scene.spectrum(fidelity)
        error, decibels = scene.compared(found)
        limit = (
            MOST_ERROR.get((scene.preset, scene.activity))
            if fidelity == "physical-optics"
            else None
        )
        claim, quantity = f"{case}, {fidelity}", "complex error of H(f, t), rms over rms"
        if limit is None:
            yield reported(claim, quantity, "", error)
        else:
            says = (
                f"a walking body by `{fidelity}` against `reference`, {scene.preset[6:8]} GHz, "
                "with occlusion: complex error"
            )
            yield judged(claim, quantity, "", error, limit, says=says, cases=found.size)
        if fidelity in MOST_DECIBELS:
            most, says = (
                MOST_DECIBELS[fidelity],
                f"frame power by `{fidelity}` against `reference`, four activities",
            )
            yield judged(claim, "frame power", "dB", decibels, most, reference=0.0, says=says)
        else:
            yield reported(claim, "frame power", "dB", decibels)


def finer_rows(scene: Scene) -> Iterator[Row]:
    """Error of the reference's facets: 5120 a part at 12 GHz against the next finer icosphere."""
    error, decibels = scene.compared(scene.spectrum("reference", facets=4 * 5120))
    claim = f"{scene.preset}, {scene.activity}, reference with four times the facets"
    yield reported(claim, "complex error of H(f, t), rms over rms", "", error)
    yield reported(claim, "frame power", "dB", decibels)


def measure(quick: bool) -> list[Row]:
    if quick:
        return list(scene_rows(Scene("paper-12ghz", "walk", 4 * EVERY_CYCLES)))
    found: list[Row] = []
    for preset in PRESETS:
        for activity in FRAMES:
            scene = Scene(preset, activity)
            found += scene_rows(scene)
            if (preset, activity) == ("paper-12ghz", "walk"):
                found += finer_rows(scene)
    return found


if __name__ == "__main__":
    sys.exit(main("Whole body: every model against `reference`.", measure))
