"""Conversion of Python functions to expressions, and properties proved from expressions."""
