"""What an author knows of a model finds errors in it, and tells where."""

import attrs
import numpy as np
import pytest
from hypothesis import given, settings

from hybrid import (
    ArgumentError,
    Guard,
    HybridSystem,
    Laws,
    Mode,
    ModelError,
    Reset,
    Transition,
    from_equations,
    simulate,
)
from hybrid.testing import Case, PropertyError, cases, check_laws, check_system

ABOVE = {"above the floor": lambda t, x, p: x.q}
ENERGY = {"energy": lambda t, x, p: 0.5 * x.v**2 + p.g * x.q}
GIVEN = {"states": {"q": (-1.0, 2.0), "v": (-2.0, 2.0)}, "t_span": (0.0, 2.0), "examples": 15}


def ball(*, floor=0.0, pull=-1.0, reset=lambda t, x, p: {"v": -x.v}, **options):
    return HybridSystem(
        state=("q", "v"),
        parameters={"g": 9.81},
        modes=[Mode("flight", lambda t, x, p: (x.v, pull * p.g))],
        transitions=[
            Transition("flight", "flight", Guard(lambda t, x, p: x.q - floor, -1), Reset(reset), name="floor")
        ],
        **options,
    )


def block(
    *, speed=lambda p: p.belt, pull=lambda x, p: -x.q - p.mu * np.sign(x.v - p.belt), catch=None, **options
):
    """A block on a belt that carries it until the spring is as strong as the friction."""
    return HybridSystem(
        state=("q", "v"),
        parameters={"belt": 0.3, "mu": 0.6},
        modes=[
            Mode("stick", lambda t, x, p: (speed(p), 0.0)),
            Mode("slip", lambda t, x, p: (x.v, -x.q + p.mu)),
        ],
        transitions=[
            Transition("stick", "slip", Guard(lambda t, x, p: x.q - p.mu, +1), name="break loose"),
            Transition(
                "slip", "stick", Guard(lambda t, x, p: x.v - p.belt, +1), catch and Reset(catch), name="catch"
            ),
        ],
        **options,
    )


CARRIED = {"stick": {"carried by the belt": lambda t, x, p: x.v - p.belt}}
PLACE = {"stick": {"place": (lambda t, x, p: x.q, lambda t, x, p: x.v)}}
ON_BELT = {"states": {"q": (-0.5, 0.5), "v": (-0.5, 0.2)}, "t_span": (0.0, 8.0), "examples": 15}


def damped(*, sign=-1.0, **options):
    return HybridSystem(
        state=("q", "v"),
        parameters={"c": 0.2, "F": 0.5},
        modes=[Mode("free", lambda t, x, p: (x.v, -x.q + sign * p.c * x.v + p.F * np.cos(t)))],
        **options,
    )


def of_spring(t, x, p):
    return 0.5 * (x.q**2 + x.v**2)


def pushed(t, x, p):
    return p.F * np.cos(t) * x.v


def driven(t, x, p):
    return (p.F * np.cos(t) - p.c * x.v) * x.v


MOVING = {"t_span": (0.0, 10.0), "examples": 10}


def stop(*, gap=lambda p: p.gap):
    """A mass that touches a spring behind a gap."""
    return HybridSystem(
        state=("q", "v"),
        parameters={"gap": 0.5, "k": 5.0},
        modes=[
            Mode("free", lambda t, x, p: (x.v, -x.q)),
            Mode("contact", lambda t, x, p: (x.v, -x.q - p.k * (x.q - p.gap))),
        ],
        transitions=[
            Transition("free", "contact", Guard(lambda t, x, p: x.q - gap(p), +1), name="touch"),
            Transition("contact", "free", Guard(lambda t, x, p: x.q - gap(p), -1), name="leave"),
        ],
    )


def failing(system, **options):
    with pytest.raises(PropertyError) as caught:
        check_system(system, **options)
    return str(caught.value)


def as_fast(t, minus, plus, p):
    return plus.v >= -minus.v


RIGHT = [
    (ball(), {"laws": Laws(invariant=ABOVE, conserved=ENERGY), **GIVEN}),
    (ball(), {"laws": Laws(across={"floor": lambda t, minus, plus, p: plus.v + minus.v}), **GIVEN}),
    (
        ball(),
        {"laws": Laws(across={"floor": {"the speed turns": lambda t, minus, plus, p: plus.v > 0}}), **GIVEN},
    ),
    (block(), {"laws": Laws(equal=CARRIED), **ON_BELT}),
    (damped(), {"laws": Laws(dissipated={"energy": (of_spring, pushed)}), **MOVING}),
    (
        damped(),
        {
            "laws": Laws(balance={"energy": (of_spring, driven)}),
            **MOVING,
        },
    ),
    (stop(), {"laws": Laws(continuous=("touch", "leave")), "examples": 10}),
]


@pytest.mark.parametrize(("system", "options"), RIGHT)
def test_a_right_model_keeps_its_laws(system, options):
    report = check_system(system, **options)
    laws = options["laws"]
    names = [law.name for some in laws.in_modes.values() for law in some]
    names += [law.of for law in laws.across] + [*laws.continuous]
    for name in names:
        (found,) = (each for each in report.properties if repr(name) in each.name)
        assert found.examples > 0


@pytest.mark.parametrize(
    ("system", "options", "words"),
    [
        (
            ball(floor=-0.5),
            {"laws": Laws(invariant=ABOVE), **GIVEN},
            ["'above the floor' is non-negative", "guards of 'floor'"],
        ),
        (
            ball(pull=-0.9),
            {"laws": Laws(conserved=ENERGY), **GIVEN},
            ["'energy' is conserved", "the field of mode 'flight'"],
        ),
        (
            ball(reset=lambda t, x, p: {"v": -0.99 * x.v}),
            {"laws": Laws(conserved=ENERGY), **GIVEN},
            ["'energy' is conserved", "the reset of 'floor'"],
        ),
        (
            ball(reset=lambda t, x, p: {"v": -1.01 * x.v}),
            {"laws": Laws(dissipated=ENERGY), **GIVEN},
            ["'energy' never grows by more than is put in", "the reset of 'floor'"],
        ),
        (
            ball(reset=lambda t, x, p: {"v": -0.7 * x.v}),
            {"laws": Laws(across={"floor": lambda t, minus, plus, p: plus.v + 0.8 * minus.v}), **GIVEN},
            ["The rule of 'floor' holds", "the reset of 'floor'"],
        ),
        (
            ball(reset=lambda t, x, p: {"v": -0.7 * x.v}),
            {"laws": Laws(across={"floor": {"as fast": as_fast}}), **GIVEN},
            ["The rule 'as fast' holds at 'floor'", "it does not hold"],
        ),
        (
            block(speed=lambda p: 2 * p.belt),
            {"laws": Laws(balance=PLACE, equal=CARRIED), **ON_BELT},
            ["'place' changes at its rate in mode 'stick'", "the field of mode 'stick'"],
        ),
        (
            block(catch=lambda t, x, p: {"v": 2 * p.belt}),
            {"laws": Laws(equal=CARRIED), **ON_BELT},
            ["'carried by the belt' is zero in mode 'stick'", "the reset of 'catch'"],
        ),
        (
            damped(sign=+1.0),
            {"laws": Laws(dissipated={"energy": (of_spring, pushed)}), **MOVING},
            ["'energy' never grows", "the field of mode 'free'"],
        ),
        (
            damped(sign=-1.1),
            {"laws": Laws(balance={"energy": (of_spring, driven)}), **MOVING},
            ["'energy' changes at its rate", "the field of mode 'free'"],
        ),
        (
            stop(gap=lambda p: 0.9 * p.gap),
            {"laws": Laws(continuous=("touch",)), "examples": 10},
            ["State and field are continuous at 'touch'", "the rate of v", "the guard of 'touch'"],
        ),
    ],
)  # fmt: skip
def test_faults_break_a_law_which_names_what_is_wrong(system, options, words):
    message = failing(system, **options)
    for word in words:
        assert word in message


def test_a_law_that_fails_first_is_told():
    """Both laws are broken, the conserved one from the start and the other at the floor below."""
    message = failing(ball(floor=-0.5, pull=-0.9), laws=Laws(invariant=ABOVE, conserved=ENERGY), **GIVEN)
    assert message.startswith("'energy' is conserved")


def test_a_number_in_place_of_a_parameter():
    """The energy varies with g, and the field does not."""
    typed = attrs.evolve(ball(), modes=[Mode("flight", lambda t, x, p: (x.v, -9.81))])
    message = failing(typed, laws=Laws(conserved=ENERGY), **GIVEN)
    assert (
        "It holds with the parameters as declared: a number stands where a parameter belongs (g)" in message
    )


def test_a_system_carries_its_laws():
    system = ball(floor=-0.5, laws=Laws(invariant=ABOVE))
    assert "'above the floor' is non-negative" in failing(system, **GIVEN)
    both = failing(ball(floor=-0.5, laws=Laws(conserved=ENERGY)), laws=Laws(invariant=ABOVE), **GIVEN)
    assert "'above the floor'" in both


def test_laws_of_a_system_that_is_split_go_by_the_names_before():
    law = {"smooth": {"energy": lambda t, x, p: 0.5 * x.v**2 + abs(x.q)}}
    system = from_equations(lambda t, x, p: (x.v, -np.sign(x.q)), state=("q", "v"), laws=Laws(conserved=law))
    assert len(system.modes) > 1
    report = check_system(system, examples=5, t_span=(0.0, 3.0))
    assert next(each for each in report.properties if "'energy'" in each.name).examples > 0


@settings(max_examples=10, deadline=None, derandomize=True)
@given(cases(block(), laws=Laws(equal=CARRIED), states=ON_BELT["states"], t_span=ON_BELT["t_span"]))
def test_starts_are_drawn_on_surfaces(case):
    if case.mode == "stick":
        assert case.x0[1] == pytest.approx(case.parameters["belt"], abs=1e-15)
    check_laws(case)


def test_starts_on_a_curved_surface():
    """A pendulum in Cartesian coordinates: on its circle, along it."""
    circle = {
        "length": lambda t, x, p: x.x**2 + x.y**2 - p.l**2,
        "along": lambda t, x, p: x.x * x.u + x.y * x.v,
    }

    def swing(t, x, p):
        pull = (x.u**2 + x.v**2 - 9.81 * x.y) / p.l**2
        return x.u, x.v, -pull * x.x, -9.81 - pull * x.y

    system = HybridSystem(
        state=("x", "y", "u", "v"),
        parameters={"l": 1.5},
        modes=[Mode("swing", swing)],
        laws=Laws(equal=circle),
    )
    report = check_system(system, examples=10, t_span=(0.0, 2.0))
    assert all(each.examples >= 5 for each in report.properties if "is zero" in each.name)


@pytest.mark.parametrize("reset", [None, Reset(lambda t, x, p: {"energy": x.energy + 0.2})])
def test_a_rise_after_a_fall_is_no_dissipation(reset):
    """On the way or at a jump, and although the energy stays below where it began."""
    pace = 0.1 if reset is None else -0.1
    system = HybridSystem(
        state=("energy",),
        modes=[Mode("fall", lambda t, x, p: (-1.0,)), Mode("on", lambda t, x, p: (pace,))],
        transitions=[Transition("fall", "on", Guard(lambda t, x, p: x.energy - 0.4, -1), reset, name="turn")],
        laws=Laws(dissipated={"energy": lambda t, x, p: x.energy}),
    )
    check_laws(Case(system, system.parameters, "fall", (1.0,), 0.0, 0.5))
    where = "field of mode 'on'" if reset is None else "reset of 'turn'"
    with pytest.raises(PropertyError, match=f"(?s)'energy' never grows.*{where}"):
        check_laws(Case(system, system.parameters, "fall", (1.0,), 0.0, 1.2))


def test_the_limit_of_a_chatter_is_no_jump_of_a_law():
    """Each bounce is counted and has its distance from the one before; the limit is no bounce."""
    system = HybridSystem(
        state=("q", "v"),
        counters=("bounces",),
        modes=[Mode("flight", lambda t, x, p: (x.v, -1.0)), Mode("rest", lambda t, x, p: (0.0, 0.0))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, -1),
                Reset(lambda t, x, p: {"v": -0.5 * x.v, "bounces": x.bounces + 1}),
                name="bounce",
                accumulates_to="rest",
            )
        ],
        laws=Laws(
            across={
                "bounce": {
                    "counts": lambda t, minus, plus, p: plus.bounces - minus.bounces - 1.0,
                    "bounces up": lambda t, minus, plus, p: plus.v > 0.0,
                }
            }
        ),
    )
    case = Case(system, system.parameters, "flight", (1.0, 0.0, 0), 0.0, 6.0)
    assert "limit" in simulate(system, (1.0, 0.0, 0), (0.0, 6.0), mode="flight").jumps.kind
    check_laws(case)


def test_a_mode_that_lasts_no_time_need_not_keep_its_laws():
    """A block that is caught where the spring is too strong slips on at once."""
    held = {"stick": {"the belt holds it": lambda t, x, p: p.mu - x.q}}
    case = Case(block(), {"belt": 0.3, "mu": 0.6}, "slip", (2.0, 0.2), 0.0, 0.5, laws=Laws(invariant=held))
    assert [jump.transition for jump in case.whole.jumps] == []
    pushed = attrs.evolve(block(), modes=[block().modes[0], Mode("slip", lambda t, x, p: (x.v, 1.0))])
    case = attrs.evolve(case, system=pushed, laws=Laws(invariant=held))
    assert [jump.transition for jump in case.whole.jumps][:2] == ["catch", "break loose"]
    check_laws(case)


@pytest.mark.parametrize(
    ("laws", "text"),
    [
        ({"invariant": {"flicht": ABOVE}}, "invariant: Mode 'flicht' does not exist. Modes: flight"),
        (
            {"conserved": {"energy": 3.0}},
            "conserved: 'energy' must be a function of (t, x, p) or the name of an output; got 3.0",
        ),
        ({"equal": {"low": lambda t, x, p: x.q > 0}}, "a comparison has no size"),
        ({"invariant": {"low": lambda t, x, p: x.z}}, "State component 'z' does not exist"),
        ({"invariant": {"low": lambda t, x, p: (x.q, x.v)}}, "must return one number"),
        ({"balance": ENERGY}, "balance: 'energy' must be a pair of functions"),
        ({"continuous": ("flour",)}, "continuous: Transition 'flour' does not exist"),
        ({"across": {"floor": lambda t, x, p: 0.0}}, "must take (t, minus, plus, p)"),
        ({"across": {"flour": lambda t, minus, plus, p: 0.0}}, "across: Transition 'flour' does not exist"),
    ],
)
def test_errors(laws, text):
    with pytest.raises(ModelError) as caught:
        check_system(ball(), laws=Laws(**laws))
    assert text in str(caught.value)
    with pytest.raises(ModelError) as caught:
        check_system(ball(laws=Laws(**laws)))
    assert text in str(caught.value)


def test_a_system_without_a_transition_keeps_the_law_until_it_is_checked():
    free = attrs.evolve(ball(laws=Laws(continuous=("floor",))), transitions=[])
    with pytest.raises(ArgumentError, match="continuous: Transition 'floor' does not exist"):
        check_system(free)
    check_system(attrs.evolve(free, laws=Laws()), examples=2)


def test_unknown_kinds_of_laws():
    for call in (Laws, lambda **options: cases(ball(), **options)):
        with pytest.raises(TypeError, match="unexpected keyword argument 'invariants'"):
            call(invariants=ABOVE)


def test_no_start_within_the_laws():
    message = failing(ball(), laws=Laws(invariant={"flight": {"high": lambda t, x, p: x.q - 5.0}}), **GIVEN)
    assert "none of" in message
    assert "invariant 'high' of mode 'flight'" in message


def test_a_guard_with_a_condition_is_no_wall():
    """A pendulum with a peg below its support: the peg is met from one side only."""
    pendulum = HybridSystem(
        state=("th", "w"),
        modes=[Mode("swing", lambda t, x, p: (x.w, -np.sin(x.th)))],
        transitions=[
            Transition(
                "swing",
                "swing",
                Guard(lambda t, x, p: x.th, -1, when=lambda t, x, p: x.w < -1.5),
                Reset(lambda t, x, p: (x.th, -0.8 * x.w)),
                name="peg",
            )
        ],
    )
    report = check_system(pendulum, states={"th": (-1.0, -0.1)}, t_span=(0.0, 3.0), examples=5)
    assert report.visits["swing"] > 0
