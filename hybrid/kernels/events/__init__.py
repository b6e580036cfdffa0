"""Where guards cross zero on a step, and on which side of each guard a state is."""
