"""Compiled inner loops: they know NumPy, the compiler and each other, nothing of the model types."""
