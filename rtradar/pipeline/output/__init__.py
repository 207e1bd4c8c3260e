"""What a run gives: maps, pictures, snapshots of the view, findings of a room, and a summary."""
