"""Compiled loops of the echo models, each with a reference in plain NumPy."""
