"""GNU Octave's ode23s straight through the discontinuity, timed by Octave itself."""

from __future__ import annotations

import functools
import shutil
import subprocess
import tempfile
from collections.abc import Callable

import numpy as np
import sympy

from benchmarks.peers.problem import ATOL_OVER_RTOL, Problem, equations
from hybrid import Answer

PATIENCE = 20.0
# The first call loads the solver; the answer is the median of the other three.
SCRIPT = """
f = @(t, x) [{field}];
o = odeset("RelTol", {rtol!r}, "AbsTol", {atol!r});
for k = 1:4, c = cputime; [t, x] = ode23s(f, [{t0!r}, {t1!r}], [{x0}], o); s(k) = cputime - c;
if s(k) > 1, break, end, end
printf("%.17g ", x(end, :)); printf("\\n%d\\n%.9g\\n", numel(t) - 1, median(s(min(2, end):end)));
"""


def methods(problem: Problem) -> dict[str, Callable[[float], Answer]]:
    """One Octave process per tolerance; it repeats and times the run itself, excluding its start."""
    if shutil.which("octave") is None:
        raise ImportError("GNU Octave is not on the path")
    if problem.straight is None:
        return {}
    given = equations(problem.straight)
    names = {s: sympy.Symbol(f"x({i + 1})") for i, s in enumerate(given.x)}
    field = "; ".join(sympy.octave_code(e.xreplace(names)) for e in given.fields[0])

    @functools.cache
    def run(rtol: float) -> Answer:
        script = SCRIPT.format(
            field=field.replace("\n", " ").replace("...", " "),
            rtol=rtol,
            atol=rtol * ATOL_OVER_RTOL,
            t0=problem.t_span[0],
            t1=problem.t_span[1],
            x0=" ".join(map(repr, problem.straight_start.tolist())),
        )
        done = subprocess.run(
            ["octave", "--no-gui", "--quiet", "--eval", script],
            capture_output=True,
            text=True,
            check=True,
            timeout=PATIENCE,
            # Octave saves its workspace here if it is interrupted.
            cwd=tempfile.gettempdir(),
        )
        state, steps, seconds = done.stdout.strip().splitlines()
        return problem.straight_answer(
            np.array(state.split(), dtype=float), steps=int(steps), seconds=float(seconds)
        )

    return {"Octave ode23s, through": run}


def version() -> str:
    """The version that Octave reports."""
    done = subprocess.run(["octave", "--version"], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[0].removeprefix("GNU Octave, version ")
