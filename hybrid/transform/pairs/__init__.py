"""Pairs of quantities that are not negative and of which one is zero."""
