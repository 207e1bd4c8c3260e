"""Data sets: many recordings x radars x scenes x fidelities, made on Dask, resumed at any time (extra: campaign)."""
