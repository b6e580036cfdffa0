"""Attractors of a system, the starts that lead to them, and how both change with a parameter."""
