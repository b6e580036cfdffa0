"""The one door to numba and llvmlite: only modules in this folder use parts of them that may change.

Anywhere else code keeps to ``numba``, ``numba.types``, ``numba.extending``, ``llvmlite.ir`` and
``llvmlite.binding``. A new release of numba may break what is here, so the versions are capped in
pyproject.toml: above the tested ones, the next minor release is tried in this folder first.
"""
