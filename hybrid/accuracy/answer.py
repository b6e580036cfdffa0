"""The results of a method, or the exact ones, and the differences between the two."""

from __future__ import annotations

from typing import Any

import attrs
import numpy as np

from hybrid import arguments
from hybrid.errors import ArgumentError
from hybrid.simulation.arc import HybridArc

QUANTITIES = ("state", "times", "saltation", "fundamental", "exponents")
EPSILON = float(np.finfo(float).eps)
# A singular value below this share of the largest is rounding, and so is its exponent.
NEGLIGIBLE = 1e-12


@attrs.frozen(eq=False)
class Answer:
    """The results of a method, or the exact ones: the state at the end, and other quantities if known.

    Parameters
    ----------
    state
        State ``(n,)`` at the end of the run.
    times
        Times ``(jumps,)`` of all events.
    saltation
        Saltation matrices ``(jumps, n, n)``.
    fundamental
        Fundamental matrix ``(n, n)`` of the whole run.
    exponents
        Exponents ``(n,)`` over the run, the largest first; by default those of ``fundamental``, the
        logarithms of its singular values over the length of the run.
    steps
        Steps of the method.
    seconds
        Time of the run, if the method measures it itself, for instance because it is another process.

    Examples
    --------
    >>> import hybrid, models
    >>> ball, height = models.bouncing_ball(), 1.0
    >>> exact = hybrid.Answer((height - 9.81 * 0.3**2 / 2, -9.81 * 0.3), times=())
    >>> found = hybrid.work_precision(
    ...     ball, (height, 0.0), (0.0, 0.3), tolerances=[1e-8], reference=exact, repeats=1
    ... )
    >>> bool(found.error["state"].max() < 1e-7)
    True
    """

    state: np.ndarray = attrs.field()
    times: np.ndarray | None = attrs.field(default=None, kw_only=True)
    saltation: np.ndarray | None = attrs.field(default=None, kw_only=True)
    fundamental: np.ndarray | None = attrs.field(default=None, kw_only=True)
    exponents: np.ndarray | None = attrs.field(default=None, kw_only=True)
    steps: int | None = attrs.field(default=None, kw_only=True)
    seconds: float | None = attrs.field(default=None, kw_only=True)

    def __attrs_post_init__(self) -> None:
        for name in QUANTITIES:
            value = getattr(self, name)
            if value is not None or name == "state":
                found = arguments.numbers(f"Answer: {name}", value, "hold numbers")
                object.__setattr__(self, name, found)
        if self.steps is not None:
            arguments.count("Answer: steps", self.steps, 0)
        if self.seconds is not None:
            arguments.not_negative("Answer: seconds", self.seconds)


def as_answer(name: str, result: Any, n: int, span: float) -> Answer:
    """The value that a method returned as an Answer, with its exponents."""
    if isinstance(result, HybridArc):
        result = Answer(
            # A run without a state at the end did not reach it.
            result.x[-1] if len(result.x) else np.full(n, np.nan),
            times=result.jumps.t if result.keeps_jumps else None,
            saltation=result.jumps.saltation if result.keeps_jumps else None,
            fundamental=result.fundamental,
            steps=result.steps,
        )
    elif not isinstance(result, Answer):
        try:
            result = Answer(result)
        except ArgumentError:
            raise ArgumentError(
                f"{name} must be the state at the end, an Answer or a HybridArc; "
                f"got {arguments.shown(result)}."
            ) from None
    if result.state.shape != (n,):
        raise ArgumentError(f"{name}: the state must have shape ({n},); got {result.state.shape}.")
    if result.exponents is None and result.fundamental is not None and span > 0:
        return attrs.evolve(result, exponents=_exponents(result.fundamental, span))
    return result


def _exponents(fundamental: np.ndarray, span: float) -> np.ndarray:
    if not np.all(np.isfinite(fundamental)):
        return np.full(len(fundamental), np.nan)
    values = np.linalg.svd(fundamental, compute_uv=False)
    with np.errstate(divide="ignore"):
        return np.log(np.where(values > NEGLIGIBLE * values[0], values, 0.0)) / span


def errors_of(found: Answer, truth: Answer) -> dict[str, float]:
    """Errors of all quantities that both have."""
    # Infinite entries of both, as of a singular saltation matrix, have no difference.
    with np.errstate(invalid="ignore", over="ignore"):
        return _errors_of(found, truth)


def _errors_of(found: Answer, truth: Answer) -> dict[str, float]:
    errors = {"state": _largest(found.state - truth.state)}
    for name in QUANTITIES[1:]:
        mine, true = getattr(found, name), getattr(truth, name)
        if mine is None or true is None:
            continue
        if mine.shape != true.shape:
            errors[name] = np.inf
        elif name in ("times", "exponents"):
            # Two directions that are both annihilated do not differ.
            errors[name] = _largest(np.where(mine == true, 0.0, mine - true))
        else:
            size = np.max(np.abs(true), axis=(-2, -1), keepdims=True, initial=0.0)
            errors[name] = _largest((mine - true) / np.where(size > 0, size, 1.0))
    return errors


def rounding_of(truth: Answer) -> dict[str, float]:
    """Half a unit in the last place of the largest value of each quantity of an exact answer."""
    floor = {}
    for name in QUANTITIES:
        value = getattr(truth, name)
        if value is not None:
            relative = name in ("saltation", "fundamental")
            finite = value[np.isfinite(value)]
            floor[name] = 0.5 * EPSILON * (1.0 if relative else float(np.max(np.abs(finite), initial=0.0)))
    return floor


def _largest(values: np.ndarray) -> float:
    return float(np.max(np.abs(values), initial=0.0))
