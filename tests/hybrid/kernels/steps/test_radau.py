"""Single steps of the implicit kernel: order, interpolant, tangent vectors, divergence, the guess."""

import numpy as np
import pytest
from numba import njit

import hybrid
from hybrid.kernels.steps.radau import NOT_SOLVED, attempt_radau
from hybrid.kernels.types.kinds import INTEGER, REAL, VECTOR
from hybrid.kernels.types.layout import Method, Model, Work
from hybrid.kernels.types.numba_types import signature_of
from hybrid.simulation.trajectory import start

# Newton's iteration to rounding; fixed steps ignore the error ratio.
TIGHT = hybrid.RadauIIA(rtol=1e-13, atol=1e-14)


@njit(signature_of(REAL, Model, Method, INTEGER, REAL, REAL, VECTOR, INTEGER, Work))
def attempt(model, method, mode, t, h, y, tangents, work):
    return attempt_radau(model, method, mode, t, h, y, tangents, work)


def system(*fields, state, **parameters):
    return hybrid.HybridSystem(
        state=state,
        parameters=parameters,
        modes=[hybrid.Mode("m", lambda t, x, p: tuple(field(t, x, p) for field in fields))],
        transitions=[],
    )


# Volterra's equations with seasonal forcing: nonlinear, non-autonomous, with a varying divergence.
PREY = system(
    lambda t, x, p: x.u * (1 + 0.5 * np.sin(t) - x.w),
    lambda t, x, p: x.w * (x.u - 1),
    state=("u", "w"),
)
X0 = (1.5, 0.5)


def field(t, x):
    u, w = x
    return np.array([u * (1 + 0.5 * np.sin(t) - w), w * (u - 1)])


class Steps:
    """Steps of a given length from a given start, whatever their error."""

    def __init__(self, tangent=None, x0=X0, solver=TIGHT):
        self.trajectory = start(PREY, x0, 0.0, solver=solver, tangent=tangent)
        self.t, self.y, self.divergence = 0.0, self.trajectory.run.y.copy(), 0.0

    def attempt(self, h):
        trajectory = self.trajectory
        work, k = trajectory.work, trajectory.tangents
        work.stages[0, :2] = field(self.t, self.y[:2])
        if k:
            jacobian = np.array(
                [
                    [1 + 0.5 * np.sin(self.t) - self.y[1], -self.y[0]],
                    [self.y[1], self.y[0] - 1],
                ]
            )
            work.stages[0, 2:-1] = (self.y[2:].reshape(k, 2) @ jacobian.T).ravel()
            work.stages[0, -1] = np.trace(jacobian)
        return attempt(trajectory.model, trajectory.method, 0, self.t, h, self.y, k, work)

    def take(self, h, count=1):
        work, method = self.trajectory.work, self.trajectory.method
        for _ in range(count):
            assert self.attempt(h) != NOT_SOLVED
            self.divergence += h * method.quadrature @ work.stages[:, -1]
            self.t, self.y = self.t + h, work.new.copy()
        return self.y


@pytest.fixture(scope="module")
def exact():
    solver = hybrid.DOP853(rtol=1e-14, atol=1e-15)
    return hybrid.simulate(PREY, X0, (0.0, 2.0), solver=solver, tangent=True)


def slope(lengths, errors):
    return np.polyfit(np.log(lengths), np.log(errors), 1)[0]


LENGTHS = np.array([1 / 8, 1 / 16, 1 / 32])


def test_steps_are_of_order_five(exact):
    errors, tangent_errors, divergence_errors = [], [], []
    log_determinant = np.log(np.linalg.det(exact.fundamental))
    for h in LENGTHS:
        steps = Steps(tangent=np.eye(2))
        y = steps.take(h, round(2 / h))
        errors.append(np.abs(y[:2] - exact.x[-1]).max())
        tangent_errors.append(np.abs(y[2:].reshape(2, 2).T - exact.fundamental).max())
        divergence_errors.append(abs(steps.divergence - log_determinant))
    assert slope(LENGTHS, errors) == pytest.approx(5, abs=0.3)
    assert slope(LENGTHS, tangent_errors) == pytest.approx(5, abs=0.3)
    assert slope(LENGTHS, divergence_errors) == pytest.approx(5, abs=0.4)


def test_interpolant_is_of_order_three(exact):
    """Inside one step the error of the interpolant falls with the fourth power of the length."""
    errors = []
    for h in LENGTHS:
        steps = Steps()
        steps.attempt(h)
        work, method = steps.trajectory.work, steps.trajectory.method
        bernstein = np.array(X0) + h * method.interpolant @ work.stages[:, :2]
        np.testing.assert_allclose(bernstein[0], X0, rtol=0)
        np.testing.assert_allclose(bernstein[-1], work.new, rtol=1e-15)
        theta = np.linspace(0, 1, 21)
        basis = np.array(
            [(1 - theta) ** 3, 3 * theta * (1 - theta) ** 2, 3 * theta**2 * (1 - theta), theta**3]
        )
        errors.append(np.abs(basis.T @ bernstein - [exact(t) for t in theta * h]).max())
    assert slope(LENGTHS, errors) == pytest.approx(4, abs=0.3)


def test_the_last_stage_is_the_derivative_at_the_end():
    steps = Steps(tangent=np.eye(2))
    steps.attempt(0.3)
    work = steps.trajectory.work
    np.testing.assert_allclose(work.stages[3, :2], field(0.3, work.new[:2]), rtol=1e-12)


def test_tangents_are_the_derivative_of_the_step():
    """Tangents differentiate the step itself; the flow differs from the step by more than the test allows."""
    h, epsilon = 0.2, 1e-5
    tangents = Steps(tangent=np.eye(2)).take(h)[2:].reshape(2, 2).T
    for column, shift in enumerate(epsilon * np.eye(2)):
        difference = Steps(x0=X0 + shift).take(h) - Steps(x0=X0 - shift).take(h)
        np.testing.assert_allclose(tangents[:, column], difference / (2 * epsilon), rtol=0, atol=1e-9)


def test_a_step_does_not_depend_on_what_was_tried_before():
    """The first guess comes from an earlier polynomial and affects only the number of iterations."""
    fresh = Steps().take(0.2)
    retaken = Steps()
    retaken.attempt(0.7)
    np.testing.assert_allclose(retaken.take(0.2), fresh, rtol=1e-13)
    onwards, alone = Steps(), Steps(x0=fresh)
    onwards.take(0.2)
    alone.t = 0.2
    np.testing.assert_allclose(onwards.take(0.3), alone.take(0.3), rtol=1e-13)


def test_a_step_of_no_length():
    steps = Steps(tangent=np.eye(2))
    before = steps.y.copy()
    assert steps.attempt(0.0) <= 1.0
    np.testing.assert_array_equal(steps.trajectory.work.new, before)
    np.testing.assert_array_equal(steps.take(0.1), Steps(tangent=np.eye(2)).take(0.1))


def test_the_estimate_is_of_the_size_of_the_interpolants_error(exact):
    """For a step at the tolerance the error of the interpolant is about the tolerance."""
    tolerance = 1e-6
    arc = hybrid.simulate(PREY, X0, (0.0, 2.0), solver=hybrid.RadauIIA(rtol=tolerance, atol=tolerance))
    worst = max(np.abs(arc(t) - exact(t)).max() for t in np.linspace(0, 2, 500))
    assert 0.05 * tolerance < worst < 5 * tolerance


@pytest.mark.parametrize("h", [1e3, 1e6])
def test_no_solution_is_no_step(h):
    assert not Steps().attempt(h) <= 1.0


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("atol", [1e-12, 1e-30])
def test_tangents_of_a_flight_that_begins_and_ends_at_zero(unit, atol):
    """The step is repeated up to the landing, where the height alone gives no tolerance for the equations."""
    ball = hybrid.HybridSystem(
        state=("q", "v"),
        parameters={"unit": 1.0},
        modes=[hybrid.Mode("flight", lambda t, x, p: (x.v * p.unit, -9.81))],
        transitions=[
            hybrid.Transition(
                "flight",
                "flight",
                hybrid.Guard(lambda t, x, p: x.q, -1),
                hybrid.Reset(lambda t, x, p: (x.q, -0.7 * x.v)),
            )
        ],
    )
    solver = hybrid.RadauIIA(rtol=1e-7, atol=atol)
    fundamental = np.eye(2)
    for end in (0.4, 0.8, 1.1):
        arc = hybrid.simulate(
            ball, (0.5 * unit, 0.0), (0.0, end), parameters={"unit": unit}, tangent=True, solver=solver
        )
        assert arc.status.ok
        fundamental, last = np.eye(2), 0.0
        for jump in arc.jumps:
            flight = np.array([[1.0, jump.t - last], [0.0, 1.0]])
            push = 9.81 * 1.7 / abs(jump.x_minus[1])
            fundamental = np.array([[-0.7, 0.0], [push, -0.7]]) @ flight @ fundamental
            last = jump.t
        fundamental = np.array([[1.0, end - last], [0.0, 1.0]]) @ fundamental
        found = arc.fundamental * [[1.0, 1.0 / unit], [unit, 1.0]]
        np.testing.assert_allclose(found, fundamental, rtol=1e-9, atol=1e-9)
