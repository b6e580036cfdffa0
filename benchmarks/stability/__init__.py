"""Where methods go wrong: measured errors and miscounted events, here and with SciPy as it is used today."""
