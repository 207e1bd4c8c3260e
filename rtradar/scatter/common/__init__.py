"""Common parts of echo models: poses, keyframes, interpolation, and polarisation."""
