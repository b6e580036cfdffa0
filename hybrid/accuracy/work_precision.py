"""Work and precision: how long methods take for the error that they make, against an answer known better."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence

import attrs
import numpy as np
from numpy.typing import ArrayLike

from hybrid import arguments
from hybrid.accuracy.answer import QUANTITIES, Answer, as_answer, errors_of, rounding_of
from hybrid.accuracy.measured import Method, check_clock, measured, own_answer, runner
from hybrid.display.tables import table
from hybrid.errors import ArgumentError
from hybrid.simulation.arc import HybridArc
from hybrid.solvers import DOP853, Solver, Taylor, Tsit5
from hybrid.status import StatusCode
from hybrid.system.graph import HybridSystem, as_system, check_mode

TOLERANCES = (1e-4, 1e-6, 1e-8, 1e-10, 1e-12)
METHODS: Mapping[str, Solver] = {"Taylor": Taylor(), "DOP853": DOP853(), "Tsit5": Tsit5()}
# The default reference, and the run of another method from which the error of the reference is estimated.
REFERENCE = Taylor(rtol=1e-14, atol=1e-16)
CHECK = DOP853(rtol=1e-13, atol=1e-15)


@attrs.frozen(eq=False, repr=False)
class WorkPrecision:
    """Errors and times of several methods, one row per method and tolerance; ``print`` shows a table.

    Attributes
    ----------
    method, tolerance
        Names and tolerances, ``(rows,)``.
    error
        Columns ``(rows,)`` by quantity. For the ``state``, the event ``times`` and the ``exponents``: the
        largest difference of a component, infinite if the numbers of events differ. For the ``saltation``
        matrices and the ``fundamental`` matrix: the largest difference relative to the largest entry of the
        exact matrix. nan if a method lacks the quantity or did not reach the end.
    seconds, compile_seconds
        Median time of a run, and the additional time of the first run, ``(rows,)``.
    steps, events
        Steps and events of a run, nan where unknown, ``(rows,)``.
    status
        ``"SUCCESS"``, the name of another status code, or the first line of an exception, ``(rows,)``.
    reference_error
        Error of the reference itself, by quantity. Errors below it are not resolved.

    Examples
    --------
    >>> import hybrid, models
    >>> found = hybrid.work_precision(
    ...     models.impact_oscillator(), (0.0, 0.0), (0.0, 10.0), tolerances=[1e-5, 1e-8], repeats=1
    ... )
    >>> found.methods, found.error["state"].shape
    (('Taylor', 'DOP853', 'Tsit5'), (6,))
    >>> bool(found.seconds_at("DOP853", 1e-3) > 0)
    True
    """

    method: np.ndarray
    tolerance: np.ndarray
    error: Mapping[str, np.ndarray]
    seconds: np.ndarray
    compile_seconds: np.ndarray
    steps: np.ndarray
    events: np.ndarray
    status: np.ndarray
    reference_error: Mapping[str, float]

    @property
    def methods(self) -> tuple[str, ...]:
        """Names of the methods in the order in which they ran."""
        return tuple(dict.fromkeys(self.method.tolist()))

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """All columns by name, as frames of other packages take them."""
        return {
            "method": self.method,
            "tolerance": self.tolerance,
            **{f"error_{quantity}": column for quantity, column in self.error.items()},
            "seconds": self.seconds,
            "compile_seconds": self.compile_seconds,
            "steps": self.steps,
            "events": self.events,
            "status": self.status,
        }

    def rows_of(self, method: str) -> np.ndarray:
        """Mask ``(rows,)`` of one method's rows.

        Raises
        ------
        ArgumentError
            If there is no such method.
        """
        arguments.known("Method", method, self.methods, "Methods")
        return self.method == method

    def seconds_at(self, method: str, error: float, quantity: str = "state") -> float:
        """Seconds a method needs for an error, between its rows on logarithmic scales; nan beyond them.

        Raises
        ------
        ArgumentError
            If there is no such method or quantity.
        """
        error = arguments.positive("error", error)
        errors = self.error_of(quantity)
        rows = self.rows_of(method) & (errors > 0) & np.isfinite(errors)
        # A tighter tolerance that takes longer and is worse counts for nothing.
        points: list[tuple[float, float]] = []
        for found, seconds in sorted(zip(errors[rows], self.seconds[rows], strict=True)):
            if not points or seconds < points[-1][1]:
                points.append((float(found), float(seconds)))
        if not points or not points[0][0] <= error:
            return float("nan")
        logs = np.log(np.array(points))
        return float(np.exp(np.interp(np.log(error), logs[:, 0], logs[:, 1])))

    def error_of(self, quantity: str) -> np.ndarray:
        """Column ``(rows,)`` of the errors of a quantity.

        Raises
        ------
        ArgumentError
            If the quantity was not measured.
        """
        arguments.known("Quantity", quantity, self.error, "Quantities")
        return self.error[quantity]

    def __repr__(self) -> str:
        return f"<WorkPrecision of {', '.join(self.methods)}, {len(self.method)} rows>"

    def __str__(self) -> str:
        headings = [
            "method",
            "tolerance",
            *(f"error: {quantity}" for quantity in self.error),
            *("ms", "compile ms", "steps", "events", "status"),
        ]
        rows = [
            [
                str(self.method[i]),
                f"{self.tolerance[i]:.0e}",
                *(_error(column[i], self.reference_error[name]) for name, column in self.error.items()),
                _figure(1e3 * self.seconds[i], ".3f"),
                _figure(1e3 * self.compile_seconds[i], ".0f"),
                _figure(self.steps[i], ".0f"),
                _figure(self.events[i], ".0f"),
                str(self.status[i]),
            ]
            for i in range(len(self.method))
        ]
        floor = [_figure(self.reference_error[quantity], ".1e") for quantity in self.error]
        rows.append(["the reference", "", *floor, *[""] * 5])
        return table(headings, rows, numbers=True)


def work_precision(
    system: HybridSystem,
    x0: ArrayLike,
    t_span: tuple[float, float],
    *,
    methods: Mapping[str, Method] = METHODS,
    tolerances: Sequence[float] = TOLERANCES,
    reference: ArrayLike | Answer | HybridArc | None = None,
    reference_error: Mapping[str, float] | None = None,
    mode: str | None = None,
    parameters: Mapping[str, float] | None = None,
    tangent: bool = False,
    repeats: int = 5,
    longest: float = 10.0,
    clock: Callable[[], float] = time.perf_counter,
) -> WorkPrecision:
    """Error against time of methods over a range of tolerances, on one run of one system.

    At each tolerance every method runs once to compile, then at least ``repeats`` times; the time is the
    median of these runs. The library's own solvers store the end of the run and its jumps, not its steps.

    Parameters
    ----------
    system, x0, t_span, mode, parameters
        The run, as for :func:`simulate`.
    methods
        Methods by name. A method is a solver, whose ``rtol`` is replaced by the tolerance and whose ``atol``
        changes in proportion; or any function of the tolerance that solves the problem and returns the state
        at the end, an :class:`Answer` or a :class:`HybridArc`. By default ``Taylor``, ``DOP853``, ``Tsit5``.
    tolerances
        Tolerances at which every method runs.
    reference
        The exact result: a state ``(n,)``, an :class:`Answer` or an arc. By default the arc of ``Taylor`` at
        ``rtol = 1e-14``; its error is estimated by the difference from ``DOP853`` at 1e-13.
    reference_error
        Error of a given reference, by quantity; by default the rounding of its largest value.
    tangent
        Whether the solvers carry the fundamental matrix, whose error and exponents are then measured too.
    repeats
        Smallest number of runs for the median. Short runs are repeated for a twentieth of a second, because
        the processor's caches still hold the data of earlier work when they begin. With 1 there is one run.
    longest
        A run that takes more seconds than this is not repeated, and finer tolerances of its method are
        skipped.
    clock
        A function that returns seconds; ``time.process_time`` if other work shares the processor.

    Returns
    -------
    WorkPrecision

    Raises
    ------
    ModelError
        If the system cannot be compiled.
    ArgumentError
        If an argument does not fit, or a method returns no state of the system.

    Examples
    --------
    >>> import models
    >>> from hybrid import work_precision
    >>> found = work_precision(models.bouncing_ball(), (1.0, 0.0), (0.0, 1.0), tolerances=[1e-6], repeats=1)
    >>> found.methods
    ('Taylor', 'DOP853', 'Tsit5')
    >>> bool(found.error["state"].max() < 1e-5)
    True
    """
    as_system("system", system)
    x0 = system.variables.state_values("x0", x0)
    t_span = arguments.time_span("t_span", t_span)
    if mode is not None:
        check_mode(system, mode)
    system.parameter_values(parameters)
    tangent = arguments.flag("tangent", tangent)
    runs = {
        name: runner(name, method, system, x0, t_span, mode, parameters, tangent)
        for name, method in arguments.mapping("methods", methods, "map names to methods").items()
    }
    if not runs:
        raise ArgumentError("methods must hold at least one solver or function; got none.")
    levels = arguments.numbers("tolerances", tolerances, "be positive numbers, one or more")
    if levels.ndim != 1 or not levels.size or not np.all((levels > 0) & np.isfinite(levels)):
        raise arguments.refusal("tolerances", "be positive and at least one", tolerances)
    repeats = arguments.count("repeats", repeats, 1)
    longest = arguments.positive("longest", longest, "be a positive number of seconds", infinite=True)
    check_clock(clock)
    known_errors = {
        arguments.known("reference_error: Quantity", quantity, QUANTITIES, "Quantities"): (
            arguments.not_negative(f"reference_error[{arguments.shown(quantity)}]", value)
        )
        for quantity, value in arguments.mapping("reference_error", reference_error).items()
    }
    n, span = system.dimension, t_span[1] - t_span[0]
    if reference is None:
        truth, check = (
            as_answer("reference", own_answer(solver, system, x0, t_span, mode, parameters, tangent), n, span)
            for solver in (REFERENCE, CHECK)
        )
        floor = errors_of(check, truth)
    else:
        truth = as_answer("reference", reference, n, span)
        if not np.all(np.isfinite(truth.state)):
            raise arguments.refusal("reference", "be a finite state", reference)
        floor = rounding_of(truth) | known_errors
    rows = []
    while runs:
        name = next(iter(runs))
        run = runs.pop(name)
        slow = False
        for tolerance in sorted(levels.tolist(), reverse=True):
            if slow:
                break
            row = measured(name, run, tolerance, truth, (n, span), repeats, longest, clock)
            rows.append(row)
            if row.status == StatusCode.INTERRUPTED.name:
                runs = {}
                break
            slow = row.seconds > longest
    quantities = [name for name in QUANTITIES if name in floor]
    return WorkPrecision(
        method=np.array([row.method for row in rows]),
        tolerance=np.array([row.tolerance for row in rows]),
        error={name: np.array([row.errors.get(name, np.nan) for row in rows]) for name in quantities},
        seconds=np.array([row.seconds for row in rows]),
        compile_seconds=np.array([row.compile_seconds for row in rows]),
        steps=np.array([row.steps for row in rows]),
        events=np.array([row.events for row in rows]),
        status=np.array([row.status for row in rows]),
        reference_error={name: floor[name] for name in quantities},
    )


# An error that cannot be told from zero.
BELOW = "below the reference's"


def _error(value: float, floor: float) -> str:
    """An error as text; one below that of the reference, which may be the same method, is not known."""
    return BELOW if value == 0.0 or value < floor else _figure(value, ".1e")


def _figure(value: float, form: str) -> str:
    return format(value, form) if np.isfinite(value) else "-"
