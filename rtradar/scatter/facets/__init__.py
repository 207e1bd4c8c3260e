"""Physical optics over triangles: surfaces, the integral over them, and their shadows."""
