"""Time as whole forcing periods and a phase."""

from __future__ import annotations

from math import floor, frexp, ldexp, ulp

import numpy as np

from hybrid.errors import ArgumentError

# A time is known to this part of a forcing period, at least.
FINEST_PHASE = 2.0**-10


def check_time(name: str, t: float, period: float) -> None:
    """ArgumentError if the phase of ``t`` within the period, if there is one, is lost in rounding."""
    if period > 0.0 and not ulp(t) <= FINEST_PHASE * period:
        raise ArgumentError(
            f"{name} must be small enough to have a phase: floating-point numbers near {t} are {ulp(t):.2g} "
            f"apart, and the forcing period is {period:.6g}. Take whole periods off."
        )


def split_time(t: float, period: float) -> tuple[int, float]:
    """Time as whole periods and a phase in ``[0, period)``; without a period (0) all of it is phase."""
    if period <= 0.0:
        return 0, float(t)
    nearest = round(t / period)
    if t == nearest * period:
        # The product is rounded, so its quotient may lie a little below the whole number.
        return nearest, 0.0
    cycle = floor(t / period)
    phase = t - cycle * period
    return (cycle + 1, 0.0) if phase >= period else (cycle, max(phase, 0.0))


def time_at(cycle: np.ndarray, phase: np.ndarray, low: np.ndarray, period: float) -> np.ndarray:
    """Times of phases in two parts, rounded once: whole periods have more digits than a number."""
    # Each half of the digits of a period times a whole number is exact, or as good as that.
    mantissa, exponent = frexp(period)
    high = ldexp(float(np.float32(mantissa)), exponent)
    whole, rest = cycle * high, cycle * (period - high)
    total = whole + phase
    part = total - whole
    return total + ((whole - (total - part)) + (phase - part) + (rest + low))
