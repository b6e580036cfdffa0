"""Newton shooting rule by rule: which shots are tried, which is kept, and when the method ends."""

from types import SimpleNamespace

import attrs
import numpy as np
import pytest

from hybrid.errors import ArgumentError
from hybrid.kernels.types import codes
from hybrid.orbits import periodic_orbit as module
from hybrid.orbits.newton import EPSILON, Point
from hybrid.solvers import Taylor
from hybrid.status import SUCCESS, Status, StatusCode

SOLVER = Taylor(rtol=1e-10, atol=1e-12)


@attrs.frozen
class Try:
    """A shot whose gap is its state, less where the orbit is."""

    point: Point
    whole: bool = True
    fits: float = 0.0
    mode: str = "run"
    status: Status = SUCCESS
    magnitude: float = 3.0

    def size(self, scale):
        assert scale == "scale"
        return abs(self.point.x)

    def closes(self, tolerance, rounding):
        assert (tolerance, rounding) == (1e-9, 4 * EPSILON * self.magnitude)
        return abs(self.point.x) <= self.fits


def at(x, period=3.0, **changes):
    return Try(Point(x, 0.5, period), **changes)


class Shooting(module._Shooting):
    """Shots at states that are numbers; those beyond 100 are in no mode."""

    def __init__(self):
        object.__setattr__(self, "tried", [])
        object.__setattr__(self, "solver", SOLVER)

    def __setattr__(self, name, value):
        object.__setattr__(self, name, value)

    def shoot(self, point):
        self.tried.append(point.x)
        assert len(self.tried) < 50
        if abs(point.x) > 100.0:
            raise ArgumentError("In no mode.")
        return Try(point, **getattr(self, "changes", {}))


class TestBetter:
    """From the state 4: the best so far is 2."""

    def better(self, change, part=1.0, longer=0.0, period=3.0):
        shooting, newton, best = Shooting(), SimpleNamespace(scale="scale"), at(2.0)
        found = shooting._better(best, at(4.0, period), newton, (change, longer), part)
        return found is best, found.point.x, found.point.period, shooting.tried

    def test_a_shot_that_closes_better(self):
        assert self.better(-3.0, 1.0, 0.5) == (False, 1.0, 3.5, [1.0])
        assert self.better(-6.0, 0.5, 0.5) == (False, 1.0, 3.25, [1.0])

    def test_a_shot_that_does_not(self):
        assert self.better(-1.0) == (True, 2.0, 3.0, [3.0])
        assert self.better(-2.0) == (True, 2.0, 3.0, [2.0])
        assert self.better(200.0) == (True, 2.0, 3.0, [204.0])

    def test_a_period_is_above_zero(self):
        assert self.better(-4.0, 1.0, -3.0) == (True, 2.0, 3.0, [])
        assert self.better(-4.0, 0.5, -3.0) == (True, 2.0, 3.0, [2.0])
        assert self.better(-3.5, 1.0, -2.5) == (False, 0.5, 0.5, [0.5])


class TestAlong:
    """The step from 4 goes this far, and without the directions of families that far."""

    def along(self, full, within):
        asked, shooting = [], Shooting()

        def step(shot, smallest=None):
            asked.append(smallest)
            return (full if smallest is None else within), 0.0

        found = shooting._along(at(4.0), SimpleNamespace(scale="scale", step=step))
        return None if found is None else found.point.x, shooting.tried, asked

    def test_a_step_that_halves_the_gap_is_taken(self):
        assert self.along(-3.0, None) == (1.0, [1.0], [None])
        assert self.along(-2.0, None) == (2.0, [2.0], [None])

    def test_else_the_step_without_families_is_tried_too(self):
        """The better one of the two is taken."""
        both = [None, module.NEARLY_SINGULAR]
        assert self.along(-1.0, -4.0) == (0.0, [3.0, 0.0], both)
        assert self.along(-1.0, 1.0) == (3.0, [3.0, 5.0], both)
        assert self.along(-9.0, -4.5) == (-0.5, [-5.0, -0.5], both)

    def test_the_full_step_is_halved_until_it_helps(self):
        found, tried, _ = self.along(-16.0, 1.0)
        assert (found, tried) == (0.0, [-12.0, 5.0, -4.0, 0.0])
        found, tried, _ = self.along(-32.0 * 8, 1.0)
        assert (found, tried[2:]) == (0.0, [-124.0, -60.0, -28.0, -12.0, -4.0, 0.0])

    def test_no_step_helps(self):
        found, tried, _ = self.along(64.0, 1.0)
        assert found is None
        assert tried[2:] == [4.0 + 64.0 / 2**i for i in range(1, 7)]


class TestNewton:
    """Each step halves the state."""

    def newton(self, monkeypatch, x, most, *, stuck=0.0, measurable=True, **changes):
        begun = SimpleNamespace(advanced=lambda shot, better: begun, measurable=lambda shot: measurable)
        monkeypatch.setattr(module.Newton, "begin", lambda *given: asked.append(given) or begun)
        asked, shooting = [], Shooting()
        shooting.changes = changes
        shooting._along = lambda shot, newton: (
            None
            if abs(shot.point.x) <= stuck
            else attrs.evolve(shot, point=Point(shot.point.x / 2, 0.5, 3.0))
        )
        shooting._status = lambda shot, newton, iterations, tolerance: (
            newton is begun,
            iterations,
            tolerance,
        )
        shooting._result = lambda shot, iterations, status: (shot.point.x, iterations, status)
        x, iterations, status = shooting.newton(Point(x, 0.5, 3.0), True, 1e-9, most)
        assert status == (True, iterations, 1e-9)
        [(_, atol, free)] = asked
        assert (atol, free) == (SOLVER.atol, True)
        return x, iterations

    def test_until_the_ends_agree(self, monkeypatch):
        assert self.newton(monkeypatch, 8.0, 9, fits=1.0) == (1.0, 3)
        assert self.newton(monkeypatch, 1.0, 9, fits=1.0) == (1.0, 0)

    def test_as_often_as_is_allowed(self, monkeypatch):
        assert self.newton(monkeypatch, 8.0, 2, fits=1.0) == (2.0, 2)
        assert self.newton(monkeypatch, 8.0, 0, fits=1.0) == (8.0, 0)

    def test_until_no_step_helps(self, monkeypatch):
        """The attempt counts."""
        assert self.newton(monkeypatch, 8.0, 9, stuck=2.0) == (2.0, 3)

    def test_not_from_numbers_whose_sizes_cannot_be_measured(self, monkeypatch):
        assert self.newton(monkeypatch, 8.0, 9, measurable=False) == (8.0, 0)

    def test_only_from_runs_that_reach_their_end(self, monkeypatch):
        assert self.newton(monkeypatch, 8.0, 9, whole=False) == (8.0, 0)


@attrs.frozen
class Orbit:
    period: float
    status: Status = SUCCESS


@pytest.mark.parametrize("ok", [True, False])
@pytest.mark.parametrize(("period", "shrank"), [(0.00299, True), (0.00301, False), (3.1, False)])
def test_a_period_that_shrinks_to_a_thousandth_is_no_orbit(period, shrank, ok):
    """Of the guess, 3; an orbit is then moved to the point nearest to the guess."""
    status = SUCCESS if ok else Status(StatusCode.NON_FINITE, "nan")
    guess, moved = Point("x", 1.0, 3.0), Point("later", 1.5, 3.2)

    def newton(point, free_period, tolerance, most):
        assert (point, free_period, tolerance, most) == (moved, True, 1e-9, 7)
        return Orbit(period, status)

    shooting = SimpleNamespace(
        _quiet_time=lambda point: 0.5,
        _moved=lambda point, shift: (
            SimpleNamespace(newton=newton),
            (point, shift) == (guess, 0.5) and moved,
        ),
        _nearest=lambda orbit, point: ("nearest", orbit, point),
    )
    found = module._Shooting.autonomous(shooting, guess, 1e-9, 7)
    if shrank:
        assert found.status.code == StatusCode.NOT_CONVERGED
        assert found.status.message.startswith("The period shrank from 3 to 0.00299: a point, no orbit")
    elif ok:
        assert found == ("nearest", Orbit(period), guess)
    else:
        assert found == Orbit(period, status)


def test_the_point_of_the_arc_that_is_nearest_to_the_guess():
    @attrs.frozen
    class Found:
        x0: np.ndarray
        mode: str
        t0: float

        def arc(self, solver):
            assert solver is SOLVER
            return SimpleNamespace(
                x=np.array([[0.0, 0.0], [3.0, 4.0], [3.0, -4.0]]), mode=["a", "b", "c"], t=[1.0, 2.0, 3.0]
            )

    shooting = SimpleNamespace(solver=SOLVER)
    for x, place, mode, t in (
        ((1.0, 1.0), 0, "a", 1.0),
        ((2.0, 3.0), 1, "b", 2.0),
        ((9.0, -4.0), 2, "c", 3.0),
    ):
        found = module._Shooting._nearest(shooting, Found(None, "", 0.0), Point(np.array(x), 0.0, 1.0))
        assert (found.mode, found.t0) == (mode, t)
        assert found.x0.tolist() == [[0.0, 0.0], [3.0, 4.0], [3.0, -4.0]][place]


@pytest.mark.parametrize("whole", [True, False])
@pytest.mark.parametrize(
    ("rough", "drift", "drifts"),
    [
        # At most a tenth of the change is left, or more of it.
        (1.0, 0.09, False),
        (1.0, -0.11, False),
        (1.0, 0.092, True),
        (1.0, -0.112, True),
        (1.0, 1.0, True),
        # Rounding.
        (0.002, 0.002, False),
        (0.004, 0.004, True),
    ],
)
def test_a_drift_is_what_a_finer_solver_leaves(rough, drift, drifts, whole, monkeypatch):
    shot = SimpleNamespace(mode="run", point="point", rounding=np.array([0.003]))
    finer = SimpleNamespace(whole=whole)
    asked = []

    def shoot(self, point):
        asked.append((self.mode, self.solver, point))
        return finer

    def parts(first, other, farthest):
        assert first is shot
        assert farthest == pytest.approx(1e-5)
        return np.array([[drift if other is finer else rough]])

    monkeypatch.setattr(module._Shooting, "shoot", shoot)
    shooting = module._Shooting("system", None, None, SOLVER)
    found = shooting._drifts(shot, SimpleNamespace(drift=parts), 1e-10)
    assert found == (drifts or not whole)
    assert asked == [("run", SOLVER.tightened(100.0), "point")]


@pytest.mark.parametrize("code", [codes.DONE, codes.TERMINAL])
@pytest.mark.parametrize("jumps", [0, 1])
@pytest.mark.parametrize("moves", [1e-14, 1.0])
def test_what_rounding_hides_counts_where_a_component_rests(moves, jumps, code, monkeypatch):
    """Of a run to its end without jumps; the second component always moves."""
    end = np.array([1000.0 + moves, 3.0])
    middle = np.array([999.0 if moves == 1.0 else 1000.0, 7.0])

    class Arc:
        t, x = (0.5, 3.5), np.array([[1000.0, 1.0], end])

        def __call__(self, times):
            assert (times[0], times[-1], len(times)) == (0.5, 3.5, module.SAMPLES)
            return np.tile(middle, (len(times), 1))

    arc = Arc()
    arc.jumps = [None] * jumps
    trajectory = SimpleNamespace(
        mode="run", x=end, tangent_matrix="matrix", model=SimpleNamespace(period=0.0), field=lambda: "field"
    )
    ends = []
    monkeypatch.setattr(module, "advance_to_close", lambda run, *place: ends.append(place) or code)
    monkeypatch.setattr(module, "hidden_gap", lambda run, arc, size: np.array([0.25, 0.5]))
    monkeypatch.setattr(module, "status_of", lambda run, code: code)
    shooting = SimpleNamespace(
        mode="run", _trajectory=lambda point, mode: trajectory, _follow=lambda point, span, mode: arc
    )
    found = module._Shooting.shoot(shooting, Point(np.array([1000.0, 1.0]), 0.5, 3.0))
    assert ends == [(0, 3.5)]
    rests = moves < 1e-10 and not jumps and code == codes.DONE
    assert found.hidden.tolist() == [0.25 if rests else 0.0, 0.0]
    assert found.extent == pytest.approx([2.0 if moves == 1.0 else 0.0, 6.0], abs=1e-11)
    assert found.magnitude.tolist() == [max(1000.0, end[0]), 7.0]
    assert (found.status, found.fundamental, found.end_mode) == (code, "matrix", "run")
