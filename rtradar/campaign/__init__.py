"""Data sets of many recordings, radars, scenes and echo models, built on Dask and resumable.

The package needs the extra ``campaign``.
"""

from rtradar.campaign.build import build_dataset, in_words

__all__ = ["build_dataset", "in_words"]
