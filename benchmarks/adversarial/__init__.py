"""Random guards and random instants compared with exact answers: events missed, invented or doubled."""
