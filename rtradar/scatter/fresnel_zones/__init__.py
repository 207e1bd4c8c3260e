"""Fresnel zones on an ellipsoid, and which fraction of them is visible past occluders."""
