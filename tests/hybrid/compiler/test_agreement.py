"""The function that runs is the function that was written, or the model is refused."""

import math
import random

import numpy as np
import pytest
import scipy.special

from hybrid import (
    Guard,
    HybridSystem,
    Mode,
    ModelError,
    Reset,
    StatusCode,
    Transition,
    compile_system,
    simulate,
)
from hybrid.compiler.agreement import comparison_points, disagreement, rounding_band
from hybrid.compiler.emit import emit
from hybrid.system.derivatives import evaluate
from hybrid.system.functions import condition_function
from hybrid.system.graph import functions_of

R = 7_000_000_000
TEN, MINUS_TWO = 10, -2
TABLE = np.linspace(0.0, 1.0, 11)
LIST = [1.0, 2.0]
PAIR = (1.0, 2.0)


def system(field, *, state=("q", "v"), jacobian=None, **options):
    return HybridSystem(
        state=state, parameters={"k": 1.0}, modes=[Mode("a", field, jacobian=jacobian)], **options
    )


def refused(field, text, **options):
    with pytest.raises(ModelError, match=text) as caught:
        compile_system(system(field, **options))
    assert "Mode 'a'" in str(caught.value)


class TestTypes:
    """Tracing uses symbols, and a symbol must not be mistaken for another argument."""

    def test_an_instance_of_float_is_one(self):
        def field(t, x, p):
            return (x.v, -x.q) if isinstance(x.q, float) and not isinstance(x.q, complex) else (x.v, x.q)

        arc = simulate(system(field), (0.7, 0.7), (0.0, 1.0))
        np.testing.assert_allclose(arc.x[-1], [0.7 * (np.cos(1) + np.sin(1)), 0.7 * (np.cos(1) - np.sin(1))])

    @pytest.mark.parametrize(
        "branch",
        [
            lambda q: type(q) is np.float64,
            lambda q: "Traced" not in repr(q),
            lambda q: type(q).__module__ == "numpy",
            lambda q: not hasattr(type(q), "content"),
        ],
    )
    def test_what_branches_on_the_type_is_refused(self, branch):
        def field(t, x, p):
            return (x.v, -x.q) if branch(x.q) else (x.v, -5 * x.q)

        refused(field, r"field: value 1 is .* compiled and .* in Python, at t = .*a branch on the type")

    @pytest.mark.parametrize("unit", [1e12])
    def test_derivatives_that_branch_on_the_type_are_refused_in_any_units(self, unit):
        """The whole number in the field cannot be traced, so its derivative is the complex step."""

        def field(t, x, p):
            force = -unit * PAIR[int(p.k)] * x.q
            return unit * x.v, 1.001 * force if isinstance(x.q, np.complex128) else force

        refused(field, "field: the derivative is .* compiled and .* in Python, at t = .*a branch on the type")

    @pytest.mark.parametrize("unit", [1e12])
    def test_derivatives_that_cancel_are_no_fault(self, unit):
        def field(t, x, p):
            force = unit * PAIR[int(p.k)] * (np.sin(x.q) ** 2 + np.cos(x.q) ** 2)
            return unit * x.v, force

        compile_system(system(field))

    @pytest.mark.parametrize("caught", [ValueError, TypeError, Exception, BaseException, ModelError])
    @pytest.mark.parametrize(
        "root",
        [
            lambda q: math.sqrt(q),
            lambda q: q if q > 0 else 1 / 0,
            lambda q: {0.5: 1.0}.get(q, 2.0) * q,
            lambda q: math.floor(q),
            lambda q: q.is_integer() * q,
            lambda q: np.spacing(q),
            lambda q: np.argmax(np.array([q, 0.0]).view(np.ndarray)) * q,
        ],
    )
    def test_an_error_of_tracing_cannot_be_caught(self, caught, root):
        def field(t, x, p):
            try:
                force = root(x.q)
            except caught:
                force = 0.0 * x.q
            return x.v, -force

        with pytest.raises(ModelError, match="what catches errors"):
            emit(system(field))


class TestPurity:
    def test_random_numbers(self):
        generator = random.Random(1)
        with pytest.raises(ModelError, match=r"field returned .* and, called again .* must be pure"):
            system(lambda t, x, p: (x.v, -x.q * (1 + generator.random())))

    def test_a_counter(self):
        calls = []

        def field(t, x, p):
            calls.append(t)
            return x.v, -x.q * len(calls)

        with pytest.raises(ModelError, match="must be pure"):
            system(field)

    def test_a_global_that_has_changed(self):
        spring = {"k": 1.0}
        changed = system(lambda t, x, p: (x.v, -spring["k"] * x.q))
        compiled = compile_system(changed)
        spring["k"] = 2.0
        t, x, values = next(comparison_points(changed))
        [(index, function)] = functions_of(changed)
        assert "a global that has changed" in disagreement(compiled, function, index, t, x, values)

    def test_a_write_into_the_state(self):
        def field(t, x, p):
            x[0] = 0.0
            return x * 1.0

        with pytest.raises(ModelError, match=r"writes into its argument.*x = x.copy\(\)"):
            system(field, state=2)

    def test_a_write_into_the_state_elsewhere_than_at_the_sample_points(self):
        def field(t, x, p):
            if x[0] > 1e4:
                x[0] = 5.0
            return x * 1.0

        refused(field, "readonly array", state=2, jacobian=lambda t, x, p: np.eye(2))

    def test_a_copy_may_be_written_to(self):
        def field(t, x, p):
            x = x.copy()
            x[0] = x[1]
            return -x

        assert not compile_system(system(field, state=2)).emitted.opaque


class TestWholeNumbers:
    """Numba's have 64 bits: where that makes a difference, the function is refused."""

    @pytest.mark.parametrize(
        "factor",
        [
            lambda x: R * R,
            lambda x: 4.9e19 * TEN**MINUS_TWO,
            lambda x: math.prod((R, R)) if x > 0 else R * R,
        ],
    )
    def test_results_beyond_64_bits_and_negative_powers(self, factor):
        refused(lambda t, x, p: (-x.q * factor(x.q) if p.k > 0 else x.q,), "Mode 'a': field", state=("q",))

    def test_a_product_that_wraps_around(self):
        def field(t, x, p):
            total, factorial = 0.0 * x.q, 1
            for i in range(1, 25):
                factorial *= i
                total = total + x.q**i / factorial
            return (-total * math.cos(0.0 * x.q),)

        text = r"compiled and .* in Python.*whole numbers beyond 64 bits"
        refused(field, text, state=("q",), jacobian=lambda t, x, p: ((-math.exp(x.q),),))

    def test_small_ones_stay_whole(self):
        def field(t, x, p, whole=1, real=2.5):
            return (-x.q * PAIR[whole] / 2.0 * real / 2.5 if p.k > 0 else x.q,)

        opaque = system(field, state=("q",))
        assert compile_system(opaque).emitted.opaque
        arc = simulate(opaque, (1.0,), (0.0, 1.0))
        assert arc.x[-1, 0] == pytest.approx(math.exp(-1.0), abs=1e-9)

    def test_an_index_out_of_range_is_no_number(self):
        def field(t, x, p):
            return x.v, -TABLE[int(abs(x.q))]

        table = system(field, jacobian=lambda t, x, p: ((0.0, 1.0), (0.0, 0.0)))
        assert simulate(table, (0.05, 0.0), (0.0, 0.1)).x[-1, 0] == pytest.approx(0.05, rel=1e-14)
        arc = simulate(table, (5.0, 50.0), (0.0, 1.0))
        assert arc.status.code == StatusCode.NON_FINITE

    @pytest.mark.as_given
    def test_whole_powers_keep_the_complex_step(self):
        def field(t, x, p):
            return (-(x.q**p.n) if p.k > 0 else x.q, x.q**3 - x.q**-2)

        with pytest.raises(ModelError, match="does not exist"):
            system(field)
        cubed = HybridSystem(state=("q", "v"), parameters={"k": 1.0, "n": 3.0}, modes=[Mode("a", field)])
        compiled = compile_system(cubed)
        [(index, function)] = functions_of(cubed)
        x = np.array([-1.25, 1.0])
        found = compiled.derivative(function, index, 0.0, x, cubed.parameter_values())
        np.testing.assert_allclose(found[:, 0], [-3 * 1.25**2, 3 * 1.25**2 + 2 * (-1.25) ** -3], rtol=1e-14)


class TestTheCompilersErrors:
    """Unknown code raises a ModelError that names the function and the next step."""

    @pytest.mark.parametrize(
        ("field", "state"),
        [
            (lambda t, x, p: (LIST[int(x.q)] * x.v, x.q), ("q", "v")),
            (lambda t, x, p: (x.v, np.format_float_positional(x.q)), ("q", "v")),
            (lambda t, x, p: (x.v, sorted([x.q, x.v], key=abs)[0]), ("q", "v")),
            (lambda t, x, p: x[np.argsort(x, kind="heapsort")], 2),
            (lambda t, x, p: {"rates": (x.v, abs(x.q) if x.q > 0 else x.v)}["rates"], ("q", "v")),
        ],
    )
    def test_no_error_of_its_own_comes_through(self, field, state):
        when = Guard(lambda t, x, p: x[0] - 0.5, when=lambda t, x, p: np.ravel(field(t, x, p))[0] > 0)
        try:
            conditioned = HybridSystem(
                state=state,
                modes=[Mode("a", lambda t, x, p: (x[1], -x[0]))],
                transitions=[Transition("a", "a", when, name="gate")],
            )
            compile_system(conditioned)
        except ModelError as error:
            told = str(error)
        else:
            told = "Transition 'gate'"
        assert "Transition 'gate'" in told
        assert len(told) < 1500

    def test_a_special_function_by_name(self):
        refused(
            lambda t, x, p: (x.v, -scipy.special.gamma(x.q)),
            r"field cannot be differentiated.*gamma.*Write it with NumPy functions",
        )

    def test_select_and_piecewise_are_traced(self):
        def field(t, x, p):
            pull = np.select([x.q > 1, x.q > 0], [x.v, x.q], 0)
            return x.v, -pull - np.piecewise(x.q, [x.q < 0], [lambda q: -q, 2.0]) - np.fmod(x.v, 2.0)

        compiled = compile_system(system(field))
        assert not compiled.emitted.opaque


def test_rounding_is_no_difference():
    """Large terms that cancel may differ with the order; the terms then set the tolerance."""

    def field(t, x, p):
        return x.v, (1e10 + x.q) - 1e10 - x.v * 3 + (x.q - x.v) * 1e8 - x.q * 1e8 + x.v * 1e8

    compiled = compile_system(system(field))
    t, x, values = next(comparison_points(compiled.system))
    wanted = evaluate(compiled.system.variables, field, t, x, values)
    band = rounding_band(compiled.system, field, t, x, values, wanted)
    assert band[0] < 1e-12
    assert 1e-8 < band[1] < 1e-3


LEAVES = ["x.q", "x.v", "p.k", "t", "2", "3", "-1", "0.5", "7", "A", "B", "R", "40", "1e3"]
BINARY = ["({} + {})", "({} - {})", "({} * {})", "({} / ({} + 9.5))", "({} * {} * R)"]
UNARY = ["abs({})", "math.sin({})", "np.tanh({})", "({})**2", "({})**-2", "2**({} - {})", "-{}", "int({})"]
CHOICES = ["({} if {} > {} else {})", "max({}, {})", "np.where({} > {}, {}, {})", "({} > {}) * {}"]


def expression(rng, depth):
    if depth == 0 or rng.random() < 0.1:
        return rng.choice(LEAVES)
    form = rng.choice(BINARY * 3 + UNARY + CHOICES)
    return form.format(*(expression(rng, depth - 1) for _ in range(form.count("{}"))))


def made_up(seed):
    rng = random.Random(seed)
    text = f"lambda A: lambda t, x, p, B=12: {expression(rng, rng.randint(1, 4))}"
    return text, eval(text, {"np": np, "math": math, "R": R})(rng.randint(-9, 9))


def runs_as_written(seeds):
    """Number of random functions from these seeds that run; all others are refused."""
    ran = 0
    for seed in seeds:
        text, function = made_up(seed)
        try:
            decay = HybridSystem(
                state=("q", "v"),
                parameters={"k": 1.5},
                modes=[Mode("a", lambda t, x, p: (-x.q, -x.v))],
                transitions=[Transition("a", "a", Guard(lambda t, x, p: x.q - 0.5, when=function))],
            )
            compiled = compile_system(decay)
        except ModelError:
            continue
        ran += 1
        rng, function = np.random.default_rng(seed), condition_function(decay.transitions[0])
        for _ in range(40):
            x = rng.choice([-1.0, 1.0], 2) * 10.0 ** rng.uniform(-4, 6, 2)
            t, values = 10.0 ** rng.uniform(-3, 5), 10.0 ** rng.uniform(-2, 2, 1)
            wanted = evaluate(decay.variables, function, t, x, values)
            if wanted is None:
                continue
            found = compiled.value(function, 0, t, x, values)
            # nan satisfies no condition, and does not count as a wrong number.
            band = 1e-7 * np.abs(wanted) + rounding_band(decay, function, t, x, values, wanted)
            assert np.isnan(found) or abs(found - wanted) <= band, (text, t, x, values, found, wanted)
    return ran


@pytest.mark.parametrize("start", range(0, 16, 4))
def test_functions_made_up_by_chance_run_as_written_or_are_refused(start):
    assert runs_as_written(range(start, start + 4)) > 0


def test_every_function_of_a_system_is_compared():
    def hit(t, x, p):
        return (x.q, -0.5 * x.v) if type(x.q) is np.float64 else (x.q, -0.4 * x.v)

    wall = Transition("a", "a", Guard(lambda t, x, p: x.q, -1), Reset(hit), name="wall")
    with pytest.raises(ModelError, match=r"Transition 'wall': reset: value 1 is"):
        compile_system(system(lambda t, x, p: (x.v, -1.0), transitions=[wall]))
