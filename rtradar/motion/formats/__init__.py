"""Readers of motion files, one module for each format."""
