"""jitcode_lyap: SciPy's explicit methods across the contact, on generated and compiled C code.

jitcode_lyap computes derivatives itself and has none for a maximum. With a case distinction in place of the
maximum, ``dop853`` fails at a tolerance of 1e-10. With a corner smoothed over a nanometre it succeeds.
"""

from __future__ import annotations

import contextlib
import shutil
import tempfile
from collections.abc import Callable, Sequence

import numpy as np
import symengine
import sympy
from jitcode import jitcode, jitcode_lyap, t, y

from benchmarks.peers.growth import Growth, Method
from benchmarks.peers.problem import ATOL_OVER_RTOL, equations
from hybrid import HybridSystem

if not (shutil.which("gcc") or shutil.which("cc")):
    raise ImportError("a C compiler is not on the path")

# Methods that the documentation of jitcode recommends for small systems.
FORMULAS = ("dop853", "dopri5")
WIDTH = 1e-9


def methods(
    system: HybridSystem, x0: Sequence[float], t_end: float, intervals: int, width: float = WIDTH
) -> dict[str, Method]:
    """Methods for a system with one mode; the error control includes the tangent vector.

    The vector is normalised after each interval. ``(z + sqrt(z**2 + width**2)) / 2``, in metres, replaces
    ``max(z, 0)``. The first tenth of the run is excluded.
    """
    given = equations(system)
    symbols = {given.t: t, **{x: y(i) for i, x in enumerate(given.x)}}
    field = [_converted(e, symbols, width) for e in given.fields[0]]
    ends, left_out = np.linspace(0.0, t_end, intervals + 1), intervals // 10
    # A fixed vector, because jitcode draws a new one each time.
    vector = np.random.default_rng(13).normal(size=len(given.x))
    start = np.append(x0, vector / np.linalg.norm(vector))

    def with_formula(formula: str) -> Method:
        def at(rtol: float) -> Callable[[], Growth]:
            model = jitcode_lyap(field, n_lyap=1, verbose=False)
            # Compile in an empty folder, because the compilation reads the project file of its folder.
            with tempfile.TemporaryDirectory() as elsewhere, contextlib.chdir(elsewhere):
                model.compile_C()
            model.set_integrator(formula, rtol=rtol, atol=rtol * ATOL_OVER_RTOL)

            def run() -> Growth:
                jitcode.set_initial_value(model, start, 0.0)
                rates = [model.integrate(end)[1][0] for end in ends[1:]]
                mean = float(np.mean(rates[left_out:]))
                return Growth(vector, left_out, mean, mean)

            return run

        return at

    return {f"jitcode_lyap {formula}": with_formula(formula) for formula in FORMULAS}


def _converted(expression: sympy.Expr, symbols: dict[sympy.Symbol, object], width: float) -> object:
    z = sympy.Wild("z")
    rounded = expression.replace(sympy.Max(0, z), lambda z: (z + sympy.sqrt(z**2 + width**2)) / 2)
    return symengine.sympify(rounded).subs({symengine.sympify(s): own for s, own in symbols.items()})
