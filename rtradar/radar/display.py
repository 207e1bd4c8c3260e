"""What a radar shows of itself: its settings and limits with their units, and its array."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from rtradar.cards import quantity
from rtradar.front_end import Antenna
from rtradar.system.figure_style import (
    STYLE,
    axes_given,
    dress,
    figure_for,
    theme_of,
    write_heading,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from rtradar.radar.radar import Radar


_ANGLES = ("azimuth", "elevation")


def brief_rows(radar: Radar) -> dict[str, str]:
    """Return the rows of a radar's ``repr``."""
    # The most important rows of the two tables of a card.
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
    # What is not set is not shown as 0.
    powers = []
    if radar.transmit_power_dbm is not None:
        powers.append(f"transmitted {radar.transmit_power_dbm:g} dBm")
    if radar.noise_figure_db is not None:
        powers.append(f"noise figure {radar.noise_figure_db:g} dB")
    in_pairs = radar.channels == "pairs" and radar.is_cross and radar.tx_y * radar.tx_z
    pairs = " (each line by itself)" if in_pairs else ""
    names = {"tdm": "TDM, one Tx after the other", "fdm": "FDM, all Tx at once"}
    names["ddm"] = f"DDM, all Tx at once in {radar.n_doppler_bands} Doppler bands"
    names["bpm"] = "BPM, all Tx at once, told apart by the signs of their chirps"
    idle = f", idle {quantity(radar.idle_s, 's')}" if radar.idle_s else ""
    return {
        "Sweep": f"{quantity(radar.start_frequency_hz, 'Hz')} to {quantity(stop_hz, 'Hz')}, "
        f"{'vertical' if radar.polarization == 'v' else 'horizontal'} polarisation",
        "Chirp": f"{quantity(radar.chirp_duration_s, 's')}, {radar.samples_per_chirp} samples at "
        f"{quantity(radar.sample_rate_hz, 'Hz')}{idle}",
        "Transmitters": _lines(radar, "tx"),
        "Receivers": _lines(radar, "rx"),
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
    measured = [(name, one) for name, one in zip(_ANGLES, radar.patterns, strict=True) if one.wide]
    # Angles with the same limit share one entry, as those of the paper's cross do.
    most: dict[str, list[str]] = {}
    for name, one in measured:
        most.setdefault(f"±{one.max_angle_deg:.3g}°", []).append(name)
    reach = ", ".join(f"{angle} in {' and '.join(names)}" for angle, names in most.items())
    beam = " and ".join(dict.fromkeys(f"{one.width_deg:.3g}°" for _, one in measured))
    lobes = _grating_lobes(radar)
    return {
        "Maximum range": f"{radar.max_range_m:.4g} m",
        "Range resolution": f"{100 * radar.range_bin_m:.4g} cm",
        "Maximum velocity": f"±{radar.max_velocity_mps:.4g} m/s",
        "Velocity resolution": f"{radar.velocity_bin_mps:.3g} m/s",
        "Maximum angle": reach or "not measured",
        "Angular resolution": f"{beam} at boresight" if beam else "not measured",
        **({"Grating lobes": lobes} if lobes else {}),
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
    names = zip(_ANGLES, radar.patterns, strict=True)
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
    names = zip(_ANGLES, radar.measures, strict=True)
    return tuple(name for name, measured in names if measured)


def _lines(radar: Radar, kind: str) -> str:
    """Say where the ``tx`` or the ``rx`` are."""
    listed = getattr(radar, f"{kind}_positions_m")
    if listed is not None:
        return f"{len(listed)} in a list"
    counts = {axis: getattr(radar, f"{kind}_{axis}") for axis in "yz"}
    lines = " and ".join(f"{count} along {axis}" for axis, count in counts.items() if count)
    apart_m = getattr(radar, f"{kind}_spacing_wavelengths") * radar.start_wavelength_m
    return f"{lines}, {quantity(apart_m, 'm')} apart" if max(counts.values()) > 1 else lines


def _antenna(antenna: Antenna | None) -> str:
    if antenna is None or antenna.pattern == "isotropic":
        return "isotropic"
    return f"{antenna.pattern}, peak {10 * math.log10(antenna.peak_gain):.3g} dBi"


def plot_radar(radar: Radar, ax: Axes | None) -> Axes:
    """Draw the array of a radar, and beside it the limits, as `Radar.plot` does."""
    _, ax = axes_given(None, ax)
    if ax is not None:
        _draw_array(radar, ax, f"{radar.name}: array, seen from behind")
        return ax
    # On a figure of one's own there is room for the limits as well.
    figure = figure_for(4.3)
    array, limits = figure.subplots(1, 2)
    write_heading(figure, f"Radar {radar.name}")
    _draw_array(radar, array, "Array, seen from behind")
    _draw_limits(radar, limits)
    return array


def _draw_array(radar: Radar, axes: Axes, title: str) -> None:
    theme = theme_of(axes)
    tx, rx = (1e3 * places[:, 1:] for places in (radar.tx_m, radar.rx_m))
    # Only receivers that are kept with some Tx are shown.
    kept = np.unique(radar.rx_of_tx)
    virtual = (tx[:, None] + rx[radar.rx_of_tx]).reshape(-1, 2)
    blue, orange = theme.cycle[:2]
    points: dict[str, Any] = {"linestyle": "none", "markerfacecolor": "none"}
    drawn = {"s": virtual, "o": rx[kept], "^": tx}
    styles: dict[str, dict[str, Any]] = {
        "s": {"color": theme.faint, "markersize": 3, "label": f"{len(virtual)} virtual (Tx + Rx)"},
        "o": {"color": blue, "markersize": 4.5, "label": f"{len(kept)} Rx"},
        "^": {"color": orange, "markersize": 8, "label": f"{len(tx)} Tx"},
    }
    for marker, places in drawn.items():
        axes.plot(*places.T, marker=marker, **points, **styles[marker])
    reach = 1.12 * max(5.0, *(float(np.abs(places).max()) for places in drawn.values()))
    upward = max(0.7 * reach, 1.12 * float(np.abs(virtual[:, 1]).max()))
    # The view is that of the radar, which has y at its left. The legend is above the array.
    axes.set(xlim=(reach, -reach), ylim=(-upward, upward + 0.75 * reach))
    axes.set(xlabel="y [mm]", ylabel="z [mm]")
    axes.set_aspect("equal")
    axes.legend(loc="upper center", handletextpad=0.2, borderpad=0.3)
    dress(axes, title=title)


def _draw_limits(radar: Radar, axes: Axes) -> None:
    from matplotlib.patches import Rectangle  # slow to import

    theme, rows = theme_of(axes), limit_rows(radar)
    # A rectangle of all unambiguous velocities and ranges, with the figures in it.
    fastest, farthest = radar.max_velocity_mps, radar.max_range_m
    colour = theme.cycle[0]
    size: dict[str, Any] = {"width": 2 * fastest, "height": farthest}
    axes.add_patch(Rectangle((-fastest, 0), **size, facecolor=colour, alpha=0.18))
    axes.add_patch(Rectangle((-fastest, 0), **size, fill=False, edgecolor=colour))
    text = "\n\n".join(
        (
            f"{rows['Maximum range']} and {rows['Maximum velocity']}\nwithout ambiguity",
            f"one cell: {rows['Range resolution']}\nby {rows['Velocity resolution']}",
            f"angle: {rows['Maximum angle']}".replace(" and ", "\nand "),
            *([f"beam: {rows['Angular resolution']}"] if measured_angles(radar) else []),
        )
    )
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": STYLE["font.size"]}
    axes.text(0, farthest / 2, text, linespacing=1.2, color=theme.text, **style)
    axes.set(xlim=(-1.2 * fastest, 1.2 * fastest), ylim=(0, 1.12 * farthest))
    axes.set(xlabel="Velocity [m/s]", ylabel="Range [m]")
    dress(axes, title="What it measures")
