"""A point at a known place and speed, read back through a radar with any array, schedule and pose.

The IF samples are made here by closed forms from the fields of the radar alone: places of antennas
in the world, times of chirps, delays, and the phase of the mixed sweep. rtradar reads range and
velocity from its map, and azimuth and elevation in the cell of the echo. `rows_of_radar` does so
for one radar; its points are inside the limits that it states. All boards are among them. The
sparse array also has its grating lobes judged, by the angle at which the array factor returns to
its height. A wall and a corner reflector are also seen from a radar that moves.

    python validation/closed_forms/any_radar.py [--quick] [--json FILE]
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from rtradar.process import angle, range_doppler
from rtradar.radar import Radar
from rtradar.scatter.clutter.static_clutter import Clutter
from rtradar.scene import Furniture, Scene, Wall, material
from rtradar.signal import separate
from rtradar.signal.clutter import MovingRoomIf
from rtradar.system.registries import BOARDS
from rtradar.validate.rows import Row, judged, main

Array = NDArray[np.float64]

LIGHT = 299_792_458.0
SHARE = 0.1  # of a bin or a beam: what a reading may be off, far below what a map can tell apart
PLACES = ((0.0, 0.0, 0.3), (0.5, 0.4, 0.4), (-0.4, -0.5, 0.6))  # of largest angles and of range
SPEEDS = (0.0, 0.45, -0.3)  # of the largest velocity
HADAMARD_2 = np.array([[1.0, 1.0], [1.0, -1.0]])
_FRAMES = (0, 2)  # the second of them lies after two gaps
_STEP_S = 1e-6  # over which a range rate is measured


def antennas(radar: Radar) -> tuple[Array, Array]:
    """Places of Tx, in the order of their chirps, and of Rx in the radar's axes [m]."""
    wavelength = LIGHT / radar.start_frequency_hz

    def line(count_y: int, count_z: int, spacing: float) -> Array:
        y, z = (
            (np.arange(count) - (count - 1) / 2) * spacing * wavelength
            for count in (count_y, count_z)
        )
        along_y = np.stack([0 * y, y, 0 * y], axis=1)
        return np.concatenate([along_y, np.stack([0 * z, 0 * z, z], axis=1)])

    tx = line(radar.tx_y, radar.tx_z, radar.tx_spacing_wavelengths)
    rx = line(radar.rx_y, radar.rx_z, radar.rx_spacing_wavelengths)
    tx = tx if radar.tx_positions_m is None else np.array(radar.tx_positions_m)
    rx = rx if radar.rx_positions_m is None else np.array(radar.rx_positions_m)
    return tx if radar.tx_order is None else tx[list(radar.tx_order)], rx


def pose(radar: Radar, time: float) -> tuple[Array, Array]:
    """Boresight, left and up of the radar in world axes, as columns, and its position [m]."""
    angles = np.array([radar.yaw_deg, radar.pitch_deg, radar.roll_deg])
    place = np.array(radar.position_m)
    for path, start in ((radar.path_m, place), (radar.path_angles_deg, angles)):
        if path is not None:
            start += [np.interp(time, radar.path_times_s, values) for values in np.transpose(path)]
    (cy, cp, cr), (sy, sp, sr) = np.cos(np.radians(angles)), np.sin(np.radians(angles))
    ahead = np.array([cp * cy, cp * sy, sp])
    left, up = np.array([-sy, cy, 0]), np.array([-sp * cy, -sp * sy, cp])
    return np.stack([ahead, cr * left + sr * up, cr * up - sr * left], axis=1), place


def chirp_times(radar: Radar, frame: int, count: int) -> Array:
    """Middles of the samples of the chirps of one frame [s]."""
    slot = radar.chirp_duration_s + radar.idle_s
    rest = radar.chirp_duration_s - radar.adc_start_s
    sampled = rest if radar.adc_rate_hz is None else radar.samples_per_chirp / radar.adc_rate_hz
    start = frame * (count * slot if radar.frame_period_s is None else radar.frame_period_s)
    return start + np.arange(count) * slot + radar.adc_start_s + sampled / 2


def samples_of(radar: Radar, times: Array, place: Array, velocity: Array, middle: float) -> Array:
    """IF samples (chirp, rx, sample) of a point that is at a place in the middle of a frame."""
    tx, rx = antennas(radar)
    rate = radar.adc_rate_hz or radar.samples_per_chirp / (
        radar.chirp_duration_s - radar.adc_start_s
    )
    fast = radar.adc_start_s + np.arange(radar.samples_per_chirp) / rate
    slope = radar.bandwidth_hz / radar.chirp_duration_s
    # What each Tx (column) transmits in each chirp of a cycle: one by itself, or all with signs.
    sent = HADAMARD_2 if radar.multiplexing == "bpm" else np.eye(len(tx))
    samples = np.empty((len(times), len(rx), len(fast)), np.complex128)
    for number, time in enumerate(times):
        axes, position = pose(radar, time)
        point = axes.T @ (place + velocity * (time - middle) - position)
        there, back = (np.linalg.norm(point - places, axis=1) for places in (tx, rx))
        path = there[:, None] + back
        delay = path[..., None] / LIGHT
        turns = (radar.start_frequency_hz + slope * fast) * delay - slope * delay**2 / 2
        samples[number] = np.tensordot(sent[number % len(tx)], np.exp(2j * np.pi * turns), 1)
    return samples


def array_factor(radar: Radar, axis: int, sines: Array) -> Array:
    """Power of a beam of all virtual elements over the difference of two sines along one axis."""
    tx, rx = antennas(radar)
    places = (tx[:, None, axis] + rx[None, :, axis]).ravel() / radar.wavelength_m
    return np.asarray(np.abs(np.exp(2j * np.pi * np.outer(sines, places)).mean(axis=1)) ** 2)


def beam_deg(radar: Radar, axis: int) -> float:
    """Half-power width of the beam on boresight [deg]."""
    sines = np.linspace(0, 1, 20_001)
    below = np.flatnonzero(array_factor(radar, axis, sines) < 0.5)
    return 180.0 if not len(below) else float(2 * np.degrees(np.arcsin(sines[below[0]])))


def centroid(power: Array) -> float:
    """Mean bin of the power within three bins of its peak; the axis is cyclic."""
    bins = int(power.argmax()) + np.arange(-3, 4)
    weights = power[bins % len(power)]
    return float(weights @ bins / weights.sum())


def rows_of_radar(radar: Radar, *, quick: bool = False) -> Iterator[Row]:
    """Rows for one radar under TDM, or BPM with two Tx: points at several places and speeds."""
    beams = beam_deg(radar, 1), beam_deg(radar, 2)
    measured = tuple(beam < 180 for beam in beams)
    count = radar.chirps_per_frame
    for frame in _FRAMES[:1] if quick else _FRAMES:
        times = chirp_times(radar, frame, count)
        middle = float(times.mean())
        for (azimuth, elevation, far), speed in zip(PLACES, SPEEDS, strict=True):
            az = np.radians(azimuth * min(radar.max_azimuth_deg, 60)) * measured[0]
            el = np.radians(elevation * min(radar.max_elevation_deg, 60)) * measured[1]
            ahead = np.array([np.cos(el) * np.cos(az), np.cos(el) * np.sin(az), np.sin(el)])
            axes, position = pose(radar, middle)
            place = position + axes @ ahead * far * radar.max_range_m
            # Less than half a range bin in a frame, for a point that crosses bins has no one bin.
            fastest = 0.5 * radar.range_bin_m / (times[-1] - times[0])
            along = np.clip(speed * radar.max_velocity_mps, -fastest, fastest)
            velocity = axes @ ahead * along
            ends = [
                np.linalg.norm(place + velocity * step - pose(radar, middle + step)[1])
                for step in (-_STEP_S, _STEP_S)
            ]
            truth = np.linalg.norm(place - position), (ends[1] - ends[0]) / (2 * _STEP_S)
            samples = samples_of(radar, times, place, velocity, middle)
            claim = f"{radar.name}, frame {frame}, {truth[0]:.2f} m, {truth[1]:+.2f} m/s"
            yield from _read(claim, samples, radar, truth, (az, el), beams)


def _read(
    claim: str,
    samples: Array,
    radar: Radar,
    truth: tuple[float, float],
    direction: tuple[float, float],
    beams: tuple[float, float],
) -> Iterator[Row]:
    parted = separate(samples, radar, 0)
    found = range_doppler(parted, radar)
    power = (np.abs(found.values) ** 2).sum(axis=2)
    cycles, says = power.shape[1], "a point reads back through any array, schedule and pose: "
    read = centroid(power.sum(axis=1)), centroid(power.sum(axis=0)) - cycles // 2
    bins = (
        radar.range_bin_m,
        LIGHT
        / radar.centre_frequency_hz
        / (2 * cycles * len(antennas(radar)[0]) * (radar.chirp_duration_s + radar.idle_s)),
    )
    for name, ours, true, width in zip(("range", "velocity"), read, truth, bins, strict=True):
        details = {"reference": true / width, "key": "any-radar", "says": says + name}
        yield judged(claim, name, "bins", ours, SHARE, **details)
    angles = angle(parted.astype(np.complex64), radar, *truth)
    names = "azimuth", "elevation"
    for name, ours, true, beam in zip(names, angles, direction, beams, strict=True):
        if beam < 180:
            details = {"reference": float(true) / np.radians(beam), "key": "any-radar"}
            share = ours / np.radians(beam)
            yield judged(claim, name, "beams", share, SHARE, says=says + name, **details)


def grating_rows(radar: Radar, axis: int, first_sine: float) -> Iterator[Row]:
    """The angle that a radar states, held against the first sine at which its beam comes again."""
    ours = (radar.max_azimuth_deg, radar.max_elevation_deg)[axis - 1]
    true = float(np.degrees(np.arcsin(min(1.0, first_sine / 2))))
    says = "grating lobes of a sparse array: unambiguous angle"
    details = {"reference": true, "key": "any-radar", "says": says}
    name = f"{radar.name}, along {'xyz'[axis]}"
    yield judged(name, "unambiguous angle", "deg", ours, SHARE * beam_deg(radar, axis), **details)
    height = float(array_factor(radar, axis, np.array([first_sine]))[0])
    says = "grating lobes of a sparse array: height beside the main lobe"
    details = {"reference": 1.0, "key": "any-radar", "says": says}
    yield judged(name, "grating lobe", "", height, 1e-9, **details)


def radars() -> dict[str, Radar]:
    """Arrays of three Tx and four Rx at 77 GHz: turned, in frames with gaps, moving, sparse."""
    # In wavelengths of the middle of the samples, so that grating lobes have round sines.
    unit = LIGHT / (77e9 + 60e12 * (3e-6 + 25.6e-6))
    plain = Radar(
        name="two rows",
        start_frequency_hz=77e9,
        bandwidth_hz=3.6e9,
        chirp_duration_s=60e-6,
        idle_s=7e-6,
        adc_start_s=3e-6,
        adc_rate_hz=5e6,
        samples_per_chirp=256,
        tx_positions_m=[[0, 0, 0], [0, -unit, unit / 2], [0, -2 * unit, 0]],
        rx_positions_m=[[0, -unit / 2 * number, 0] for number in range(4)],
        tx_order=[0, 2, 1],
        chirps_per_frame=96,
        position_m=(0.3, -0.2, 1.1),
    )
    turned = {"yaw_deg": 25.0, "pitch_deg": -12.0, "roll_deg": 8.0}
    gaps = {"frame_period_s": 1 / 30}
    moves = {
        "path_times_s": [0.0, 1.0],
        "path_m": [[0, 0, 0], [0.7, -0.4, 0.2]],
        "path_angles_deg": [[0, 0, 0], [30, 10, -5]],
    }
    wide = [[0, -1.5 * unit * number, 0] for number in range(4)]
    sparse = {"tx_positions_m": [[0, 0, 0], [0, 0, unit], [0, 0, 2 * unit]], "rx_positions_m": wide}
    two = {"tx_positions_m": [[0, 0, 0], [0, -2 * unit, 0]], "tx_order": None}
    kinds = {
        "two rows": {},
        "turned": turned,
        "with gaps": gaps,
        "moving": turned | gaps | moves,
        "two Tx by their signs": two | turned | gaps | {"multiplexing": "bpm"},
        "sparse": sparse | gaps | {"tx_order": None},
    }
    return {name: dataclasses.replace(plain, name=name, **own) for name, own in kinds.items()}


def room_rows(quick: bool) -> Iterator[Row]:
    """A metal wall and a trihedral before a radar that moves and turns: their range and velocity.

    A wall is at twice the way to its plane, a trihedral at that to its apex.
    """
    metal = material("metal")
    position = np.array((0.0, 0.0, 1.0))
    wall = Wall(
        name="wall",
        corner_m=(3.0, 4.0, -2.0),
        edge_u_m=(0.0, -8.0, 0.0),
        edge_v_m=(0.0, 0.0, 6.0),
        material=metal,
        thickness_m=0.01,
    )
    apex = (3.0, 0.8, 1.3)
    reflector = Furniture("trihedral", "trihedral", metal, position_m=apex, yaw_deg=180)
    things = {"wall": Scene(walls=(wall,)), "trihedral": Scene(furniture=(reflector,))}
    for (name, scene), speed in itertools.product(things.items(), (1.5, -0.6)):
        radar = Radar(
            name=name,
            start_frequency_hz=24e9,
            bandwidth_hz=1e9,
            tx_y=2,
            tx_z=0,
            rx_y=2,
            rx_z=0,
            samples_per_chirp=64,
            chirps_per_frame=512,
            position_m=tuple(position),
            yaw_deg=5.0,
            path_times_s=[0.0, 0.1],
            path_m=[[0, 0, 0], [0.1 * speed, 0.02, -0.01]],
            path_angles_deg=[[0, 0, 0], [4, 2, -1]],
        )
        room = MovingRoomIf(radar, 0.1, functools.partial(_clutter, scene))
        times = chirp_times(radar, 0, radar.chirps_per_frame)
        way = (
            np.array(apex if name == "trihedral" else (3.0, 0.0, 0.0))
            - pose(radar, float(times.mean()))[1]
        )
        way = way if name == "trihedral" else way * (1, 0, 0)
        velocity = np.array([speed, 0.2, -0.1])
        truth = float(np.linalg.norm(way)), -float(velocity @ way / np.linalg.norm(way))
        power = range_doppler(room.clutter_if(np.arange(len(times))), radar).values
        summed = (np.abs(power) ** 2).sum(axis=2)
        cycles = summed.shape[1]
        read = centroid(summed.sum(axis=1)), centroid(summed.sum(axis=0)) - cycles // 2
        doppler = LIGHT / radar.centre_frequency_hz / (4 * cycles * radar.chirp_duration_s)
        says = "a wall and a corner reflector before a radar that moves: "
        claim = f"{name}, {truth[0]:.2f} m, {truth[1]:+.2f} m/s"
        for kind, ours, true in zip(
            ("range", "velocity"),
            read,
            (truth[0] / radar.range_bin_m, truth[1] / doppler),
            strict=True,
        ):
            details = {"reference": true, "key": "any-radar", "says": says + kind}
            yield judged(claim, kind, "bins", ours, SHARE, **details)
        if quick:
            return


def _clutter(scene: Scene, radar: Radar) -> Clutter:
    return Clutter(radar, scene, order=1)


def measure(quick: bool) -> list[Row]:
    found = radars()
    names = ("iwr6843aop", "awr2944") if quick else (*BOARDS, "radhar", "mars")
    every = (*found.values(), *map(Radar.preset, names))
    rows = [row for radar in every for row in rows_of_radar(radar, quick=quick)]
    for axis, first in ((1, 1 / 1.5), (2, 1.0)):
        rows += grating_rows(found["sparse"], axis, first)
    return rows + list(room_rows(quick))


if __name__ == "__main__":
    says = "A point reads back through any array, schedule and pose."
    sys.exit(main(says, measure))
