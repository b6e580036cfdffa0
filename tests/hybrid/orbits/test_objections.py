"""Why the last shot of Newton's method is no periodic orbit: each reason alone, on shots in closed form."""

from types import SimpleNamespace

import attrs
import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Taylor, Transition
from hybrid.orbits import shooting as module
from hybrid.orbits.newton import EPSILON, Newton, Point
from tests.hybrid.orbits.test_newton import shot

SOLVER = Taylor(rtol=1e-10, atol=1e-12)
TOLERANCE = 1e-10
# The state moves by 2 around (1000, 1000) and ends where it began; the map contracts.
MOVES = {"extent": np.array([2.0, 2.0]), "magnitude": np.array([1000.0, 1000.0])}
X, CONTRACTION = [1000.0, 1000.0], np.diag([0.5, -0.25])


def objection(found, *, free_period=False, moved=None, drifts=False, monkeypatch=None):
    shooting = module.Shooting(None, None, None, SOLVER)
    newton = Newton.begin(found, SOLVER.atol, free_period)
    if moved is not None:
        newton = attrs.evolve(newton, moved=np.array(moved))
    if monkeypatch is not None:
        monkeypatch.setattr(module.Shooting, "_drifts", lambda *_: drifts)
    return shooting._objection(found, newton, 3, TOLERANCE)


def closed(fundamental=CONTRACTION, gap=(0.0, 0.0), **changes):
    return shot(X, np.add(X, gap), fundamental, **(MOVES | changes))


def test_an_orbit():
    assert objection(closed()) is None
    assert objection(closed(), free_period=True) is None


@pytest.mark.parametrize(
    ("found", "text"),
    [
        (closed(end_mode="other"), "the orbit ends in mode 'other' and starts in 'run'"),
        (closed(np.diag([np.nan, 0.5])), "the tangent vectors left the range of numbers"),
        (closed(np.diag([3.0 / EPSILON, 0.5])), "errors of the start grow by a factor of 1.35e+16 over"),
        (closed(gap=(0.0, 3e-3)), "the residual is 0.003 after 3 iterations"),
        (
            shot([1e-13, 0.0], [1e-13, 0.0], CONTRACTION),
            "all states are below the atol of the solver, 1e-12, and so not controlled",
        ),
    ],
)
def test_reasons(found, text):
    assert objection(found).startswith(text)


def test_only_what_moves_has_a_period_of_its_own():
    rest = closed(extent=np.array([1e-11, 0.0]))
    assert objection(rest) is None
    text = objection(rest, free_period=True)
    assert text == "it led to an equilibrium: the state moves by 1e-11 in all"
    assert objection(closed(extent=np.array([0.0, 2.0])), free_period=True) is None


class TestFamilies:
    """Orbits side by side: the step along the family is arbitrary, and a part of the gap stays."""

    @staticmethod
    def family(**changes):
        return closed(np.diag([1.0 + 1e-13, -0.25]), gap=(1e-10, 0.0), **changes)

    def test_one_near_to_the_guess_at_which_the_method_has_settled(self, monkeypatch):
        assert objection(self.family(), monkeypatch=monkeypatch) is None

    def test_a_solution_that_drifts(self, monkeypatch):
        text = objection(self.family(), drifts=True, monkeypatch=monkeypatch)
        assert text.startswith("the ends agree to 1e-10, but the next step would move the start by ")
        assert text.endswith("the solution drifts, or no orbit is near")

    @pytest.mark.parametrize(("share", "settled"), [(0.9, True), (-0.9, True), (1.1, False), (-1.1, False)])
    @pytest.mark.parametrize("component", [0, 1])
    def test_the_last_step_is_compared_with_the_motion(self, share, settled, component, monkeypatch):
        """A component that does not move is compared with its size."""
        moved = np.zeros(2)
        moved[component] = share * module.SETTLED * 2.0
        text = objection(self.family(), moved=moved, monkeypatch=monkeypatch)
        assert (text is None) == settled
        at_rest = self.family(extent=np.array([2.0, 0.0]))
        moved = np.array([0.0, share * module.SETTLED * 1000.0])
        assert (objection(at_rest, moved=moved, monkeypatch=monkeypatch) is None) == settled

    def test_far_from_the_guess(self, monkeypatch):
        """The first shot was a thousand times smaller than the orbit."""
        found = self.family()
        shooting = module.Shooting(None, None, None, SOLVER)
        monkeypatch.setattr(module.Shooting, "_drifts", lambda *_: False)
        for size, near in ((2.0 / module.FARTHEST * 1.1, True), (2.0 / module.FARTHEST * 0.9, False)):
            newton = attrs.evolve(Newton.begin(found, SOLVER.atol, False), first=np.full(2, size))
            assert (shooting._objection(found, newton, 3, TOLERANCE) is None) == near


@pytest.mark.parametrize(("share", "far"), [(0.9, False), (-0.9, False), (1.1, True), (-1.1, True)])
def test_far_along_a_direction_in_which_the_ends_agree_everywhere(share, far):
    """The map keeps one direction; far along the other is no matter."""
    for fundamental, kept, other in (
        (np.diag([1.0, 0.5]), [1.0, 0.0], [0.0, 5.0]),
        ([[1.0, 0.0], [0.5, 0.5]], [1.0, 1.0], [5.0, -5.0]),
    ):
        found = closed(fundamental)
        newton = Newton.begin(found, SOLVER.atol, False)
        for direction, said in ((kept, far), (other, False)):
            gone = share * module.FARTHEST * 1000.0 * np.array(direction)
            moved = attrs.evolve(newton, anchor=found.point.x - gone)
            assert moved.led_astray(found, module.FARTHEST) == said
            text = module.Shooting(None, None, None, SOLVER)._objection(found, moved, 3, TOLERANCE)
            assert (text is not None and text.startswith("it went far along a direction")) == said


@pytest.mark.parametrize("off", [-0.09, -0.03, 0.0, 0.05, 0.09])
def test_the_guessed_period_is_moved_to_where_the_solution_returns(off):
    """Of a rotation with the period 2 pi, to half the distance between the times that are compared."""
    rotation = HybridSystem(state=("q", "v"), modes=[Mode("run", lambda t, x, p: (x.v, -x.q))])
    shooting = module.Shooting(rotation, None, None, SOLVER)
    guess = 2 * np.pi / (1 + off)
    found = shooting._time_of_return(Point(np.array([1.0, 0.5]), 0.7, guess))
    apart = guess * module.PERIOD_OFF / (module.SAMPLES - 1)
    assert found == pytest.approx(2 * np.pi, abs=0.51 * apart)


def test_a_guess_without_a_return_stays():
    line = HybridSystem(state=("q",), modes=[Mode("run", lambda t, x, p: (1.0 + 0.0 * x.q,))])
    shooting = module.Shooting(line, None, None, SOLVER)
    assert shooting._time_of_return(Point(np.array([1.0]), 0.0, 3.0)) == 3.0


def test_the_search_starts_at_a_later_point_of_the_guess():
    """Half a turn later a rotation has led ``(1, 0)`` to ``(-1, 0)``, which is on the left."""
    modes = [Mode(side, lambda t, x, p: (x.v, -x.q)) for side in ("right", "left")]
    across = Guard(lambda t, x, p: x.q)
    rotation = HybridSystem(
        state=("q", "v"),
        modes=modes,
        transitions=[Transition("right", "left", across), Transition("left", "right", across)],
    )
    shooting = module.Shooting(rotation, "right", None, SOLVER)
    later, moved = shooting._moved(Point(np.array([1.0, 0.0]), 0.7, 2 * np.pi), np.pi)
    assert later.mode == "left"
    np.testing.assert_allclose(moved.x, [-1.0, 0.0], atol=1e-9)
    assert (moved.t, moved.period) == pytest.approx((0.7 + np.pi, 2 * np.pi))


@pytest.mark.parametrize(
    ("jumps", "quiet"), [([2.0, 12.0], 7.0), ([16.0], 9.95), ([4.0], 9.95), ([9.0, 19.0], 4.5)]
)
def test_the_quietest_time_is_farthest_from_jumps_in_two_periods(jumps, quiet):
    """Of a period of 10; the start of the guess counts as a jump too."""
    asked = []

    def follow(*given, **options):
        asked.append(given[1])
        return SimpleNamespace(jumps=SimpleNamespace(t=0.7 + np.array(jumps)))

    found = SimpleNamespace(_follow=follow, mode="run")
    assert module.Shooting._quiet_time(found, Point(np.zeros(1), 0.7, 10.0)) == pytest.approx(quiet)
    assert asked == [20.0]
