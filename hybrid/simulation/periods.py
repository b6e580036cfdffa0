"""Time as whole forcing periods and a phase."""

from __future__ import annotations

from math import floor, ulp

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
