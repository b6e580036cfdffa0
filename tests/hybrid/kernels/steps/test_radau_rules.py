"""The implicit step piece by piece, compared with NumPy: matrices, first guesses, iterations, estimates."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import RadauIIA
from hybrid.kernels.steps import radau
from hybrid.kernels.steps.radau import LAST_LENGTH, LAST_MODE, MOST_ITERATIONS, NOT_SOLVED
from hybrid.simulation.plan import kernel_method
from tests.hybrid.kernels.plain import plain

kernels = plain(radau)
NAMES = ("a", "b", "c", "error", "second_error", "quadrature")
# Of the three stages, and of the step from 3 to 3.25.
NODES, WEIGHTS = RadauIIA.tableau.c[1:], RadauIIA.tableau.a[1:, 1:]
MODE, T, H = 1, 3.0, 0.25
Y = np.array([2.0, -0.5])


def three_stages(rtol=1e-6, atol=1e-8):
    tableau = kernel_method(RadauIIA(), False)
    return SimpleNamespace(**{name: getattr(tableau, name) for name in NAMES}, rtol=rtol, atol=atol)


def one_stage(rtol=1e-6, atol=1.0):
    """Euler's implicit method."""
    return SimpleNamespace(
        a=np.array([[0.0, 0.0], [0.0, 1.0]]),
        b=np.array([1.0]),
        c=np.array([0.0, 1.0]),
        error=np.array([0.5, -0.5]),
        second_error=np.zeros(2),
        quadrature=np.array([0.0, 1.0]),
        rtol=rtol,
        atol=atol,
    )


class Model:
    """``x' = (A + t B) x + c + t d``, whose Jacobian is zero in one place."""

    dimension = 2
    parameters = np.zeros(0)
    constant, growth = np.array([[-3.0, 4.0], [0.0, 1.0]]), np.array([[0.5, -1.0], [0.0, -2.0]])
    push, pull = np.array([0.75, 1.5]), np.array([-1.0, 0.25])

    def matrix(self, t):
        return self.constant + t * self.growth

    def rates(self, t, x):
        return self.matrix(t) @ x + self.push + t * self.pull

    def field(self, mode, t, x, parameters, out):
        assert mode == MODE
        out[:2] = self.rates(t, x[:2])

    def field_jacobian(self, mode, t, x, parameters, out):
        assert mode == MODE
        exact = self.matrix(t)
        out[0, 0], out[0, 1], out[1, 1] = exact[0, 0], exact[0, 1], exact[1, 1]


def memory(s=3, n=2, tangents=0):
    length = n * (1 + tangents)
    return SimpleNamespace(
        stages=np.full((s + 1, length + 1), 9.0),
        trial=np.full(length, 9.0),
        new=np.full(length, 9.0),
        error=np.full(length, 9.0),
        second_error=np.full(length, 9.0),
        jacobian=np.full((n, n + 1), 9.0),
        systems=np.full(((s + 1) * n + s + 4, s * n), -1.0),
        pivots=np.full((s + 1) * n, 9),
    )


def kept(work, s=3, n=2):
    """The rows that keep the last step's polynomial."""
    return work.systems[(s + 1) * n + 1 :]


def test_the_rows_of_a_stage():
    jacobian = np.array([[2.0, -3.0, 9.0], [5.0, 0.5, 9.0]])
    for stage in (1, 2, 3):
        matrix = np.full((6, 6), 7.0)
        kernels.fill_rows(three_stages(), H, jacobian, 2, stage, matrix)
        rows = slice(2 * stage - 2, 2 * stage)
        np.testing.assert_allclose(
            matrix[rows], (np.eye(6) - H * np.kron(WEIGHTS, jacobian[:, :2]))[rows], rtol=1e-15, atol=1e-16
        )
        assert np.all(np.delete(matrix, rows, axis=0) == 7.0)


class TestFirstGuess:
    """The rates of the last step are ``1 + 2 s - s^2`` and ``3 - s`` at the share ``s`` of it."""

    last = 0.5

    def guess(self, y, mode=MODE, h=H, kept_h=last, method=None):
        method, work = method or three_stages(), memory()
        for stage, share in enumerate(NODES, 1):
            work.stages[stage, :2] = self.rates(share)
        work.new[:2] = 6.0, 7.0
        kernels.remember(method, MODE, kept_h, np.array([4.0, 5.0]), 2, work)
        assert kept(work)[3, :2].tolist() == [4.0, 5.0]
        assert kept(work)[4, :2].tolist() == [6.0, 7.0]
        work.stages[:] = 9.0
        kernels.predict(method, mode, h, np.array(y), 2, work)
        assert np.all(work.stages[0] == 9.0)
        assert np.all(work.stages[:, 2] == 9.0)
        return work.stages[1:, :2]

    def rates(self, share):
        return 1.0 + 2.0 * share - share * share, 3.0 - share

    @pytest.mark.parametrize("h", [0.5, 0.25, 0.75])
    def test_goes_on_with_the_last_polynomial(self, h):
        expected = [self.rates(1.0 + node * h / self.last) for node in NODES]
        np.testing.assert_allclose(self.guess((6.0, 7.0), h=h), expected, rtol=1e-13)

    @pytest.mark.parametrize("h", [0.5, 0.25, 0.1])
    def test_is_that_of_the_same_start(self, h):
        expected = [self.rates(node * h / self.last) for node in NODES]
        np.testing.assert_allclose(self.guess((4.0, 5.0), h=h), expected, rtol=1e-13)

    def test_is_zero_elsewhere(self):
        for y in ((4.0, 7.0), (6.0, 5.0), (1.0, 1.0)):
            assert np.all(self.guess(y) == 0.0)
        for y in ((4.0, 5.0), (6.0, 7.0)):
            assert np.all(self.guess(y, mode=MODE + 1) == 0.0)
            # A step of no length has no polynomial.
            assert np.all(self.guess(y, kept_h=0.0) == 0.0)

    def test_a_state_at_rest_is_its_own_start(self):
        method, work = three_stages(), memory()
        work.stages[1:, :2] = [self.rates(share) for share in NODES]
        work.new[:2] = Y
        kernels.remember(method, MODE, 0.5, Y, 2, work)
        assert (kept(work)[5, LAST_LENGTH], kept(work)[5, LAST_MODE]) == (0.5, MODE)
        kernels.predict(method, MODE, 0.5, Y, 2, work)
        np.testing.assert_allclose(work.stages[1:, :2], [self.rates(share) for share in NODES], rtol=1e-14)


class Feedback:
    """``x' = feedback x + push``: if its slope is ignored, each change is ``feedback`` times the last one."""

    dimension, parameters = 1, np.zeros(0)

    def __init__(self, feedback, push):
        self.feedback, self.push, self.calls = feedback, push, 0

    def field(self, mode, t, x, parameters, out):
        assert (mode, t) == (MODE, T + 1.0)
        self.calls += 1
        out[0] = self.feedback * x[0] + self.push


class TestIteration:
    def solved(self, feedback, push, *, rtol=1e-6, atol=1.0, y=0.0, guess=0.0):
        """Whether a step of length 1 is solved, and after how many iterations."""
        model, work = Feedback(feedback, push), memory(1, 1)
        work.systems[0, 0], work.pivots[0] = 1.0, 0
        work.stages[1, 0] = guess
        found = kernels.solve_stages(model, one_stage(rtol, atol), MODE, T, 1.0, np.array([y]), work)
        if found:
            partial = sum(feedback**k for k in range(model.calls))
            assert work.stages[1, 0] == pytest.approx((push + feedback * y) * partial, rel=1e-14)
            assert work.new[0] == y + work.stages[1, 0]
        return bool(found), model.calls

    def test_ends_where_the_change_is_small(self):
        """Enough is the root of the relative tolerance, at most 0.03 and at least ten roundings over it."""
        for rtol, enough in ((1e-6, 1e-3), (1e-8, 1e-4), (0.25, 0.03), (1e-14, 10.0 * 2.220446049250313e-2)):
            assert self.solved(0.5, 0.999 * enough, rtol=rtol, atol=1.0) == (True, 1)
            assert self.solved(0.5, -0.99 * enough, rtol=rtol, atol=1.0) == (True, 1)
            assert self.solved(0.5, 1.04 * enough, rtol=rtol, atol=1.0)[1] > 1

    def test_ends_where_what_is_left_is_small(self):
        """After a change of ``c`` and one of ``theta c``, what is left is ``theta^2 / (1 - theta) c``."""
        for theta in (0.1, 0.5, -0.1, -0.5):
            size = abs(theta)
            first = 1e-3 * (1.0 - size) / size**2
            assert self.solved(theta, 0.99 * first) == (True, 2)
            assert self.solved(theta, 1.01 * first) == (True, 3)

    def test_gives_up_where_it_does_not_contract(self):
        for theta in (1.1, -1.1, 1.5, -2.0, 5.0):
            assert self.solved(theta, 1.0) == (False, 2)
            # Stalled in rounding.
            assert self.solved(theta, 0.99e-2 / abs(theta)) == (True, 2)
            assert self.solved(theta, 1.01e-2 / abs(theta)) == (False, 2)

    @pytest.mark.parametrize("theta", [0.3, 0.5, -0.5, 0.8])
    def test_gives_up_where_the_iterations_left_do_not_suffice(self, theta):
        """Nine iterations leave ``theta^9 / (1 - theta) c``."""
        size = abs(theta)
        first = 1e-2 * (1.0 - size) / size ** (MOST_ITERATIONS - 1)
        assert self.solved(theta, 1.01 * first) == (False, 2)
        solved, calls = self.solved(theta, 0.98 * first)
        assert solved
        assert 2 < calls <= MOST_ITERATIONS

    def test_what_is_not_finite_is_no_solution(self):
        with np.errstate(invalid="ignore"):
            assert self.solved(0.5, math.inf) == (False, 1)
            assert self.solved(0.5, math.nan) == (False, 1)

    def test_begins_with_the_guess(self):
        model, work = Feedback(0.5, 1.0), memory(1, 1)
        work.systems[0, 0], work.pivots[0], work.stages[1, 0] = 1.0, 0, 2.0
        assert kernels.solve_stages(model, one_stage(), MODE, T, 1.0, np.array([0.0]), work)
        assert (work.stages[1, 0], work.new[0], model.calls) == (2.0, 2.0, 1)

    @pytest.mark.parametrize(
        ("y", "size"), [(8.0, 12.0), (-8.0, 8.0), (0.0, 4.0), (-4.0, 4.0), (-3.0, 4.0), (2.0, 6.0)]
    )
    @pytest.mark.parametrize("atol", [0.0, 0.25])
    def test_a_change_is_compared_with_the_largest_of_the_step(self, y, size, atol):
        """The rate is 4: the start, the end or the way between them is the largest."""
        rtol = 1e-4
        once = 1e-2 * (atol + rtol * size)
        for share, calls in ((0.99, 1), (1.01, 2), (-0.99, 1), (-1.01, 2)):
            model, work = Feedback(0.0, 4.0), memory(1, 1)
            work.systems[0, 0], work.pivots[0], work.stages[1, 0] = 1.0, 0, 4.0 - share * once
            assert kernels.solve_stages(model, one_stage(rtol, atol), MODE, T, 1.0, np.array([y]), work)
            assert model.calls == calls


def collocation(y, h=H, start=Model.rates):
    """Rates of the three stages from ``y``, if ``start`` tells the rates there."""
    model, times, rows = Model(), T + h * NODES, np.eye(6)
    for i, time in enumerate(times):
        rows[2 * i : 2 * i + 2] -= h * np.kron(WEIGHTS[i], model.matrix(time))
    return np.linalg.solve(rows, np.concatenate([start(model, time, y) for time in times])).reshape(3, 2)


def vectors(y, h=H):
    """The same for a tangent vector."""
    return collocation(y, h, lambda model, time, y: model.matrix(time) @ y)


TANGENTS = np.array([1.0, 0.5, -2.0, 3.0])


def test_tangent_vectors_solve_the_equations_with_the_matrix_of_each_stage():
    work = memory(tangents=2)
    work.stages[1:, :2] = collocation(Y)
    y = np.r_[Y, TANGENTS]
    assert kernels.solve_tangents(Model(), three_stages(), MODE, T, H, y, 2, work)
    np.testing.assert_allclose(work.stages[1:, :2], collocation(Y), rtol=1e-14)
    np.testing.assert_allclose(work.stages[1:, 2:4], vectors(TANGENTS[:2]), rtol=1e-12)
    np.testing.assert_allclose(work.stages[1:, 4:6], vectors(TANGENTS[2:]), rtol=1e-12)
    traces = [np.trace(Model().matrix(T + H * node)) for node in NODES]
    np.testing.assert_allclose(work.stages[1:, 6], traces, rtol=1e-14)
    assert np.all(work.stages[0] == 9.0)


class Plain:
    """``x' = rate x``."""

    dimension, parameters = 1, np.zeros(0)

    def __init__(self, rate):
        self.rate = rate

    def field(self, mode, t, x, parameters, out):
        out[0] = self.rate * x[0]

    def field_jacobian(self, mode, t, x, parameters, out):
        out[0, 0] = self.rate


def test_tangent_vectors_of_a_singular_step_are_none():
    work = memory(1, 1, 1)
    for rate, solved in ((2.0, False), (1.0, True)):
        assert kernels.solve_tangents(Plain(rate), one_stage(), MODE, T, 0.5, np.ones(2), 1, work) == solved


def expected_ratio(y, new, errors, h, method):
    """Of the state and each tangent vector."""
    worst = 0.0
    for start in range(0, len(y), 2):
        part = slice(start, start + 2)
        floor = method.rtol * np.sqrt(np.mean(new[part] ** 2)) if start else method.atol
        scale = floor + method.rtol * np.maximum(abs(y[part]), abs(new[part]))
        worst = max(worst, h * np.sqrt(np.mean((errors[part] / scale) ** 2)))
    return worst


class TestAttempt:
    def attempt(self, h=H, tangents=2, rtol=1e-10):
        """The ratio, and the larger one of those that are expected: of the plain and the filtered error."""
        model, method, work = Model(), three_stages(rtol, 1e-8), memory(tangents=tangents)
        y = np.r_[Y, TANGENTS][: 2 * (1 + tangents)]
        jacobian = model.matrix(T)
        work.stages[0, :2] = model.rates(T, Y)
        for k in range(1, 1 + tangents):
            work.stages[0, 2 * k : 2 * k + 2] = jacobian @ y[2 * k : 2 * k + 2]
        found = kernels.attempt_radau(model, method, MODE, T, h, y, tangents, work)
        rates = np.hstack(
            [collocation(Y, h), *(vectors(y[2 * k : 2 * k + 2], h) for k in range(1, 1 + tangents))]
        )
        length = 2 * (1 + tangents)
        np.testing.assert_allclose(work.stages[1:, :length], rates, rtol=1e-9)
        new = y + h * WEIGHTS[2] @ rates
        np.testing.assert_allclose(work.new, new, rtol=1e-10)
        errors = method.error @ np.vstack([work.stages[0, :length], rates])
        plain_ratio = expected_ratio(y[:2], new[:2], errors[:2], h, method)
        smoother = np.linalg.inv(np.eye(2) - h * method.error[0] * jacobian)
        errors = (errors.reshape(-1, 2) @ smoother.T).ravel()
        np.testing.assert_allclose(work.error, errors, rtol=1e-6, atol=1e-12)
        filtered = expected_ratio(y, new, errors, h, method)
        assert found == pytest.approx(max(plain_ratio, filtered), rel=1e-6)
        return plain_ratio > filtered, work

    def test_compared_with_numpy(self):
        """The plain error of the state counts, or the filtered one of the tangent vectors if it is larger."""
        for h in (0.25, 0.0625):
            for tangents in (0, 1, 2):
                # The state decays: its filtered error is the smaller one.
                is_plain, work = self.attempt(h, tangents)
                assert is_plain == (tangents == 0)
                np.testing.assert_allclose(kept(work)[0:3, :2], collocation(Y, h), rtol=1e-9)
                assert kept(work)[3, :2].tolist() == Y.tolist()
                np.testing.assert_allclose(kept(work)[4, :2], work.new[:2], rtol=1e-14)
                assert kept(work)[5, :2].tolist() == [h, MODE]

    def test_a_repeated_step_begins_with_its_solution(self):
        _, work = self.attempt(tangents=0)
        model = Model()
        calls, field = [], model.field

        def counted(*given):
            calls.append(given[1])
            field(*given)

        model.field = counted
        kernels.attempt_radau(model, three_stages(), MODE, T, H, Y, 0, work)
        assert len(calls) == 3

    def test_singular_matrices_are_no_step(self):
        """That of the stages, and that of the filter: ``1 - h rate`` and ``1 - h gamma rate`` are zero."""
        method = one_stage()
        for rate in (2.0, 4.0):
            work = memory(1, 1)
            work.stages[0, 0] = rate
            assert math.isnan(kernels.attempt_radau(Plain(rate), method, MODE, T, 0.5, np.ones(1), 0, work))

    def test_unsolved_equations_are_no_step(self):
        """The iteration jumps between two places; nothing is left that could be taken for a step."""

        class Turning(Plain):
            def field(self, mode, t, x, parameters, out):
                out[0] = -8.0 * x[0] + 1.0

        work = memory(3, 1, 1)
        kept(work, 3, 1)[:] = MODE
        y = np.array([0.0, 1.0])
        assert kernels.attempt_radau(Turning(0.0), three_stages(), MODE, T, 4.0, y, 1, work) == NOT_SOLVED
        assert np.all(np.isnan(work.new))
        assert kept(work, 3, 1)[5].tolist() == [MODE, -1.0, MODE]


def test_the_change_of_all_components_and_stages_counts():
    """The root of the mean square of ``h A`` times the changes, each over the scale of its component."""
    steady = np.array([3.0, -1.0])
    model = SimpleNamespace(dimension=2, parameters=None)

    def field(mode, t, x, parameters, out):
        model.calls += 1
        out[:] = steady

    model.field = field
    change = np.array([[1.0, -2.0], [0.5, 4.0], [-3.0, 0.25]])
    rtol, atol = 1e-4, 0.125
    way = H * WEIGHTS @ change
    scale = atol + rtol * np.maximum(np.abs(Y), np.maximum(np.abs(Y + H * steady), np.abs(H * steady)))
    norm = np.sqrt(np.mean((way / scale) ** 2))
    for share, calls in ((0.999, 1), (1.001, 2)):
        work, model.calls = memory(), 0
        work.systems[:6], work.pivots[:6] = np.eye(6), np.arange(6)
        work.stages[1:, :2] = steady - share * 1e-2 / norm * change
        assert kernels.solve_stages(model, three_stages(rtol, atol), MODE, T, H, Y, work)
        assert model.calls == 3 * calls


def test_tangent_vectors_have_the_jacobian_of_the_state_at_each_stage():
    """``x' = x^2`` with the rates 1, -2 and 0.5: at the stage ``i`` the slope is twice the state there."""
    rates, y = np.array([1.0, -2.0, 0.5]), np.array([2.0, 1.0])

    def field_jacobian(mode, t, x, parameters, out):
        out[0, 0] = 2.0 * x[0]

    model = SimpleNamespace(dimension=1, parameters=None, field_jacobian=field_jacobian)
    work = memory(3, 1, 1)
    work.stages[1:, 0] = rates
    assert kernels.solve_tangents(model, three_stages(), MODE, T, H, y, 1, work)
    slopes = 2.0 * (2.0 + H * WEIGHTS @ rates)
    np.testing.assert_allclose(work.stages[1:, 2], slopes, rtol=1e-14)
    expected = np.linalg.solve(np.eye(3) - H * slopes[:, None] * WEIGHTS, slopes * y[1])
    np.testing.assert_allclose(work.stages[1:, 1], expected, rtol=1e-13)
