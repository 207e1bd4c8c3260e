"""From IF samples to range-Doppler maps, their detections, directions and spectrograms."""

from rtradar.process.angles import (
    AngleSpectra,
    angle,
    angle_grid,
    angle_spectra,
    range_azimuth,
    range_elevation,
)
from rtradar.process.cfar import ca_cfar, ca_scale, os_cfar, os_scale
from rtradar.process.clutter import CLUTTER_REMOVALS, ClutterRemoval, clutter_removal
from rtradar.process.detectors import (
    Detector,
    PointDetector,
    build_detector,
    build_point_detector,
    register_detector,
    takes_channels,
    ti_oob,
)
from rtradar.process.frames import SlidingRangeTime, SlidingWindows, range_time
from rtradar.process.power_maps import power_map
from rtradar.process.spectra import RangeDoppler, cell_spectra, range_doppler, range_spectrum
from rtradar.process.spectrogram import SlidingSpectrogram, Spectrogram, spectrogram, window_cycles
from rtradar.process.vital_signs import VitalSigns, vital_signs
from rtradar.process.window_functions import WindowFunctions
from rtradar.radar.display import measured_angles
from rtradar.system.registries import DETECTORS

__all__ = [
    "CLUTTER_REMOVALS",
    "DETECTORS",
    "AngleSpectra",
    "ClutterRemoval",
    "Detector",
    "PointDetector",
    "RangeDoppler",
    "SlidingRangeTime",
    "SlidingSpectrogram",
    "SlidingWindows",
    "Spectrogram",
    "VitalSigns",
    "WindowFunctions",
    "angle",
    "angle_grid",
    "angle_spectra",
    "build_detector",
    "build_point_detector",
    "ca_cfar",
    "ca_scale",
    "cell_spectra",
    "clutter_removal",
    "measured_angles",
    "os_cfar",
    "os_scale",
    "power_map",
    "range_azimuth",
    "range_doppler",
    "range_elevation",
    "range_spectrum",
    "range_time",
    "register_detector",
    "spectrogram",
    "takes_channels",
    "ti_oob",
    "vital_signs",
    "window_cycles",
]
