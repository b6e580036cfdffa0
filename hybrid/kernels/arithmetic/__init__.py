"""Arithmetic on numbers, vectors, polynomials and intervals, which knows nothing of a model."""
