"""Why no crossing is lost: each sentence of the argument in `docs/events.md` is the docstring of a test."""

import inspect
import re
from pathlib import Path as File

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Reset, Taylor, Transition, Tsit5, simulate
from tests.reference.sign_word import Path, sign_word

PAGE = File(__file__).parents[4] / "docs" / "events.md"
EACH_SOLVER = pytest.mark.parametrize("solver", [Taylor(), DOP853(), Tsit5(), RadauIIA()])


def moving(*transitions, dimension=3):
    """``q`` is a polynomial in time: with ``dimension`` 3 ``q'' = a``, and ``a`` is constant."""
    names = ("q", "v", "a", "j")[:dimension]
    return HybridSystem(
        state=names,
        modes=[Mode("move", lambda t, x, p: (*(getattr(x, name) for name in names[1:]), 0.0 * x.q))],
        transitions=transitions,
    )


def watch(direction=0, guard=lambda t, x, p: x.q, target="move", name="zero", **more):
    return Transition("move", target, Guard(guard, direction), name=name, **more)


def test_page_and_tests_say_the_same():
    """The list on the page is the list of the tests below."""
    section = PAGE.read_text(encoding="utf-8").split("\n## ")[1]
    tests = [each for name, each in globals().items() if name.startswith("test_")][1:]
    assert re.findall(r"^\d+\. (.*)$", section, re.MULTILINE) == [inspect.getdoc(test) for test in tests]


@EACH_SOLVER
def test_path(solver):
    """Each step gives a path: the state as polynomials, off by rounding and by the method's error."""
    swing = HybridSystem(state=("q", "v"), modes=[Mode("swing", lambda t, x, p: (x.v, -x.q))])
    arc, t = simulate(swing, (1.0, 0.0), (0.0, 10.0), solver=solver), np.linspace(0.0, 10.0, 1001)
    assert np.abs(arc(t)[:, 0] - np.cos(t)).max() < 1e3 * solver.rtol


def test_word():
    """A guard on a path reads as a word over `-`, `0`, `+`; `0` is where errors may hide the sign."""
    word = sign_word(lambda q: q * q - 0.25, Path([[-1.0, 1.0]], [1e-3], 2.0))
    assert [letter for _, letter in word] == [1, 0, -1, 0, 1]
    assert [round(place, 3) for place, _ in word] == [0.0, 0.499, 0.501, 1.499, 1.501]


@EACH_SOLVER
def test_pieces(solver):
    """A path is halved until on each piece the guard has no zero, or moves in one direction."""
    system = moving(watch())
    for width in 10.0 ** -np.arange(1.0, 6.0):
        arc = simulate(system, (1.0 - width**2, -2.0, 2.0), (0.0, 4.0), solver=solver)
        assert arc.jumps.t == pytest.approx([1.0 - width, 1.0 + width], abs=1e-3 * width)


@EACH_SOLVER
def test_crossing(solver):
    """`- 0 +` and `+ 0 -` are crossings: each fires once, in the direction of its transition."""
    for direction, times in ((+1, [3.0]), (-1, [1.0]), (0, [1.0, 3.0])):
        arc = simulate(moving(watch(direction)), (3.0, -4.0, 2.0), (0.0, 9.0), solver=solver)
        assert arc.jumps.t == pytest.approx(times, abs=1e-12)


@EACH_SOLVER
def test_touch(solver):
    """`- 0 -` and `+ 0 +` are touches: they fire nothing, and the run records them."""
    for sign in (1.0, -1.0):
        arc = simulate(moving(watch()), (sign, -2.0 * sign, 2.0 * sign), (0.0, 4.0), solver=solver)
        crossed = [jump.t for jump in arc.jumps]
        # No deeper than rounding, a touch may be read as two crossings, in and out.
        assert len(crossed) in (0, 2)
        assert [*crossed, *(touch.t for touch in arc.grazings)] == pytest.approx(
            [1.0] * (len(crossed) or 1), abs=1e-6
        )


@EACH_SOLVER
def test_rest(solver):
    """`0` to the end is rest: a guard that the flow holds at zero has not been crossed."""
    arc = simulate(moving(watch()), (0.0, 0.0, 0.0), (0.0, 5.0), solver=solver)
    assert arc.status.ok
    assert len(arc.jumps) == 0


@EACH_SOLVER
@pytest.mark.parametrize("order", [1, 2, 3])
def test_start(solver, order):
    """A state on a guard is on the side of the first letter behind it that is not `0`."""
    system = moving(watch(+1, target=None), dimension=4)
    for sign in (1.0, -1.0):
        start = np.zeros(4)
        start[order] = sign
        arc = simulate(system, start, (0.0, 2.0), solver=solver)
        assert (arc.t[-1] == 0.0) == (sign > 0)


@EACH_SOLVER
def test_cut(solver):
    """A reset onto a guard does not fire it again, and a run may be cut anywhere, even at an event."""
    up = Reset(lambda t, x, p: (x.q, -x.v, x.a))
    system = moving(watch(-1, reset=up, name="bounce"))
    whole = simulate(system, (1.0, 0.0, -2.0), (0.0, 10.0), solver=solver)
    assert whole.jumps.t == pytest.approx([1.0, 3.0, 5.0, 7.0, 9.0], abs=1e-9)
    for cut in (2.0, 3.0, float(whole.jumps.t[1])):
        first = simulate(system, (1.0, 0.0, -2.0), (0.0, cut), solver=solver)
        rest = simulate(system, first.x[-1], (cut, 10.0), solver=solver)
        assert [*first.jumps.t, *rest.jumps.t] == pytest.approx(whole.jumps.t, abs=1e-9)


@EACH_SOLVER
def test_landing(solver):
    """An event is where the far letter begins if anything may jump there, else at the root."""
    for reset, beyond in ((lambda t, x, p: (np.mod(x.q, 1.0), x.v, x.a), True), (None, False)):
        more = {} if reset is None else {"reset": Reset(reset)}
        system = moving(watch(+1, guard=lambda t, x, p: x.q - 1.0, **more))
        arc = simulate(system, (0.3, 1.3, 0.0), (0.0, 3.0), solver=solver)
        assert np.all(arc.jumps.x_minus[:, 0] > 1.0) or not beyond
        assert arc.jumps.x_minus[:, 0] == pytest.approx(1.0, abs=1e-13)
        assert len(arc.jumps) == (4 if beyond else 1)


@EACH_SOLVER
def test_shorter_step(solver):
    """A `0` that the method's error makes, and not rounding, asks for a shorter step."""
    decay = HybridSystem(
        state=("h",),
        modes=[Mode("decay", lambda t, x, p: (-x.h,))],
        transitions=[Transition("decay", "decay", Guard(lambda t, x, p: x.h), name="zero")],
    )
    arc = simulate(decay, (1.0,), (0.0, 60.0), solver=solver)
    assert arc.status.ok
    assert len(arc.jumps) == 0


@EACH_SOLVER
def test_earliest(solver):
    """The earliest event of all guards ends the step; at one instant the first in the list fires."""
    for apart, first in ((1e-9, "one"), (-1e-9, "two"), (0.0, "one")):
        system = moving(
            watch(+1, guard=lambda t, x, p: x.q - 1.0, target=None, name="one"),
            watch(+1, guard=lambda t, x, p, apart=apart: 2.0 * (x.q - 1.0 - apart), target=None, name="two"),
        )
        arc = simulate(system, (0.0, 1.0, 0.0), (0.0, 3.0), solver=solver)
        assert [jump.transition for jump in arc.jumps] == [first]


@EACH_SOLVER
def test_drift(solver):
    """What another mode holds at zero has drifted by the method's error: the guard reads `0` there."""
    ring = HybridSystem(
        state=("x", "y"),
        modes=[
            Mode("held", lambda t, s, p: (-s.y, s.x)),
            Mode("free", lambda t, s, p: (-s.y - 0.1 * s.x, s.x - 0.1 * s.y)),
        ],
        transitions=[
            Transition("held", "free", Guard(lambda t, s, p: s.y, -1), name="let go"),
            Transition("free", None, Guard(lambda t, s, p: s.x**2 + s.y**2 - 1.0, +1), name="out"),
        ],
    )
    arc = simulate(ring, (1.0, 0.0), (0.0, 6.0), mode="held", solver=solver)
    assert [jump.transition for jump in arc.jumps] == ["let go"]
    assert arc.status.ok


@EACH_SOLVER
def test_samples(solver):
    """Only a guard that cannot be traced is sampled, at 32 places of each step; the status says so."""

    def opaque(t, x, p):
        return x.q - 0.5 if t < 1e9 else 0.0

    watched = Guard(opaque, -1, gradient=lambda t, x, p: (1.0, 0.0 * t, 0.0 * t, 0.0 * t))
    arc = simulate(moving(Transition("move", "move", watched)), (1.0, -1.0, 0.0), (0.0, 1.0), solver=solver)
    assert arc.jumps.t == pytest.approx([0.5], abs=1e-12)
    assert "sampled on each step" in str(arc.status)
