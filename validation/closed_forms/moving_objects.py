"""Objects that move: a rotating blade, a swinging door, and a corner reflector on a cart.

blade    a plate that turns about the vertical, far away: its field at every chirp against the
         closed form of physical optics, cos(a) sin(kw sin a) / (kw sin a) of the broadside echo;
         the Doppler extent of its flashes against -2 v / lambda to 2 v / lambda of its tips; and
         two flashes a turn
door     a leaf of metal that swings on its hinge: the velocity of its free edge, read in
         spectra of slow time, against d/dt |r(angle(t)) - radar| over the same window
cart     a triangular trihedral that comes nearer at one velocity: range and velocity of its peak
         in range-Doppler spectra of IF samples, and its RCS against 4 pi a^4 / (3 lambda^2)

    python validation/closed_forms/moving_objects.py [--quick] [--json FILE]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh
from numpy.typing import NDArray

import rtradar as rt
from rtradar.scatter.people_and_objects import build_model_of_all
from rtradar.validate.rows import Row, judged, main, reported

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))
from helpers import MovingEllipsoid

Array = NDArray[np.float64]
C = 299_792_458.0

ONE = rt.Radar(
    tx_y=1, tx_z=0, rx_y=1, rx_z=0, start_frequency_hz=13.95e9, bandwidth_hz=0.1e9,
    position_m=(-600.0, 0.0, 1.0),
)  # fmt: skip
"""One Tx and one Rx far away, with range bins of 1.5 m: everything is in one of them."""

ASIDE = MovingEllipsoid(centre=(0.0, 200.0, 1.0), axes=(0.1, 0.1, 0.1))
"""Somebody has to be in a run."""


def echoes_of(radar: rt.Radar, moving: rt.Object, chirps: NDArray[np.int64]) -> rt.Echoes:
    """Echoes of an object alone."""
    scene = rt.Scene(objects=(moving,))
    body = replace(ASIDE, duration_s=float(chirps[-1] + 1) * radar.chirp_interval_s)
    world = build_model_of_all("specular", radar, body, scene=scene)
    return world.objects[0][0].echoes(chirps)


def slow_time(echoes: rt.Echoes, middle_hz: float) -> NDArray[np.complex128]:
    """Field of the first Rx at the middle of the sweep, chirp by chirp, for exp(+j omega t)."""
    node = int(np.abs(echoes.frequency - middle_hz).argmin())
    turns = np.exp(-2j * np.pi * echoes.frequency[node] / C * echoes.length[:, 0])
    return np.asarray((echoes.amplitude[node, :, 0].conj() * turns).sum(axis=1))


def blade_rows() -> Iterator[Row]:
    """A plate of 0.6 by 0.05 m, 2 mm thick, that turns ten times a second."""
    wide, high, rate = 0.6, 0.05, 10.0
    plate = trimesh.creation.box((0.002, wide, high))
    motion = rt.Turning(rate_hz=rate, phase_deg=-90.0)
    blade = rt.Object("blade", plate, "perfect-conductor", position_m=(0, 0, 1), motion=motion)
    count = round(1.5 / rate / ONE.chirp_interval_s)
    field = slow_time(echoes_of(ONE, blade, np.arange(count)), ONE.centre_frequency_hz)
    times = ONE.centres_of(np.arange(count))
    angle = 2 * np.pi * rate * times - np.pi / 2
    k, away = 2 * np.pi * ONE.centre_frequency_hz / C, 600.0
    most = k * wide * high / np.sqrt(np.pi) / away**2
    along = np.sinc(k * wide * np.sin(angle) / np.pi)
    expected = most * np.abs(np.cos(angle) * along)
    # Not near edge-on, where the two faces swap and the thickness is seen.
    facing = np.abs(np.cos(angle)) > 0.3
    off = np.abs(np.abs(field) - expected)[facing].max() / most
    says = "a rotating blade: field at every chirp, of that broadside"
    yield judged("blade", "field, worst", "1", float(off), 0.01, says=says)
    # Flashes: maxima of power above half of the largest, with a quarter turn between them.
    power = np.abs(field) ** 2
    tops = [
        n for n in range(1, count - 1)
        if power[n] > 0.5 * power.max() and power[n] >= power[n - 1] and power[n] > power[n + 1]
    ]  # fmt: skip
    says = "a rotating blade: flashes a second"
    period = float(np.diff(times[tops]).mean())
    yield judged("blade", "flashes a second", "Hz", 1 / period, 0.05, reference=2 * rate, says=says)
    # Over a quarter turn either side of a flash every place of the blade passes its broadside.
    first = tops[1] - round(0.25 / rate / ONE.chirp_interval_s)
    around = field[first : first + 2 * (tops[1] - first) + 1]
    tip = 2 * np.pi * rate * wide / 2
    low, high_edge = edges(around, ONE)
    for name, found, reference in (("approaching", low, -tip), ("receding", high_edge, tip)):
        says = "a rotating blade: Doppler of its tips, over 2 v / lambda"
        ratio = found / reference
        yield judged(
            f"blade, {name}", "velocity of the tip", "1", ratio, 0.02, reference=1.0, says=says
        )


def edges(field: NDArray[np.complex128], radar: rt.Radar) -> tuple[float, float]:
    """Least and largest velocity [m/s] of a band, where its power has fallen to a quarter.

    At the end of a flat band the stationary phase is on the end of the blade: half of the field.
    """
    size = 8 * len(field)
    spectrum = np.abs(np.fft.fftshift(np.fft.fft(field * np.hanning(len(field)), size))) ** 2
    smooth = np.convolve(spectrum, np.ones(65) / 65, "same")
    wavelength = C / radar.centre_frequency_hz
    # Approaching lets phases of exp(-jk length) ascend: its frequency is positive.
    velocity = -np.fft.fftshift(np.fft.fftfreq(size, radar.chirp_interval_s)) * wavelength / 2
    inside = smooth > 0.25 * np.median(smooth[smooth > 0.25 * smooth.max()])
    return float(velocity[inside].min()), float(velocity[inside].max())


def door_rows(quick: bool) -> Iterator[Row]:
    """Leaves of 0.9 m that swing by 40 degrees, their hinge 3 m ahead and 1 m to the side.

    The end of a leaf of 2 mm is one edge. That of one of 2 cm, a wavelength wide, has two: where
    their echoes cancel there is no one velocity, so this leaf is reported, at the same instants.
    """
    says = "a swinging door: velocity of its free edge, in cells of resolution"
    quantity = "velocity of its free edge, worst"
    # Over these instants the velocity rises, is largest and falls, by up to two cells in a window.
    instants = np.linspace(0.85, 1.25, 9 if quick else 17)
    thin, thick = (
        max(abs(_edge_off(middle_s, thickness)) for middle_s in instants)
        for thickness in (0.002, 0.02)
    )
    # Spectra have 16 places a cell; the rest is what the hinge and the ends of the window send.
    yield judged("door of 2 mm", quantity, "cell", thin, 0.2, says=says, cases=len(instants))
    yield reported("door of 2 cm", quantity, "cell", thick, cases=len(instants))


def _edge_off(middle_s: float, thickness: float) -> float:
    """How far off the velocity of the free edge is over 60 ms about an instant, in cells."""
    wide = 0.9
    leaf = trimesh.creation.box((thickness, wide, 0.4))
    leaf.apply_translation((0.0, wide / 2, 0.0))
    amplitude, period, yaw = 40.0, 2.0, 40.0
    motion = rt.Swinging(amplitude_deg=amplitude, period_s=period)
    hinge = np.array([3.0, -1.0, 1.0])
    door = rt.Object(
        "door", leaf, "perfect-conductor", position_m=tuple(hinge), yaw_deg=yaw, motion=motion
    )
    radar = replace(ONE, position_m=(0.0, 0.0, 1.0), bandwidth_hz=0.02e9, samples_per_chirp=64)
    window = round(0.06 / radar.chirp_interval_s)
    chirps = round(middle_s / radar.chirp_interval_s) + np.arange(window)
    field = slow_time(echoes_of(radar, door, chirps), radar.centre_frequency_hz)
    size = 16 * window
    spectrum = np.abs(np.fft.fft(field * np.hanning(window), size))
    wavelength = C / radar.centre_frequency_hz
    velocity = -np.fft.fftfreq(size, radar.chirp_interval_s) * wavelength / 2
    resolution = wavelength / 2 / (window * radar.chirp_interval_s)
    # The hinge stands still.
    spectrum[np.abs(velocity) < 3 * resolution] = 0.0
    times = radar.centres_of(chirps)
    swung = np.radians(yaw + amplitude * np.sin(2 * np.pi * times / period))
    edge = hinge + wide * np.stack([-np.sin(swung), np.cos(swung), 0 * swung], axis=1)
    rates = np.gradient(np.linalg.norm(edge - radar.tx[0], axis=1), times)
    expected = np.average(rates, weights=np.hanning(window))
    return float(velocity[spectrum.argmax()] - expected) / resolution


def cart_rows() -> Iterator[Row]:
    """A trihedral of 0.4 m that comes nearer at 2 m/s."""
    velocity, edge, begin = -2.0, 0.4, 100.0
    radar = replace(
        ONE, position_m=(0.0, 0.0, 1.0), start_frequency_hz=11.95e9, samples_per_chirp=512
    )
    cart = rt.Object(
        "cart", "trihedral", "perfect-conductor", position_m=(begin, 0, 1), yaw_deg=180,
        motion=rt.FollowingPath(velocity_mps=(velocity, 0, 0)),
    )  # fmt: skip
    count = radar.cycles_per_frame
    chirps = np.arange(count)
    echoes = echoes_of(radar, cart, chirps)
    middle = begin + velocity * radar.centres_of(chirps).mean()
    field = slow_time(echoes, radar.centre_frequency_hz)
    ranges = begin + velocity * radar.centres_of(chirps)
    wavelength = C / radar.centre_frequency_hz
    power = np.abs(field) ** 2 * ranges**4
    closed = 4 * np.pi * edge**4 / (3 * wavelength**2)
    off = float(np.abs(10 * np.log10(power / closed)).max())
    yield judged("cart", "RCS, worst", "dB", off, 0.3, says="a trihedral on a cart: its RCS")
    samples = rt.signal.synthesize(echoes, radar, radar.chirp_times(count))
    spectra = rt.process.range_doppler(samples, radar)
    values = np.abs(spectra.values[..., 0])
    cell = np.unravel_index(int(values.argmax()), values.shape)
    found = spectra.range_m[cell[0]], spectra.velocity[cell[1]]
    for name, own, exact, size in (
        ("range", found[0], middle, radar.range_bin_m),
        ("velocity", found[1], velocity, float(np.diff(spectra.velocity[:2])[0])),
    ):
        says = f"a trihedral on a cart: {name} of its peak, in cells"
        yield judged(
            "cart", f"{name} in cells", "cell", (own - exact) / size, 0.51, reference=0.0, says=says
        )


def measure(quick: bool) -> list[Row]:
    return [*blade_rows(), *door_rows(quick), *cart_rows()]


if __name__ == "__main__":
    sys.exit(main("Objects that move: a blade, a door, a corner reflector on a cart.", measure))
