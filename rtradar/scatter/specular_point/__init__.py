"""Specular points of ellipsoids: where they are, and which of them are visible."""
