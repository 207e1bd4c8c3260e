"""Data sets of many recordings, radars, scenes and echo models, built on Dask and resumable.

To build one needs the extra ``campaign``.
"""

from rtradar.campaign.build import build_dataset, in_words
from rtradar.campaign.export import export_dataset
from rtradar.campaign.template import write_template

__all__ = ["build_dataset", "export_dataset", "in_words", "write_template"]
