"""jitcode_lyap: SciPy's explicit methods straight through the contact, on C that it writes and compiles.

It takes its own derivatives, and C has none for a maximum. With a case distinction in its place ``dop853``
gives up at a tolerance of 1e-10; with a corner that is rounded off over a nanometre it does not.
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

# Those that its documentation names for small systems.
FORMULAS = ("dop853", "dopri5")
WIDTH = 1e-9


def methods(
    system: HybridSystem, x0: Sequence[float], t_end: float, intervals: int, width: float = WIDTH
) -> dict[str, Method]:
    """Of a system of one mode. The tangent vector is under the error control, and normalised each interval.

    In the place of ``max(z, 0)`` stands ``(z + sqrt(z**2 + width**2)) / 2``, in metres. A tenth of the run
    is left out at its beginning.
    """
    given = equations(system)
    symbols = {given.t: t, **{x: y(i) for i, x in enumerate(given.x)}}
    field = [_converted(e, symbols, width) for e in given.fields[0]]
    ends, left_out = np.linspace(0.0, t_end, intervals + 1), intervals // 10
    # Its own would be another one each time.
    vector = np.random.default_rng(13).normal(size=len(given.x))
    start = np.append(x0, vector / np.linalg.norm(vector))

    def with_formula(formula: str) -> Method:
        def at(rtol: float) -> Callable[[], Growth]:
            model = jitcode_lyap(field, n_lyap=1, verbose=False)
            # Its compilation reads the project of the folder that it runs in.
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
