"""Where guards cross zero on a step, and on which side of them a state is."""
