"""The model as the user defines it: the graph of modes and transitions, variables, functions, checks."""
