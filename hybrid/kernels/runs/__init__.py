"""Whole runs: from one start to the next, without leaving the compiled code."""
