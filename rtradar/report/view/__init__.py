"""The linked view of a run: its data, its page and its stills."""
