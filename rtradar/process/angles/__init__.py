"""Directions of echoes: spectra over angle, their peaks, and maps over range and angle."""
