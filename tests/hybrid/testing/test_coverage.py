"""What runs reach: guards that cannot fire, conditions that refuse everything, modes that are dead ends."""

import attrs
import numpy as np
import pytest

import models
from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition
from hybrid.testing import PropertyError, check_system

FLIGHT = Mode("flight", lambda t, x, p: (x.v, -9.81))
NEAR = {"states": {"q": (0.0, 1.0)}, "t_span": (0.0, 1.0), "examples": 10}


def ball(guard, *, reset=lambda t, x, p: {"v": -0.5 * x.v}, when=None, modes=(), transitions=()):
    hit = Transition("flight", "flight", Guard(guard, -1, when=when), Reset(reset), name="hit")
    return HybridSystem(
        state=("q", "v"), modes=[FLIGHT, *modes], transitions=[hit, *transitions], name="ball"
    )


@pytest.mark.parametrize(
    ("guard", "told"),
    [(lambda t, x, p: x.q**2 + 1.0, "positive"), (lambda t, x, p: -np.exp(x.q) - 1e-3, "negative")],
)
def test_a_guard_that_never_crosses_zero(guard, told):
    with pytest.raises(PropertyError, match=f"guard of 'hit' is {told} at all 500 states that were tried"):
        check_system(ball(guard), **NEAR)


def test_a_condition_that_refuses_every_crossing():
    """The guard falls only while the velocity is negative, which the condition excludes."""
    faulty = ball(lambda t, x, p: x.q, when=lambda t, x, p: x.v > 0.0)
    with pytest.raises(PropertyError, match="condition of 'hit' refuses the crossing of its guard at all"):
        check_system(faulty, **NEAR)


def test_both_sides_of_a_condition():
    """A hole in the floor: to the left of 0 the ball falls through."""
    holed = HybridSystem(
        state=("q", "v", "x"),
        modes=[Mode("flight", lambda t, x, p: (x.v, -9.81, 0.0))],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(lambda t, x, p: x.q, -1, when=lambda t, x, p: x.x > 0.0),
                Reset(lambda t, x, p: {"q": 0.0, "v": -0.5 * x.v}),
                name="floor",
            )
        ],
    )
    fall = {"t_span": (0.0, 2.0), "examples": 60}
    report = check_system(holed, states={"q": 0.1, "v": 0.0}, **fall)
    assert report.jumps["floor"] > 0
    assert report.one_sided == ()
    right = check_system(holed, states={"q": 0.1, "v": 0.0, "x": (0.5, 1.0)}, **fall)
    assert right.one_sided == ("floor",)
    assert "ONE SIDE ONLY: the condition of floor has refused no crossing" in str(right)


def test_what_the_ranges_do_not_reach_is_told_first():
    """A clock that strikes at t = 100, and a disk that few states are in, can fire."""
    for guard in (lambda t, x, p: 100.0 - t, lambda t, x, p: np.hypot(x.q - 50.0, x.v) - 0.1):
        report = check_system(ball(guard), **NEAR)
        assert report.never_seen == ("hit",)
        assert str(report).splitlines()[1] == "- NEVER SEEN: hit. Give ranges that reach them."


def test_modes_that_nothing_leaves_or_enters():
    land = Transition("flight", "roll", Guard(lambda t, x, p: x.v, -1, when=lambda t, x, p: x.q > 0.5))
    start = Transition("launch", "flight", Guard(lambda t, x, p: x.v + 1.0, +1))
    modes = [Mode("roll", lambda t, x, p: (x.v, 0.0)), Mode("launch", lambda t, x, p: (x.v, 1.0))]
    report = check_system(ball(lambda t, x, p: x.q, modes=modes, transitions=[land, start]), **NEAR)
    assert "- NEVER LEFT: no transition leaves mode 'roll', in which the state moves." in str(report)
    assert "- NEVER ENTERED: no transition leads to mode 'launch'." in str(report)


def test_a_mode_at_rest_is_no_dead_end():
    rest = Mode("rest", lambda t, x, p: (0.0, 0.0))
    (hit,) = ball(lambda t, x, p: x.q).transitions
    hit = attrs.evolve(hit, accumulates_to="rest")
    system = HybridSystem(state=("q", "v"), modes=[FLIGHT, rest], transitions=[hit])
    assert check_system(system, **NEAR | {"t_span": (0.0, 3.0)}).dead_ends == ()


def test_runs_that_end_early_are_counted():
    report = check_system(models.bouncing_ball(), states={"q": (0.1, 0.5)}, t_span=(0.0, 9.0), examples=10)
    assert report.ends == {"with ACCUMULATION of bounce": report.ends.total()}
    assert report.ends.total() > 0
    assert "ENDED EARLY: " in str(report)
    assert report.cut["it has more than 5 jumps"] > 0
    assert "CUT, for all but laws and ends: " in str(report)


def test_a_guard_that_is_crossed_the_other_way_alone():
    """The level only rises, and the guard waits for its fall."""
    tank = HybridSystem(
        state=("h",),
        modes=[Mode("fill", lambda t, x, p: (1.0,)), Mode("drain", lambda t, x, p: (-1.0,))],
        transitions=[
            Transition(
                "fill",
                "drain",
                Guard(lambda t, x, p: x.h - 1.0, -1, when=lambda t, x, p: x.h > 0.5),
                name="full",
            ),
            Transition("drain", "fill", Guard(lambda t, x, p: x.h + 9.0, -1), name="empty"),
        ],
    )
    with pytest.raises(PropertyError, match=r"guard of 'full' rises at all .* and fires where it falls"):
        check_system(tank, states={"h": (0.1, 0.9)}, examples=5)


def test_a_condition_on_a_counter_is_not_judged_by_drawn_values():
    gears = HybridSystem(
        state=("v", "n"),
        modes=[Mode("drive", lambda t, x, p: (1.0, 0.0))],
        transitions=[
            Transition(
                "drive",
                "drive",
                Guard(lambda t, x, p: x.v - 1.0, +1, when=lambda t, x, p: x.n == 1.0),
                Reset(lambda t, x, p: {"v": 0.0, "n": 2.0}),
                name="up",
            )
        ],
    )
    assert check_system(gears, examples=5, t_span=(0.0, 2.0)).never_seen == ("up",)


def test_runs_are_aimed_at_what_no_run_took():
    """Two carts latch if they meet slowly, which the drawn starts do not."""

    def joined(t, x, p):
        v = 0.5 * (x.u + x.v)
        return {"x": x.y, "u": v, "v": v}

    def carts(reset):
        return HybridSystem(
            state=("x", "u", "y", "v"),
            modes=[
                Mode("apart", lambda t, x, p: (x.u, 0.0, x.v, 0.0)),
                Mode("latched", lambda t, x, p: (x.u, 0.0, x.u, 0.0)),
            ],
            transitions=[
                Transition(
                    "apart",
                    "latched",
                    Guard(lambda t, x, p: x.y - x.x, -1, when=lambda t, x, p: x.u - x.v < 0.05),
                    Reset(reset),
                    name="latch",
                )
            ],
        )

    together = {
        "laws": Laws(equal={"latched": {"together": lambda t, x, p: x.u - x.v}}),
        "examples": 20,
        "mode": "apart",
    }
    assert not check_system(carts(joined), **together).never_seen
    with pytest.raises(PropertyError, match="'together' is zero in mode 'latched'"):
        check_system(carts(lambda t, x, p: {"u": 0.5 * (x.u + x.v)}), **together)


def test_a_mode_that_never_lasts():
    """The charger is full at the voltage at which it begins."""
    charger = HybridSystem(
        state=("u",),
        modes=[Mode("off", lambda t, x, p: (-1.0,)), Mode("charge", lambda t, x, p: (1.0,))],
        transitions=[
            Transition("off", "charge", Guard(lambda t, x, p: x.u, -1), Reset(lambda t, x, p: {"u": 1.0})),
            Transition("charge", "off", Guard(lambda t, x, p: x.u - 0.5, +1)),
        ],
    )
    report = check_system(charger, states={"u": (0.1, 1.0)}, mode="off", t_span=(0.0, 4.0), examples=5)
    assert "- NEVER LASTS: each of " in str(report)
    assert "left mode 'charge' at the instant at which it entered" in str(report)


def block_on_a_belt(forward_guard=lambda t, x, p: p.k * x.x + p.c * p.v0 + p.F):
    """The belt runs to the right, and a spring pulls back: no block at rest on the belt overtakes it."""
    slips = [
        Transition(
            "stick", "back", Guard(lambda t, x, p: p.k * x.x + p.c * p.v0 - p.F, +1), name="slip back"
        ),
        Transition("stick", "forward", Guard(forward_guard, -1), name="slip forward"),
        Transition(
            "back", "stick", Guard(lambda t, x, p: x.v - p.v0, +1), Reset(lambda t, x, p: {"v": p.v0})
        ),
        Transition(
            "forward", "stick", Guard(lambda t, x, p: x.v - p.v0, -1), Reset(lambda t, x, p: {"v": p.v0})
        ),
    ]
    slide = lambda sign: lambda t, x, p: (x.v, -p.k * x.x - p.c * x.v + sign * 0.6 * p.F)  # noqa: E731
    modes = [
        Mode("stick", lambda t, x, p: (p.v0, 0.0)),
        Mode("back", slide(+1)),
        Mode("forward", slide(-1)),
    ]
    return HybridSystem(
        state=("x", "v"),
        parameters={"k": 1.0, "c": 0.1, "v0": 0.5, "F": 1.0},
        modes=modes,
        transitions=slips,
        start="stick",
        name="block on a belt",
    )


BELT = {
    "parameters": {"v0": (0.2, 1.0)},
    "states": {"x": (-0.5, 0.5), "v": (-0.5, 0.5)},
    "t_span": (0.0, 20.0),
    "examples": 10,
}


def test_the_other_side_of_a_symmetric_model_is_told_and_not_raised():
    report = check_system(block_on_a_belt(), **BELT)
    assert "slip forward" in report.never_seen
    assert report.jumps["slip back"] > 0
    assert "slip forward" in str(report)


def test_a_wrong_sign_on_the_other_side_of_a_symmetric_model_is_raised():
    faulty = block_on_a_belt(lambda t, x, p: p.k * x.x - p.c * p.v0 + p.F)
    with pytest.raises(PropertyError, match="guard of 'slip forward' rises at all"):
        check_system(faulty, **BELT)
