"""A short stretch of a run around one jump, along which saltation matrices are checked by differences."""

from __future__ import annotations

import numpy as np

from hybrid.simulation.holding import tangent_projection
from hybrid.simulation.jumps import Jump
from hybrid.system.functions import field_function, guard_function
from hybrid.testing.case import Case
from hybrid.testing.errors import discard
from hybrid.testing.run import mode_after

# Displacements of the finite differences, relative to the size of the state.
STEP = 1e-4


class Window:
    """The time window around one jump, or several jumps at one instant, for differences of the flow."""

    def __init__(self, case: Case, jump: Jump) -> None:
        self.case, self.run = case, case.run
        self.jumps = [other for other in self.run.arc.jumps if other.t == jump.t]
        self.jump, self.last = self.jumps[0], self.jumps[-1]
        self.scale = self.run.scale[: case.system.tangent_dimension]
        times = np.array([case.t0, *self.run.arc.jumps.t, self.run.t1])
        before, after = jump.t - times[self.jump.j], times[self.last.j + 2] - jump.t
        if not min(before, after) > 1e-6 * case.duration:
            discard("events follow one another too closely")
        rates = [
            np.abs(field_slope(case, mode, jump.t, x))
            for mode, x in ((self.jump.source, self.jump.x_minus), (mode_after(self.last), self.last.x_plus))
        ]
        scale = self.scale
        fastest = max(float(np.max(np.sum(rate * scale / scale[:, None], axis=1))) for rate in rates)
        longest = min(0.5 * before, 0.5 * after)
        self.width = min(longest, 0.2 / fastest) if fastest > 0 else longest
        self.begin, self.end = jump.t - self.width, jump.t + self.width
        self.start = self.run.arc(self.begin)

    def differences(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivative of the end state by the start state, and the tolerance of its scaled form."""
        scale, jump = self.scale, self.jump
        slope = np.abs(guard_slope(self.case, jump))
        # The displaced runs must also cross the guard inside the window.
        shift = slope * scale / abs(jump.transversality)
        step = min(STEP, 0.1 * self.width / float(shift.max())) if shift.any() else STEP
        if step < 1e-7:
            discard("the guard is crossed too slowly for finite differences")
        coarse, fine = (self._central(h) for h in (step, 0.5 * step))
        spread = np.abs(self.scaled(fine - coarse))
        size = 1.0 + np.abs(self.scaled(fine)).max()
        noise = 20.0 * (self.case.solver.rtol + 1e-13) / step
        tolerance = 2.0 * spread + (noise + 1e-7) * size
        if not tolerance.max() <= 1e-2 * size:
            discard("the finite differences do not converge near a grazing")
        return (4.0 * fine - coarse) / 3.0 @ self._within(), tolerance

    def _within(self) -> np.ndarray:
        """The directions in which a state may be displaced: what its mode holds stays zero."""
        case, mode = self.case, self.case.mode_of(self.jump.source)
        if mode.holds is None:
            return np.eye(len(self.scale))
        return tangent_projection(case.system, mode, self.begin, self.start, case.values)

    def _central(self, step: float) -> np.ndarray:
        columns = []
        for i, h in enumerate(step * self.scale):
            displacement = np.zeros_like(self.start)
            displacement[i] = h
            columns.append(
                (self._flow(self.start + displacement) - self._flow(self.start - displacement)) / (2 * h)
            )
        return np.column_stack(columns)

    def _flow(self, x: np.ndarray) -> np.ndarray:
        arc = self.case.simulate(self.end, start=(self.begin, x, self.jump.source))
        if not arc.status.ok or [jump.transition for jump in arc.jumps] != [
            jump.transition for jump in self.jumps
        ]:
            discard("a displaced run has other events")
        return np.asarray(arc.x[-1, : len(self.scale)])

    def fundamental(self) -> np.ndarray:
        """Tangent map of a run across the event."""
        arc = self.case.simulate(self.end, start=(self.begin, self.start, self.jump.source), tangent=True)
        assert arc.fundamental is not None
        return arc.fundamental

    def through(self, xi: np.ndarray) -> np.ndarray:
        """The matrix ``xi`` between the tangent maps up to just before the jump and from just after it."""
        case, jump, last = self.case, self.jump, self.last
        gap = 1e-6 * self.width
        before = case.simulate(jump.t - gap, start=(self.begin, self.start, jump.source), tangent=True)
        after = case.simulate(self.end, start=(last.t, last.x_plus, mode_after(last)), tangent=True)
        rest = np.eye(len(self.scale)) + gap * field_slope(case, jump.source, jump.t, jump.x_minus)
        assert before.fundamental is not None
        assert after.fundamental is not None
        return np.asarray(after.fundamental @ xi @ rest @ before.fundamental)

    def product(self) -> np.ndarray:
        """Product of the saltation matrices of all jumps at the instant."""
        product = self.jump.saltation
        for jump in self.jumps[1:]:
            product = jump.saltation @ product
        return product

    def invertible(self) -> bool:
        """Whether all matrices but the last can be inverted, so that the product must be the tangent map."""
        conditions = [np.linalg.cond(self.scaled(jump.saltation)) for jump in self.jumps[:-1]]
        return all(condition < 1e6 for condition in conditions)

    def scaled(self, matrix: np.ndarray) -> np.ndarray:
        """A map between states, in units of the sizes of the components."""
        return np.asarray(matrix * self.scale / self.scale[:, None])


def guard_slope(case: Case, jump: Jump) -> np.ndarray:
    """The derivative ``(k,)`` of the guard by the state before a jump."""
    function = guard_function(case.transition(jump))
    return case.slope(function, jump.transition, jump.t, jump.x_minus)[0, : case.system.tangent_dimension]


def field_slope(case: Case, mode: str, t: float, x: np.ndarray) -> np.ndarray:
    """The derivative ``(k, k)`` of the field of a mode."""
    function = field_function(case.mode_of(mode), case.system.variables)
    k = case.system.tangent_dimension
    return case.slope(function, mode, t, x)[:k, :k]
