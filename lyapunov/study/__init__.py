"""The study of the founding paper: `python -m lyapunov`."""
