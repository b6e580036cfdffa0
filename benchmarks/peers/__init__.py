"""How others solve these problems, a file a package; each makes functions of the tolerance of a problem.

All are handed the same equations, traced from one model, in the form each of them compiles.
"""
