"""Data sets: many recordings x radars x scenes x fidelities, made on Dask, resumed at any time (extra: campaign)."""

from rtradar.campaign.build import build_dataset
from rtradar.campaign.words import in_words

__all__ = ["build_dataset", "in_words"]
