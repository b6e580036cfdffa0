"""Speed and acceleration of guards and their rounding, rule by rule, from numbers that are known."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.events import derivatives
from hybrid.kernels.events.derivatives import BENDS, SHARE, SPREADS, SPREADS_OF_BENDS
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

CLOSE = {"rel": 1e-13, "abs": 0.0}
T = 8.0
FIELD, SCALE = [3.0, -5.0], [10.0, 100.0]
# The last column is the derivative in time. The field writes no other cells than these.
JACOBIAN = [[0.0, -0.5, 7.0], [-2.0, 0.25, -1.0]]
# How far each rate moves: its own size, by time, by the state.
MOVED = [3.0 + 7.0 * T + 0.5 * 100.0, 5.0 + 1.0 * T + 2.0 * 10.0 + 0.25 * 100.0]


def nothing(*given):
    pass


def memory(*, affine=True, gradient=(2.0, -3.0, 4.0), **functions):
    """A model of two states, a run and its memory, with the rates and slopes above."""
    model = SimpleNamespace(
        dimension=2,
        period=0.0,
        parameters="p",
        affine_guard=np.array([9, int(affine)]),
        first_slope=np.array([[9] * 3, [0, 1, 3]]),
        slope_column=np.array([1, 0, 1]),
        target=np.zeros(4),
        first_forcing=np.array([0, 2]),
        first_residue=np.array([0, 1, 1]),
        residue_component=np.array([0, 0]),
        guard_gradient=lambda transition, t, x, parameters, out: out.__setitem__(slice(None), gradient),
    )
    vars(model).update(functions)
    work = SimpleNamespace(
        field=np.array(FIELD),
        gradient=np.array(gradient),
        jacobian=np.array(JACOBIAN),
        rounding=np.full((4, 2), 88.0),
        state=np.zeros(2),
    )
    work.jacobian[0, 0] = 99.0
    return model, SimpleNamespace(scale=np.array(SCALE)), work


class TestSpreads:
    def spreads(self, **given):
        model, run, work = memory(**given)
        terms = []

        def spread_of_terms(model, run, program, share, t, x, work):
            terms.append((program, share, t, x))
            return 0.125 * SHARE

        tested = plain(derivatives, slopes_at_guard=nothing, spread_of_terms=spread_of_terms)
        tested.spread_rates(model, run, 1, 1, T, "x", work)
        self.terms = terms
        return work.rounding[SPREADS].tolist()

    def test_rates_move_by_their_size_and_with_time_and_state(self):
        assert self.spreads() == MOVED
        assert self.terms == []

    def test_an_affine_guard_needs_only_the_rates_in_its_gradient(self):
        assert self.spreads(gradient=(2.0, 0.0, 4.0)) == [MOVED[0], 0.0]
        assert self.spreads(gradient=(0.0, -1.0, 4.0)) == [0.0, MOVED[1]]
        assert self.spreads(gradient=(0.0, 0.0, 4.0), affine=False) == MOVED

    def test_terms_of_time_that_may_cancel_count_too(self):
        residues = {"first_residue": np.array([0, 1, 3]), "residue_component": np.array([0, 1, 0])}
        assert self.spreads(**residues) == [MOVED[0] + 0.125, MOVED[1] + 0.125]
        # Their programs follow those of guards, conditions and forcing.
        assert self.terms == [(4 + 2 + 1, SHARE, T, "x"), (4 + 2 + 2, SHARE, T, "x")]
        assert self.spreads(gradient=(2.0, 0.0, 4.0), **residues) == [MOVED[0] + 0.125, 0.0]


class TestBends:
    def bends(self, **given):
        model, run, work = memory(**given)
        plain(derivatives)._bend_rates(model, run, 1, 1, T, work)
        return work.rounding[[BENDS, SPREADS_OF_BENDS]].tolist()

    BENT = (7.0 - 0.5 * -5.0, -1.0 - 2.0 * 3.0 + 0.25 * -5.0)
    SPREAD = (7.0 + 0.5 * MOVED[1], 1.0 + 2.0 * MOVED[0] + 0.25 * MOVED[1])

    @pytest.mark.parametrize("affine", [True, False])
    def test_rates_bend_along_the_flow(self, affine):
        assert self.bends(affine=affine) == [list(self.BENT), list(self.SPREAD)]

    def test_an_affine_guard_needs_only_those_in_its_gradient(self):
        assert self.bends(gradient=(2.0, 0.0, 4.0)) == [[self.BENT[0], 0.0], [self.SPREAD[0], 0.0]]
        assert self.bends(gradient=(0.0, 2.0, 4.0), affine=False) == [list(self.BENT), list(self.SPREAD)]

    def test_a_slope_that_is_zero_counts_for_nothing(self):
        """Also if the rate that it belongs to has no bound."""
        model, run, work = memory(affine=True)
        work.jacobian[0, 1], work.field[1] = 0.0, math.inf
        plain(derivatives)._bend_rates(model, run, 1, 1, T, work)
        assert work.rounding[[BENDS, SPREADS_OF_BENDS], 0].tolist() == [7.0, 7.0]


def test_the_rounding_of_a_speed():
    tested = plain(derivatives, slopes_at_guard=nothing, _turned_by_rounding=lambda *given: 0.5)
    model, run, work = memory()
    found = tested.speed_rounding(model, run, 1, 1, T, "x", work)
    assert found - 0.5 == pytest.approx(SHARE * (4.0 + 2.0 * MOVED[0] + 3.0 * MOVED[1]), abs=2e-16)


def test_the_rounding_of_an_acceleration():
    model, run, work = memory()
    found = plain(derivatives, slopes_at_guard=nothing).acceleration_rounding(model, run, 1, 1, T, "x", work)
    spread = TestBends.SPREAD
    assert found == pytest.approx(SHARE * (2.0 * spread[0] + 3.0 * spread[1]), **CLOSE)


class TestTurned:
    def turned(self, slopes, *, affine=False, period=0.0, base=1.0):
        """The speed changes with these slopes of the two states and time."""
        model, run, work = memory(affine=affine)
        model.period = period
        x = np.zeros(2)

        def derivative(model, transition, t, place, second, work):
            assert not second
            return base + slopes[0] * place[0] + slopes[1] * place[1] + slopes[2] * (t - T), 99.0

        tested = plain(derivatives, _derivative=derivative)
        found = tested._turned_by_rounding(model, run, 1, T, x, work)
        assert affine or work.gradient.tolist() == [2.0, -3.0, 4.0]
        return found / SHARE

    def test_an_affine_guard_does_not_turn(self):
        assert self.turned([1.0, 1.0, 1.0], affine=True) == 0.0

    def test_each_argument_alone_turns_the_gradient(self):
        """The differences are divided by a rounding: a base of zero keeps all their digits."""
        assert self.turned([2.0, 0.0, 0.0], base=0.0) == pytest.approx(20.0, rel=1e-12)
        assert self.turned([0.0, -3.0, 0.0], base=0.0) == pytest.approx(300.0, rel=1e-12)
        assert self.turned([0.0, 0.0, -4.0], base=0.0) == pytest.approx(32.0, rel=1e-12)
        assert self.turned([2.0, 3.0, -4.0], base=0.0) == pytest.approx(352.0, rel=1e-12)
        # The phase may have come from the end of a period.
        assert self.turned([0.0, 0.0, -4.0], base=0.0, period=16.0) == pytest.approx(64.0, rel=1e-12)

    def test_a_gradient_that_is_no_number_tells_nothing(self):
        assert self.turned([1.0, 0.0, 0.0], base=math.nan) == 0.0


class TestDerivative:
    def found(self, *, second, affine=True, curvature=0.0):
        def guard_curvature(transition, t, x, parameters, out):
            assert (transition, t, x, parameters, out.tolist()) == (1, T, "x", "p", FIELD)
            out[0] = curvature

        model, _, work = memory(affine=affine, guard_curvature=guard_curvature, gradient=(2.0, -3.0, -4.0))
        work.gradient[:] = 99.0
        work.rounding[:3] = [0.5, 0.25], [6.0, 7.0], [1.0, 8.0]
        return plain(derivatives)._derivative(model, 1, T, "x", second, work)

    def test_a_speed(self):
        rounding = pytest.approx(SHARE * (4.0 + 2.0 * 0.5 + 3.0 * 0.25), **CLOSE)
        assert self.found(second=False) == (-4.0 + 2.0 * 3.0 + 3.0 * 5.0, rounding)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_an_acceleration(self, way):
        bent = 2.0 * 6.0 - 3.0 * 7.0
        assert self.found(second=True) == (bent, pytest.approx(SHARE * (2.0 + 24.0), **CLOSE))
        found = self.found(second=True, affine=False, curvature=way * 32.0)
        assert found == (bent + way * 32.0, pytest.approx(SHARE * (32.0 + 2.0 + 24.0), **CLOSE))


class TestSpeedSign:
    """A guard whose speed moves by at most ``4 + 2 * 1 + 3 * 8`` with its rates."""

    def sign(self, speed, *, affine=False, later=(0.0, 0.0), reverses=False):
        model, run, work = memory(affine=affine)
        asked = []

        def spread_rates(model, run, transition, mode, t, x, work):
            work.rounding[SPREADS] = 1.0, 8.0

        def derivative(model, transition, t, place, second, work):
            asked.append((transition, t, place.tolist(), second))
            work.gradient[:] = 99.0
            return later

        def may_reverse(model, run, transition, t, x, sign, second, work):
            asked.append((transition, t, sign, second))
            work.gradient[:] = 99.0
            return reverses

        tested = plain(
            derivatives,
            spread_rates=spread_rates,
            _derivative=derivative,
            _may_reverse=may_reverse,
            moment_of_rounding=lambda model, run, t, work: 0.5 * t,
        )
        found = tested.speed_sign(model, run, 1, 1, T, np.array([1.0, 2.0]), speed, work)
        assert work.gradient.tolist() == [2.0, -3.0, 4.0]
        self.asked = asked
        return found

    SIZE = SHARE * (4.0 + 2.0 * 1.0 + 3.0 * 8.0)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_of_an_affine_guard(self, way):
        assert self.sign(1.01 * way * self.SIZE, affine=True) == way
        assert self.sign(0.99 * way * self.SIZE, affine=True, later=(1.0, 0.0)) == 0
        assert self.asked == []

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_may_be_reversed_by_rounding(self, way):
        speed = 1.01 * way * self.SIZE
        assert self.sign(speed) == way
        assert self.asked == [(1, T, way, False)]
        assert self.sign(speed, reverses=True) == 0

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_that_is_hidden_is_the_one_of_a_moment_later(self, way):
        """Time and state are 16 moments later, a moment being half of the time here."""
        speed = 0.99 * way * self.SIZE
        moment = 16.0 * 0.5 * T
        place = [1.0 + moment * 3.0, 2.0 - moment * 5.0]
        assert self.sign(speed, later=(-way * 2.0, 1.9)) == -way
        assert self.asked == [(1, T + moment, place, False), (1, T, -way, False)]
        assert self.sign(speed, later=(-way * 2.0, 2.1)) == 0
        assert self.asked == [(1, T + moment, place, False)]
        assert self.sign(speed, later=(-way * 2.0, 1.9), reverses=True) == 0


class TestAccelerationSign:
    def sign(self, acceleration, *, rounding=1.0, affine=False, reverses=False, opaque=math.nan):
        model, run, work = memory(affine=affine)
        asked = []

        def bend_rates(model, run, transition, mode, t, work):
            work.rounding[SPREADS_OF_BENDS] = 1.0, 8.0

        def may_reverse(model, run, transition, t, x, sign, second, work):
            asked.append((transition, t, x, sign, second))
            work.gradient[:] = 99.0
            return reverses

        def derivative(model, transition, t, x, second, work):
            assert (transition, t, x, second) == (1, T, "x", True)
            return acceleration, rounding

        tested = plain(
            derivatives,
            slopes_at_guard=nothing,
            _bend_rates=bend_rates,
            _derivative=derivative,
            _may_reverse=may_reverse,
            guard_acceleration=lambda *given: opaque,
        )
        found = tested.acceleration_sign(model, run, 1, 1, T, "x", work)
        assert work.gradient.tolist() == [2.0, -3.0, 4.0]
        self.asked = asked
        return found

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_is_certain_beyond_its_rounding(self, way):
        assert self.sign(1.01 * way, affine=True) == way
        assert self.sign(0.99 * way, affine=True) == 0
        assert self.sign(0.99 * way) == 0
        assert self.asked == []

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_may_be_reversed_by_rounding(self, way):
        assert self.sign(1.01 * way) == way
        assert self.asked == [(1, T, "x", way, True)]
        assert self.sign(1.01 * way, reverses=True) == 0
        assert self.sign(1.01 * way, reverses=True, affine=True) == way

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_of_a_guard_that_is_not_traced(self, way):
        """Only the rounding of its gradient is known."""
        size = SHARE * (2.0 * 1.0 + 3.0 * 8.0)
        assert self.sign(math.nan, opaque=1.01 * way * size, reverses=True) == way
        assert self.sign(math.nan, opaque=0.99 * way * size, reverses=True) == 0
        assert self.asked == []


def test_the_moment_of_rounding_is_that_of_what_moves():
    def moment(field, t=1.0, period=0.0):
        model, run, work = memory()
        model.period, work.field[:] = period, field
        return plain(derivatives).moment_of_rounding(model, run, t, work) / EPSILON

    assert moment([3.0, -5.0]) == 100.0 / 5.0
    assert moment([-3.0, 0.0]) == pytest.approx(10.0 / 3.0, **CLOSE)
    assert moment([0.0, -4.0]) == 25.0
    # The rounding of time may be larger; if nothing moves, there is no other.
    assert moment([3.0, -5.0], t=-30.0) == 30.0
    assert moment([3.0, -5.0], period=40.0) == 40.0
    assert moment([0.0, 0.0]) == 1.0
