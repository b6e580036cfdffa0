"""Guards as functions of the place on a step, with bounds that are known exactly."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.types.codes import HIGH, HIGH_MIDDLE, LEAST_SLOPE, LOW, LOW_MIDDLE, MOST_SLOPE
from hybrid.kernels.types.layout import EPSILON, Path

# One component, which is the place itself: time is 10 plus half of the place.
START, PACE = 10.0, 0.5
ALONG = Path(np.array([[0.0], [1.0]]), 1, -1, START, PACE, 1.0, True)
TRANSITION = 1
# Lengths of steps.
UNITS = [1.0, 2.0**-20, 2.0**20]


def approx(place, roundings):
    """A place up to a few units in the last place, without the absolute tolerance of pytest."""
    return pytest.approx(place, rel=roundings * EPSILON, abs=0.0)


class Curve:
    """A guard as a function of the place, its slope, and the places where either may turn.

    It jumps or has a vertical tangent at the places ``steep``, and has a value on ``domain`` alone; with
    ``sure`` its slope is bounded even so. Its bounds are its ranges, ``noise`` wider, and those of its slope
    ``tilts`` wider. With ``loose``, a range is that of the mean value theorem.
    """

    def __init__(
        self,
        value,
        slope,
        turns=(),
        *,
        noise=0.0,
        tilts=0.0,
        steep=(),
        domain=(-math.inf, math.inf),
        loose=False,
        sure=False,
    ):
        self.sure = sure
        self.value, self.slope, self.turns = value, slope, turns
        self.noise, self.tilts, self.steep, self.domain, self.loose = noise, tilts, steep, domain, loose
        self.asked = []

    def __call__(self, place):
        return self.value(place) if self.domain[0] <= place <= self.domain[1] else math.nan

    def ranges(self, low, high):
        """The bounds on a piece."""
        middle = 0.5 * (low + high)
        least, most = max(low, self.domain[0]), min(high, self.domain[1])
        if least > most:
            return -math.inf, math.inf, -math.inf, math.inf, -math.inf, math.inf
        places = [least, most, *(each for each in self.turns if least < each < most)]
        slopes = [self.slope(each) for each in places]
        flat, steep = min(slopes) - self.tilts, max(slopes) + self.tilts
        values = [self.value(each) for each in places]
        if any(low <= each <= high for each in self.steep) or (
            not self.sure and (least > low or most < high)
        ):
            flat, steep = -math.inf, math.inf
        if self.loose and steep < math.inf:
            most = max(abs(flat), abs(steep)) * (high - middle)
            values = [self.value(middle) - most, self.value(middle) + most]
        center = self(middle)
        near = (-math.inf, math.inf) if math.isnan(center) else (center - self.noise, center + self.noise)
        return min(values) - self.noise, max(values) + self.noise, flat, steep, *near


def polynomial(*roots, factor=1.0, **others):
    """A guard with these roots."""
    exact = np.polynomial.Polynomial.fromroots(roots)
    turns = np.concatenate([[], *(exact.deriv(k).roots() for k in range(1, len(roots)))])

    def value(place):
        return factor * math.prod(place - root for root in roots)

    def slope(place):
        left_out = ([*roots[:i], *roots[i + 1 :]] for i in range(len(roots)))
        return factor * sum(math.prod(place - root for root in some) for some in left_out)

    return Curve(value, slope, [each.real for each in turns if abs(each.imag) < 1e-6], **others)


def scene(curve, *, direction=0, side=0, on_guard=0, scale=1.0, fired=-1, since_entry=0.0, tolerance=0.0):
    """Model, method, run and memory."""

    def bound(programs, transition, path, middle, radius, registers):
        assert (transition, path[:5]) == (TRANSITION, ALONG[:5])
        curve.asked.append((middle, radius))
        assert radius >= 0.0
        registers[2, [LOW, HIGH, LEAST_SLOPE, MOST_SLOPE, LOW_MIDDLE, HIGH_MIDDLE]] = curve.ranges(
            middle - radius, middle + radius
        )
        return 2

    def guard(transition, t, x, parameters, out):
        assert (transition, t) == (TRANSITION, START + PACE * x[0])
        out[0] = curve(x[0])

    def gradient(transition, t, x, parameters, out):
        assert (transition, t) == (TRANSITION, START + PACE * x[0])
        out[:] = curve.slope(x[0]), 7.0

    model = SimpleNamespace(
        dimension=1,
        period=0.0,
        parameters=np.zeros(0),
        programs=SimpleNamespace(first=np.array([0, 0, 3])),
        direction=np.array([5, direction]),
        bound=bound,
        propagator=np.zeros(1),
        guard=guard,
        guard_gradient=gradient,
        spread=lambda programs, transition, t, clock, x, scale, share, registers: curve.noise,
    )
    method = SimpleNamespace(atol=tolerance, rtol=0.0)
    run = SimpleNamespace(
        mode=0,
        side=np.array([5, side]),
        on_guard=np.array([5, on_guard]),
        passed=np.full(2, NO_ROOT),
        rehearsal=np.zeros((4, 2)),
        scale=np.array([scale]),
        y=np.zeros(1),
        last_fired=fired,
        since_entry=since_entry,
        unproved=0,
        grazing_place=NO_ROOT,
        next_grazing=NO_ROOT,
        grazing_value=math.nan,
        grazing_guard=-1,
    )
    work = SimpleNamespace(
        state=np.zeros(1),
        scalar=np.zeros(1),
        gradient=np.zeros(2),
        field=np.zeros(1),
        registers=np.full((3, 6), 99.0),
        intervals=np.full((200, 2), 99.0),
    )
    return model, method, run, work
