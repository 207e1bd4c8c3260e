"""Static clutter of a room: walls, rough surfaces, furniture, and the shadow of a body in it."""
