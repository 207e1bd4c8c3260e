"""What several echo models share: poses of a chirp, interpolation over the array, polarisation and materials."""
