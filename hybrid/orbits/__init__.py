"""Periodic orbits and sections."""
