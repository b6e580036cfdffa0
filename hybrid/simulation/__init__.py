"""One run: its memory, its plan, the trajectory that is advanced, and the arc that comes of it."""
