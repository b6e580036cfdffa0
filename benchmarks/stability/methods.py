"""The compared methods, their tolerances, and the conversion of a run into a point of a curve."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from benchmarks.peers.scipy_ivp import GivenUp, Outcome
from hybrid import DOP853, RadauIIA, Taylor, Tsit5
from hybrid.plot import COLOURS

# Relative and absolute tolerances of the two runs of each method.
TIGHT, LOOSE = {"rtol": 1e-10, "atol": 1e-12}, {"rtol": 1e-5, "atol": 1e-7}
OURS: dict[str, Any] = {
    f"{method.__name__}, {name}": method(**tolerances)
    for method in (Taylor, DOP853, Tsit5, RadauIIA)
    for name, tolerances in (("tight", TIGHT), ("loose", LOOSE))
}
EVENTS, STRAIGHT, SMOOTHED = "SciPy, events", "SciPy, straight", "SciPy, smoothed"
STRAIGHT_LOOSE = "SciPy, straight, loose"
IMPLICIT = "SciPy Radau, events"
WITHOUT_PERIOD = "DOP853, time not split"
SCIPY: dict[str, Any] = {"method": "DOP853", **TIGHT}
# Width of the smoothed step, in units of the state.
WIDTH = 1e-3
# Smaller errors are drawn at this value.
LEAST = 1e-17

LOOSELY = {"markerfacecolor": "white", "linestyle": "-."}
STYLES: dict[str, dict[str, Any]] = {
    "Taylor, tight": {"color": "0.1", "marker": "*"},
    "Taylor, loose": {"color": "0.1", "marker": "*", **LOOSELY},
    "DOP853, tight": {"color": COLOURS[0], "marker": "o"},
    "DOP853, loose": {"color": COLOURS[0], "marker": "o", **LOOSELY},
    "Tsit5, tight": {"color": COLOURS[2], "marker": "s"},
    "Tsit5, loose": {"color": COLOURS[2], "marker": "s", **LOOSELY},
    "RadauIIA, tight": {"color": COLOURS[5], "marker": "D"},
    "RadauIIA, loose": {"color": COLOURS[5], "marker": "D", **LOOSELY},
    WITHOUT_PERIOD: {"color": COLOURS[0], "linestyle": ":"},
    EVENTS: {"color": COLOURS[1], "marker": "^", "linestyle": "--"},
    STRAIGHT: {"color": COLOURS[3], "marker": "v", "linestyle": "--"},
    STRAIGHT_LOOSE: {"color": COLOURS[3], "marker": "v", "markerfacecolor": "white", "linestyle": ":"},
    SMOOTHED: {"color": COLOURS[4], "marker": "x", "linestyle": "--"},
    IMPLICIT: {"color": COLOURS[6], "marker": "+", "linestyle": "--"},
}
Curves = dict[str, list[tuple[float, float]]]


def measure(
    curves: Curves,
    name: str,
    at: float,
    distance: Callable[[np.ndarray], float],
    run: Any,
    *arguments: Any,
    **options: Any,
) -> None:
    """Add the error at the end of a run as a point; nan if the run was aborted or failed."""
    try:
        result = run(*arguments, **options)
        x = result.x if isinstance(result, Outcome) else result.x[-1]
        done = isinstance(result, Outcome) or result.status.ok
        value = max(distance(x), LEAST) if done else math.nan
    except (GivenUp, ValueError, StopIteration):
        value = math.nan
    curves.setdefault(name, []).append((at, value))
