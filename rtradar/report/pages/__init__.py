"""Pages in one file each, which open without a network."""
