"""Solutions of the problems with other packages, one file per package; each returns functions of a tolerance.

All packages receive the same equations, traced from one model, in the form that they compile.
"""
