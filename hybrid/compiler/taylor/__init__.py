"""Recurrences of Taylor coefficients, generated from the expressions of a vector field."""
