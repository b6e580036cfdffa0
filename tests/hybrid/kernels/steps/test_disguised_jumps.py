"""Jumps of a field in disguise: tangent vectors pass them unchanged, so the run must say that it met one.

First the kernels rule by rule, then whole runs.
"""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import DOP853, HybridSystem, Mode, RadauIIA, StatusCode, Taylor, Tsit5, simulate
from hybrid.kernels.steps import disguised_jumps
from hybrid.kernels.types.codes import EXACT, RUNGE_KUTTA, TAYLOR
from hybrid.kernels.types.layout import EPSILON
from lyapunov import lyapunov_spectrum
from tests.hybrid.kernels.plain import plain

kernels = plain(disguised_jumps)


def plane(rates=None, slopes=((0.0, 0.0), (0.0, 0.0)), propagator=TAYLOR, timed=0):
    """A model of two components whose second mode has these rates as a function of time and state."""

    def field(mode, t, x, parameters, out):
        assert mode == 1
        out[:] = rates(t, x)

    def field_jacobian(mode, t, x, parameters, out):
        assert mode == 1
        out[:, :2] = slopes(t, x) if callable(slopes) else slopes

    return SimpleNamespace(
        dimension=2,
        parameters=np.zeros(0),
        propagator=np.array([EXACT, propagator]),
        timed=np.array([1 - timed, timed]),
        field=field,
        field_jacobian=field_jacobian,
        # Of the first mode nothing; the rate of the second component depends on the first one alone.
        first_slope=np.array([[0, 0, 0], [0, 2, 3]]),
        slope_column=np.array([0, 1, 0]),
    )


def memory(*departure):
    work = {name: np.full(2, 1e9) for name in ("field", "field_after", "trial", "new", "error", "state")}
    return SimpleNamespace(
        departure=np.array(departure),
        second_error=np.full(2, 1e9),
        jacobian=np.full((2, 3), 1e9),
        **work,
    )


def run_at(*y):
    return SimpleNamespace(mode=1, y=np.array(y), phase=5.0, field_jumps=7, jumped_in=-1)


def test_the_state_before_a_step_is_kept():
    work = memory(9.0, 9.0)
    kernels.leave(plane(), run_at(1.0, 2.0), work)
    assert work.departure.tolist() == [1.0, 2.0]


class TestLookingBack:
    """The state moves from (3, -4) by ``move`` in all, so that its size is 7, and more if it grows."""

    def asked(self, move, *, answers=(False, False), rtol=1e-3, **model):
        times, answers = [], list(answers)

        def jumps_between(model, method, run, t, span, work):
            times.append(t)
            return answers.pop(0)

        run = run_at(3.0 - move / 2, -4.0 + move / 2)
        look_back = plain(disguised_jumps, jumps_between=jumps_between).look_back
        method = SimpleNamespace(rtol=rtol, atol=1e-9)
        look_back(plane(**model), method, run, 0.25, memory(3.0, -4.0))
        assert (run.field_jumps, run.jumped_in) in ((7, -1), (8, 1))
        return times, run.field_jumps - 7

    def test_only_short_steps_are_looked_at(self):
        assert self.asked(0.2) == ([5.0], 0)
        assert self.asked(-0.2) == ([5.0], 0)
        assert self.asked(0.0) == ([], 0)
        assert self.asked(0.22) == ([], 0)
        assert self.asked(-0.22) == ([], 0)

    def test_the_size_is_the_larger_one_of_each_component(self):
        assert self.asked(-0.213) == ([5.0], 0)
        assert self.asked(0.205) == ([5.0], 0)

    def test_short_is_less_with_less_tolerance(self):
        assert self.asked(6.9e-3, rtol=1e-10) == ([5.0], 0)
        assert self.asked(7.1e-3, rtol=1e-10) == ([], 0)

    def test_exact_modes_are_not(self):
        assert self.asked(0.1, propagator=EXACT) == ([], 0)
        assert self.asked(0.1, propagator=RUNGE_KUTTA) == ([5.0], 0)

    def test_a_mode_with_time_is_looked_at_at_both_ends(self):
        assert self.asked(0.1, timed=1) == ([5.0, 5.25], 0)
        assert self.asked(0.1, timed=1, answers=(False, True)) == ([5.0, 5.25], 1)
        assert self.asked(0.1, timed=1, answers=(True,)) == ([5.0], 1)
        assert self.asked(0.1, answers=(True,)) == ([5.0], 1)


class TestRatesAtTheEnds:
    """From (1, 2) to (1.5, 1): tolerances of 0.1 and 0.125, times 1e4, over a span of 1000."""

    def asked(self, before, after, *, answers=(False, False), span=1000.0):
        components, answers = [], list(answers)

        def rate_jumps(model, run, t, i, rate_before, rate_after, work):
            assert (t, rate_before, rate_after) == (6.0, before[i], after[i])
            components.append(i)
            return answers.pop(0)

        def rates(t, x):
            assert t == 6.0
            return {1.0: before, 1.5: after}[x[0]]

        method = SimpleNamespace(atol=0.025, rtol=0.05)
        between = plain(disguised_jumps, rate_jumps=rate_jumps).jumps_between
        found = between(plane(rates), method, run_at(1.5, 1.0), 6.0, span, memory(1.0, 2.0))
        return components, found

    def test_of_any_component_count(self):
        assert self.asked((0.0, 0.0), (0.5, 0.5)) == ([0, 1], False)
        assert self.asked((0.0, 0.0), (0.5, 0.5), answers=(True,)) == ([0], True)
        assert self.asked((0.0, 0.0), (0.5, 0.5), answers=(False, True)) == ([0, 1], True)

    def test_that_hardly_differ_do_not_count(self):
        assert self.asked((0.5, 0.5), (0.5 + 1.1e-6, 0.5 - 1.1e-6)) == ([0, 1], False)
        assert self.asked((0.5, 0.5), (0.5 + 0.9e-6, 0.5 - 0.9e-6)) == ([], False)
        assert self.asked((-1.0, 0.0), (-1.0 - 1.9e-6, 0.0)) == ([], False)
        assert self.asked((0.0, -1.0), (0.0, -1.0 - 2.1e-6)) == ([1], False)

    def test_that_move_the_state_visibly_do_not_count(self):
        assert self.asked((0.0, 0.0), (0.99, -1.24)) == ([0, 1], False)
        assert self.asked((0.0, 0.0), (1.01, -1.26)) == ([], False)
        assert self.asked((0.0, 0.0), (-1.01, 1.24)) == ([1], False)
        assert self.asked((0.0, 0.0), (3.9, 0.0), span=250.0) == ([0], False)


class TestRate:
    """The rate of the second component, which goes from 0 to 1 while the first one goes from 4 to 6."""

    def jumps(self, rate, slope=0.0):
        places = []

        def rates(t, x):
            assert t == 6.0
            assert x[0] == 4.0 + 2.0 * x[1]
            places.append(float(x[1]))
            return 1e9, 1.0 + 4.0 * rate(x[1])

        tested = plain(
            disguised_jumps, explained_change=lambda *given: 4.0 * slope * abs(given[5][1] - given[4][1])
        )
        work, run = memory(4.0, 0.0), run_at(6.0, 1.0)
        found = tested.rate_jumps(
            plane(rates), run, 6.0, 1, 1.0 + 4.0 * rate(0.0), 1.0 + 4.0 * rate(1.0), work
        )
        assert (work.departure.tolist(), run.y.tolist()) == ([4.0, 0.0], [6.0, 1.0])
        return found, places

    @pytest.mark.parametrize("sign", [1.0, -1.0])
    def test_a_jump_is_followed_to_where_it_is(self, sign):
        found = self.jumps(lambda s: sign if s > 0.3 else 0.0)
        assert found == (True, [0.5, 0.25, 0.375])
        found = self.jumps(lambda s: sign if s > 0.8 else 0.0)
        assert found == (True, [0.5, 0.75, 0.875])

    def test_a_rate_that_changes_all_along_does_not_jump(self):
        assert not self.jumps(lambda s: s)[0]
        assert len(self.jumps(lambda s: s)[1]) == 3
        assert len(self.jumps(lambda s: -s)[1]) == 3
        # Half of the change is at one place.
        assert self.jumps(lambda s: 0.6 * (s > 0.3) + 0.4 * s)[0]
        assert not self.jumps(lambda s: 0.4 * (s > 0.3) + 0.6 * s)[0]

    def test_a_jump_that_derivatives_explain_is_none(self):
        """Each halving halves the rest of the step, and thirty times the slope counts."""
        step = lambda s: 1.0 if s > 0.3 else 0.0  # noqa: E731
        assert self.jumps(step, slope=8.1 / 30) == (True, [0.5, 0.25, 0.375, 0.3125])
        assert self.jumps(step, slope=7.9 / 30) == (True, [0.5, 0.25, 0.375])
        assert self.jumps(step, slope=1023.0 / 30)[0]
        found, places = self.jumps(step, slope=1025.0 / 30)
        assert not found
        assert len(places) == 11

    def test_a_change_that_ends_somewhere_is_none(self):
        """A steep slope, of which later halvings find the inside."""
        steep = lambda s: min(max((s - 0.3) * 32.0, 0.0), 1.0)  # noqa: E731
        found, places = self.jumps(steep, slope=64.0 / 30)
        assert (found, len(places)) == (False, 7)


def test_what_derivatives_explain():
    """The sum at both ends of the slopes times what the components move, and what their rounding moves."""
    slopes = lambda t, x: [[3.0, -5.0], [-7.0, 1e9]] if x[0] == 1.0 else [[1.0, 1.0], [1.0, 1e9]]  # noqa: E731
    low, high = np.array([1.0, -8.0]), np.array([1.5, -6.0])
    moves = 0.5 + EPSILON * 1.5, 2.0 + EPSILON * 8.0
    found = [
        kernels.explained_change(plane(slopes=slopes), 1, 6.0, i, low, high, memory(0.0, 0.0)) for i in (0, 1)
    ]
    assert found == pytest.approx([4.0 * moves[0] + 6.0 * moves[1], 8.0 * moves[0]], rel=1e-15, abs=0.0)
    still = np.array([0.0, -8.0])
    found = kernels.explained_change(
        plane(slopes=[[3.0, -5.0], [0.0, 0.0]]), 1, 6.0, 0, still, still, memory(0.0, 0.0)
    )
    assert found == pytest.approx(10.0 * EPSILON * 8.0, rel=1e-15, abs=0.0)


SOLVERS = {
    "Taylor": Taylor(),
    "DOP853": DOP853(),
    "RadauIIA": RadauIIA(rtol=1e-9, atol=1e-11),
    "Tsit5": Tsit5(rtol=1e-6, atol=1e-8),
}
# Values on both sides of zero differ.
JUMPS = {
    "quotient by abs": lambda u: u / np.abs(u),
    "quotient of abs": lambda u: 0.3 * np.abs(u) / u,
    "quotient by a root": lambda u: u / np.sqrt(u**2),
    "quotient of a maximum": lambda u: np.maximum(u, 0) / u,
    "arctan of a quotient": lambda u: np.arctan(1 / u),
    "arctan of a tangent": lambda u: np.arctan(np.tan(u + np.pi / 2)),
    "tanh of a quotient": lambda u: np.tanh(1 / u),
    "steeper than any step": lambda u: np.tanh(1e14 * u),
    "saturation": lambda u: np.clip(1e14 * u, -1, 1),
}
SMOOTH = {
    "kink": np.abs,
    "product of jumps": lambda u: u * u / np.abs(u),
    "steep": lambda u: np.tanh(1e3 * u),
    "contact": lambda u: -30 * np.maximum(-u, 0) ** 1.5,
    "flat": lambda u: u**3,
    "plain": np.sin,
}


def pushed(push, moving=0.0):
    """A driven oscillator with a push that depends on the height over a moving level."""
    return HybridSystem(
        state=("q", "v"),
        parameters={"a": moving},
        modes=[
            Mode(
                "swing",
                lambda t, x, p: (x.v, np.cos(t) - 0.1 * x.v - x.q - push(x.q - 0.1 - p.a * np.sin(t))),
            )
        ],
        period=2 * np.pi,
    )


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
@pytest.mark.parametrize("moving", [0.0, 0.3])
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("jump", JUMPS)
def test_a_run_with_tangent_vectors_tells_of_a_jump_in_disguise(jump, solver, moving):
    system = pushed(JUMPS[jump], moving)
    arc = simulate(system, (1.5, 0.0), (0.0, 5.0), tangent=True, solver=SOLVERS[solver])
    assert arc.status.code == StatusCode.DISCONTINUOUS_FIELD, arc.status
    assert "'swing'" in arc.status.message
    plain = simulate(system, (1.5, 0.0), (0.0, 5.0), solver=SOLVERS[solver])
    assert plain.status.ok
    spectrum = lyapunov_spectrum(system, (1.5, 0.0), intervals=3, transient=0, solver=SOLVERS[solver])
    assert spectrum.status.code == StatusCode.DISCONTINUOUS_FIELD


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
@pytest.mark.parametrize("moving", [0.0, 0.3])
@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("push", SMOOTH)
def test_tangent_vectors_that_pass_no_jump_are_the_derivative(push, solver, moving):
    system, method = pushed(SMOOTH[push], moving), SOLVERS[solver]
    arc = simulate(system, (1.5, 0.0), (0.0, 5.0), tangent=True, solver=method)
    assert arc.status.code == StatusCode.SUCCESS, arc.status
    fine, step = DOP853(rtol=1e-13, atol=1e-13, max_step=0.01), 1e-5
    ends = [
        [simulate(system, start, (0.0, 5.0), solver=fine).x[-1] for start in starts]
        for starts in (((1.5 + step, 0.0), (1.5 - step, 0.0)), ((1.5, step), (1.5, -step)))
    ]
    derivative = np.transpose([(ahead - behind) / (2 * step) for ahead, behind in ends])
    assert np.allclose(arc.fundamental, derivative, rtol=0, atol=2e-3 if solver == "Tsit5" else 2e-4)


@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_jump_in_time_changes_no_tangent_vector(solver):
    system = HybridSystem(
        state=("q", "v"),
        modes=[Mode("swing", lambda t, x, p: (x.v, -x.q + np.abs(np.cos(t)) / np.cos(t)))],
        period=2 * np.pi,
    )
    arc = simulate(system, (1.5, 0.0), (0.0, 5.0), tangent=True, solver=SOLVERS[solver])
    assert arc.status.code == StatusCode.SUCCESS
    assert np.allclose(arc.fundamental, [[np.cos(5), np.sin(5)], [-np.sin(5), np.cos(5)]], atol=1e-4)
