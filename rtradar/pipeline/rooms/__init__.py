"""A run in a room: what of the room is modelled, whether the person stands in a wall, and the IF of clutter."""
