"""A field counts as discontinuous in the state unless its continuity is proved."""

import math
from itertools import pairwise

import numpy as np
import pytest

import hybrid
import models
from hybrid.compiler.emission import emitted_of
from hybrid.compiler.emit import emit
from hybrid.expression.continuity import _sides, jumps_of, may_jump, vanishes_on
from hybrid.expression.evaluation import Program
from hybrid.expression.nodes import NAN, Symbol, node, number
from hybrid.expression.operations import Sin
from hybrid.expression.tracing import model_symbols, trace

STATES, PARAMETERS = ("q", "v"), ("k", "c")


def jumps(function):
    entries = trace(lambda t, x, p: (function(t, x, p),), STATES, PARAMETERS)
    return jumps_of(entries, model_symbols(2, 2).x)


CONTINUOUS = {
    "kinks": lambda t, x, p: np.abs(x.q) + np.maximum(x.v, x.q) - np.clip(x.q, -1, p.k),
    "sign times its argument": lambda t, x, p: np.sign(x.q) * x.q,
    "sign times a power": lambda t, x, p: np.sign(x.q - p.c) * np.abs(x.q - p.c) ** 1.5,
    "a ramp": lambda t, x, p: np.where(x.q > 0, p.k * x.q, 0.0),
    "two slopes": lambda t, x, p: np.where(x.q > p.c, 2 * x.q, x.q + p.c),
    "three pieces": lambda t, x, p: np.where(x.q < -1, -1.0, np.where(x.q > 1, 1.0, x.q)),
    "select": lambda t, x, p: np.select([x.q < -1, x.q < 1], [-1.0, x.q], 1.0),
    "piecewise": lambda t, x, p: np.piecewise(x.q, [x.q < 0, x.q >= 0], [lambda q: -q, lambda q: q]),
    "a truth value as a factor": lambda t, x, p: (x.q > 1) * (x.q - 1),
    "both of two": lambda t, x, p: np.where((x.q > 0) & (x.v > 0), x.q * x.v, 0.0),
    "either of two": lambda t, x, p: np.where((x.q > 0) | (x.v > 0), 0.0, x.q * x.v),
    "either of two in two ways": lambda t, x, p: (
        np.where((x.q > 0) | (x.v > 0), 1.0, 0.0) - np.where(x.q > 0, 1.0, np.where(x.v > 0, 1.0, 0.0))
    ),
    "both of two in two ways": lambda t, x, p: (
        np.where((x.q > 0) & (x.v > 0), 1.0, 0.0) - np.where(x.q > 0, np.where(x.v > 0, 1.0, 0.0), 0.0)
    ),
    "what is not in two ways": lambda t, x, p: (
        np.where(~((x.q > 0) & (x.v > 0)), 1.0, 0.0) + np.where((x.q > 0) & (x.v > 0), 1.0, 0.0)
    ),
    "either of two, in another way on either side of a third": lambda t, x, p: (
        np.where(x.q + x.v > 1, np.where((x.q > 0) | (x.v > 0), 1.0, 0.0), 0.0)
        + np.where(x.q + x.v > 1, 0.0, np.where(x.q > 0, 1.0, np.where(x.v > 0, 1.0, 0.0)))
        - np.where((x.q > 0) | (x.v > 0), 1.0, 0.0)
    ),
    "at one point only": lambda t, x, p: np.where(x.q == 0, 1.0, np.sin(x.q) / x.q),
    "a switch that moves": lambda t, x, p: np.where(x.q > np.sin(t), x.q - np.sin(t), 0.0),
    "a bent switch": lambda t, x, p: np.where(np.sin(x.q) > 0.5, np.sin(x.q), 0.5),
    "a triangular wave": lambda t, x, p: np.abs(np.mod(x.q, 2.0) - 1.0),
    "a harmonic of a remainder": lambda t, x, p: np.sin(2 * np.pi * np.mod(x.q, 1.0)),
    "the sine of an angle": lambda t, x, p: np.sin(np.arctan2(x.v, x.q)),
    "jumps in time": lambda t, x, p: np.sign(np.sin(t)) * x.q + np.mod(t, 1.0),
    "jumps in parameters": lambda t, x, p: np.where(p.k > 1, x.q, x.v),
    "an angle right of the origin": lambda t, x, p: np.arctan2(x.v, 1 + x.q**2) + np.arctan2(x.q, 0.9),
    "an angle above the origin": lambda t, x, p: np.arctan2(np.exp(x.v), x.q),
    "a sign that never changes": lambda t, x, p: x.q * np.sign(2 + np.sin(x.v)),
    "a condition that always holds": lambda t, x, p: np.where(x.v**2 > -1, x.q, x.v),
    "heaviside of a ramp": lambda t, x, p: np.heaviside(x.q, 0.5) * x.q**2,
}
JUMPING = {
    "friction": (lambda t, x, p: -p.k * np.sign(x.v), "x[1] = 0"),
    "a step": (lambda t, x, p: np.where(x.q > p.c, 1.0, 0.0), "x[0] = p[1]"),
    "heaviside": (lambda t, x, p: np.heaviside(x.q - 1, 0.5), "x[0]"),
    "a truth value": (lambda t, x, p: x.v * (x.q > 1), "x[0] = 1"),
    "floor": (lambda t, x, p: np.floor(3 * x.q), "3*x[0] is a whole number"),
    "a sawtooth": (lambda t, x, p: np.mod(x.q, 2.0), "x[0] is a multiple of 2"),
    "fmod": (lambda t, x, p: np.fmod(x.q, 2.0), "x[0] is a multiple of 2"),
    "an angle": (lambda t, x, p: np.arctan2(x.v, x.q), "the angle of (x[0], x[1])"),
    "an angle left of the origin": (lambda t, x, p: np.arctan2(x.v, -1 - x.q**2), "the angle of"),
    "an angle beside who knows what": (lambda t, x, p: np.arctan2(x.v, p.k), "the angle of"),
    "an angle with a touch": (lambda t, x, p: np.arctan2(x.v, x.q**2), "the angle of"),
    "one of two slopes": (lambda t, x, p: np.where(x.q > 1, 2 * x.q, x.q), "x[0] = 1"),
    "the wrong factor": (lambda t, x, p: np.sign(x.q) * x.v, "x[0] = 0"),
    "a sheet of two": (lambda t, x, p: np.sign(x.q * x.v) * x.q, "x[0]*x[1] = 0"),
    "a part of the condition": (lambda t, x, p: np.where((x.q > 0) & (x.v > 0), x.q, 0.0), "x[1] = 0"),
    "a belt": (lambda t, x, p: np.sign(x.v - np.cos(t)), "x[1] - cos(t) = 0"),
    "tiny": (lambda t, x, p: 1e-20 * np.sign(x.v), "x[1] = 0"),
    "hidden by a kink": (lambda t, x, p: np.abs(np.sign(x.q) + 0.5), "x[0] = 0"),
}


@pytest.mark.parametrize("name", CONTINUOUS)
def test_what_is_proved_continuous(name):
    assert jumps(CONTINUOUS[name]) == []


@pytest.mark.parametrize("name", JUMPING)
def test_what_jumps(name):
    function, text = JUMPING[name]
    [place] = jumps(function)[:1]
    assert text in place.replace("x[0] = x[1]*0", "")


def pieces(rng):
    """A piecewise field of q with random switches, and whether it is continuous at all of them."""
    switches = np.sort(rng.choice(np.arange(-8, 9), 3, replace=False)) / 4
    slopes, jumps_at = rng.choice([-2.0, -0.5, 0.0, 1.5], 4), rng.choice([0.0, 0.0, 0.0, 0.75], 3)
    offsets = [0.25]
    for switch, (before, after), jump in zip(switches, pairwise(slopes), jumps_at, strict=True):
        offsets.append(offsets[-1] + (before - after) * switch + jump)

    def field(t, x, p):
        value = slopes[3] * x.q + offsets[3]
        for i in (2, 1, 0):
            value = np.where(x.q < switches[i], slopes[i] * x.q + offsets[i], value)
        return value

    return field, not jumps_at.any()


@pytest.mark.parametrize("seed", range(40))
def test_random_pieces(seed):
    field, continuous = pieces(np.random.default_rng(seed))
    assert (jumps(field) == []) == continuous


def random_choices(rng):
    """A field of products, chosen by comparisons with connectives; most of its jumps cancel."""
    a, b, c = (float(each) for each in rng.choice([-1.0, 0.5, 2.0], 3))
    order = rng.permutation(4)
    factors = [lambda q, v: 1.0, lambda q, v: q - a, lambda q, v: v - b, lambda q, v: (q - a) * (v - b)]
    first, second = factors[order[0]], factors[order[1]]
    kinds = rng.integers(0, 3, 2)

    def field(t, x, p):
        q, v = x.q, x.v
        one = (q > a, q >= a, ~(q < a))[kinds[0]]
        other = (v < b, v <= b, ~(v > b))[kinds[1]]
        both, either = np.where(one & other, first(q, v), 0.0), np.where(one | other, 0.0, second(q, v))
        return both + either + np.where(q > c, (q - c) * v, 0.0) + 0.5 * np.sign(v - b) * second(q, v)

    return field, {"x[0]": {a, c}, "x[1]": {b}}


class At:
    def __init__(self, q, v):
        self.q, self.v = np.float64(q), np.float64(v)


@pytest.mark.parametrize("seed", range(60))
def test_exactly_the_surfaces_where_values_jump_are_named(seed):
    """The values are compared on both sides of each surface, at many points of it."""
    field, levels = random_choices(np.random.default_rng(seed))
    jumping = set()
    for name, several in levels.items():
        for level in several:
            for along in np.linspace(-3.1, 3.3, 23):
                sides = [level - 1e-9, level + 1e-9]
                places = [At(side, along) if name == "x[0]" else At(along, side) for side in sides]
                below, above = (float(field(0.0, place, None)) for place in places)
                if abs(above - below) > 1e-6:
                    jumping.add(f"{name} = {level:g}")
    named = {plain(each) for each in jumps(field)}
    assert named == jumping


def plain(surface):
    """``x[0] = 0.5`` for ``0.5 = x[0]`` and for ``x[0] - 0.5 = 0``."""
    one, other = surface.split(" = ")
    heights = [eval(f"({one}) - ({other})", {"x": np.array(x)}) for x in ([0, 0], [1, 0], [0, 1])]
    slopes = np.subtract(heights[1:], heights[0])
    [i] = np.flatnonzero(slopes)
    return f"x[{i}] = {-heights[0] / slopes[i]:g}"


@pytest.mark.parametrize(
    "model", [models.vibroimpact, models.stick_slip, models.dry_friction_oscillator, models.buck_converter]
)
def test_models_of_the_library_do_not_jump(model):
    assert not any(emitted_of(model()).discontinuities)


def test_what_a_guard_says_of_its_mode_is_used():
    def system(target):
        return hybrid.HybridSystem(
            state=("q", "v"),
            modes=[
                hybrid.Mode("up", lambda t, x, p: (x.v, -np.sign(x.v))),
                hybrid.Mode("down", lambda t, x, p: (x.v, 1.0)),
            ],
            transitions=[
                hybrid.Transition("up", target, hybrid.Guard(lambda t, x, p: x.v, -1)),
                hybrid.Transition("down", "up", hybrid.Guard(lambda t, x, p: x.v, +1)),
                hybrid.Transition("up", "down", hybrid.Guard(lambda t, x, p: x.q - 9, +1), name="far"),
            ],
        )

    assert emitted_of(system("down")).discontinuities == ("", "")
    assert emitted_of(system("up")).discontinuities == ("v = 0", "")


LEVEL = 2.0


def _helper(q):
    return q


OPAQUE = [
    (lambda t, x, p: (math.sin(x.q),), False),
    (lambda t, x, p: (math.sin(x.q) ** 2 / math.hypot(x.q, 1.0),), False),
    (lambda t, x, p: (1.0 if x.q > 0 else -1.0,), True),
    (lambda t, x, p: ((x.q > LEVEL) * 1.0,), True),
    (lambda t, x, p: (math.floor(x.q),), True),
    (lambda t, x, p: (math.sin(x.q) % 1.0,), True),
    (lambda t, x, p: (_helper(x.q),), True),
    (lambda t, x, p: (sum([math.copysign(1.0, v) for v in x]),), True),
]


@pytest.mark.parametrize(("function", "jumping"), OPAQUE)
def test_what_could_not_be_traced_is_judged_by_its_code(function, jumping):
    assert may_jump(function, differentiable=False) == jumping


def test_complex_numbers_have_no_order():
    assert not may_jump(lambda t, x, p: x * t if p.e > 1 else x, differentiable=True)
    assert may_jump(lambda t, x, p: x * t if x[0].real > 1 else x, differentiable=True)


def by_parameter(t, x, p):
    return (x.v, -x.q) if p.k > 1 else (x.v, x.q)


def of_real_numbers(t, x, p):
    return float(x.v), -float(x.q) if x.q < 0 else -x.q


@pytest.mark.parametrize(
    ("field", "jacobian", "where"),
    [
        (by_parameter, None, ""),
        (by_parameter, lambda t, x, p: ((0.0, 1.0), (-1.0, 0.0)), ""),
        (of_real_numbers, lambda t, x, p: ((0.0, 1.0), (-1.0, 0.0)), "it branches"),
    ],
)
def test_a_field_that_runs_on_complex_numbers_does_not_branch_on_the_state(field, jacobian, where):
    modes = [hybrid.Mode("only", field, jacobian=jacobian)]
    system = hybrid.HybridSystem(state=STATES, parameters={"k": 2.0}, modes=modes)
    assert emit(system).discontinuities == (where,)


def friction(field=lambda t, x, p: (x.v, p.A * np.cos(t) - 0.1 * x.v - x.q**3 - 2 * np.sign(x.q))):
    return hybrid.HybridSystem(
        name="friction",
        state=("q", "v"),
        parameters={"A": 2.0},
        modes=[hybrid.Mode("only", field)],
        period=2 * np.pi,
    )


def test_a_run_with_tangent_vectors_says_so():
    system = friction()
    assert hybrid.simulate(system, (0.5, 0.1), (0.0, 3.0)).status.ok
    status = hybrid.simulate(system, (0.5, 0.1), (0.0, 3.0), tangent=True).status
    assert status.code == hybrid.StatusCode.DISCONTINUOUS_FIELD
    assert "the field of mode 'only' jumps where q = 0" in status.message
    assert "modes joined by guards" in status.remedy
    told = repr(hybrid.compile_system(system))
    assert "its field jumps where q = 0: steps resolve it, tangent vectors are not valid beyond it" in told


def test_an_angle_that_turns_is_told_in_words():
    turning = friction(lambda t, x, p: (x.v, -np.arctan2(x.q, x.v)))
    arc = hybrid.simulate(turning, (1.0, 0.0), (0.0, 1.0), tangent=True)
    assert "the angle of (v, q) turns from pi to -pi" in arc.status.message


def test_exponents_and_orbits_say_so():
    import lyapunov

    system = friction()
    spectrum = lyapunov.lyapunov_spectrum(system, (0.5, 0.1), intervals=3)
    assert spectrum.status.code == hybrid.StatusCode.DISCONTINUOUS_FIELD
    orbit = hybrid.periodic_orbit(system, (0.5, 0.1))
    assert orbit.status.code == hybrid.StatusCode.DISCONTINUOUS_FIELD
    chart = lyapunov.chart(system, {"A": (2.0, 3.0)}, (0.5, 0.1), intervals=3)
    assert (chart.status != 0).all()


def test_functions_within_a_function_are_looked_at():
    def outer(t, x, p):
        def inner(value):
            return value if value > 1.0 else 1.0

        return (inner(x[0].real),)

    def smooth(t, x, p):
        def inner(value):
            return value * value

        return (inner(x[0]),)

    for differentiable in (False, True):
        assert may_jump(outer, differentiable)
        assert not may_jump(smooth, differentiable)
    assert not may_jump(lambda t, x, p: (x[0].real * x[1],), differentiable=True)


@pytest.mark.parametrize(
    ("function", "step", "jump", "values"),
    [
        (np.floor, 2, 2.0, (1.0, 2.0)),
        (np.ceil, 2, 2.0, (2.0, 3.0)),
        (np.ceil, -1, -1.0, (-1.0, 0.0)),
        (np.sign, 0, 0.0, (-1.0, 1.0)),
        (lambda q: np.mod(q, 3.0), 2, 6.0, (3.0, 0.0)),
    ],
)
def test_values_below_and_above_a_jump_are_those_of_numpy(function, step, jump, values):
    [expression] = trace(lambda t, x, p: (function(x.q),), STATES, PARAMETERS)
    surface, sides = _sides(expression, Symbol("n"))
    found = Program([surface, *sides]).run({model_symbols(2, 2).x[0]: jump, Symbol("n"): step})
    assert found == [0.0, *values]
    np.testing.assert_allclose([function(jump - 1e-9), function(jump + 1e-9)], values, atol=1e-8)


@pytest.mark.parametrize(
    ("expression", "surface", "vanishes"),
    [
        ("0", "q", True),
        ("q", "q", True),
        ("q*v", "q", True),
        ("q**2 - v**2", "q - v", True),
        ("(q - c)*v", "2*q - 2*c", True),
        ("sin(q) - k", "sin(q) - k", True),
        ("1", "q", False),
        ("v", "q", False),
        ("q + v", "q - v", False),
        ("q - 2*c", "q - c", False),
        # What is left of 3e8 is rounding, beside 1e-6 as well; what has no value does not vanish.
        ("3e8*v*(q + 0.1) - 3e7*v - 3e8*q*v + 1e-6*k*(q + 1) - 1e-6*k - 1e-6*k*q", "c", True),
        ("3e8*v*(q + 0.1) - 3e7*v - 3e8*q*v + 1e-3*k", "c", False),
        ("nan", "q", False),
        ("inf", "q", False),
    ],
)
def test_what_vanishes_on_a_surface(expression, surface, vanishes):
    symbols = model_symbols(2, 2)
    names = dict(zip(("q", "v", "k", "c"), (*symbols.x, *symbols.p), strict=True))
    names |= {"sin": Sin, "inf": number(math.inf), "nan": NAN}
    assert vanishes_on(*(node(eval(each, names)) for each in (expression, surface))) == vanishes
