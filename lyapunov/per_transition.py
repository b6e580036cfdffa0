"""Exponents per jump of one transition: a ratio of two means along the same orbit."""

from __future__ import annotations

import attrs
import numpy as np

from hybrid import ArgumentError, HybridSystem, arguments
from hybrid.measures.averages import Array, standard_error_from_batches, taper_inflation
from hybrid.system.members import shared_name


@attrs.frozen(eq=False, repr=False)
class PerTransition:
    """Exponents per jump of a transition, which have no unit.

    Attributes
    ----------
    transition
        Name of the transition.
    exponents, standard_error
        ``(k,)``, as those of the spectrum, per jump instead of per unit time.
    time
        Mean time between two of its jumps.
    """

    transition: str
    exponents: np.ndarray
    standard_error: np.ndarray
    time: float

    def __repr__(self) -> str:
        pairs = zip(self.exponents, self.standard_error, strict=True)
        values = ", ".join(f"{value:.8g} +- {error:.1g}" for value, error in pairs)
        return f"<PerTransition [{values}] per jump of {self.transition!r}, one in a time of {self.time:.6g}>"


@attrs.frozen(eq=False)
class JumpRates:
    """Growth rates beside the rates at which transitions fire, on one orbit.

    ``means`` and the rows of ``batches (b, ...)`` hold the ``k`` growth rates, the other side of the sum
    rule, and the jumps of each transition per unit time: tapered means, and plain means of batches.
    """

    names: tuple[str, ...]
    part_of: tuple[str | None, ...]
    k: int
    means: Array
    batches: Array

    @classmethod
    def of(cls, system: HybridSystem, k: int, means: Array, batches: Array) -> JumpRates:
        """Those of the transitions of a system."""
        parts = tuple(each.part_of for each in system.transitions)
        return cls(system.transition_names, parts, k, means, batches)

    @property
    def shared(self) -> tuple[str, ...]:
        """By transition the name for those of all members of a repeat, or its own."""
        pairs = zip(self.names, self.part_of, strict=True)
        return tuple(shared_name(part_of or name) for name, part_of in pairs)

    def per(self, transition: str) -> PerTransition:
        r"""Exponents per jump of a transition, and its copies where it has been split or repeated.

        The ratio of the means, with the error of :math:`g - r n`: growth and number of jumps of an interval
        belong together (the error of a ratio to first order).
        """
        known = dict.fromkeys([*self.names, *filter(None, self.part_of), *self.shared])
        arguments.known("transition: Transition", transition, known, "Transitions")
        own = [transition in each for each in zip(self.names, self.part_of, self.shared, strict=True)]
        columns = self.k + 1 + np.flatnonzero(own)
        rate = float(self.means[columns].sum())
        if not rate > 0.0:
            raise ArgumentError(
                f"transition {transition!r} did not fire in the intervals of this spectrum, so there is no "
                "exponent per jump. Take more intervals, or another transition."
            )
        ratio = self.means[: self.k] / rate
        finite = np.where(np.isfinite(ratio), ratio, 0.0)
        apart = self.batches[:, : self.k] - finite * self.batches[:, columns].sum(axis=1, keepdims=True)
        error = standard_error_from_batches(apart) * taper_inflation() / rate
        return PerTransition(transition, ratio, error, 1.0 / rate)
