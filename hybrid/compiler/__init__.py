"""From generated text to machine code, without numba's inference of types."""
