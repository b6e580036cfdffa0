"""Compiled inner loops: numba only, one arrow inwards, nothing of the model types."""
