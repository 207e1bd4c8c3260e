"""From IF samples to range-Doppler maps and their detections."""

from rtradar.process.cfar import ca_cfar, os_cfar
from rtradar.process.cfar_law import ca_scale, os_scale
from rtradar.process.spectra import RangeDoppler, power_map, range_doppler, range_spectrum
from rtradar.process.windows import SlidingWindows

__all__ = [
    "RangeDoppler",
    "SlidingWindows",
    "ca_cfar",
    "ca_scale",
    "os_cfar",
    "os_scale",
    "power_map",
    "range_doppler",
    "range_spectrum",
]
