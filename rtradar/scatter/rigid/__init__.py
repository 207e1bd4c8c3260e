"""Rigid objects that move: their facets, legs, and bounces on sheets."""
