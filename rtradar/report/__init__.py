"""Pictures and pages of results."""

from rtradar.report.angle_figures import draw_range_angle, draw_spatial_cloud
from rtradar.report.figures import draw_range_doppler, draw_range_time, draw_rdt_cloud
from rtradar.report.html import write_report
from rtradar.report.room_figures import draw_before_after, draw_plan, draw_range_azimuth_with_walls
from rtradar.report.spectrogram_figure import draw_spectrogram

__all__ = [
    "draw_before_after",
    "draw_plan",
    "draw_range_angle",
    "draw_range_azimuth_with_walls",
    "draw_range_doppler",
    "draw_range_time",
    "draw_rdt_cloud",
    "draw_spatial_cloud",
    "draw_spectrogram",
    "write_report",
]
