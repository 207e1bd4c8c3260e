"""TDM, FDM and DDM: the unambiguous velocity of each, and a foot that is too fast for one of them.

limits   the unambiguous velocity of the paper's 12 GHz radar with each, against lambda / (4 T) as
         computed here, where T is the time until the same Tx transmits again; and the bandwidth
         that FDM costs
point    a point that recedes at 11 m/s: the position of the map's maximum
walk     the same walk with all three, frame by frame: the mean velocity of all echoes in the map,
         from the phase of its power so that it can wrap around the axis, and the fraction of power
         beyond 7 m/s, a velocity that a walk does not have
kick     the foot of the synthetic kick, replayed 1.7 times as fast, as trained people kick, at its
         fastest: its mean velocity in the map, alone, against the range rate of the point of its
         surface that is nearest to the radar, computed here from the poses; with TDM it must be
         the folded velocity

Frames last 25 ms, in which a foot changes its speed little. The noise is 20 dB below the person's
echoes in the IF samples.
"""

from __future__ import annotations

import dataclasses
import math
import sys
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import rtradar as rt
from rtradar.motion import place
from rtradar.process import power_map, range_spectrum
from rtradar.scatter import build_model
from rtradar.signal import Noise, receive, separate, synthesize
from rtradar.validate.rows import Row, judged, main, reported

KINDS = ("tdm", "fdm", "ddm")
LIGHT = 299_792_458.0
WAVELENGTH = LIGHT / 14e9
CHIRP_S, TX, FRAME_S = 62.5e-6, 12, 0.025
FASTER = 1.7
NAMES = {"tdm": "TDM", "fdm": "FDM", "ddm": "Doppler division, 16 bands"}


@lru_cache
def radar(kind: str) -> rt.Radar:
    """The paper's 12 GHz radar, with short frames."""
    return rt.Radar(
        name=f"12 GHz {kind}",
        frame_duration_s=FRAME_S,
        multiplexing=kind,
        channels="all" if kind == "ddm" else "pairs",
    )


def limit_rows() -> Iterator[Row]:
    for kind in KINDS:
        repetition = CHIRP_S * (TX if kind == "tdm" else 1)
        own = radar(kind).max_velocity_mps
        says = (
            "the unambiguous velocity under TDM, FDM and Doppler division, against lambda / (4 T)"
        )
        limit = WAVELENGTH / (4 * repetition)
        yield judged(
            "limits",
            f"velocity, {NAMES[kind]}",
            "m/s",
            own,
            1e-9,
            reference=limit,
            says=says,
            cases=3,
        )
    fdm = radar("fdm")
    rate = 256 / CHIRP_S
    yield judged(
        "limits",
        "FDM: bandwidth beyond the sweep",
        "MHz",
        (fdm.occupied_bandwidth_hz - 4e9) / 1e6,
        1e-6,
        reference=11 * rate / 1e6,
    )
    yield judged(
        "limits",
        "FDM: rate of a receiver",
        "MHz",
        fdm.receiver_rate_hz / 1e6,
        1e-6,
        reference=12 * rate / 1e6,
    )


def point_rows() -> Iterator[Row]:
    true = 11.0
    for kind in KINDS:
        made = radar(kind)
        chirps = np.arange(made.chirps_per_frame)
        times = (chirps if kind == "tdm" else chirps // TX) * CHIRP_S + CHIRP_S / 2
        target = np.array([0.5, 0.3, 1.2]) - np.array(made.position_m)
        away = target / np.linalg.norm(target)
        at = target + np.asarray(made.position_m) + (times - times.mean())[:, None] * true * away
        tx = chirps % TX
        length = np.linalg.norm(at - made.tx[tx], axis=1)[:, None] + np.linalg.norm(
            at[:, None] - made.rx[made.rx_of_tx[tx]], axis=2
        )
        one = np.zeros(1, np.int64)
        amplitude = np.ones((1, *length.shape, 1), dtype=np.complex128)
        echoes = rt.Echoes(
            length=length[..., None],
            amplitude=amplitude,
            frequency=[14e9],
            tx=tx,
            part=one,
            bounces=one + 1,
        )
        power = maps(echoes, made, 0.0)
        found = made.velocity_mps(power.shape[1])[int(power.max(axis=0).argmax())]
        expected = folded(true) if kind == "tdm" else true
        says = (
            "a point at 11 m/s in the map: "
            "folded under TDM, where it is under FDM and Doppler division"
        )
        yield judged(
            "point",
            NAMES[kind],
            "m/s",
            found,
            made.velocity_bin_mps,
            reference=expected,
            says=says,
            cases=3,
        )


def folded(velocity: float) -> float:
    """Velocity at which TDM shows an echo [m/s]."""
    whole = WAVELENGTH / (2 * CHIRP_S * TX)
    return (velocity + whole / 2) % whole - whole / 2


def maps(echoes: rt.Echoes, made: rt.Radar, noise_m2: float) -> NDArray[np.floating]:
    """Power (range, velocity) of one frame."""
    rows = synthesize(echoes, made, made.chirp_times(len(echoes.tx)), dtype=np.complex64)
    received = receive(rows, made, 0)
    Noise(noise_m2, 0).add(received, made, 0)
    spectra = range_spectrum(separate(received, made, 0), made)
    return power_map(spectra.reshape(-1, TX, *spectra.shape[1:]), made)


def of_parts(echoes: rt.Echoes, parts: list[int]) -> rt.Echoes:
    chosen = np.isin(echoes.part, parts)
    return rt.Echoes(
        length=echoes.length[..., chosen],
        amplitude=echoes.amplitude[..., chosen],
        frequency=echoes.frequency,
        tx=echoes.tx,
        part=echoes.part[chosen],
        bounces=echoes.bounces[chosen],
    )


@lru_cache
def body_of(activity: str) -> rt.Body:
    motion = rt.synthetic_motion(activity, seed=0, duration_s=3.0)
    if activity == "kick":
        assert motion.length_s is not None
        times = {
            "first_frame_s": motion.first_frame_s / FASTER,
            "length_s": motion.length_s / FASTER,
        }
        motion = dataclasses.replace(motion, rate_hz=FASTER * motion.rate_hz, **times)
    return rt.Body.from_motion(place(motion))


def window(activity: str, kind: str, middle_s: float) -> rt.Echoes:
    """Echoes of the frame whose middle is at a time [s]."""
    made = radar(kind)
    cycle = round(
        (middle_s - made.cycles_per_frame * made.cycle_duration_s / 2) / made.cycle_duration_s
    )
    return build_model("analytic", made, body_of(activity)).echoes(
        cycle * TX + np.arange(made.chirps_per_frame)
    )


def mean_velocity(power: NDArray[np.floating], made: rt.Radar) -> float:
    """Mean velocity of the power in a map, around the axis [m/s]."""
    turns = made.velocity_mps(power.shape[1]) / (2 * made.max_velocity_mps)
    total = (power.sum(axis=0) * np.exp(2j * np.pi * turns)).sum()
    return float(np.angle(total) / np.pi * made.max_velocity_mps)


def noise_of(echoes: rt.Echoes) -> float:
    """Noise power 20 dB below all echoes together [m^2]."""
    return float((np.abs(echoes.amplitude[0]) ** 2).sum(axis=-1).mean()) / 100


def walk_rows(quick: bool) -> Iterator[Row]:
    times = np.linspace(0.4, 2.6, 4 if quick else 12)
    found: dict[str, list[float]] = {kind: [] for kind in KINDS}
    beyond: dict[str, list[float]] = {kind: [] for kind in KINDS}
    for time in times:
        for kind in KINDS:
            echoes, made = window("walk", kind, float(time)), radar(kind)
            power = maps(echoes, made, noise_of(echoes))
            floor = np.median(power)
            above = np.where(power > 10 * floor, power, 0)
            found[kind].append(mean_velocity(above, made))
            fast = np.abs(made.velocity_mps(power.shape[1])) > 7.0
            beyond[kind].append(float(above[:, fast].sum() / above.sum()))
    for kind in KINDS[1:]:
        error = float(np.abs(np.subtract(found[kind], found["tdm"])).max())
        says = (
            "mean velocity in the maps of a walk: FDM and Doppler division against TDM, worst frame"
        )
        yield judged(
            "walk",
            f"{NAMES[kind]} less TDM",
            "m/s",
            error,
            radar("tdm").velocity_bin_mps,
            says=says,
            cases=2 * len(times),
        )
        says = (
            "power beyond 7 m/s in the maps of a walk that reaches 5 m/s: "
            "FDM and Doppler division, worst frame"
        )
        yield judged(
            "walk",
            f"beyond 7 m/s, {NAMES[kind]}",
            "share",
            max(beyond[kind]),
            0.01,
            says=says,
            cases=2 * len(times),
        )


def foot_rate(body: rt.Body, part: int, times: NDArray[np.float64]) -> NDArray[np.float64]:
    """Range rate of the foot's surface point that faces the radar [m/s], by differences of 1 ms."""

    def distance(at: NDArray[np.float64]) -> NDArray[np.float64]:
        centres, frames, axes = body.at(at)
        sight = np.array(radar("tdm").position_m) - centres[:, part]
        own = np.einsum(
            "tji,tj->ti", frames[:, part], sight / np.linalg.norm(sight, axis=1, keepdims=True)
        )
        near = axes[part] ** 2 * own / np.linalg.norm(axes[part] * own, axis=1, keepdims=True)
        point = centres[:, part] + np.einsum("tij,tj->ti", frames[:, part], near)
        return np.asarray(np.linalg.norm(point - np.array(radar("tdm").position_m), axis=1))

    return np.asarray((distance(times + 5e-4) - distance(times - 5e-4)) / 1e-3)


@lru_cache
def fastest() -> tuple[int, float, float]:
    """Part and time at which a foot of the kick is fastest, and its mean range rate there."""
    body = body_of("kick")
    feet = [number for number, name in enumerate(body.part_names) if "foot" in name]
    times = np.arange(0.1, body.duration_s - 0.1, 1e-3)
    rates = {foot: foot_rate(body, foot, times) for foot in feet}
    foot = max(feet, key=lambda number: np.abs(rates[number]).max())
    middle = float(times[np.abs(rates[foot]).argmax()])
    inside = middle + (np.arange(200) - 100) / 200 * FRAME_S
    weight = (0.5 + 0.5 * np.cos(2 * np.pi * (inside - middle) / FRAME_S)) ** 2
    return foot, middle, float((foot_rate(body, foot, inside) * weight).sum() / weight.sum())


def kick_rows() -> Iterator[Row]:
    foot, middle, rate = fastest()
    yield reported("kick", "range rate of the foot", "m/s", rate)
    for kind in KINDS:
        made = radar(kind)
        power = maps(of_parts(window("kick", kind, middle), [foot]), made, 0.0)
        expected = folded(rate) if kind == "tdm" else rate
        says = (
            "a foot that kicks faster than 7.14 m/s, alone: "
            "folded under TDM, at its range rate under FDM and Doppler division"
        )
        found = mean_velocity(power, made)
        yield judged(
            "kick",
            f"the foot alone, {NAMES[kind]}",
            "m/s",
            found,
            made.velocity_bin_mps,
            reference=expected,
            says=says,
            cases=3,
        )
    for kind in KINDS:
        fast = np.abs(radar(kind).velocity_mps(kicked(kind).shape[1])) > WAVELENGTH / (
            4 * CHIRP_S * TX
        )
        power = kicked(kind)
        above = np.where(power > 10 * np.median(power), power, 0)
        yield reported(
            "kick",
            f"whole body, power beyond 7.14 m/s, {NAMES[kind]}",
            "share",
            float(above[:, fast].sum() / above.sum()),
        )


@lru_cache
def kicked(kind: str) -> NDArray[np.floating]:
    """Map of the whole body when the foot is fastest, with noise."""
    echoes = window("kick", kind, fastest()[1])
    return maps(echoes, radar(kind), noise_of(echoes))


def figure(rows: list[Row], path: Path) -> None:
    """The three maps of the kick."""
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    _, _, rate = fastest()
    drawn, panels = plt.subplots(
        1, 3, figsize=(12, 4.4), sharex=True, sharey=True, layout="constrained"
    )
    for axes, kind in zip(panels, KINDS, strict=True):
        made, power = radar(kind), kicked(kind)
        level = 10 * np.log10(power / power.max())
        velocity, step = made.velocity_mps(power.shape[1]), made.velocity_bin_mps
        extent = (velocity[0] - step / 2, velocity[-1] + step / 2, 0, made.max_range_m)
        shown = axes.imshow(
            level, origin="lower", aspect="auto", extent=extent, vmin=-50, vmax=0, cmap="viridis"
        )
        axes.axvline(rate, color="red", linewidth=0.8, linestyle=":")
        axes.text(rate, 5.9, f" foot {rate:.1f} m/s", color="red", fontsize=8, ha="left", va="top")
        axes.set_title(f"{NAMES[kind]}: ±{made.max_velocity_mps:.2f} m/s", fontsize=9)
        axes.set_xlim(-20, 20)
        axes.set_ylim(2, 6)
        axes.set_xlabel("velocity [m/s] (positive: receding)")
        axes.set_facecolor("0.85")
    panels[0].set_ylabel("range [m]")
    drawn.colorbar(shown, ax=panels, label="power below the peak [dB]")
    drawn.suptitle("A kick at its fastest, 25 ms, SNR 20 dB: the foot folds under TDM", fontsize=10)
    drawn.savefig(path, dpi=130)
    plt.close(drawn)


def measure(quick: bool) -> list[Row]:
    return [*limit_rows(), *point_rows(), *walk_rows(quick), *kick_rows()]


if __name__ == "__main__":
    assert math.isclose(WAVELENGTH, 0.0214137, rel_tol=1e-5)
    sys.exit(main("TDM, FDM and Doppler division: their unambiguous velocities.", measure, figure))
