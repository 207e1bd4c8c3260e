"""Pictures and pages of results."""

from rtradar.report.angle_figures import draw_range_angle, draw_spatial_cloud
from rtradar.report.figures import draw_range_doppler, draw_range_time, draw_rdt_cloud
from rtradar.report.html import write_report
from rtradar.report.spectrogram_figure import draw_spectrogram

__all__ = [
    "draw_range_angle",
    "draw_range_doppler",
    "draw_range_time",
    "draw_rdt_cloud",
    "draw_spatial_cloud",
    "draw_spectrogram",
    "write_report",
]
