"""How long kernels run before Python asks whether to stop, and the status of what was stopped."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any

from hybrid.kernels.types import codes
from hybrid.status import Status, StatusCode

# Steps of the first burst, which takes less than a millisecond for most models, and how long later ones take:
# a step may become ten times slower from one burst to the next, where numbers leave the normal range.
FIRST_BURST = 256
SECONDS = 0.02


class Bursts:
    """How many steps kernels may take before Python asks whether to stop: 20 ms of them.

    Where a burst ends has no influence on what is computed.

    Parameters
    ----------
    runs
        The trajectories that the kernel takes further; the first one has the limit of steps and the stop.
    """

    def __init__(self, runs: Sequence[Any]) -> None:
        self.runs, self.stop, self.limit = runs, runs[0].stop, runs[0].max_steps
        self.steps = FIRST_BURST
        self.begin = perf_counter()

    def most(self) -> int:
        """Limit of steps for the burst that begins now, counted from the start of the first run."""
        self.begin = perf_counter()
        return min(self.limit, self.runs[0].steps + self.steps)

    def judged(self, code: int) -> int:
        """The code of a kernel: GO_ON if only the burst has ended, INTERRUPTED if the run is to stop."""
        seconds = perf_counter() - self.begin
        ended = code == codes.MAX_STEPS and all(run.steps < self.limit for run in self.runs)
        # A kernel that has done its work before the end of the burst does not tell how long a burst takes.
        if ended and seconds < SECONDS:
            self.steps *= 2
        elif seconds > 2 * SECONDS:
            self.steps = max(1, int(self.steps * SECONDS / seconds))
        if code != codes.DONE and not ended:
            return code
        if self.stop.is_set():
            return StatusCode.INTERRUPTED
        return codes.GO_ON if ended else code


def interrupted_status(what: str) -> Status:
    """Status of a result that Ctrl-C has cut short; ``what`` it holds."""
    return Status(
        StatusCode.INTERRUPTED, f"Interrupted; the result holds {what}.", "Call again for the whole of it."
    )
