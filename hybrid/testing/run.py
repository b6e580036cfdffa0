"""The run of a case: what of a run properties can be judged on."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid.simulation.arc import HybridArc
from hybrid.simulation.jumps import Jump

# The run is repeated with tolerances looser by this factor, to estimate the error at its end.
LOOSER = 100.0

# A run is cut short after this many jumps: more jumps test nothing new.
MOST_JUMPS = 5

# What a jump is that is not judged.
WHY = {"grazing": "so shallow that the tolerances decide it", "limit": "the limit of a chatter"}


@attrs.frozen(eq=False)
class Run:
    """A run that properties can be judged on.

    Attributes
    ----------
    arc
        The run; all its jumps are transverse.
    t1
        End of the run, before any chatter, grazing or status that would end it.
    error
        Change of the end state with looser tolerances, ``(n,)``.
    scale
        Sizes of the components along the run, ``(n,)``, each in its own unit.
    cut
        Why the run ends before that of the case does; empty if it does not.

    Examples
    --------
    >>> import models
    >>> from hybrid.testing import Case
    >>> ball = models.bouncing_ball()
    >>> run = Case(ball, ball.parameters, "flight", (1.0, 0.0), 0.0, 0.6).run
    >>> len(run.arc.jumps), run.cut
    (1, '')
    """

    arc: HybridArc
    t1: float
    error: np.ndarray
    scale: np.ndarray
    cut: str = ""

    @property
    def tolerance(self) -> np.ndarray:
        """Largest allowed difference between the ends of two runs that should agree, ``(n,)``."""
        return 1e-9 * self.scale + LOOSER * self.error


def is_clean(arc: HybridArc) -> bool:
    """Whether a run reached its end with transverse jumps only."""
    return arc.status.ok and not arc.grazings and not np.any(arc.jumps.kind != "transverse")


def lasting(arc: HybridArc) -> np.ndarray:
    """Which rows of a run hold states in which it stays for some time.

    A jump may land where the next fires at once. Before the limit of a chatter the state is that of the last
    jump that was followed.
    """
    first = np.searchsorted(arc.j, arc.j, side="left")
    last = np.searchsorted(arc.j, arc.j, side="right") - 1
    lasts = (arc.t[last] > arc.t[first]) | (len(arc.jumps) == 0)
    limits = np.flatnonzero(arc.jumps.kind == "limit")
    lasts &= ~(np.isin(arc.j, limits) & (np.arange(len(arc.t)) == last))
    return np.asarray(lasts)


def before_trouble(arc: HybridArc) -> tuple[float, str]:
    """A time before the first grazing, chatter or failure, between two jumps, and which of them it is."""
    kinds = arc.jumps.kind
    bad = np.flatnonzero(kinds != "transverse")
    touched = min((grazing.t for grazing in arc.grazings), default=np.inf)
    first = int(bad[0]) if len(bad) else len(kinds)
    if len(bad) and arc.jumps.t[first] <= touched:
        end, why = float(arc.jumps.t[first]), f"{arc.jumps.transition[first]!s} is {WHY[str(kinds[first])]}"
    elif arc.grazings:
        end, why = touched, "a guard is grazed"
    else:
        end, why = float(arc.t[-1]), f"the run ends with {arc.status.code.name}"
    jumps = arc.jumps.t[:first]
    jumps = jumps[jumps < end]
    if len(jumps) > MOST_JUMPS:
        jumps, why = jumps[:MOST_JUMPS], f"it has more than {MOST_JUMPS} jumps"
    times = np.unique([arc.t[0], *jumps])
    if len(times) < 2:
        return float(0.5 * (times[0] + end)), why
    return float(0.5 * (times[-2] + times[-1])), why


def mode_after(jump: Jump) -> str:
    """The mode that a jump leads to; a judged run contains no jump that ends the run."""
    assert jump.target is not None
    return jump.target
