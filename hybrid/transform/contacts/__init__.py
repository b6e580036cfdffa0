"""Mechanical systems with unilateral contacts and dry friction, from gaps and masses."""
