"""Labels of pages: keys of ``summary.json`` as people read them, with their units."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

_LABELS = {
    # what was found
    "windows": "Frames",
    "chirps": "Chirps",
    "detections": "Detected cells, over all frames",
    "rdt_triangles": "Triangles of the surface about the detections",
    "rdt_points": "Points of the range-Doppler-time cloud",
    "xyz_points": "Points of the spatial cloud",
    "xyz_points_found": "Points of the spatial cloud before it was thinned",
    "echo_power_m2": "Echo power of the person, mean, with spreading loss",
    "noise_power_m2": "Noise power of one IF sample",
    "occlusion": "Occlusion decided by",
    "rays_traced": "Rays traced",
    "variant": "Ray tracer's backend",
    "watts_per_m2": "Received power of 1 m²",
    "echo_power_w": "Echo power, received",
    "noise_power_w": "Noise power, received",
    # settings of a run
    "motion": "Recording",
    "scene": "Scene",
    "fidelity": "Fidelity level",
    "start_s": "Start in the recording",
    "duration_s": "Duration",
    "heading_deg": "Heading of the person",
    "snr_db": "Signal-to-noise ratio of one IF sample",
    "pfa": "False alarms, probability in one cell",
    "seed": "Seed of random numbers",
    "spreading": "Spreading loss over the path",
    "clutter_removal": "Static clutter removed",
    "background": "Background subtracted",
    "body_material": "Material of the body",
    "breathing": "Breathing",
    "order": "Most reflections off walls",
    "keep_all": "Echoes below the noise kept",
    "save_if": "IF samples saved",
    "detector": "Detector",
    "detector_options": "Options of the detector",
    "range_window": "Window function over range",
    "spectrogram_window_s": "Window of the spectrogram [s]",
    "spectrogram_overlap": "Overlap of its windows",
    "doppler_window": "Window function over velocity",
    "unit": "Unit of the samples",
    "noise_power_given_m2": "Noise power given",
    # radar
    "name": "Name",
    "start_frequency_hz": "Frequency at the start of the sweep",
    "bandwidth_hz": "Bandwidth",
    "chirp_duration_s": "Duration of a chirp",
    "idle_s": "Idle time between chirps",
    "adc_start_s": "First sample after the start of a chirp",
    "adc_rate_hz": "Sample rate",
    "samples_per_chirp": "Samples of a chirp",
    "tx_y": "Transmitters on the horizontal line",
    "tx_z": "Transmitters on the vertical line",
    "rx_y": "Receivers on the horizontal line",
    "rx_z": "Receivers on the vertical line",
    "tx_spacing_wavelengths": "Spacing of transmitters",
    "rx_spacing_wavelengths": "Spacing of receivers",
    "tx_positions_m": "Places of transmitters",
    "rx_positions_m": "Places of receivers",
    "tx_order": "Order of transmitters",
    "position_m": "Position of the array (x, y, z)",
    "yaw_deg": "Yaw",
    "pitch_deg": "Pitch",
    "roll_deg": "Roll",
    "path_times_s": "Times of the path",
    "path_m": "Path of the radar",
    "path_angles_deg": "Turns along the path",
    "frame_period_s": "Time from frame to frame, with its gap",
    "chirps_per_frame": "Chirps in a frame",
    "channels": "Channels used",
    "frame_duration_s": "Duration of a frame",
    "frame_hop_s": "Time from frame to frame",
    "multiplexing": "Multiplexing of transmitters",
    "carrier_step_hz": "Step of the carrier",
    "doppler_bands": "Doppler bands",
    "polarization": "Polarisation",
    "transmit_power_dbm": "Transmit power",
    "noise_figure_db": "Noise figure",
    "noise_temperature_k": "Antenna temperature",
    # cost
    "wall_s": "Whole run, without what a process does once",
    "warmup_s": "What a process does once, such as compiling",
    "capture_s": "Radar simulated",
    "real_time_factor": "Seconds for each second of radar",
    "peak_memory_mb": "Peak memory",
}
_STAGES = {
    "motion": "Motion and body", "survey": "Link budget", "room": "Tracing the room",
    "scatter": "Echoes", "signal": "IF samples", "clutter": "Static clutter", "noise": "Noise",
    "range": "Range spectra", "clutter removal": "Clutter removal", "write": "Writing files",
    "frames": "Range spectra into frames",
    "doppler": "Range-Doppler maps", "cfar": "Detection", "cloud": "Clouds", "angle": "Angles",
    "received": "Frame before clutter removal", "spectrogram": "Spectrogram",
    "sources": "Who returned each detection",
    "pictures": "Pictures", "view": "Echoes for the view", "report": "This page",
}  # fmt: skip
_UNITS = {
    "hz": "Hz", "s": "s", "m": "m", "m2": "m²", "mps": "m/s", "db": "dB", "deg": "°", "mb": "MB",
    "w": "W", "k": "K", "dbm": "dBm", "wavelengths": "wavelengths at the start of the sweep",
}  # fmt: skip
_ACRONYMS = {"if": "IF", "pfa": "Pfa", "rdt": "RDT", "rx": "Rx", "snr": "SNR", "tx": "Tx"}
_PREFIXED = {"Hz", "s", "W"}  # shown as 12 GHz or 62.5 µs


def quantity(name: str, value: object) -> tuple[str, str]:
    """Return the label of a key and its value with a unit, such as ("Bandwidth", "4 GHz").

    The unit is that of the key's suffix. The words of a key without a label are its own, such as
    ("Gain of antenna", "3 dB"). The value is a number, a text, a Boolean, a sequence of them, or
    None. Nothing is escaped yet.
    """
    words = name.split("_")
    unit = _UNITS.get(words[-1], "") if len(words) > 1 else ""
    if unit:
        words = words[:-1]
    spoken = " ".join(_ACRONYMS.get(word, word) for word in words)
    return _LABELS.get(name, spoken[:1].upper() + spoken[1:]), with_unit(value, unit)


def stage_label(name: str) -> str:
    """Return what a stage of a run does, such as "Detection"."""
    return _STAGES.get(name, name[:1].upper() + name[1:])


def with_unit(value: object, unit: str) -> str:
    """Return a value as text with its unit, such as "62.5 µs" or "(-4, 0, 1) m"."""
    if value is None:
        return "-"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, list | tuple):
        return f"({', '.join(with_unit(item, '') for item in value)}){' ' if unit else ''}{unit}"
    if isinstance(value, int) and not unit:
        return grouped(value)
    if isinstance(value, int | float):
        if unit in _PREFIXED and value:
            from matplotlib.ticker import EngFormatter

            return EngFormatter(unit=unit, places=None)(value)
        shown = f"{value:.5g}"
    else:
        shown = str(value)
        if shown not in ("inf", "-inf"):
            unit = ""
    return shown + ("" if unit in ("", "°") else " ") + unit


def signal_to_noise(summary: Mapping[str, Any]) -> str | None:
    """Return the signal-to-noise ratio of one IF sample that a run had, such as "31.6 dB".

    It is None where a summary knows no noise, as of measured samples.
    """
    if "noise_power_m2" not in summary:
        return None
    echo, noise = summary["echo_power_m2"], summary["noise_power_m2"]
    if not echo:
        return "nobody is visible"
    return f"{10 * math.log10(echo / noise):.1f} dB" if noise else "no noise"


def grouped(number: int) -> str:
    """Return a whole number in groups of three digits, from five digits on."""
    return str(number) if abs(number) < 10_000 else f"{number:,}".replace(",", "\u202f")


def minus(text: str) -> str:
    """Return a number in a text with the sign that is as wide as a plus."""
    return text.replace("-", "\N{MINUS SIGN}")
