"""A user's transitions in a system that is split: which pieces they leave, and on which side they land."""

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, ModelError, Reset, StatusCode, Transition, simulate, split

PAIR = (1.0, 0.5)
RATE = 0.1


def clock(reset, *more, guard=None):
    """A speed ``u`` with friction, changed by a reset once per unit of time."""
    tick = Transition("m", "m", guard or Guard(lambda t, x, p: x.q, -1), Reset(reset), name="tick")
    return split(
        HybridSystem(
            state=("q", "u"),
            parameters={"k": 1.0},
            modes=[Mode("m", lambda t, x, p: (-1.0, -RATE * np.sign(x.u)))],
            transitions=[tick, *more],
        )
    )


def slowed(u, t):
    """The speed after a time."""
    return np.sign(u) * max(abs(u) - RATE * t, 0.0)


RESETS = {
    "lands on either side": lambda u: np.abs(u) - 0.25,
    "lands on the side it came from": lambda u: 0.5 * u + 0.75 * np.sign(u),
    "lands on the other side": lambda u: -0.9 * u - 0.5 * np.sign(u),
    "is chosen": lambda u: np.where(np.abs(u) > 0.3, -u, 2.0 * u),
    "is one of three, told from above": lambda u: np.where(u > 0.3, 0.3, np.where(u > 0.15, 0.2, 0.5)),
    "is one of three, told from below": lambda u: np.where(u < 0.15, 0.5, np.where(u < 0.3, 0.2, 0.3)),
    "lands above": lambda u: 1.0 + 0.0 * u,
    "lands below": lambda u: -0.25 + 0.0 * u,
    "lands on the surface": lambda u: 0.0 * u,
    "stays": lambda u: u,
}


@pytest.mark.parametrize("name", RESETS)
@pytest.mark.parametrize("start", [0.5, -0.35])
def test_a_reset_lands_on_the_side_of_its_value(name, start):
    reset = RESETS[name]
    arc = simulate(clock(lambda t, x, p: (1.0, reset(x.u))), (1.0, start), (0.0, 5.5))
    assert arc.status.ok
    u = start
    for period in range(5):
        assert arc(period + 0.5)[1] == pytest.approx(slowed(u, 0.5), abs=1e-12)
        u = float(reset(np.float64(slowed(u, 1.0))))
    assert arc.x[-1, 1] == pytest.approx(slowed(u, 0.5), abs=1e-12)
    ticks = [jump for jump in arc.jumps if jump.transition.startswith("tick")]
    np.testing.assert_allclose([jump.t for jump in ticks], range(1, 6), atol=1e-12)


@pytest.mark.parametrize("start", [0.5, -0.5])
def test_a_guard_with_a_kink_ends_the_run_on_both_sides(start):
    end = Transition("m", None, Guard(lambda t, x, p: np.abs(x.u) - 0.25, -1), name="slow")
    arc = simulate(clock(lambda t, x, p: (1.0, x.u), end), (1.0, start), (0.0, 9.0))
    assert arc.status.code == StatusCode.TERMINAL
    assert arc.t[-1] == pytest.approx(2.5, abs=1e-12)
    assert arc.x[-1] == pytest.approx([0.5, start / 2], abs=1e-12)


def test_conditions_are_asked_in_every_piece():
    asked = Guard(lambda t, x, p: x.q, -1, when=lambda t, x, p: x.u - 0.15)
    system = clock(lambda t, x, p: (1.0, np.abs(x.u) - 0.5), guard=asked)
    arc = simulate(system, (1.0, 0.75), (0.0, 3.0))
    # At t = 1 the speed is 0.65, and 0.15 after the reset; at t = 2 the condition does not hold.
    ticks = [jump.t for jump in arc.jumps if jump.transition.startswith("tick")]
    np.testing.assert_allclose(ticks, [1.0], atol=1e-12)
    assert arc(2.0)[1] == pytest.approx(0.05, abs=1e-12)
    assert arc.x[-1] == pytest.approx([-1.0, 0.0], abs=1e-12)


def test_functions_that_cannot_be_traced_stay_as_they_are():
    guard = Guard(lambda t, x, p: x.q * PAIR[int(p.k)], -1)
    system = clock(lambda t, x, p: (1.0, -x.u), guard=guard)
    arc = simulate(system, (1.0, 0.5), (0.0, 1.5))
    assert arc.x[-1] == pytest.approx([0.5, -0.35], abs=1e-10)
    with pytest.raises(ModelError, match="a reset into mode 'm' cannot be traced, so it is not known"):
        simulate(clock(lambda t, x, p: (1.0, x.u * PAIR[int(p.k)])), (1.0, 0.5), (0.0, 1.5))


def test_a_reset_that_cannot_be_traced_may_lead_to_a_smooth_mode():
    system = split(
        HybridSystem(
            state=("q", "u"),
            parameters={"k": 1.0},
            modes=[
                Mode("m", lambda t, x, p: (-1.0, -RATE * np.sign(x.u))),
                Mode("free", lambda t, x, p: (-1.0, 0.0)),
            ],
            transitions=[
                Transition(
                    "m",
                    "free",
                    Guard(lambda t, x, p: x.q, -1),
                    Reset(lambda t, x, p: (x.q, x.u * PAIR[int(p.k)])),
                )
            ],
        )
    )
    arc = simulate(system, (1.0, 0.5), (0.0, 2.0), mode="m")
    assert arc.mode[-1] == "free"
    assert arc.x[-1] == pytest.approx([-1.0, 0.2], abs=1e-10)


@pytest.mark.parametrize("start", [0.5, -0.5])
def test_chatter_ends_in_the_piece_of_the_state(start):
    """A ball that slides sideways: it comes to rest on the ground at ``3 sqrt(2)``, and slides on."""
    system = split(
        HybridSystem(
            state=("q", "v", "u"),
            modes=[
                Mode("flight", lambda t, x, p: (x.v, -1.0, -RATE * np.sign(x.u))),
                Mode("ground", lambda t, x, p: (0.0, 0.0, -2.0 * RATE * np.sign(x.u))),
            ],
            transitions=[
                Transition(
                    "flight",
                    "flight",
                    Guard(lambda t, x, p: x.q, -1),
                    Reset(lambda t, x, p: (0.0, -0.5 * x.v, x.u)),
                    name="bounce",
                    accumulates_to="ground",
                )
            ],
        )
    )
    arc = simulate(system, (1.0, 0.0, start), (0.0, 4.5), mode="flight")
    limit = 3.0 * np.sqrt(2.0)
    assert arc.status.ok
    assert arc.mode[-1].startswith("ground")
    [last] = [jump for jump in arc.jumps if jump.kind == "limit"]
    assert last.t == pytest.approx(limit, abs=1e-9)
    expected = slowed(slowed(start, limit), 2.0 * (4.5 - limit))
    assert arc.x[-1] == pytest.approx([0.0, 0.0, expected], abs=1e-9)


@pytest.mark.parametrize(
    ("name", "fired"),
    [
        ("lands on either side", ["u>0->u>0", "u>0->u<0"]),
        ("lands on the other side", ["u>0->u<0", "u<0->u>0"]),
        # Where there is one landing, the side that is left says enough.
        ("lands above", ["u>0", "u>0"]),
        ("lands below", ["u>0", "u<0"]),
    ],
)
def test_copies_are_named_after_the_sides_that_matter(name, fired):
    reset = RESETS[name]
    arc = simulate(clock(lambda t, x, p: (1.0, reset(x.u))), (1.0, 0.5), (0.0, 2.5))
    assert [jump.transition for jump in arc.jumps] == [f"tick ({sides})" for sides in fired]
