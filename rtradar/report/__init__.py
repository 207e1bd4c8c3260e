"""Pictures and pages of results."""

from rtradar.report.figures.maps import (
    draw_range_angle,
    draw_range_doppler,
    draw_range_time,
    draw_rdt_cloud,
    draw_spatial_cloud,
    draw_spectrogram,
)
from rtradar.report.figures.rooms import draw_before_after, draw_plan, draw_range_azimuth_with_walls
from rtradar.report.pages.run_page import write_report

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
