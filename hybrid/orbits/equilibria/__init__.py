"""Equilibria of modes, their branches over a parameter, and the bifurcations on them."""
