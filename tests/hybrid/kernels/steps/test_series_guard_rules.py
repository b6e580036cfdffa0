"""Guards along a series, rule by rule, on polynomials whose roots are known."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.events.onset import BY_SPEED, BY_STEP
from hybrid.kernels.events.resolution import MARGIN, UNDERFLOW
from hybrid.kernels.steps import series_guards
from hybrid.kernels.steps.series_guards import TAIL_OF_GUARD
from hybrid.kernels.types.codes import DESINGULARISED, EXACT, NO_TRANSITION, ROOTED, TAYLOR
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain, run_at_guards

kernels = plain(series_guards)


def column(*powers):
    """A series in the second of two columns."""
    return np.column_stack([np.full(len(powers), 77.0), powers])


@pytest.mark.parametrize(
    ("kind", "root", "size"),
    [(TAYLOR, 2, 64.0), (EXACT, 2, 64.0), (DESINGULARISED, 2, 8.0), (ROOTED, 2, 8.0), (ROOTED, 3, 4.0)],
)
def test_the_size_of_a_guard_in_its_series(kind, root, size):
    model = SimpleNamespace(propagator=np.array([9, kind]), root=np.array([9, root]))
    assert kernels.as_root(model, 1, 64.0) == pytest.approx(size, rel=1e-14)


def test_the_last_terms():
    powers = [1.0, -1.0, 3.0, -5.0, 7.0, 11.0, -13.0]
    exact = sum(abs(each) * 2.0**k for k, each in enumerate(powers) if k > 6 - TAIL_OF_GUARD)
    assert kernels.last_terms(column(*powers), 1, 6, 2.0) == exact
    # The value at the start is none of them.
    assert kernels.last_terms(column(*powers), 1, 2, 2.0) == 2.0 + 12.0


def test_how_close_a_guard_comes_to_zero_at_the_ends():
    for first, last, close, tiny in (
        (3.0, -4.0, False, False),
        (-1.5, 4.0, True, False),
        (3.0, 1.5, True, False),
        (UNDERFLOW, 0.5 * UNDERFLOW, True, False),
        (0.5 * UNDERFLOW, -UNDERFLOW, True, False),
        (0.5 * UNDERFLOW, -0.5 * UNDERFLOW, True, True),
        (0.0, 0.0, True, True),
    ):
        series = column(first, 9.0, last, 99.0)
        assert kernels.is_close(series, 1, 1, 2.0) == close
        assert kernels.underflows_on_series(series, 1, 1) == tiny


class TestIsResolved:
    """A series of third order on a step of 2, of a guard that is twice the second of two components."""

    def resolved(self, guard=(1.0, 0.0, 0.0, 0.0), end=1.0, total=0.0, state=((0.0,) * 4,) * 2, **given):
        series = np.zeros((6, 3))
        series[:4, 2] = guard
        series[4, 2], series[5, 2] = end, total
        for i in range(2):
            series[:4, i] = state[i]
        series[4, :2] = given.get("last", (1.0, 1.0))
        asked = []

        def keeps_sign(model, transition, t, x, work):
            asked.append((transition, t, x.tolist(), work.field_after.tolist()))
            return given.get("keeps", (True, True))[len(asked) - 1]

        def gradient(transition, t, x, parameters, out):
            assert (transition, t) == (3, 7.0)
            out[:] = 0.0, 2.0, given.get("rate", 0.0)

        model = SimpleNamespace(
            dimension=2,
            degree=np.array([0, given.get("degree", 0)]),
            guard_gradient=gradient,
            parameters=None,
            period=given.get("period", 0.0),
            propagator=np.array([9, given.get("kind", TAYLOR)]),
            root=np.array([9, 2]),
        )
        run = SimpleNamespace(mode=1, y=np.array(given.get("y", (5.0, 0.0))))
        work = SimpleNamespace(
            series=series, gradient=np.zeros(3), trial=np.zeros(2), field_after=np.zeros(2)
        )
        tested = plain(series_guards, keeps_sign=keeps_sign)
        found = tested.is_resolved_by_series(
            model, run, 3, given.get("column", 2), 3, 7.0, 2.0, -1, given.get("on_guard", 0), work
        )
        self.asked = asked
        return found

    def test_polynomials_and_guards_that_are_zero_are(self):
        tiny = (0.5 * UNDERFLOW, 0.0, 0.0, 1.0)
        assert not self.resolved(tiny)
        assert self.resolved(tiny, degree=1)
        assert self.resolved(tiny, on_guard=BY_SPEED)
        assert not self.resolved((-0.5 * UNDERFLOW, 0.0, 0.0, 0.0), last=(1.0, 1e300))

    def test_the_last_terms_are_far_less_than_the_guard(self):
        """A third power of 1/8 is 1 on the step: the guard has to be 100 at both ends."""
        for first, end, found in ((101.0, 101.0, True), (101.0, -101.0, True), (99.0, 101.0, False)):
            assert self.resolved((first, 0.0, 0.0, 0.125), end) == found
            assert self.resolved((first, 0.0, 0.0, -0.125), -end) == found
        assert not self.resolved((101.0, 0.0, 0.0, 0.125), 99.0)
        # Rounding of the sum counts too.
        assert not self.resolved((101.0, 0.0, 0.0, 0.125), 101.0, total=2.0 / EPSILON)
        assert self.resolved((101.0, 0.0, 0.0, 0.125), 101.0, total=0.5 / EPSILON)

    def test_or_less_than_rounding_of_the_state(self):
        error = MARGIN * 8.0 * 1e-15
        size = error / (16.0 * EPSILON)
        guard = (1e-20, 0.0, 0.0, 1e-15)
        for factor in (0.99, 1.01):
            assert self.resolved(guard, y=(0.0, -0.5 * factor * size)) == (factor > 1.0)
            assert self.resolved(guard, last=(0.0, -0.5 * factor * size)) == (factor > 1.0)
            assert self.resolved(guard, last=(0.0, 0.0), rate=-factor * size / 7.0) == (factor > 1.0)
            assert self.resolved(guard, last=(0.0, 0.0), rate=factor * size / 9.0, period=9.0) == (
                factor > 1.0
            )
        # The root of a guard is larger than the guard.
        root = error**2 / (16.0 * EPSILON)
        for factor in (0.99, 1.01):
            y = (0.0, 0.5 * factor * root)
            assert self.resolved(guard, y=y, last=(0.0, 0.0), kind=ROOTED) == (factor > 1.0)

    def test_a_guard_that_is_no_series_keeps_its_sign_for_all_errors_of_the_state(self):
        state = ((1.0, 0.0, 0.0, 0.125), (3.0, 0.0, 0.0, 1e-16))
        for keeps, found in (((True, True), True), ((False, True), False), ((True, False), False)):
            assert self.resolved(state=state, column=-1, keeps=keeps, last=(2.0, -1.0), y=(1.0, 3.0)) == found
            # An error below rounding does not count.
            assert self.asked[0] == (3, 7.0, [1.0, 3.0], [1.0, 0.0])
            assert self.asked[1:] == ([(3, 9.0, [2.0, -1.0], [1.0, 0.0])] if keeps[0] else [])

    @pytest.mark.parametrize("place", ["first", "second", "last"])
    def test_the_size_of_a_component_is_its_largest(self, place):
        """An error of 1 is rounding for a size above 1 / (16 roundings)."""
        size = 1.0 / (16.0 * EPSILON)
        for factor in (0.99, 1.01):
            value = -factor * size
            powers = [
                value if place == "first" else 0.0,
                0.5 * value if place == "second" else 0.0,
                0.0,
                0.125,
            ]
            if place == "second":
                # The term counts among the last ones, too.
                powers = [0.0, 0.5 * value, 0.0, 0.0]
            last = (value if place == "last" else 0.0, 0.0)
            self.resolved(state=(powers, (0.0,) * 4), column=-1, last=last)
            error = self.asked[0][3][0]
            if place == "second":
                assert error == factor * size
            else:
                assert error == (0.0 if factor > 1.0 else 1.0)


class TestEarliest:
    """One state, and guards that are polynomials on a step of 2 from the time 7."""

    H, ORDER = 2.0, 12

    def earliest(self, *guards, sides=None, on_guard=None, kind=TAYLOR, band=0.0, rounding=0.0, **given):
        count = len(guards)
        series = np.zeros((self.ORDER + 3, 1 + count))
        for i, powers in enumerate(guards, 1):
            series[: len(powers), i] = powers
            terms = np.array(powers) * self.H ** np.arange(len(powers))
            series[-2, i], series[-1, i] = terms.sum(), np.abs(terms).sum()
        series[-2, 0] = 55.0
        asked = []

        def beside(model, method, run, transition, order, t, h, clock, work):
            asked.append((transition, order, t, h, clock))
            run.rehearsal[3, transition] = given.get("side_beside", -1)
            return given["beside"]

        def underflows(model, transition, t, x, later, y, scalar):
            asked.append(("underflows", t, later, y.tolist()))
            return given.get("underflows", False)

        def resolved(model, run, transition, column, order, t, h, clock, held, work):
            asked.append((transition, column, held))
            return given.get("resolved", True)

        tested = plain(
            series_guards,
            rounding_band=lambda *given: rounding,
            error_band=lambda *given: band,
            is_resolved_by_series=resolved,
            underflows=underflows,
        )
        first = 1
        transitions = np.arange(first, first + count)
        model = SimpleNamespace(
            dimension=1,
            parameters=None,
            propagator=np.array([9, kind]),
            root=np.array([9, 2]),
            first_outgoing=np.array([0, 1, 1 + count]),
            outgoing=np.array([0, *transitions]),
            guard_in_series=np.array([9, *([0] if "beside" in given else [1]) * count]),
            direction=np.array([9, *given.get("directions", [0] * count)]),
            guard_gradient=lambda *given: None,
        )
        sides = sides or [1 if each[0] > 0.0 else -1 for each in guards]
        run = run_at_guards(np.zeros(1), sides, on_guard, given.get("fired", -1))
        work = SimpleNamespace(
            series=series,
            gradient=np.zeros(2),
            trial=np.zeros(1),
            scalar=np.zeros(1),
            polynomial=np.zeros(40),
            stack=np.zeros((80, 40)),
        )
        attempts = SimpleNamespace(crossing_beside_series=beside)
        found = tested.earliest_on_series(
            attempts, model, SimpleNamespace(), run, self.ORDER, 7.0, self.H, -1, work
        )
        self.run, self.asked = run, asked
        return found

    @staticmethod
    def powers(*roots, factor=1.0):
        """The power coefficients of a guard with these roots."""
        return [*(factor * np.polynomial.Polynomial.fromroots(roots).coef)]

    NONE = (NO_ROOT, NO_TRANSITION, 1.0, NO_TRANSITION)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize("kind", [TAYLOR, EXACT])
    def test_a_falling_guard_crosses_at_its_root(self, way, kind):
        for root in (0.25, 1.0, 1.75):
            for direction in (0, -1, 1):
                found = self.earliest(
                    self.powers(root, 5.0, factor=way), directions=[way * direction], kind=kind
                )
                if direction == 1:
                    assert found == self.NONE
                    # An event on the last half of the rest of the step finds it on the other side.
                    assert self.run.side[1] == self.run.rehearsal[3, 1] == -way
                    assert self.run.passed[1] == pytest.approx(0.5 + root / 4.0, rel=1e-14)
                else:
                    assert found == (pytest.approx(root / 2.0, rel=1e-14), 1, 1.0, NO_TRANSITION)
                    assert self.run.side[1] == way
                    assert self.run.rehearsal[3, 1] == way
                assert self.run.rehearsal[0, 1] == way

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_crossing_on_the_later_half(self, way):
        """``3 + t - 1.5 t^2`` rises before it falls."""
        found = self.earliest([3.0 * way, way, -1.5 * way])
        assert found[:2] == (pytest.approx((1.0 + math.sqrt(19.0)) / 6.0, rel=1e-14), 1)
        assert self.run.rehearsal[3, 1] == way

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_the_earliest_of_several(self, way):
        near, far, none = (self.powers(root, factor=way) for root in (0.5, 1.5, 9.0))
        for guards, place in (((near, far, none), 1), ((far, none, near), 3), ((none, near, near), 2)):
            found = self.earliest(*guards)
            assert found == (pytest.approx(0.25, rel=1e-14), place, 1.0, NO_TRANSITION)
            assert self.run.side.tolist() == [9, -way, -way, -way]
        assert self.earliest(none, none) == self.NONE
        assert self.run.rehearsal[3].tolist() == [88, 0, 0]

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_guard_that_turns_back_crosses_twice(self, way):
        powers = self.powers(0.5, 0.75, factor=way)
        assert self.earliest(powers, directions=[-way])[0] == pytest.approx(0.25, rel=1e-14)
        found = self.earliest(powers, directions=[way])
        assert found == (pytest.approx(0.375, rel=1e-14), 1, 1.0, NO_TRANSITION)
        assert self.run.rehearsal[3, 1] == -way

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_touches(self, way):
        """Closer to zero than the band, which is that of rounding for an exact series."""
        for gap, band, rounding, kind, place in (
            (1e-6, 1e-5, 0.0, TAYLOR, 0.4),
            (1e-6, 1e-7, 0.0, TAYLOR, NO_ROOT),
            (1e-6, 0.0, 1e-5, EXACT, 0.4),
            (1e-6, 1e-5, 0.0, EXACT, NO_ROOT),
        ):
            powers = np.array(self.powers(0.8, 0.8, factor=way))
            powers[0] += way * gap
            found = self.earliest([*powers], band=band, rounding=rounding, kind=kind)
            assert found == self.NONE
            assert self.run.grazing_place == pytest.approx(place, rel=1e-6)

    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize("kind", [TAYLOR, ROOTED, DESINGULARISED])
    def test_roots_at_the_start_are_known(self, way, kind):
        for on_guard in (1, 2, 3):
            roots = min(on_guard, 1) if kind != TAYLOR and on_guard != BY_STEP else on_guard
            powers = self.powers(*[0.0] * roots, 0.5, factor=-way)
            found = self.earliest(powers, sides=[way], on_guard=[on_guard], kind=kind)
            assert found == (pytest.approx(0.25, rel=1e-13), 1, 1.0, NO_TRANSITION)
            assert self.run.on_guard[1] == 0
            assert self.run.rehearsal[1, 1] == on_guard

    def test_a_guard_at_rest_stays_on_zero(self):
        for rounding, stays in ((1.01e-3, True), (0.99e-3, False)):
            self.earliest([0.0, 0.5e-3], sides=[1], on_guard=[BY_SPEED], rounding=rounding)
            assert self.run.on_guard[1] == (BY_SPEED if stays else 0)
        # A value at the start is rounding, too.
        self.earliest([5.0, 0.5e-3], sides=[1], on_guard=[BY_SPEED], rounding=1.01e-3)
        assert self.run.on_guard[1] == BY_SPEED
        self.earliest([5.0, 0.5e-3], sides=[1], on_guard=[BY_SPEED], rounding=0.99e-3)
        assert self.run.on_guard[1] == 0
        # It is one of a root in the series of a root.
        self.earliest([0.0, 0.5e-3], sides=[1], on_guard=[BY_SPEED], rounding=1.1e-6, kind=ROOTED)
        assert self.run.on_guard[1] == BY_SPEED
        self.earliest([0.0, 0.5e-3], sides=[1], on_guard=[BY_SPEED], rounding=0.9e-6, kind=ROOTED)
        assert self.run.on_guard[1] == 0

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_guard_whose_step_shows_the_side(self, way):
        """It goes the other way at once: that is a crossing unless its transition has just fired."""
        powers = [0.0, 0.0, 0.0, way]
        found = self.earliest(powers, sides=[-way], on_guard=[BY_STEP])
        assert found[:2] == (0.0, 1)
        assert self.earliest(powers, sides=[-way], on_guard=[BY_STEP], fired=1) == self.NONE
        assert self.run.side[1] == way

    @pytest.mark.parametrize("way", [1.0, -1.0])
    @pytest.mark.parametrize("roots", [(0.5,), (0.5, 0.75)])
    def test_a_crossing_that_the_error_may_have_made_is_blurred(self, way, roots):
        """A line of first order is far longer than its last terms, which are zero."""
        powers = self.powers(*roots, factor=way)
        found = self.earliest(powers, resolved=False)
        assert found[3] == (NO_TRANSITION if len(roots) == 1 else 1)
        long = [*self.powers(0.5, factor=-way), *[1e-3 * way] * (self.ORDER - 1)]
        found = self.earliest(long, resolved=False)
        assert (found[1], found[3]) == (1, 1)
        assert self.asked == [(1, 1, 0)]

    @pytest.mark.parametrize("way", [1.0, -1.0])
    def test_a_guard_that_underflows_has_no_crossing(self, way):
        for roots in ((0.5,), (0.5, 0.75), (0.9, 1.1)):
            powers = self.powers(*roots, factor=way * 1e-255)
            assert self.earliest(powers) == self.NONE
            assert self.run.side[1] == (way if len(roots) == 2 else -way)

    @pytest.mark.parametrize("side", [1, -1])
    def test_guards_that_are_no_series(self, side):
        for theta, share, fired, proved in ((0.25, 1.0, 1, 1.0), (NO_ROOT, 0.5, NO_TRANSITION, 0.5)):
            found = self.earliest([side], beside=(theta, share), side_beside=-side)
            assert found == (theta, fired, proved, NO_TRANSITION)
            assert self.asked[0] == (1, self.ORDER, 7.0, 2.0, -1)
            assert self.asked[1:] == [("underflows", 7.0, 9.0, [55.0]), (1, -1, 0)]
            assert self.run.side[1] == (side if fired == 1 else -side)
            assert self.run.rehearsal[3, 1] == side
        found = self.earliest([side], beside=(0.25, 1.0), resolved=False)
        assert found == (0.25, 1, 1.0, 1)
        found = self.earliest([side], beside=(0.25, 0.5), underflows=True)
        assert found == (NO_ROOT, NO_TRANSITION, 0.5, NO_TRANSITION)
        assert self.run.rehearsal[3, 1] == 0
        found = self.earliest([side], [side], beside=(0.25, 1.0))
        assert found == (0.25, 1, 1.0, NO_TRANSITION)
