"""Recurrences of Taylor coefficients, written from the expressions of a field."""
