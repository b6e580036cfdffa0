"""How far a run is off, and what an accuracy costs."""
