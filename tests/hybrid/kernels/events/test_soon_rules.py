"""Accelerations soon after a place, rule by rule: powers of the time, and where they are certain."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events import soon
from hybrid.kernels.events.derivatives import SHARE
from tests.hybrid.kernels.plain import plain


def test_a_moment_along_the_flow():
    """``x' = v``, ``v' = t`` from (1, 2) at the time 3, by the midpoint rule for a half."""

    def field(mode, t, x, parameters, out):
        assert (mode, parameters) == (1, "p")
        out[:] = x[1], t

    model = SimpleNamespace(dimension=2, parameters="p", field=field)
    work = SimpleNamespace(field=np.array([2.0, 3.0]), field_after=np.zeros(2), settled=np.zeros(2))
    plain(soon).move_for(model, 1, 3.0, np.array([1.0, 2.0]), 0.5, work)
    assert work.settled.tolist() == [1.0 + 0.5 * 2.75, 2.0 + 0.5 * 3.25]
    assert work.field.tolist() == [3.625, 3.5]


class TestSign:
    """A run of 16 time units, so that the moments are 1, 1/16, 1/256 and so on."""

    def found(self, acceleration, *, noise=0.0, horizon=16.0, clock=1e-30):
        """The sign for an acceleration as a function of the moment; up to ``noise`` it is hidden."""
        moments = []

        def move_for(model, mode, t, x, moment, work):
            assert (mode, t, x, work.field) == (1, 3.0, "x", "field at x")
            moments.append(moment)
            work.field = "field after"

        def of(function):
            def asked(model, run, transition, mode, t, x, work):
                assert (transition, mode, x, work.field) == (5, 1, "settled", "field after")
                assert t == 3.0 + moments[-1]
                assert speeds[-1] == (t, "settled", "field after")
                return function(acceleration(moments[-1]))

            return asked

        def guard_speed(model, transition, t, x, field, gradient):
            speeds.append((t, x, field))

        def field(mode, t, x, parameters, out):
            assert (mode, t, x) == (1, 3.0, "x")
            work.field = "field at x"

        speeds = []
        work = SimpleNamespace(field="field at x", settled="settled", gradient=None)
        tested = plain(
            soon,
            move_for=move_for,
            guard_speed=guard_speed,
            acceleration_sign=of(lambda a: 0 if abs(a) <= noise else int(np.sign(a))),
            guard_acceleration=of(lambda a: a),
            size_of_time=lambda model, t: clock,
        )
        model, run = SimpleNamespace(parameters=None, field=field), SimpleNamespace(horizon=horizon)
        sign = tested.acceleration_soon(model, run, 5, 1, 3.0, "x", work)
        # The field and the gradient are those at the place again.
        assert work.field == "field at x"
        assert speeds[-1] == (3.0, "x", "field at x")
        self.moments = moments
        return sign

    @pytest.mark.parametrize("way", [1, -1])
    def test_of_powers_of_the_time(self, way):
        for power, sign in ((1.0, way), (2.0, way), (0.8, way), (2.2, way), (0.0, 0), (0.7, 0), (2.3, 0)):
            assert self.found(lambda m, power=power: way * 7.0 * m**power) == sign

    @pytest.mark.parametrize("way", [1, -1])
    def test_the_shortest_moments_count(self, way):
        assert self.found(lambda m: way * (m - 50.0 * m**2)) == way
        # Unless rounding hides them: from 1/256 on.
        assert self.found(lambda m: way * (1e-3 * m - 50.0 * m**2), noise=1e-3) == -way

    def test_two_moments_must_be_certain_of_one_sign(self):
        assert self.found(lambda m: m if m < 0.5 else -m, noise=1e-2) == 0
        assert self.found(lambda m: m, noise=0.05) == 1
        assert self.found(lambda m: m, noise=0.07) == 0
        assert self.found(lambda m: 0.0) == 0

    def test_moments_end_at_the_rounding_of_time(self):
        self.found(lambda m: m)
        assert self.moments == [16.0**-k for k in range(12)]
        for clock, count in ((0.99 / 256.0, 3), (1.01 / 256.0, 2), (16.0, 0)):
            assert self.found(lambda m: m, clock=clock / SHARE) == int(count > 1)
            assert len(self.moments) == count
        self.found(lambda m: m, horizon=0.0)
        assert self.moments == []

    def test_no_more_are_tried_without_any_acceleration(self):
        self.found(lambda m: 0.0)
        assert len(self.moments) == 2
        self.found(lambda m: m if m > 0.5 else 0.0)
        assert len(self.moments) == 3
