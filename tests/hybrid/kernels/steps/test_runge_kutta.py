"""A step of a Runge-Kutta method, rule by rule: its length, its first event, what it leaves behind."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.arithmetic.bernstein import NO_ROOT
from hybrid.kernels.steps import runge_kutta, runge_kutta_guards
from hybrid.kernels.steps.runge_kutta import CLOSEST, FINEST, GROW, SAFETY, SHRINK
from hybrid.kernels.steps.runge_kutta_guards import NOT_THERE
from hybrid.kernels.types.codes import NO_TRANSITION
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
    """The attempted step is 4 long, from the time 7 on; the rounding of time is that of 2."""

    H, T, EULER = 4.0, 7.0, 1e-3

    def find(self, *crossings, affine=True, h=H, interpolated=False, **answers):
        """What is found for these crossings, one for each search, and what was asked for on the way."""
        calls, left = [], list(crossings)
        answers = {
            "reach": NOT_THERE,
            "land_on_first": (NOT_THERE, 0.0, 1),
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
            measured_time=lambda model, run, mode: 2.0,
            restore_sides=told("restore"),
            attempt_again=told("again"),
            note_touch=told("touch"),
            share_with_one_touch=lambda run: answers.get("share", NO_ROOT),
            **{name: told(name, answers[name]) for name in ("reach", "land_on_first", "drowns", "is_beyond")},
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
        found = tested.find_event(task, h, interpolated)
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

    def test_stages_of_the_interpolant_that_are_known_are_not_evaluated_again(self):
        assert self.find(self.NONE, interpolated=True)[1] == [("search", 7.0, 4.0, NO_TRANSITION, 0.0)]
        # The step has been taken again since.
        again = self.find((0.75, 1, 1.0, NO_TRANSITION), self.NONE, interpolated=True)[1]
        assert again.count(("stages", 2, 7.0, 4.0)) == 1

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
        found, calls = self.find((0.25, 1, 0.5, NO_TRANSITION), land_on_first=(0.9, self.EULER, 0))
        assert found == (0.9, self.EULER, 0)
        assert calls[2:] == [("land_on_first", 1, 7.0, 2.0, 4.0, 0.25, 6)]

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
        shortest = 4.0 * FINEST
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


def bent(band, module=runge_kutta):
    """A guard ``1e-3 (s - 0.5)`` on a step of 4 from the time 7, whose path is the square of the place."""

    def guard(transition, t, x, parameters, out):
        assert (transition, t) == (1, pytest.approx(7.0 + 4.0 * math.sqrt(x[0])))
        out[0] = 1e-3 * (math.sqrt(x[0]) - 0.5)

    def rounding_band(model, run, transition, t, x, work):
        assert (transition, t, work.gradient[0]) == (1, pytest.approx(7.0 + 4.0 * math.sqrt(x[0])), 5.0)
        return band

    def gradient(transition, t, x, parameters, out):
        assert (transition, t) == (1, pytest.approx(7.0 + 4.0 * math.sqrt(x[0])))
        out[0] = 5.0

    model = SimpleNamespace(
        dimension=1, affine_guard=np.array([1, 0]), guard=guard, guard_gradient=gradient, parameters=None
    )
    work = SimpleNamespace(
        path=np.array([[0.0], [0.0], [1.0]]),
        state=np.zeros(1),
        new=np.zeros(1),
        scalar=np.zeros(1),
        gradient=np.zeros(2),
    )
    return plain(module, rounding_band=rounding_band), model, work


def test_a_flight_is_all_rounding_if_its_start_middle_and_end_are():
    for band, theta, expected in ((0.5e-3, 1.0, True), (0.49e-3, 1.0, False), (0.2e-3, 1.0, False)):
        tested, model, work = bent(band)
        assert tested.drowns(model, method_of(), None, 1, 7.0, theta, 4.0, work) == expected
    tested, model, work = bent(0.5e-3)
    assert not tested.drowns(model, method_of(), None, 1, 7.0, 1.01, 4.0, work)
    # In the middle alone it may be farther from zero.
    model.guard = lambda transition, t, x, parameters, out: out.__setitem__(0, float(x[0] == 0.25))
    assert not tested.drowns(model, method_of(), None, 1, 7.0, 1.0, 4.0, work)
    assert tested.drowns(model, method_of(), None, 1, 7.0, 0.9, 4.0, work)
    model.affine_guard[1] = 1
    assert not tested.drowns(model, method_of(), None, 1, 7.0, 0.9, 4.0, work)


def test_the_end_of_a_step_is_beyond_a_guard_if_it_is_so_by_more_than_rounding():
    tested, model, work = bent(0.125e-3, runge_kutta_guards)
    for place, side, expected in (
        (1.0, -1, True),
        (1.0, 1, False),
        (0.0, 1, True),
        (0.0, -1, False),
        (0.6, -1, False),
        (0.4, 1, False),
    ):
        work.new[0] = place**2
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
        (math.exp(-CLOSEST), 0.125),
        (math.exp(-4.0 * CLOSEST), 8.0),
    ):
        asked = []

        def independence(*given, product=product, asked=asked):
            asked.append(given)
            return product

        tested = plain(runge_kutta, independence=independence)
        work = SimpleNamespace(new="new", jacobian="scratch")
        found = tested.alignment_ratio(SimpleNamespace(exponent=1.0 / 3.0), 3, 2, work)
        assert found == pytest.approx(ratio, rel=1e-12)
        assert asked == [("new", 3, 2, "scratch")]
