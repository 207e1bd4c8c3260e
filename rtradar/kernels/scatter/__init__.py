"""Compiled loops of the echo models."""
