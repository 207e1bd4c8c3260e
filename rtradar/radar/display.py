"""What a radar shows of itself: its settings and limits with their units, and its array."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from rtradar.cards import quantity
from rtradar.front_end import Antenna

if TYPE_CHECKING:
    from rtradar.radar.radar import Radar


def brief_rows(radar: Radar) -> dict[str, str]:
    """Return the rows of a radar's ``repr``."""
    settings, limits = settings_rows(radar), limit_rows(radar)
    rows = {label.lower(): settings[label] for label in ("Sweep", "Chirp", "Channels", "Frame")}
    rows["position"] = settings["Position"]
    for name, most in (("range", "Maximum range"), ("velocity", "Maximum velocity")):
        rows[name] = f"{limits[most]}, resolution {limits[f'{name.capitalize()} resolution']}"
    rows["angle"] = limits["Maximum angle"]
    if measured_angles(radar):
        rows["angle"] += f", resolution {limits['Angular resolution']}"
    if radar.transmit_power_dbm is not None or radar.noise_figure_db is not None:
        rows["power"] = settings["Power"]
    return rows


def settings_rows(radar: Radar) -> dict[str, str]:
    """Return what was set, as texts with units by their labels."""
    stop_hz = radar.start_frequency_hz + radar.bandwidth_hz
    stated = {
        "transmitted": (radar.transmit_power_dbm, "dBm"),
        "noise figure": (radar.noise_figure_db, "dB"),
    }
    powers = [
        f"{name} {value:g} {unit}" for name, (value, unit) in stated.items() if value is not None
    ]
    pairs = (
        " (each line by itself)"
        if radar.channels == "pairs" and radar.is_cross and radar.tx_y * radar.tx_z
        else ""
    )
    names = {"tdm": "TDM, one Tx after the other", "fdm": "FDM, all Tx at once"}
    names["ddm"] = f"DDM, all Tx at once in {radar.n_doppler_bands} Doppler bands"
    names["bpm"] = "BPM, all Tx at once, told apart by the signs of their chirps"
    idle = f", idle {quantity(radar.idle_s, 's')}" if radar.idle_s else ""
    return {
        "Sweep": f"{quantity(radar.start_frequency_hz, 'Hz')} to {quantity(stop_hz, 'Hz')}, "
        f"{'vertical' if radar.polarization == 'v' else 'horizontal'} polarisation",
        "Chirp": f"{quantity(radar.chirp_duration_s, 's')}, {radar.samples_per_chirp} samples at "
        f"{quantity(radar.sample_rate_hz, 'Hz')}{idle}",
        "Transmitters": _line(radar, radar.tx_y, radar.tx_z, radar.tx_spacing_wavelengths)
        if radar.tx_positions_m is None
        else f"{radar.n_tx} in a list",
        "Receivers": _line(radar, radar.rx_y, radar.rx_z, radar.rx_spacing_wavelengths)
        if radar.rx_positions_m is None
        else f"{radar.n_rx} in a list",
        "Channels": f"{radar.n_tx} Tx × {radar.n_rx} Rx = {radar.n_channels}{pairs}",
        "Multiplexing": names[radar.multiplexing],
        "Frame": f"{quantity(radar.frame_duration_s, 's')} every "
        f"{quantity(radar.frame_hop_s, 's')}: {radar.cycles_per_frame} cycles of "
        f"{quantity(radar.cycle_duration_s, 's')}",
        "Position": f"({', '.join(f'{value:g}' for value in radar.position_m)}) m, {_turn(radar)}",
        "Antennas": f"Tx {_antenna(radar.tx_antenna)}, Rx {_antenna(radar.rx_antenna)}",
        "Power": ", ".join(powers) or "not stated",
    }


def limit_rows(radar: Radar) -> dict[str, str]:
    """Return the limits that follow from the settings, as texts with units by their labels."""
    axes = " and ".join(measured_angles(radar))
    beam, most = f"{radar.angle_resolution_deg:.3g}°", f"±{radar.max_angle_deg:.3g}° in {axes}"
    gratings = {}
    if not radar.is_cross:
        own = {
            "azimuth": (radar.max_azimuth_deg, radar.azimuth_resolution_deg),
            "elevation": (radar.max_elevation_deg, radar.elevation_resolution_deg),
        }
        measured = [(name, *own[name]) for name in measured_angles(radar)]
        most = ", ".join(f"±{angle:.3g}° in {name}" for name, angle, _ in measured)
        beam = " and ".join(f"{width:.3g}°" for _, _, width in measured)
        if lobes := _grating_lobes(radar):
            gratings = {"Grating lobes": lobes}
    return {
        "Maximum range": f"{radar.max_range_m:.4g} m",
        "Range resolution": f"{100 * radar.range_bin_m:.4g} cm",
        "Maximum velocity": f"±{radar.max_velocity_mps:.4g} m/s",
        "Velocity resolution": f"{radar.velocity_bin_mps:.3g} m/s",
        "Maximum angle": most if axes else "not measured",
        "Angular resolution": f"{beam} at boresight" if axes else "not measured",
        **gratings,
        "Wavelength": f"{quantity(radar.wavelength_m, 'm')} at the sweep centre",
        "Samples in a frame": f"{radar.chirps_per_frame * radar.n_rx * radar.samples_per_chirp:,}",
    }


def _turn(radar: Radar) -> str:
    """Say where the radar looks, and that it moves."""
    turns = {"yaw": radar.yaw_deg, "pitch": radar.pitch_deg, "roll": radar.roll_deg}
    said = ", ".join(f"{name} {angle:g}°" for name, angle in turns.items() if angle)
    return (said or "boresight +x") + (", moving" if radar.is_moving else "")


def _grating_lobes(radar: Radar) -> str:
    """Say how far from an echo, in sines, its first grating lobe is, and how high."""
    names = zip(("azimuth", "elevation"), radar.patterns, strict=True)
    return ", ".join(
        f"{one.grating_sine:.3g} from an echo in the sine of {name}, {one.grating_db:.1f} dB"
        for name, one in names
        if one.grating_db > -math.inf
    )


def measured_angles(radar: Radar) -> tuple[str, ...]:
    """Which of ``azimuth`` and ``elevation`` the radar measures, by two channels on a line.

    Without a line along z, azimuth is the cone angle asin(y / r).

    Parameters
    ----------
    radar : Radar
        Radar whose array counts.

    Returns
    -------
    tuple of str
    """
    names = zip(("azimuth", "elevation"), radar.measures, strict=True)
    return tuple(name for name, measured in names if measured)


def _line(radar: Radar, n_y: int, n_z: int, spacing_wavelengths: float) -> str:
    lines = [f"{count} along {axis}" for axis, count in (("y", n_y), ("z", n_z)) if count]
    apart = quantity(spacing_wavelengths * radar.start_wavelength_m, "m")
    return f"{' and '.join(lines)}, {apart} apart" if max(n_y, n_z) > 1 else " and ".join(lines)


def _antenna(antenna: Antenna | None) -> str:
    if antenna is None or antenna.pattern == "isotropic":
        return "isotropic"
    return f"{antenna.pattern}, peak {10 * math.log10(antenna.peak_gain):.3g} dBi"
