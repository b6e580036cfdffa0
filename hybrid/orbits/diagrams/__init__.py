"""Whole diagrams: branches that bifurcations join, and those that sweeps show."""
