"""Ray tracing: the choice of Mitsuba's backend, and what rays meet."""
