"""Pictures of results."""

from rtradar.report.figures import draw_range_doppler, draw_range_time, draw_rdt_cloud

__all__ = ["draw_range_doppler", "draw_range_time", "draw_rdt_cloud"]
