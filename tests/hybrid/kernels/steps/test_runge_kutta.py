"""A step of a Runge-Kutta method, rule by rule: its length, its first event, what it leaves behind."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.steps import runge_kutta
from hybrid.kernels.steps.runge_kutta import CLOSEST, FINEST, GROW, SAFETY, SHRINK
from hybrid.kernels.steps.runge_kutta_guards import NOT_THERE
from hybrid.kernels.types.codes import GO_ON, NO_TRANSITION, NON_FINITE, READY, STALE, STEP_TOO_SMALL
from hybrid.kernels.types.layout import EPSILON
from tests.hybrid.kernels.plain import plain

kernels = plain(runge_kutta)


def graph(*modes):
    """Transitions that leave each mode, as index arrays."""
    return {
        "first_outgoing": np.cumsum([0, *map(len, modes)]),
        "outgoing": np.array([each for some in modes for each in some], dtype=int),
    }


def test_whether_all_guards_of_a_mode_are_affine():
    model = SimpleNamespace(affine_guard=np.array([1, 0, 1, 1]), **graph((0, 1), (2, 3), (), (1,)))
    assert [kernels.all_affine(model, mode) for mode in range(4)] == [False, True, True, False]


# Rates of two components, of one tangent vector, and the divergence.
STAGES = np.array(
    [[1.0, 2.0, 3.0, 4.0, 5.0], [-1.0, 4.0, 1.0, 2.0, 7.0], [6.0, -3.0, 2.0, 8.0, 9.0], [5.0] * 5]
)
POWERS = np.array([[0.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [-0.5, 1.0, 2.0, 0.25]])


def method_of(**others):
    return SimpleNamespace(
        a=np.zeros((4, 4)), b=np.zeros(2), powers=POWERS, quadrature=np.array([0.5, 0.25, 2.0]), **others
    )


def test_a_step_is_recorded_as_powers_of_a_place_on_it():
    """Rows of the record beyond the powers of the method are zero, whatever an earlier step has left."""
    asked = []
    record = SimpleNamespace(step_coefficients=np.full((3, 5, 3), 99.0))

    def start_record(*given):
        assert given[1:] == (record, 7.0, 0.5)
        return 1

    tested = plain(
        runge_kutta, interpolation_stages=lambda *given: asked.append(given), start_record=start_record
    )
    model, run = SimpleNamespace(dimension=2), SimpleNamespace(mode=3, y=np.array([10.0, 20.0, 30.0, 40.0]))
    method, work = method_of(), SimpleNamespace(stages=STAGES)
    tested.remember_step(model, method, run, record, 7.0, 0.5, work)
    assert asked == [(model, method, 3, 7.0, 0.5, run.y, work)]
    expected = np.zeros((5, 3))
    expected[0, :2] = 10.0, 20.0
    expected[1:3, :2] = 0.5 * POWERS[1:] @ STAGES[:, :2]
    expected[1, 2] = 0.5
    assert record.step_coefficients[1].tolist() == expected.tolist()
    assert np.all(record.step_coefficients[[0, 2]] == 99.0)


def test_a_touch_is_recorded_at_its_place_on_the_part_of_the_step_that_is_taken():
    asked = []
    tested = plain(
        runge_kutta,
        interpolation_stages=lambda *given: asked.append(given[2:5]),
        interpolant_path=lambda *given: asked.append(given[1]),
        state_at=lambda *given: asked.append(given[1:4]),
        remember_touch=lambda model, run, record, place, time, work: asked.append((place, time)),
    )
    run = SimpleNamespace(mode=3, y=np.zeros(2), grazing_place=0.25)
    work = SimpleNamespace(path=None, state=None)
    tested.remember_touch_on_step(SimpleNamespace(dimension=2), method_of(), run, None, 7.0, 2.0, 4.0, work)
    # A quarter of a step of 4 is half of the 2 that are taken of it.
    assert asked == [(3, 7.0, 2.0), 2.0, (2, 2, 0.5), (0.5, 8.0)]


@pytest.mark.parametrize("on_guard", [0, 1, 3])
@pytest.mark.parametrize("tangents", [0, 1])
def test_the_end_of_a_step_is_accepted(on_guard, tangents):
    """A size is kept on a guard; the divergence is that of the step and of the Euler step after it."""
    model = SimpleNamespace(dimension=2, **graph((), (0, 1), (2,)))
    run = SimpleNamespace(
        mode=1,
        on_guard=np.array([on_guard, 0, 4]),
        scale=np.array([9.0, 9.0]),
        y=np.array([1.0, -6.0, 3.0, 4.0, 5.0]),
        divergence=100.0,
    )
    work = SimpleNamespace(stages=10.0 * STAGES, new=np.array([-2.0, 5.0, 7.0, 8.0, 9.0]))
    kernels.accept(model, method_of(), run, tangents, 0.5, 0.125, work)
    # The first component moves by 5, the second one by 10.
    assert run.scale.tolist() == ([9.0, 10.0] if on_guard else [5.0, 10.0])
    if tangents:
        assert run.y.tolist() == [-2.0, 5.0, 7.0, 8.0, 5.0]
        total = 50.0 * 0.5 + 70.0 * 0.25 + 90.0 * 2.0
        assert run.divergence == 100.0 + 0.5 * total + 0.125 * 90.0
    else:
        assert run.y.tolist() == [-2.0, 5.0, 3.0, 4.0, 5.0]
        assert run.divergence == 100.0


@pytest.mark.parametrize("component", [0, 1])
def test_the_size_of_a_component_is_the_largest_of_the_step(component):
    for y, new, rate, size in ((-3.0, 1.0, 2.0, 3.0), (1.0, -4.0, 2.0, 4.0), (1.0, 2.0, -20.0, 10.0)):
        run = SimpleNamespace(mode=0, on_guard=np.zeros(0, dtype=int), scale=np.zeros(2), y=np.zeros(2))
        work = SimpleNamespace(stages=np.zeros((3, 3)), new=np.zeros(2))
        run.y[component], work.new[component], work.stages[0, component] = y, new, rate
        kernels.accept(SimpleNamespace(dimension=2, **graph(())), method_of(), run, 0, 0.5, 0.0, work)
        assert run.scale[component] == size
        assert run.scale[1 - component] == 0.0


class TestFindEvent:
    """The attempted step is 4 long, from the time 7 on; the rounding of time is that of 1."""

    H, T, EULER = 4.0, 7.0, 1e-3

    def find(self, *crossings, affine=True, h=H, **answers):
        """What is found for these crossings, one for each search, and what was asked for on the way."""
        calls, left = [], list(crossings)
        answers = {
            "reach": NOT_THERE,
            "land": (NOT_THERE, 0.0),
            "drowns": False,
            "is_beyond": False,
        } | answers

        def told(name, answer=None):
            def tell(*given):
                numbers = [each for each in given if type(each) in (int, float)]
                calls.append((name, *numbers))
                return answer

            return tell

        def earliest_crossing(model, method, run, t, h, ignored, touched, work):
            calls.append(("search", t, h, ignored, touched))
            return left.pop(0)

        tested = plain(
            runge_kutta,
            interpolation_stages=told("stages"),
            interpolant_path=told("path"),
            earliest_crossing=earliest_crossing,
            measured_time=lambda model, run, mode: 1.0,
            restore_sides=told("restore"),
            attempt_again=told("again"),
            note_touch=told("touch"),
            share_with_one_touch=lambda run: answers.get("share", NO_ROOT),
            **{name: told(name, answers[name]) for name in ("reach", "land", "drowns", "is_beyond")},
        )
        run = SimpleNamespace(
            mode=2,
            phase=answers.get("phase", self.T),
            y=None,
            rehearsal=np.array([[11, 12], [0, 0], [0, 0], [13, 14]]),
            last_fired=answers.get("fired", -1),
            since_entry=answers.get("since", 0.0),
        )
        run.rehearsal[0] = answers.get("side", 1)
        model = SimpleNamespace(
            dimension=1,
            affine_guard=np.array([1, int(affine)]),
            direction=np.array([0, answers.get("direction", 0)]),
            **graph((), (), (0, 1)),
        )
        task = SimpleNamespace(
            attempts=None, model=model, method=None, run=run, record=None, work=None, tangents=6
        )
        found = tested.find_event(task, h)
        assert not left
        self.run = run
        return found, calls

    NONE = (NO_ROOT, NO_TRANSITION, 1.0, NO_TRANSITION)

    @pytest.mark.parametrize("affine", [True, False])
    def test_without_a_crossing_the_step_is_whole(self, affine):
        found, calls = self.find(self.NONE, affine=affine)
        assert found == (4.0, 0.0, NO_TRANSITION)
        path = [] if affine else [("path", 4.0, 1)]
        assert calls == [("stages", 2, 7.0, 4.0), *path, ("search", 7.0, 4.0, NO_TRANSITION, 0.0)]

    def test_a_step_with_two_touches_is_cut_between_them(self):
        found, calls = self.find(self.NONE, share=0.25)
        assert found == (1.0, 0.0, NO_TRANSITION)
        assert calls[2:] == [("again", 2, 7.0, 1.0, 6)]

    @pytest.mark.parametrize("theta", [NO_ROOT, 0.75])
    def test_a_step_is_cut_to_its_proved_part(self, theta):
        found, calls = self.find((theta, 1, 0.5, NO_TRANSITION))
        assert found == (2.0, 0.0, NO_TRANSITION)
        assert calls[2:] == [("again", 2, 7.0, 2.0, 6)]

    def test_a_crossing_before_the_end_of_the_proved_part_is_landed_on(self):
        found, calls = self.find((0.25, 1, 0.5, NO_TRANSITION), land=(0.9, self.EULER))
        assert found == (0.9, self.EULER, 1)
        assert calls[2:] == [("land", 1, 2, 7.0, 1.0, 4.0, 0.25, 6)]

    def test_a_flight_that_drowns_in_rounding_ends_at_the_crossing(self):
        found, calls = self.find((0.25, 1, 1.0, NO_TRANSITION), drowns=True)
        assert found == (1.0, 0.0, 1)
        assert calls[3:] == [("drowns", 1, 7.0, 0.25, 4.0), ("again", 2, 7.0, 1.0, 6)]

    def test_a_guard_that_is_beyond_zero_at_the_end_fires_at_the_crossing(self):
        found, calls = self.find((0.25, 1, 1.0, NO_TRANSITION), is_beyond=True)
        assert found == (1.0, 0.0, 1)
        assert calls[4:] == [
            ("again", 2, 7.0, 4.0, 6),
            ("is_beyond", 1, 11.0),
            ("again", 2, 7.0, 1.0, 6),
        ]

    def test_a_crossing_of_the_interpolant_alone_is_a_touch(self):
        """The step is searched again without that guard."""
        found, calls = self.find((0.25, 1, 1.0, NO_TRANSITION), self.NONE)
        assert found == (4.0, 0.0, NO_TRANSITION)
        assert calls[4:] == [
            ("again", 2, 7.0, 4.0, 6),
            ("is_beyond", 1, 11.0),
            ("touch", 1, 0.25, 0.0),
            ("stages", 2, 7.0, 4.0),
            ("search", 7.0, 4.0, 1, 0.25),
        ]
        found, _ = self.find((0.25, 1, 1.0, NO_TRANSITION), (0.5, 0, 1.0, NO_TRANSITION))
        assert found == (4.0, 0.0, NO_TRANSITION)

    def test_a_step_whose_error_may_have_made_the_crossing_is_shortened(self):
        found, calls = self.find((0.25, 1, 1.0, 1))
        assert found == (0.0, 0.0, NO_TRANSITION)
        assert calls[2:] == [("restore",)]
        shortest = 2.0 * FINEST
        assert self.find((0.25, 1, 1.0, 1), h=1.01 * shortest)[0] == (0.0, 0.0, NO_TRANSITION)

    @pytest.mark.parametrize("side", [1, -1])
    @pytest.mark.parametrize("direction", [-1, 0, 1])
    @pytest.mark.parametrize(
        ("phase", "fired", "since", "returns"),
        [
            # The step is 6 roundings of 1 long.
            (7.0, 1, 6.9, True),
            (7.0, 1, 7.1, False),
            (-7.0, 1, 6.9, True),
            (5.0, 1, 5.9, True),
            (5.0, 1, 6.1, False),
            (7.0, 0, 0.0, False),
        ],
    )
    def test_the_shortest_step_reaches_a_guard_that_holds_the_state(
        self, side, direction, phase, fired, since, returns
    ):
        h = 1.5 * FINEST
        found, calls = self.find(
            (0.25, 1, 1.0, 1),
            h=h,
            phase=phase,
            reach=0.125,
            side=side,
            direction=direction,
            fired=fired,
            since=since * EPSILON,
        )
        if direction in (0, -side) and not returns:
            assert found == (0.0, 0.125, 1)
        else:
            assert math.isnan(found[0])
            assert found[1:] == (0.0, NO_TRANSITION)
        assert calls[2:] == [("reach", 1, phase, h, 6), ("restore",)]
        assert self.run.rehearsal[3].tolist() == [13, side]

    def test_the_shortest_step_goes_on_where_there_is_no_guard(self):
        found, calls = self.find((NO_ROOT, NO_TRANSITION, 1.0, 1), h=1.5 * FINEST)
        assert found == (1.5 * FINEST, 0.0, NO_TRANSITION)
        assert calls[2:] == [("reach", 1, 7.0, 1.5 * FINEST, 6), ("again", 2, 7.0, 1.5 * FINEST, 6)]


def bent(band):
    """A guard ``1e-3 (s - 0.5)`` on a step of 4 from the time 7, whose path is the place itself."""

    def guard(transition, t, x, parameters, out):
        assert (transition, t) == (1, 7.0 + 4.0 * x[0])
        out[0] = 1e-3 * (x[0] - 0.5)

    def rounding_band(model, run, transition, t, x, work):
        assert (transition, t, work.gradient[0]) == (1, 7.0 + 4.0 * x[0], 5.0)
        return band

    def gradient(transition, t, x, parameters, out):
        assert (transition, t) == (1, 7.0 + 4.0 * x[0])
        out[0] = 5.0

    model = SimpleNamespace(
        dimension=1, affine_guard=np.array([1, 0]), guard=guard, guard_gradient=gradient, parameters=None
    )
    work = SimpleNamespace(
        path=np.array([[0.0], [1.0], [0.0]]),
        state=np.zeros(1),
        new=np.zeros(1),
        scalar=np.zeros(1),
        gradient=np.zeros(2),
    )
    return plain(runge_kutta, rounding_band=rounding_band), model, work


def test_a_flight_is_all_rounding_if_its_start_middle_and_end_are():
    for band, theta, expected in ((0.5e-3, 1.0, True), (0.49e-3, 1.0, False), (0.2e-3, 1.0, False)):
        tested, model, work = bent(band)
        assert tested.drowns(model, method_of(), None, 1, 7.0, theta, 4.0, work) == expected
    tested, model, work = bent(0.5e-3)
    assert not tested.drowns(model, method_of(), None, 1, 7.0, 1.01, 4.0, work)
    # In the middle alone it may be farther from zero.
    model.guard = lambda transition, t, x, parameters, out: out.__setitem__(0, float(x[0] == 0.5))
    assert not tested.drowns(model, method_of(), None, 1, 7.0, 1.0, 4.0, work)
    assert tested.drowns(model, method_of(), None, 1, 7.0, 0.9, 4.0, work)
    model.affine_guard[1] = 1
    assert not tested.drowns(model, method_of(), None, 1, 7.0, 0.9, 4.0, work)


def test_the_end_of_a_step_is_beyond_a_guard_if_it_is_so_by_more_than_rounding():
    tested, model, work = bent(0.125e-3)
    for place, side, expected in (
        (1.0, -1, True),
        (1.0, 1, False),
        (0.0, 1, True),
        (0.0, -1, False),
        (0.6, -1, False),
        (0.4, 1, False),
    ):
        work.new[0] = place
        assert tested.is_beyond(model, None, 1, side, 7.0 + 4.0 * place, work) == expected


def test_rates_at_the_end_are_carried_to_the_next_start():
    work = SimpleNamespace(stages=STAGES.copy())
    kernels.carry_rates(method_of(), 3, work)
    assert work.stages[0].tolist() == [6.0, -3.0, 2.0, 8.0, 5.0]
    assert work.stages[1:].tolist() == STAGES[1:].tolist()


@pytest.mark.parametrize(
    ("last_step", "last_ratio", "h", "ratio", "factor"),
    [
        # Without a step before, the ratio alone: its square root with an exponent of 1/2.
        (0.0, 0.0, 1.0, 0.25, 2.0),
        (0.0, 0.0, 1.0, 4.0, 0.5),
        # A trend to shorter steps counts, one to longer steps does not.
        (2.0, 0.25, 1.0, 0.25, 2.0 * 0.5),
        (1.0, 0.0625, 1.0, 0.25, 2.0 * 0.5),
        (0.5, 0.25, 1.0, 0.25, 2.0),
        (1.0, 1.0, 1.0, 0.25, 2.0),
        (0.5, 0.015625, 1.0, 0.25, 2.0 * 2.0 * 0.25),
    ],
)
def test_the_factor_of_the_next_step(last_step, last_ratio, h, ratio, factor):
    run = SimpleNamespace(last_step=last_step, last_ratio=last_ratio)
    found = kernels.growth_factor(SimpleNamespace(exponent=0.5), run, h, ratio)
    assert found == pytest.approx(SAFETY * factor, rel=1e-14)


def test_the_factor_of_the_next_step_is_bounded():
    run = SimpleNamespace(last_step=0.0, last_ratio=0.0)
    assert kernels.growth_factor(SimpleNamespace(exponent=0.5), run, 1.0, 1e-16) == GROW
    assert kernels.growth_factor(SimpleNamespace(exponent=0.5), run, 1.0, 1e16) == SHRINK


def test_angles_of_tangent_vectors_limit_a_step():
    """The logarithm of the product of their sines is 1 at its limit; the ratio follows by the exponent."""
    for product, ratio in (
        (1.0, 0.0),
        (-1.0, 0.0),
        (1.5, 0.0),
        (0.0, math.inf),
        (math.exp(-2.0 * CLOSEST), 1.0),
        (math.exp(-CLOSEST), 0.25),
        (math.exp(-4.0 * CLOSEST), 4.0),
    ):
        asked = []

        def independence(*given, product=product, asked=asked):
            asked.append(given)
            return product

        tested = plain(runge_kutta, independence=independence)
        work = SimpleNamespace(new="new", jacobian="scratch")
        found = tested.alignment_ratio(SimpleNamespace(exponent=0.5), 3, 2, work)
        assert found == pytest.approx(ratio, rel=1e-12)
        assert asked == [("new", 3, 2, "scratch")]


class TestStep:
    """A step of a method of second order from the time 7; the rounding of time is that of 1."""

    def step(
        self, *, remaining=100.0, ratio=0.25, outgoing=(), event=None, orthonormal=0, implicit=0, **given
    ):
        calls = []

        def told(name, answer=None):
            def tell(*given):
                calls.append((name, *[each for each in given if type(each) in (int, float)]))
                return answer

            return tell

        names = {"rates": None, "starting_step": given.pop("start", 1.0), "attempt": ratio}
        names |= {"alignment_ratio": given.pop("alignment", 0.0), "find_event": event}
        names |= {"reach_any": given.pop("reaches", (NOT_THERE, NO_TRANSITION)), "accept": None}
        names |= {
            "remember_touch_on_step": None,
            "remember_step": None,
            "carry_rates": None,
            "sides_at": None,
        }
        tested = plain(
            runge_kutta,
            measured_time=lambda *given: 1.0,
            is_forced=lambda *given, forced="explained" in given: self.forced,
            **{name: told(name, answer) for name, answer in names.items()},
        )
        self.forced = "explained" in given or "shortened" in given
        attempts = SimpleNamespace(
            explained_step=told("explained step", given.pop("shortened", 2.0)),
            explained_attempt=told("explained attempt", given.pop("explained", math.inf)),
        )
        run = SimpleNamespace(
            mode=0,
            phase=7.0,
            y=None,
            stage=READY,
            next_step=2.0,
            last_step=0.0,
            last_ratio=0.0,
            steps=10,
            rejected=5,
            pending=77,
            grazing_place=NO_ROOT,
            first_step=np.zeros(1),
        )
        method = SimpleNamespace(
            exponent=0.5, max_step=math.inf, implicit=implicit, b=np.zeros(2), a=np.zeros((3, 3))
        )
        record = SimpleNamespace(step_phase=np.zeros(given.pop("room", 0)))
        method.max_step = given.pop("max_step", math.inf)
        for name, value in given.items():
            assert hasattr(run, name)
            setattr(run, name, value)
        task = SimpleNamespace(
            attempts=attempts,
            model=SimpleNamespace(dimension=2, **graph(outgoing)),
            method=method,
            run=run,
            record=record,
            work=SimpleNamespace(stages=[None]),
            tangents=3,
            orthonormal=orthonormal,
        )
        self.run = run
        code, length = tested.runge_kutta_step(task, remaining)
        return (code, length), calls

    def test_an_accepted_step(self):
        found, calls = self.step()
        assert found == (GO_ON, 2.0)
        assert calls == [("attempt", 0, 7.0, 2.0, 3), ("accept", 3, 2.0, 0.0), ("carry_rates", 8)]
        run = self.run
        # Its error is a quarter of the tolerance: the next step is 0.9 times twice as long.
        assert run.next_step == pytest.approx(2.0 * SAFETY * 2.0, rel=1e-14)
        assert (run.last_step, run.last_ratio, run.steps, run.rejected) == (2.0, 0.25, 11, 5)
        assert (run.pending, run.stage, run.first_step[0]) == (NO_TRANSITION, READY, 2.0)
        assert self.step(first_step=np.array([0.5]))[0] == (GO_ON, 2.0)
        assert self.run.first_step[0] == 0.5

    def test_rates_that_are_stale_are_evaluated_first(self):
        found, calls = self.step(stage=STALE)
        assert found == (GO_ON, 2.0)
        assert calls[:2] == [("rates", 0, 7.0, 3), ("attempt", 0, 7.0, 2.0, 3)]
        assert self.run.stage == READY
        for length in (0.0, -1.0):
            found, calls = self.step(stage=STALE, next_step=length, start=0.5)
            assert found == (GO_ON, 0.5)
            assert calls[1] == ("starting_step", 0, 7.0, 3, 100.0)
        for length in (0.0, math.nan):
            assert self.step(stage=STALE, next_step=0.0, start=length)[0] == (NON_FINITE, 0.0)

    def test_the_last_step_ends_at_the_end(self):
        """Its length says nothing of the next one, unless that may be longer."""
        for remaining, ratio, following in ((0.5, 0.25, 2.0), (2.0, 0.25, 3.6), (0.5, 1e-30, 3.0)):
            found, _ = self.step(remaining=remaining, ratio=ratio)
            assert found == (GO_ON, remaining)
            assert self.run.next_step == pytest.approx(following, rel=1e-14)
        assert self.run.last_ratio == 1e-16

    def test_the_longest_step(self):
        assert self.step(max_step=0.75)[0] == (GO_ON, 0.75)
        assert self.step(max_step=0.75, remaining=0.5)[0] == (GO_ON, 0.5)

    @pytest.mark.parametrize(
        ("ratio", "shrink"),
        [(4.0, 0.45), (1.000001, 0.9), (1e6, SHRINK), (math.inf, SHRINK), (math.nan, 0.1)],
    )
    def test_a_rejected_step_is_shortened(self, ratio, shrink):
        found, calls = self.step(ratio=ratio, last_step=3.0, last_ratio=0.5)
        assert found == (GO_ON, 0.0)
        assert len(calls) == 1
        run = self.run
        assert run.next_step == pytest.approx(2.0 * shrink, rel=1e-6)
        assert (run.steps, run.rejected, run.last_step, run.last_ratio) == (11, 6, 3.0, 0.5)
        assert self.step(ratio=1.0)[0] == (GO_ON, 2.0)

    @pytest.mark.parametrize(("ratio", "code"), [(4.0, STEP_TOO_SMALL), (math.nan, NON_FINITE)])
    def test_the_shortest_step_may_reach_a_guard(self, ratio, code):
        shrink = 0.45 if ratio == 4.0 else 0.1
        for factor in (0.99, 1.01):
            length = factor * FINEST / shrink
            found, calls = self.step(ratio=ratio, next_step=length)
            assert found == ((code, 0.0) if factor < 1.0 else (GO_ON, 0.0))
            assert calls[1:] == ([("reach_any", 7.0, length, 3)] if factor < 1.0 else [])
            found, calls = self.step(ratio=ratio, next_step=length, reaches=(0.125, 4))
            if factor < 1.0:
                assert found == (GO_ON, 0.125)
                assert calls[2:] == [("accept", 3, 0.0, 0.125)]
                assert self.run.pending == 4
            else:
                assert found == (GO_ON, 0.0)

    def test_angles_of_tangent_vectors_count_in_implicit_steps_alone(self):
        for orthonormal, implicit, ratio, accepted in (
            (1, 1, 0.25, False),
            (0, 1, 0.25, True),
            (1, 0, 0.25, True),
        ):
            found, calls = self.step(orthonormal=orthonormal, implicit=implicit, ratio=ratio, alignment=4.0)
            assert found == (GO_ON, 2.0 if accepted else 0.0)
            assert (("alignment_ratio", 2, 3) in calls) != accepted
        assert self.step(orthonormal=1, implicit=1, ratio=0.25, alignment=0.0)[0] == (GO_ON, 2.0)
        assert self.run.last_ratio == 0.25
        assert self.step(orthonormal=1, implicit=1, ratio=9.0, alignment=0.0)[0] == (GO_ON, 0.0)
        assert ("alignment_ratio", 2, 3) not in self.step(orthonormal=1, implicit=1, ratio=9.0)[1]

    def test_pulses_of_the_field_shorten_a_step(self):
        found, calls = self.step(remaining=1.5, shortened=0.5)
        assert found == (GO_ON, 0.5)
        assert calls[:3] == [("explained step", 1.5), ("attempt", 0, 7.0, 0.5, 3), ("explained attempt", 0.5)]
        # It is not the last step then.
        assert self.run.next_step == pytest.approx(0.5 * SAFETY * 2.0, rel=1e-14)
        found, calls = self.step(remaining=1.5, shortened=1.5)
        assert found == (GO_ON, 1.5)
        assert self.run.next_step == pytest.approx(1.5 * SAFETY * 2.0, rel=1e-14)
        found, calls = self.step(shortened=2.0, explained=0.25)
        assert found == (GO_ON, 0.0)
        assert (self.run.rejected, self.run.next_step, self.run.last_step) == (6, 0.25, 0.0)
        assert self.step(shortened=2.0, explained=2.0)[0] == (GO_ON, 2.0)

    def test_an_event_ends_a_step(self):
        found, calls = self.step(outgoing=(3,), event=(0.5, 0.125, 3), room=1)
        assert found == (GO_ON, 0.625)
        assert calls == [
            ("attempt", 0, 7.0, 2.0, 3),
            ("find_event", 2.0),
            ("remember_step", 7.0, 0.5),
            ("accept", 3, 0.5, 0.125),
        ]
        assert (self.run.pending, self.run.last_step, self.run.first_step[0]) == (3, 2.0, 0.0)
        assert self.run.next_step == pytest.approx(3.6, rel=1e-14)
        self.step(outgoing=(3,), event=(0.015625, 0.0, 3))
        assert self.run.next_step == 1.5625
        # A step of no length is not recorded.
        found, calls = self.step(outgoing=(3,), event=(0.0, 0.125, 3), room=1)
        assert found == (GO_ON, 0.125)
        assert calls[2:] == [("accept", 3, 0.0, 0.125)]

    def test_a_step_may_be_cut_or_tried_again_without_an_event(self):
        found, calls = self.step(outgoing=(3,), event=(0.5, 0.0, NO_TRANSITION))
        assert found == (GO_ON, 0.5)
        assert calls[2:] == [("accept", 3, 0.5, 0.0), ("sides_at", 7.5), ("carry_rates", 8)]
        assert (self.run.pending, self.run.first_step[0]) == (NO_TRANSITION, 0.5)
        assert self.run.next_step == pytest.approx(3.6, rel=1e-14)
        found, calls = self.step(outgoing=(3,), event=(0.0, 0.0, NO_TRANSITION))
        assert found == (GO_ON, 0.0)
        assert (self.run.rejected, self.run.next_step) == (6, 1.0)
        assert calls[2:] == []
        assert self.step(outgoing=(3,), event=(math.nan, 0.0, NO_TRANSITION))[0] == (STEP_TOO_SMALL, 0.0)

    def test_a_touch_on_the_part_that_is_taken_is_recorded(self):
        for place, touches in ((0.25, True), (0.24, True), (0.26, False)):
            _, calls = self.step(outgoing=(3,), event=(0.5, 0.0, NO_TRANSITION), grazing_place=place)
            assert (("remember_touch_on_step", 7.0, 0.5, 2.0) in calls) == touches
