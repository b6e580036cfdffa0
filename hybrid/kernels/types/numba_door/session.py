"""Numba in this process: how it is imported, and who is asked between two of its passes."""

from numba.core import config
from numba.core.event import Listener, install_listener
from numba.core.registry import cpu_target

# Numba's event at the begin and at the end of each of its passes.
PASS = "numba:run_pass"


def import_array_functions():
    """Import numba's array functions without SciPy's linear algebra, which kernels do not need.

    On import, the array functions look for SciPy's BLAS, which takes a fifth of a second. BLAS is available,
    since this package requires SciPy; functions that call BLAS look for it again.
    """
    from numba.np import linalg

    look = linalg.ensure_blas
    linalg.ensure_blas = lambda: None
    try:
        from numba.np import arraymath
    finally:
        linalg.ensure_blas = look
    vars(arraymath)["ensure_blas"] = look


def choose_processor(name, features):
    """Let numba compile for a processor; false if it has compiled for another one before."""
    chosen = vars(config)
    if name != chosen["CPU_NAME"] and "_toplevel_target_context" in vars(cpu_target):
        return False
    chosen["CPU_NAME"], chosen["CPU_FEATURES"] = name, features
    return True


class _Asking(Listener):
    def __init__(self, ask):
        self._ask = ask

    def on_start(self, event):
        self._ask()

    on_end = on_start


def between_passes(ask):
    """Within this block ``ask()`` is called before and after each pass of numba."""
    return install_listener(PASS, _Asking(ask))
