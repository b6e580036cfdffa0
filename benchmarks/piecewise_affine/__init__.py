"""Runs of random piecewise-affine fields by `hybrid.split`, compared with an independent event loop."""
