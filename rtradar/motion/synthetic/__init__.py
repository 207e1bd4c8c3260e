"""Synthetic actors: how they are built, and how they move."""
