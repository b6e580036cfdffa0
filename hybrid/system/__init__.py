"""What a user writes down: the graph of modes and transitions, its variables, functions and checks."""
