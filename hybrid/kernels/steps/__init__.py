"""One step of each method, its step control and its dense output."""
