"""Ray tracing: the choice of Mitsuba's backend, and what rays meet. Nothing is imported until it is used."""
