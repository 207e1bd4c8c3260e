"""A person in a room: image paths over walls, the interaction with walls, and the echoes over them."""
