"""From a Python function to an expression, and what can be proved of expressions."""
