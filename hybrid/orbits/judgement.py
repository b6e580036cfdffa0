"""The judgement on the last shot of a search: a periodic orbit, one of many, or none, and why."""

from __future__ import annotations

from collections.abc import Callable

import attrs
import numpy as np

from hybrid.orbits.newton import ROUNDING_OF_GAP, Newton, Point, Shot, length
from hybrid.orbits.rest import EPSILON
from hybrid.solvers import Solver
from hybrid.status import Status, StatusCode, noting

# An autonomous orbit moves by more than this many times the accepted rounding.
LEAST_MOTION = 1e3
# Share of its states by which a point that hardly moves may still be wrong.
POINT_ERROR = 1e-8
# Where Newton's method cannot tell which of many orbits it is at, that is one only if it closes up to this
# share of its motion, is at most so many times larger than the solution through the guess, and the last step
# moved it by less than a share of its motion.
DRIFT = 1e-3
FARTHEST = 1e3
SETTLED = 0.1
# And it closes better the tighter the tolerances are: by this factor, where they are tighter by its square.
TIGHTER = 10.0
# Directions in which the matrix of Newton's method is smaller than this share of its size may be those of a
# family of orbits.
NEARLY_SINGULAR = 1e-5
# A multiplier may be 1 if it is this near: of a double one that is the root of its error.
NEAR_ONE = 1e-3
FAMILY = "The orbit is one of a family"
# What helps a search that found no orbit.
START_NEARER = "Start nearer to the orbit: simulate first if it is stable."
MORE_ITERATIONS = (
    "Start nearer to the orbit (simulate first if it is stable), or raise max_iterations; if states are "
    "small, give a solver= with a lower atol."
)
NAME_THE_MODE = (
    "Start in the mode that the orbit is in at this time: name it with mode=, or simulate first and start "
    "from the end of that run, with its mode."
)
START_IN_THE_RUN = (
    "Simulate first, and start from the end of that run, arc.x[-1] with mode=arc.end.mode: it holds what is "
    "under way."
)
HOLD_IT = (
    "If the system conserves a quantity, declare it with HybridSystem(laws=Laws(conserved=...)): the search "
    "then holds the value that it has at the guess."
)


@attrs.frozen(eq=False)
class Judgement:
    """What the last shot of Newton's method is, after so many ``iterations`` and with so much ``tolerance``.

    ``finer`` shoots from a point in the mode of the shot with tolerances that are tighter by the square of
    ``TIGHTER``.
    """

    shot: Shot
    newton: Newton
    iterations: int
    tolerance: float
    solver: Solver
    finer: Callable[[Point], Shot]

    @property
    def status(self) -> Status:
        """How Newton's method ended: with an orbit, or why there is none."""
        if not self.shot.reached:
            return self.shot.status
        objection = self._objection()
        if objection is None:
            # With what the run along the orbit has to say of its crossings and its tangent vectors.
            return self.shot.status
        reason, remedy = objection
        return Status(StatusCode.NOT_CONVERGED, f"Newton's method did not converge: {reason}.", remedy)

    def explained(self, status: Status, multipliers: np.ndarray, held: str) -> Status:
        """The status of an orbit, with what is ``held``, and whether the orbit is still one of many."""
        told = [f"Held as at the guess: {held}."] if held else []
        if self._is_one_of_many(multipliers):
            besides = " besides that of the flow" if self.newton.free_period else ""
            told.append(f"{FAMILY}: a multiplier is 1{besides}, and the guess decides which one is found.")
            remedy = f"{status.remedy} {HOLD_IT}".strip()
            status = attrs.evolve(status, remedy=remedy)
        return noting(status, *told)

    def _is_one_of_many(self, multipliers: np.ndarray) -> bool:
        """Whether a direction of the start is free, beside that along an autonomous orbit.

        A small singular value alone may come from an instability, and a multiplier near 1 from a fold.
        """
        shot, newton = self.shot, self.newton
        ones = int(np.sum(np.abs(multipliers - 1.0) <= NEAR_ONE)) - int(np.sum(shot.cyclic))
        if ones <= newton.free_period or not newton.nearly_singular(shot, NEARLY_SINGULAR):
            return False
        change, longer = newton.step(shot, NEARLY_SINGULAR)
        moved = attrs.evolve(shot.point, x=shot.point.x + change, period=shot.point.period + longer)
        finer = self.finer(moved)
        return finer.whole and newton.free_directions(shot, finer)

    def _objection(self) -> tuple[str, str] | None:
        """Why the last shot is no periodic orbit, and what helps; None if it is one.

        The ends agree; the orbit moves, if nothing but its motion has a period; and what is left of Newton's
        step is small. At infinity, or where a solution drifts, the ends may agree and that step is large. It
        is arbitrary where orbits come in families: then the orbit has to be near to the guess, the method has
        to have settled at it, and the solver's error alone may keep it from closing.
        """
        shot, newton, tolerance = self.shot, self.newton, self.tolerance
        if shot.end_mode != shot.mode:
            return f"the orbit ends in mode {shot.end_mode!r} and starts in {shot.mode!r}", NAME_THE_MODE
        if shot.more_waits:
            return "more, or fewer, delays are under way at its end than at its start", START_IN_THE_RUN
        if not shot.whole or not newton.measurable(shot):
            return "the tangent vectors left the range of numbers", START_NEARER
        growth = shot.growth(newton.scale)
        if not growth * EPSILON < 1.0:
            told = (
                f"errors of the start grow by a factor of {growth:.3g} over the period, so no digit is left"
            )
            return told, START_NEARER
        ends = np.abs([newton.anchor, shot.point.x, shot.end]).max()
        # The ends of a larger orbit may be zero to rounding, which its gap is known against.
        if 0.0 < ends <= self.solver.atol and tolerance * shot.at_steps <= self.solver.atol:
            told = (
                f"all states are below the atol of the solver, {self.solver.atol:.3g}, and so not controlled"
            )
            return told, "Give a solver= with a lower atol, or write the model in other units."
        # A component that is throughout below the solver's absolute tolerance, or below what the rounding of
        # the others makes of it, counts as zero.
        zero = np.maximum(self.solver.atol, shot.rounding)
        nothing = np.where(shot.magnitude <= zero, zero, 0.0)
        if not shot.closes(tolerance, shot.rounding, nothing):
            return (
                f"the residual is {length(shot.gap):.3g} after {self.iterations} iterations",
                MORE_ITERATIONS,
            )
        noise = np.maximum(ROUNDING_OF_GAP * EPSILON * shot.magnitude, nothing)
        if newton.free_period and not np.any(shot.extent > LEAST_MOTION * noise):
            told = f"it led to an equilibrium: the state moves by {shot.extent.max():.3g} in all"
            return told, "Start farther from the equilibrium: simulate first if the orbit is stable."
        step, _ = newton.step(shot)
        enough = np.maximum(np.sqrt(tolerance) * shot.extent, POINT_ERROR * shot.magnitude)
        if newton.led_astray(shot, FARTHEST):
            told = "it went far along a direction in which the ends do not tell where an orbit is"
            return told, START_NEARER
        if np.all(np.abs(step) <= np.maximum(enough, nothing)):
            return None
        near = np.all((shot.extent <= FARTHEST * newton.first) & (np.abs(shot.gap) <= DRIFT * shot.extent))
        sizes = np.where(shot.extent > noise, shot.extent, shot.magnitude)
        settled = np.all(np.abs(newton.moved) <= np.maximum(SETTLED * sizes, noise))
        if near and settled and not self._drifts():
            return None
        told = (
            f"the ends agree to {length(shot.gap):.3g}, but the next step would move the start by "
            f"{length(step):.3g}: the solution drifts, or no orbit is near"
        )
        return told, START_NEARER

    def _drifts(self) -> bool:
        """Whether the part of the gap that no step removes is more than the error of the solver.

        A solution that drifts does so at any tolerance.
        """
        shot, newton = self.shot, self.newton
        finer = self.finer(shot.point)
        if not finer.whole:
            return True
        rough, drift = (newton.drift(shot, each, np.sqrt(self.tolerance)) for each in (shot, finer))
        noise = np.maximum(np.abs(rough - drift) / TIGHTER, shot.rounding[:, None])
        return bool(np.any(np.abs(drift) > noise))
