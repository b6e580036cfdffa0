"""Where methods fail: errors and miscounted events of this library and of common uses of SciPy."""
