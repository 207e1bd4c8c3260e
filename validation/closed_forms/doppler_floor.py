"""Doppler floor of smooth motion: the power outside the true Doppler of one ellipsoid, every model.

A sphere flies past and an ellipsoid rotates, both analytically, through the model, IF samples,
range spectra and slow-time spectra, all in complex128 with Chebyshev windows of 160 dB. Whatever
is not smooth from chirp to chirp, such as a facet that flips or an inexact specular point, would
raise the floor. Outside the true Doppler of the motion and the main lobe of the window around it,
the floor must stay below -80 dB of the strongest cell, in every channel.

The true Doppler comes from the shortest path over the surface, which is found here by a general
minimiser at a few instants.

Physical optics of a rotating body has a wave of its own from the terminator, at -60 to -65 dB,
which is no fault of its sampling. There the median outside must stay below -80 dB, and the highest
cell within 3 dB of that of `reference`. These models are tested with one Tx that transmits once in
each TDM cycle, because `reference` evaluates every facet at every chirp.

    python validation/closed_forms/doppler_floor.py [--quick] [--json FILE]
"""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

import rtradar as rt
from rtradar.body.body import Poses
from rtradar.scatter import MODELS, build_model
from rtradar.validate.rows import Row, judged, main, reported

Array = NDArray[np.float64]
ATTENUATION_DB = 160.0
FACETED = tuple(
    fidelity for fidelity in ("reference", "physical-optics", "rays") if fidelity in MODELS
)
OPTICAL = tuple(fidelity for fidelity in ("analytic", "specular") if fidelity in MODELS)
OVER_REFERENCE_DB = 3.0


class Moving(Protocol):
    """All that a model asks of a body."""

    part_names: tuple[str, ...]
    duration_s: float

    @property
    def semi_axes(self) -> Array: ...

    def at(self, times: Array) -> Poses: ...


@dataclass(frozen=True)
class FlyingSphere:
    """A sphere in straight flight at constant velocity."""

    velocity: tuple[float, float, float]
    radius: float = 0.1
    part_names: tuple[str, ...] = ("sphere",)
    duration_s: float = 1.0

    @property
    def semi_axes(self) -> Array:
        return np.full((1, 3), self.radius)

    def at(self, times: Array) -> Poses:
        times = np.asarray(times)
        centres = (times[:, None] - 0.05) * np.array(self.velocity) + [0.0, 0.3, 1.2]
        return Poses(
            centres[:, None], np.broadcast_to(np.eye(3), (len(times), 1, 3, 3)), self.semi_axes
        )


@dataclass(frozen=True)
class TurningEllipsoid:
    """An ellipsoid that rotates about an axis through one end, as a limb does about its joint."""

    rate: float  # [rad/s]
    axes: tuple[float, float, float]
    start: float = 0.3  # angle at the beginning [rad]
    part_names: tuple[str, ...] = ("limb",)
    duration_s: float = 1.0

    @property
    def semi_axes(self) -> Array:
        return np.array([self.axes])

    def at(self, times: Array) -> Poses:
        # The axis is tilted, so that nothing is symmetric about the array.
        turn = Rotation.from_rotvec(
            np.outer(self.start + self.rate * np.asarray(times), [0.1, 0.97, 0.2])
        )
        frames = turn.as_matrix()
        centres = np.array([0.0, 0.2, 1.1]) + frames[:, :, 2] * self.axes[2]
        return Poses(centres[:, None], frames[:, None], self.semi_axes)


MOTIONS: dict[str, Moving] = {
    "sphere flying off at 2 m/s": FlyingSphere((2.0, 0.3, 0.1)),
    "sphere coming at 1 m/s": FlyingSphere((-1.0, 0.0, 0.4)),
    "limb turning at 5 rad/s": TurningEllipsoid(5.0, (0.05, 0.05, 0.16)),
    "tri-axial body at -4 rad/s": TurningEllipsoid(-4.0, (0.05, 0.09, 0.2), start=0.9),
}


def shortest(tx: Array, rx: Array, centre: Array, frame: Array, axes: Array) -> float:
    """Shortest path Tx-surface-Rx [m], minimised over two angles about the side that faces them."""
    local_t, local_r = (tx - centre) @ frame, (rx - centre) @ frame
    pole = axes * (local_t / np.linalg.norm(local_t) + local_r / np.linalg.norm(local_r))
    pole /= np.linalg.norm(pole)
    east = np.cross(pole, np.eye(3)[np.argmin(np.abs(pole))])
    east /= np.linalg.norm(east)
    north = np.cross(pole, east)

    def length(step: Array) -> float:
        place = pole + step[0] * east + step[1] * north
        point = place / np.linalg.norm(place) * axes
        return float(np.linalg.norm(local_t - point) + np.linalg.norm(local_r - point))

    return float(
        minimize(
            length, np.zeros(2), method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-13}
        ).fun
    )


def true_velocities(radar: rt.Radar, body: Moving, tx: int, rx: Array) -> tuple[float, float]:
    """Least and largest range rate over the frame for one channel [m/s]."""
    times = np.linspace(0, radar.cycles_per_frame * radar.cycle_duration_s, 41)
    poses = body.at(times)
    lengths = np.array(
        [
            shortest(radar.tx[tx], rx, c[0], f[0], poses.semi_axes[0])
            for c, f in zip(poses.centres, poses.frames, strict=True)
        ]
    )
    rates = np.gradient(lengths, times, edge_order=2) / 2
    return float(rates.min()), float(rates.max())


def main_lobe_bins(n: int) -> float:
    """Half the width of the Chebyshev window's main lobe, down to its side lobes [bins].

    T_(n-1)(x0 cos(w/2)) = 1 at x0 cos(w/2) = 1, x0 = cosh(arccosh(10^(A/20)) / (n-1));
    Harris, 1978.
    """
    x0 = np.cosh(np.arccosh(10 ** (ATTENUATION_DB / 20)) / (n - 1))
    return float(2 * np.arccos(1 / x0) * n / (2 * np.pi))


@dataclass(frozen=True)
class Floor:
    """Power outside the true Doppler over that of the strongest cell, worst channel [dB]."""

    highest: float
    farther: float  # highest twice as far outside
    median: float


def floor_of(
    radar: rt.Radar, body: Moving, fidelity: str, bands: dict[tuple[int, int], tuple[float, float]]
) -> Floor:
    n = radar.cycles_per_frame
    chebyshev = rt.process.WindowFunctions(*2 * [("chebwin", ATTENUATION_DB)])
    lobe = main_lobe_bins(n) * radar.velocity_bin_mps
    chirps = np.arange(radar.chirps_per_frame)
    echoes = build_model(fidelity, radar, body).echoes(chirps)
    x = rt.signal.synthesize(echoes, radar, radar.chirp_times(len(chirps)))
    spectrum = rt.process.range_doppler(x, radar, window_functions=chebyshev)
    found = []
    for (tx, rx), (least, most) in bands.items():
        power = np.abs(spectrum.values[:, :, tx * radar.n_rx + rx]) ** 2
        outside, farther = (
            power[
                :,
                beyond(
                    spectrum.velocity,
                    least - wide * lobe,
                    most + wide * lobe,
                    2 * radar.max_velocity_mps,
                ),
            ]
            for wide in (1, 2)
        )
        # Doppler cells at their strongest range; a median over all ranges would be of empty ones.
        found.append([outside.max(), farther.max(), np.median(outside.max(axis=0))] / power.max())
    return Floor(*(10 * np.log10(np.max(found, axis=0))).tolist())


def bands_of(
    radar: rt.Radar, body: Moving, channels: list[tuple[int, int]]
) -> dict[tuple[int, int], tuple[float, float]]:
    receivers = radar.rx[radar.rx_of_tx]
    return {(tx, rx): true_velocities(radar, body, tx, receivers[tx, rx]) for tx, rx in channels}


def optical_rows(
    radar: rt.Radar, name: str, body: Moving, channels: list[tuple[int, int]]
) -> Iterator[Row]:
    bands = bands_of(radar, body, channels)
    claim = f"{radar.name}, {name}"
    # The Doppler of a rotating body differs in the paper's model, which has the centre's range.
    for fidelity in (*OPTICAL, *(("analytic-paper",) if isinstance(body, FlyingSphere) else ())):
        floor = floor_of(radar, body, fidelity, bands)
        # -80 dB was asked for; -160 dB is what the windows leave. An echo that crosses range bins
        # has a wider lobe than the window, because each bin sees it come and go. That enters the
        # first figure, and it is gone in the second.
        quantity = f"{fidelity}: highest cell outside, worst of {len(bands)} channels"
        motion = "sphere in flight" if isinstance(body, FlyingSphere) else "turning ellipsoid"
        says = f"Doppler floor of `{fidelity}`: {motion}, highest cell"
        yield judged(
            claim, quantity, "dB", floor.highest, -80.0, key="doppler", says=says, cases=len(bands)
        )
        yield reported(
            claim,
            f"{fidelity}: highest cell twice as far outside",
            "dB",
            floor.farther,
            key="doppler",
        )
    widths = [(most - least) / radar.velocity_bin_mps for least, most in bands.values()]
    yield reported(claim, "width of the true Doppler", "bins", max(widths), key="doppler")


def faceted_rows(radar: rt.Radar, name: str, body: Moving) -> Iterator[Row]:
    bands = bands_of(radar, body, [(0, 0), (0, 1)])
    claim = f"{radar.name}, {name}"
    highest = {}
    for fidelity in FACETED:
        floor = floor_of(radar, body, fidelity, bands)
        highest[fidelity] = floor.highest
        if isinstance(body, FlyingSphere):
            says = f"Doppler floor of `{fidelity}`: sphere in flight, highest cell"
            yield judged(
                claim,
                f"{fidelity}: highest cell outside",
                "dB",
                floor.highest,
                -80.0,
                key="doppler",
                says=says,
            )
        else:
            says = f"Doppler floor of `{fidelity}`: turning ellipsoid, median"
            yield judged(
                claim,
                f"{fidelity}: median of the cells outside",
                "dB",
                floor.median,
                -80.0,
                key="doppler",
                says=says,
            )
            yield reported(
                claim, f"{fidelity}: highest cell outside", "dB", floor.highest, key="doppler"
            )
            if fidelity != "reference":
                over = floor.highest - highest["reference"]
                quantity = f"{fidelity}: highest cell outside, over reference"
                says = (
                    f"Doppler floor of `{fidelity}`: turning ellipsoid, "
                    "highest cell over that of `reference`"
                )
                yield judged(
                    claim, quantity, "dB", over, OVER_REFERENCE_DB, key="doppler", says=says
                )


def beyond(velocity: Array, least: float, most: float, ambiguity: float) -> NDArray[np.bool_]:
    """Cells outside the interval [least, most], which may wrap around the ends of the axis."""
    away = (velocity - (least + most) / 2 + ambiguity / 2) % ambiguity - ambiguity / 2
    return np.abs(away) > (most - least) / 2


def measure(quick: bool) -> list[Row]:
    rows: list[Row] = []
    for preset in ("paper-12ghz",) if quick else ("paper-12ghz", "paper-77ghz"):
        # All Tx, and of the Rx of each line the two at its ends.
        whole = rt.Radar.preset(preset)
        ends = (whole.rx_y - 1) * whole.rx_spacing_wavelengths
        radar = dataclasses.replace(whole, rx_y=2, rx_z=2, rx_spacing_wavelengths=ends)
        one = dataclasses.replace(
            radar, tx_y=1, tx_z=0, rx_z=0, chirp_duration_s=whole.cycle_duration_s
        )
        channels = [(tx, rx) for tx in ((0, 11) if quick else (0, 5, 6, 11)) for rx in (0, 1)]
        for index, (name, body) in enumerate(MOTIONS.items()):
            rows += optical_rows(radar, name, body, channels)
            if not quick or index % 2 == 0:
                rows += faceted_rows(one, name, body)
    return rows


if __name__ == "__main__":
    sys.exit(main("Doppler floor of smooth motion on every model.", measure))
