"""Families of periodic orbits over a parameter, and where they change."""
