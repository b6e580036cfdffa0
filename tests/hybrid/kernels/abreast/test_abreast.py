"""Runs that take their steps together find what each finds alone."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hybrid
import lyapunov
import models
from hybrid import Every, Guard, HybridSystem, Mode, Reset, Transition, simulate, simulate_many
from hybrid.simulation.crew import together
from hybrid.simulation.plan import plan_of
from tests.models.test_laws import RUNS

# Where the end of a run is this sensitive to its start, rounding is not told from a mistake.
MOST_STRETCH = 1e5


def starts_of(system, ranges, count):
    """Starts in the given ranges, always the same."""
    random, states = np.random.default_rng(5), ranges.get("states", {})
    columns = []
    for i, name in enumerate(system.state_names):
        # Counters begin at whole numbers.
        usual = (-1.0, 1.0) if i < system.tangent_dimension else (0.0, 0.0)
        low, high = np.broadcast_to(states.get(name, usual), 2)
        columns.append(random.uniform(low, high, count))
    return np.stack(columns, axis=1)


def assert_same_runs(system, starts, span, **options):
    found = simulate_many(system, starts, span, executor=1, progress=False, **options)
    for i, x0 in enumerate(starts):
        try:
            arc = simulate(system, x0, span, tangent=system.growth is None, **options)
        except hybrid.HybridError:
            assert found.status.values[i] == hybrid.StatusCode.FAILED
            continue
        if arc.fundamental is not None and not np.linalg.norm(arc.fundamental) < MOST_STRETCH:
            continue
        assert found.status.values[i] == arc.status.code, (i, found.message.values[i], arc.status)
        assert found.jumps.values[i] == arc.jump_count, i
        size = np.abs(arc.x).max(axis=0) + 1e-3
        apart = np.abs(found.x_end.values[i] - arc.x[-1]) / size
        assert apart.max() < 1e-8, (i, apart)


@pytest.mark.parametrize("name", RUNS)
def test_many_runs_of_a_model_are_those_of_each(name):
    system, ranges = RUNS[name]
    starts = starts_of(system, ranges, 24)
    assert_same_runs(system, starts, ranges["t_span"])


@pytest.mark.abreast
@pytest.mark.parametrize("tangents", [0, 1])
@pytest.mark.parametrize("name", ["vibroimpact", "impact_oscillator", "bouncing_ball", "bilinear_oscillator"])
def test_a_plain_model_takes_its_steps_abreast(name, tangents):
    compiled = hybrid.compile_system(RUNS[name][0])
    plan = plan_of(compiled, hybrid.Taylor(), tangents)
    assert together(compiled, plan, tangents).able.all()


@settings(max_examples=12)
@given(
    stiffness=st.floats(0.5, 4.0),
    cubic=st.floats(-0.2, 0.5),
    amplitude=st.floats(0.0, 1.0),
    wall=st.floats(0.3, 1.5),
    other=st.floats(-1.5, -0.3),
    restitution=st.floats(0.5, 0.95),
    tick=st.floats(0.7, 3.0),
)
def test_drawn_oscillators_between_walls(stiffness, cubic, amplitude, wall, other, restitution, tick):
    """Two walls, a threshold that changes the field, a clock that kicks: whatever the numbers are."""

    def field(damping):
        return lambda t, x, p: (
            x.v,
            -stiffness * x.q - cubic * x.q**3 - damping * x.v + amplitude * np.cos(1.7 * t),
        )

    bounce = Reset(lambda t, x, p: (x.q, -restitution * x.v))
    walls = [
        Transition(name, name, Guard(lambda t, x, p, at=at: x.q - at, direction), bounce, name=f"{name} {at}")
        for name in ("slow", "fast")
        for at, direction in ((wall, 1), (other, -1))
    ]
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("slow", field(0.1)), Mode("fast", field(0.3))],
        transitions=[
            *walls,
            Transition("slow", "fast", Guard(lambda t, x, p: x.v - 0.4, 1)),
            Transition("fast", "slow", Guard(lambda t, x, p: x.v - 0.2, -1)),
            Transition("slow", "slow", Every(tick), Reset(lambda t, x, p: (x.q, x.v + 0.05)), name="kick"),
        ],
    )
    starts = np.random.default_rng(2).uniform(-0.25, 0.25, (10, 2)) * [1.0, 0.5]
    assert_same_runs(system, starts, (0.0, 12.0), mode="slow")


GUARDS = {
    "a steep step": lambda t, x, p: np.tanh(30.0 * (x.q - 0.3)) - 0.9,
    "a pulse in the state": lambda t, x, p: np.exp(-200.0 * (x.q - 0.3) ** 2) - 0.5,
    "a pulse in time": lambda t, x, p: np.exp(-50.0 * (t - 2.3) ** 2) - 0.4 + 0.001 * x.q,
    "a pole beside the path": lambda t, x, p: 1.0 / (1.0 + 1e4 * (x.q - 0.3) ** 2) - 0.5,
    "a sine of the state": lambda t, x, p: np.sin(3.0 * x.q) - 0.5,
    "a moving threshold": lambda t, x, p: x.q - 0.5 * np.tanh(4.0 * (t - 3.0)),
    "a power": lambda t, x, p: x.q**9 - 0.01,
    "a product with a sine of time": lambda t, x, p: x.q * x.v - 0.2 * np.sin(11.0 * t),
}


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("guard", GUARDS.values(), ids=GUARDS.keys())
def test_guards_of_any_function(guard, direction):
    """A pendulum that counts the crossings, on a surface that two transitions share."""
    system = HybridSystem(
        state=("q", "v", "n"),
        modes=[Mode("m", lambda t, x, p: (x.v, -2.0 * np.sin(x.q), 0.0))],
        transitions=[
            Transition(
                "m", "m", Guard(guard, direction), Reset(lambda t, x, p: (x.q, x.v, x.n + 1.0)), name="first"
            ),
            Transition("m", "m", Guard(guard, -direction), name="back"),
        ],
    )
    random = np.random.default_rng(4)
    starts = np.column_stack([random.uniform(-1.0, 1.0, (16, 2)), np.zeros(16)])
    assert_same_runs(system, starts, (0.0, 6.0))


def test_transitions_that_share_a_crossing_are_told():
    """Two on one surface fire the same way: which comes first matters, in many runs as in one."""
    surface = Guard(lambda t, x, p: x.q - 0.3, 1)
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("m", lambda t, x, p: (x.v, -x.q))],
        transitions=[
            Transition("m", "m", surface, Reset(lambda t, x, p: (x.q, 0.5 * x.v)), name="half"),
            Transition("m", "m", surface, Reset(lambda t, x, p: (x.q, 2.0 * x.v)), name="double"),
        ],
    )
    assert_same_runs(system, np.random.default_rng(4).uniform(-1.0, 0.2, (12, 2)), (0.0, 5.0))


@pytest.mark.abreast
def test_like_terms_of_a_larger_system_are_taken_together():
    """What is written as a loop for a single run is written out here."""

    def field(t, x, p):
        q, v = x[:6], x[6:]
        return (*v, *(-np.sin(each) + 0.1 * np.cos((i + 1.0) * t) for i, each in enumerate(q)))

    wall = Transition(
        "m",
        "m",
        Guard(lambda t, x, p: x[0] - 0.4, 1),
        Reset(lambda t, x, p: (*x[:6], -0.8 * x[6], *x[7:])),
    )
    system = HybridSystem(state=12, modes=[Mode("m", field)], transitions=[wall])
    compiled = hybrid.compile_system(system)
    assert together(compiled, plan_of(compiled, hybrid.Taylor(), 0), 0).able.all()
    assert_same_runs(system, np.random.default_rng(6).uniform(-0.3, 0.3, (10, 12)), (0.0, 8.0))


def test_a_run_does_not_depend_on_those_beside_it():
    """To the last bit, alone, among others, and in another order."""
    system, ranges = RUNS["vibroimpact"]
    starts = starts_of(system, ranges, 40)
    options = {"executor": 1, "progress": False}
    together = simulate_many(system, starts, (0.0, 5.0), **options).x_end.values
    back = simulate_many(system, starts[::-1], (0.0, 5.0), **options).x_end.values
    np.testing.assert_array_equal(together, back[::-1])
    for i in (0, 7, 23):
        alone = simulate_many(system, starts[i : i + 1], (0.0, 5.0), **options).x_end.values
        np.testing.assert_array_equal(together[i], alone[0])


@pytest.mark.parametrize("k", [1, 2, None])
def test_rows_of_a_chart_are_spectra(k):
    """Each with its own parameters, and its own period."""
    system, start = models.vibroimpact(), (-0.02, 0.01, 0.4, -0.1)
    options = {"k": k, "intervals": 30, "transient": 5}
    values = np.linspace(4.0, 9.0, 11)
    chart = lyapunov.chart(system, {"omega": values}, start, mode="free", progress=False, **options)
    for i in (0, 4, 10):
        alone = lyapunov.lyapunov_spectrum(
            system, start, mode="free", parameters={"omega": values[i]}, **options
        )
        np.testing.assert_allclose(chart.exponents.values[i], alone.exponents, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("count", [3, 40, 2000])
@pytest.mark.parametrize("name", ["vibroimpact", "impact_oscillator", "boost_converter"])
def test_a_run_stops_within_its_steps(name, count):
    """At times at which its state is kept, one or many of them in a step: they change nothing."""
    system, ranges = RUNS[name]
    starts, span = starts_of(system, ranges, 11), ranges["t_span"]
    samples = np.linspace(*span, count)
    options = {"executor": 1, "progress": False}
    found = simulate_many(system, starts, span, samples=samples, **options)
    without = simulate_many(system, starts, span, **options)
    np.testing.assert_array_equal(found.jumps, without.jumps)
    for i, x0 in enumerate(starts):
        arc = simulate(system, x0, span, samples=samples)
        size = np.abs(arc.x).max(axis=0) + 1e-3
        assert (np.abs(found.x.values[i] - arc.x) / size).max() < 1e-8, i
        assert np.abs(found.x_end.values[i] - without.x_end.values[i]).max() < 1e-8 * size.max()


@pytest.mark.parametrize("interval", [0.05, 0.9, 20.0])
@pytest.mark.parametrize("k", [1, None])
def test_intervals_of_a_chart_end_within_steps(k, interval):
    """The growth of tangent vectors over intervals shorter and longer than a step."""
    system, start = models.impact_oscillator(), (0.0, 0.1)
    options = {"k": k, "interval": interval, "intervals": 60, "transient": 10}
    values = np.linspace(0.9, 2.8, 10)
    chart = lyapunov.chart(system, {"w": values}, start, progress=False, **options)
    for i in (0, 4, 9):
        alone = lyapunov.lyapunov_spectrum(system, start, parameters={"w": values[i]}, **options)
        np.testing.assert_allclose(chart.exponents.values[i], alone.exponents, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("w", [0.3, 40.0, 3e4, 3e6])
def test_forcing_of_any_pace_from_the_origin(w):
    """A state that begins at zero says nothing of its size, and the unit of time nothing: a closed form."""
    system = HybridSystem(
        state=("q",),
        modes=[Mode("m", lambda t, x, p: (np.cos(w * t) + np.sin(2.0 * w * t),))],
        transitions=[],
    )
    for begin in (0.0, 7.0):
        end = begin + 50.0 / w
        found = simulate_many(system, [[0.0]] * 9, (begin, end), executor=1, progress=False).x_end.values
        alone = simulate(system, (0.0,), (begin, end)).x[-1]
        # Exact times: the phases are known to their rounding.
        late = np.array([np.longdouble(w) * np.longdouble(t) for t in (begin, end)])
        first, last = np.sin(late) - np.cos(2.0 * late) / 2.0
        error = 1e-13 + 10.0 * w * np.spacing(end)
        assert np.abs(found * w - float(last - first)).max() < error
        assert abs(alone[0] * w - float(last - first)) < error
