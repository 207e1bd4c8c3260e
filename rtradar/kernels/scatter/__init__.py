"""Compiled loops of the echo models: lines of sight, Fresnel zones, footprints."""
