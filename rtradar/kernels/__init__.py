"""Compiled loops: how functions are compiled and kept on disk, and small ones that others share."""
