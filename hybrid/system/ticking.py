"""The numbers of all clocks of a system, as kernels get them at the start of a run."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybrid.errors import ArgumentError
from hybrid.system.clocks import fault_of, numbers_of, ticks_of
from hybrid.system.graph import HybridSystem
from hybrid.system.places import UnderWay


def put_ticks(
    system: HybridSystem, x: np.ndarray, parameters: np.ndarray, ticks: np.ndarray, rows: np.ndarray
) -> None:
    """Write the numbers of all clocks at a state and parameters, and the rows of schedules, into arrays.

    Rows are written of listed times alone. ArgumentError if a number cannot be.
    """
    # The numbers of tables are behind the parameters.
    own = parameters[: len(system.parameters)].tolist()
    view, p = system.variables.state_view(x), system.variables.parameter_view(own)
    for first, transition, moving in zip(system.first_tick, system.transitions, system.moving, strict=False):
        clock = transition.clock
        if clock is not None:
            numbers, row = ticks_of(clock, view, p)
            fault = fault_of(clock, numbers, bool(moving))
            if isinstance(clock, UnderWay) and not fault:
                _check_under_way(transition.name, clock, view, p)
            if fault:
                # In the order in which they were given.
                fault = fault_of(clock, tuple(map(float, numbers_of(clock, view, p))), bool(moving))
                owner = f"Transition {transition.name!r}: {clock.kind}"
                raise ArgumentError(f"{owner}: {fault} with these parameters.")
            ticks[first : first + len(numbers)] = numbers
            if row is not None:
                rows[first : first + len(numbers)] = row


def _check_under_way(name: str, clock: UnderWay, x: Any, p: Any) -> None:
    """ArgumentError unless a state may be that of a run with delays."""
    fault = clock.places.fault(x, p)
    if fault:
        raise ArgumentError(
            f"x0 cannot hold what transition {name!r} has under way: {fault}. Leave these components out of "
            "x0, so that nothing is under way, or give a state of a run, such as arc.x[-1]."
        )
