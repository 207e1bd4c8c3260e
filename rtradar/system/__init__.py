"""Files, output folders, threads, seeds, names in registries, and checks of input."""
