"""Arithmetic on numbers, vectors, polynomials and intervals, independent of any model."""
