"""Constructions of hybrid systems from simpler descriptions."""
