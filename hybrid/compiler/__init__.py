"""From expressions to machine code: trace, differentiate, choose propagators, write, load."""
