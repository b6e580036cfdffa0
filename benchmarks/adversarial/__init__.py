"""Random guards and random instants against exact answers: what is missed, invented or doubled."""
