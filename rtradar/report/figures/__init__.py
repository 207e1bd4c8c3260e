"""Pictures of maps, clouds, rooms and classifiers as PNG files."""
