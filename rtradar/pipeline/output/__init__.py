"""What a run leaves in its folder: maps, IF samples, the summary and the list of files."""
