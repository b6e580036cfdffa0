"""A component or an output along an arc, in parts on which a polynomial of the dense output resolves it."""

from __future__ import annotations

from collections.abc import Iterator

import attrs
import numpy as np
from numpy.polynomial import chebyshev

from hybrid.errors import ArgumentError
from hybrid.simulation.arc import HybridArc
from hybrid.simulation.points import Pieces
from hybrid.simulation.quantities import Evaluator

DEGREE = 16
# A part is resolved if the last coefficients of its polynomial are this small beside the largest value.
LAST = 3
RESOLVED = 1e-13
# A part is not halved below this share of its step: there is a kink or a jump in it.
NARROWEST = 2.0**-44
# Rounding of a polynomial's values, in units of the sum of its terms: of what rests nothing else is left, and
# no part resolves that.
OF_TERMS = 4.0 * float(np.finfo(float).eps)
# Of an output the terms are not known. But kinks and jumps leave few parts, and rounding leaves all of them.
MOST_PARTS, MOST_PER_STEP = 2**14, 256
# A polynomial that exceeds the largest known value by less than this share of it does not exceed it.
ROUNDING = 1e-15
# A root of a slope with an imaginary part up to this is an extremum that rounding has moved.
NEARLY_REAL = 1e-6

# Chebyshev's extreme points on [-1, 1] with both ends, what makes coefficients of values there, and the
# weights of the integral (Clenshaw and Curtis; Trefethen, Approximation Theory and Practice, chapters 3, 19).
POINTS = np.polynomial.chebyshev.chebpts2(DEGREE + 1)
TO_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(POINTS, DEGREE))
WEIGHTS = np.array([2.0 / (1.0 - k * k) if k % 2 == 0 else 0.0 for k in range(DEGREE + 1)]) @ TO_COEFFICIENTS


@attrs.frozen(eq=False)
class Parts:
    """``M`` parts of the steps of an arc, each a stretch of the place ``theta`` on ``[0, 1]`` of its step.

    Attributes
    ----------
    step, low, width
        Index of the step, begin and width of the stretch, ``(M,)``.
    values
        The quantity at Chebyshev's points of each, ``(M, DEGREE + 1)``.
    """

    step: np.ndarray
    low: np.ndarray
    width: np.ndarray
    values: np.ndarray

    @property
    def places(self) -> np.ndarray:
        """Places in their steps of the points ``(M, DEGREE + 1)``."""
        return self.low[:, None] + 0.5 * self.width[:, None] * (1.0 + POINTS)

    def taken(self, which: np.ndarray) -> Parts:
        """Some of the parts."""
        return Parts(self.step[which], self.low[which], self.width[which], self.values[which])


@attrs.frozen(eq=False)
class Profile:
    """A component or an output along an arc.

    Attributes
    ----------
    arc, quantity
        The arc, and what is looked at.
    parts
        Parts that cover all steps in whose modes the quantity has a value.
    largest
        The largest value of the quantity times a sign, by this sign, as far as it is known.
    """

    arc: HybridArc
    quantity: Evaluator
    parts: Parts
    largest: dict[float, float]

    def maximum(self) -> float:
        """The largest value; at a jump, both sides count."""
        return self._largest(1.0)

    def minimum(self) -> float:
        """The smallest value; at a jump, both sides count."""
        return -self._largest(-1.0)

    def amplitude(self) -> float:
        """Half of the way from the smallest to the largest value."""
        return 0.5 * (self.maximum() - self.minimum())

    def mean(self) -> float:
        """The time average."""
        return self._average(self.parts.values)

    def rms(self) -> float:
        """The root of the time average of the square."""
        # The square of the smallest numbers would be zero.
        size = float(np.abs(self.parts.values).max())
        return size * np.sqrt(self._average((self.parts.values / size) ** 2)) if size > 0.0 else 0.0

    def _average(self, values: np.ndarray) -> float:
        parts, pieces = self.parts, _pieces_of(self.arc)
        left_out = np.setdiff1d(pieces.mode[pieces.h > 0.0], pieces.mode[parts.step])
        if left_out.size:
            modes = ", ".join(repr(self.arc.system.mode_names[i]) for i in left_out)
            raise ArgumentError(
                f"name: output {self.quantity.name!r} has no value in mode {modes}, which the arc visits, "
                "so it has no mean and no RMS value. Give the output a value there, such as 0.0."
            )
        rates = _slopes_at(pieces.coefficients[parts.step, :, -1], parts.places)
        total, time = (float(parts.width @ (each @ WEIGHTS)) for each in (values * rates, rates))
        return total / time

    def _largest(self, sign: float) -> float:
        """The largest value of the quantity times a sign."""
        if sign not in self.largest:
            self.largest[sign] = self._searched(sign)
        return self.largest[sign]

    def _searched(self, sign: float) -> float:
        arc, parts, values = self.arc, self.parts, sign * self.parts.values
        # States between jumps at one instant are on no step.
        points = self.quantity(arc.t, arc.x, arc._mode_index, arc._values)
        best = float(np.fmax.reduce(sign * points, initial=values.max()))
        coefficients = values @ TO_COEFFICIENTS.T
        bounds = coefficients[:, 0] + np.abs(coefficients[:, 1:]).sum(axis=1)
        for i in np.argsort(-bounds):
            if not bounds[i] > best + ROUNDING * abs(best):
                break
            places = np.array([*_turns(coefficients[i])])
            if places.size:
                there = parts.low[i] + 0.5 * parts.width[i] * (1.0 + places)
                found = _values_at(arc, self.quantity, parts.step[[i]], there[None])
                best = max(best, float((sign * found).max()))
        return best


def profile_of(arc: HybridArc, name: str) -> Profile:
    """The profile of a component or an output; what is found of it stays with the arc.

    Raises
    ------
    ArgumentError
        If the arc has no dense output or takes no time, or if the quantity has no value or one that is not
        finite.
    """
    if name not in arc.resolved:
        quantity = Evaluator(arc.system, name)
        arc.resolved[name] = quantity, _parts_of(arc, quantity), {}
    return Profile(arc, *arc.resolved[name])


def _parts_of(arc: HybridArc, quantity: Evaluator) -> Parts:
    """Parts on which a polynomial resolves a quantity."""
    pieces = _pieces_of(arc)
    has_value = np.array([quantity.has_value_in(mode) for mode in range(len(arc.system.modes))])
    [left] = np.nonzero(has_value[pieces.mode] & (pieces.h > 0.0))
    if not left.size:
        raise ArgumentError(
            f"name: output {quantity.name!r} has no value in any mode of the arc. Give it one there, such as "
            "0.0."
        )
    low, width = np.zeros(len(left)), np.ones(len(left))
    done: list[Parts] = []
    scale, rounding, most = 0.0, np.zeros(len(pieces.h)), max(MOST_PARTS, MOST_PER_STEP * len(left))
    if quantity.name in arc.system.state_names:
        terms = pieces.coefficients[:, :, arc.system.state_names.index(quantity.name)]
        rounding = OF_TERMS * np.abs(terms).sum(axis=1)
    while left.size:
        made = Parts(left, low, width, np.empty((len(left), DEGREE + 1)))
        made = attrs.evolve(made, values=_values_at(arc, quantity, left, made.places))
        scale = max(scale, float(np.abs(made.values).max()))
        tails = np.abs(made.values @ TO_COEFFICIENTS[-LAST:].T).max(axis=1)
        known = np.maximum(RESOLVED * scale, rounding[left])
        resolved = (tails <= known) | (width < NARROWEST) | (len(left) > most)
        done.append(made.taken(resolved))
        rest = made.taken(~resolved)
        half = 0.5 * rest.width
        left, width = np.repeat(rest.step, 2), np.repeat(half, 2)
        low = np.column_stack([rest.low, rest.low + half]).ravel()
    return Parts(
        *(np.concatenate([getattr(each, field.name) for each in done]) for field in attrs.fields(Parts))
    )


def _pieces_of(arc: HybridArc) -> Pieces:
    pieces = arc._pieces
    if pieces is None:
        raise ArgumentError("arc keeps samples only. Run simulate without samples= for dense output.")
    if not len(pieces.t) or not arc.t[-1] > arc.t[0]:
        raise ArgumentError(f"arc must take some time to be measured; it begins and ends at t = {arc.t[-1]}.")
    return pieces


def _values_at(arc: HybridArc, quantity: Evaluator, step: np.ndarray, places: np.ndarray) -> np.ndarray:
    """The quantity ``(M, K)`` at places ``(M, K)`` in steps ``(M,)``."""
    pieces = _pieces_of(arc)
    own = pieces.coefficients[step]
    if quantity.name in arc.system.state_names:
        found = _polynomials_at(own[:, :, arc.system.state_names.index(quantity.name)], places)
    else:
        columns = [_polynomials_at(own[:, :, k], places).ravel() for k in range(own.shape[2])]
        count = places.shape[1]
        t = np.repeat(pieces.t[step] + pieces.low[step], count) + columns[-1]
        modes = np.repeat(pieces.mode[step], count)
        found = quantity(t, np.column_stack(columns[:-1]), modes, arc._values).reshape(places.shape)
    bad = np.argwhere(~np.isfinite(found))
    if len(bad):
        i, k = bad[0]
        t = pieces.t[step[i]] + _polynomials_at(own[[i], :, -1], places[[i]])[0, k]
        mode = arc.system.mode_names[pieces.mode[step[i]]]
        raise ArgumentError(
            f"name: {quantity.name!r} is {found[i, k]} at t = {t:.12g} in mode {mode!r}; a measure needs "
            "finite values."
        )
    return found


def _polynomials_at(coefficients: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Polynomials ``(M, d + 1)`` at places ``(M, K)`` of each (Horner)."""
    found = np.zeros_like(places)
    for column in coefficients.T[::-1]:
        found = found * places + column[:, None]
    return found


def _slopes_at(coefficients: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Derivatives of polynomials ``(M, d + 1)`` at places ``(M, K)`` of each."""
    return _polynomials_at(coefficients[:, 1:] * np.arange(1, coefficients.shape[1]), places)


def _turns(coefficients: np.ndarray) -> Iterator[float]:
    """Where a Chebyshev series ``(DEGREE + 1,)`` may have extrema within ``(-1, 1)``."""
    slope = chebyshev.chebder(coefficients)
    if not np.abs(slope[1:]).sum() > abs(slope[0]):
        # The slope keeps its sign.
        return
    size = np.abs(slope).max()
    roots = chebyshev.chebroots(chebyshev.chebtrim(slope, RESOLVED * size))
    for root in roots[np.abs(roots.imag) <= NEARLY_REAL]:
        if abs(root.real) < 1.0:
            yield float(root.real)
