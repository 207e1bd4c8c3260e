"""From IF samples to range-Doppler maps, their detections, directions and spectrograms."""

from rtradar.process.angles.maps import angle_grid, range_azimuth, range_elevation
from rtradar.process.angles.spectra import AngleSpectra, angle, angle_spectra
from rtradar.process.angles.steering import measured_angles, measures_angle
from rtradar.process.cells import cell_spectra
from rtradar.process.clutter import CLUTTER_REMOVALS, ClutterRemoval, clutter_removal
from rtradar.process.detection.cfar import ca_cfar, os_cfar
from rtradar.process.detection.cfar_thresholds import ca_scale, os_scale
from rtradar.process.detection.clutter_map import ClutterMap, clutter_map_scale
from rtradar.process.detection.detectors import (
    DETECTORS,
    Detector,
    build_detector,
    register_detector,
)
from rtradar.process.frames import SlidingWindows
from rtradar.process.power_maps import power_map, range_time
from rtradar.process.sliding_range_time import SlidingRangeTime
from rtradar.process.spectra import RangeDoppler, range_doppler, range_spectrum
from rtradar.process.spectrogram import WINDOW_CYCLES as SPECTROGRAM_CYCLES
from rtradar.process.spectrogram import SlidingSpectrogram, Spectrogram, spectrogram, window_cycles
from rtradar.process.window_functions import WindowFunctions

__all__ = [
    "CLUTTER_REMOVALS",
    "DETECTORS",
    "SPECTROGRAM_CYCLES",
    "AngleSpectra",
    "ClutterMap",
    "ClutterRemoval",
    "Detector",
    "RangeDoppler",
    "SlidingRangeTime",
    "SlidingSpectrogram",
    "SlidingWindows",
    "Spectrogram",
    "WindowFunctions",
    "angle",
    "angle_grid",
    "angle_spectra",
    "build_detector",
    "ca_cfar",
    "ca_scale",
    "cell_spectra",
    "clutter_map_scale",
    "clutter_removal",
    "measured_angles",
    "measures_angle",
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
    "window_cycles",
]
