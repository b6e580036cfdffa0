"""A step of a Runge-Kutta method, rule by rule: its length, its first event, what it leaves behind."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid.kernels.steps import runge_kutta, runge_kutta_guards
from hybrid.kernels.steps.runge_kutta import CLOSEST, GROW, SAFETY, SHRINK
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
