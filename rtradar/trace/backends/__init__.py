"""Mitsuba's backends: which there are, whether they work, and their libLLVM."""
