"""Where a period begins and ends, if the orbit jumps there.

A run that starts on a guard jumps at once, and a jump at the end of a run belongs to the run. Over a period,
that would be one jump too many.
"""

from __future__ import annotations

import math

from hybrid.kernels.types import codes
from hybrid.simulation.trajectory import Trajectory
from hybrid.status import StatusCode

# Units in the last place by which the end of a period may miss the jumps there.
ROUNDING_OF_TIME = 16


def jumps_at_once(trajectory: Trajectory) -> bool:
    """Whether a run makes a jump where it starts; it is advanced up to that jump.

    The jumps at the end of a period are then those of its start, and belong to the next period.
    """
    run = trajectory.run
    code = trajectory.advance_to(int(run.cycle), float(run.phase), trajectory.no_record(), max_jumps=0)
    return code == codes.MAX_JUMPS


def same_time(one: float, other: float, period: float) -> bool:
    """Whether two times are the same up to rounding; they hold whole forcing periods, if there are any."""
    return abs(one - other) <= ROUNDING_OF_TIME * math.ulp(max(abs(other), period))


def advance_to_close(trajectory: Trajectory, cycle: int, phase: float) -> int:
    """Advance a run from its start to the end of a period, without the jumps there if it made them before.

    The end is given by whole forcing periods and a phase. Returns the code of the run.
    """
    record, period = trajectory.no_record(), trajectory.model.period
    if not jumps_at_once(trajectory):
        return trajectory.advance_to(cycle, phase, record)
    code = codes.MAX_JUMPS
    while code == codes.MAX_JUMPS:
        if trajectory.stop.is_set():
            return StatusCode.INTERRUPTED
        code = trajectory.advance_to(cycle, phase, record, max_jumps=trajectory.jumps + 1)
        if code == codes.MAX_JUMPS and same_time(trajectory.t, cycle * period + phase, period):
            return codes.DONE
    return code
