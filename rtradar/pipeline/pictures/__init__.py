"""Pictures of a run, and the snapshots that the linked view shows."""
