"""Which mode a run starts in: the one that is named, or the only one whose guards allow the start."""

from functools import cache
from operator import attrgetter

import numpy as np
import pytest

from hybrid import ArgumentError, Guard, HybridSystem, Mode, Reset, Transition, from_equations, simulate

# At ``q = 0`` with ``q' = 1`` the guard of a transition with this place is crossed, crosses at once,
# is ahead, or has no value.
BEYOND, LEAVES, AHEAD, UNDEFINED = -1.0, 0.0, 1.0, 3.0


def rising(name):
    """Positive beyond its place, and nan where that is above 2."""
    place = attrgetter(name)
    return Guard(lambda t, x, p: (x.q - place(p)) * np.sqrt(2.0 - place(p)), +1)


@cache
def three_modes():
    """Transitions are named after the modes that they join; each has its place as a parameter."""
    names = ("ab", "ac", "bc", "ca")
    return HybridSystem(
        state=("q",),
        parameters=dict.fromkeys(names, AHEAD),
        modes=[Mode(mode, lambda t, x, p: (1.0,)) for mode in "abc"],
        transitions=[Transition(name[0], name[1], rising(name), name=name) for name in names],
    )


def begun(places, mode=None):
    return simulate(three_modes(), (0.0,), (0.0, 0.5), mode=mode, parameters=places)


@pytest.mark.parametrize(
    ("places", "mode", "expected"),
    [
        # A named mode is entered wherever its guards are; those of other modes do not count.
        ({"ab": BEYOND, "ac": AHEAD, "bc": BEYOND}, "a", "a"),
        ({"ab": BEYOND, "ac": BEYOND}, "b", "b"),
        ({"ca": BEYOND, "ab": UNDEFINED}, "c", "c"),
        # Without a name, the only mode that no guard objects to.
        ({"ab": BEYOND, "bc": LEAVES}, None, "c"),
        ({"ac": LEAVES, "ca": BEYOND}, None, "b"),
        # A guard without a value objects to its mode alone.
        ({"ab": UNDEFINED, "ca": BEYOND}, None, "b"),
    ],
)
def test_the_mode_that_allows_the_start(places, mode, expected):
    arc = begun(places, mode)
    assert arc.mode[0] == expected
    beyond = [name for name, place in places.items() if place == BEYOND and name[0] == expected]
    assert ("The start lies beyond the guard of" in arc.status.message) == bool(beyond)
    assert all(repr(name) in arc.status.message for name in beyond)


@pytest.mark.parametrize(
    ("places", "mode", "text"),
    [
        ({"ab": BEYOND}, None, r"x0 = \(0.0,\) is allowed in more than one mode: b, c. Choose"),
        ({}, None, "in more than one mode: a, b, c"),
        (
            {"ab": BEYOND, "ac": LEAVES, "bc": BEYOND, "ca": LEAVES},
            None,
            "no mode: mode 'a' is left through 'ab', 'ac'; mode 'b' is left through 'bc'; mode 'c' is left",
        ),
        # The first of the guards without a value, where no mode is left.
        ({"ab": BEYOND, "ca": UNDEFINED, "bc": UNDEFINED}, None, "'bc': the guard is nan"),
        ({"ac": UNDEFINED}, "a", r"'ac': the guard is nan at t = 0.0, x0 = \(0.0,\)"),
    ],
)
def test_a_start_that_no_mode_or_several_allow_is_refused(places, mode, text):
    with pytest.raises(ArgumentError, match=text):
        begun(places, mode)


def sides(left, right, reset=None):
    """Two modes on the sides of ``q = 0``."""
    return HybridSystem(
        state=("q", "v"),
        modes=[Mode("left", left), Mode("right", right)],
        transitions=[
            Transition("left", "right", Guard(lambda t, x, p: x.q, direction=+1), reset),
            Transition("right", "left", Guard(lambda t, x, p: x.q, direction=-1)),
        ],
    )


def soft(t, x, p):
    return x.v, -x.q


def stiff(t, x, p):
    return x.v, -4.0 * x.q


class TestOnAKink:
    """Both modes allow a start that does not leave the guard at once."""

    def test_at_rest_on_a_continuous_kink_either_mode_is_right(self):
        arc = simulate(sides(soft, stiff), (0.0, 0.0), (0.0, 1.0))
        assert arc.status.ok
        assert arc.x[-1].tolist() == [0.0, 0.0]

    def test_a_start_in_equations_with_a_kink(self):
        arc = simulate(
            from_equations(lambda t, x, p: (x.v, -np.abs(x.q)), state=("q", "v")), (0.0, 0.0), (0.0, 1.0)
        )
        assert arc.x[-1].tolist() == [0.0, 0.0]

    @pytest.mark.parametrize("sign", [-1.0, 1.0])
    def test_a_flow_that_leaves_by_a_high_derivative_goes_to_its_side(self, sign):
        """From rest ``q = sign t^5 / 20`` at first: with ``sign t^3`` as the force."""

        def field(stiffness):
            return lambda t, x, p: (x.v, sign * t**3 - stiffness * x.q)

        arc = simulate(sides(field(1.0), field(4.0)), (0.0, 0.0), (0.0, 1.0))
        assert str(arc.mode[-1]) == ("right" if sign > 0 else "left")
        # The solution of q'' = sign t^3 - k q with k = w^2 from rest.
        w = 2.0 if sign > 0 else 1.0
        exact = sign * (1.0 - 6.0 / w**2 + 6.0 * np.sin(w) / w**3) / w**2
        assert arc.x[-1, 0] == pytest.approx(exact, rel=1e-9)

    def test_fields_that_agree_at_the_start_alone_are_refused(self):
        """On the guard they differ elsewhere: each leads to its own side, by a third derivative."""

        def field(sign):
            return lambda t, x, p: (sign * x.v**2, 1.0)

        with pytest.raises(ArgumentError, match="allowed in more than one mode: left, right"):
            simulate(sides(field(-1.0), field(1.0)), (0.0, 0.0), (0.0, 1.0))

    def test_fields_that_differ_on_the_guard_are_refused(self):
        apart = sides(lambda t, x, p: (0.0, 1.0), lambda t, x, p: (0.0, 2.0))
        with pytest.raises(ArgumentError, match="allowed in more than one mode: left, right"):
            simulate(apart, (0.0, 0.0), (0.0, 1.0))

    def test_modes_that_a_reset_joins_are_refused(self):
        system = sides(soft, stiff, Reset(lambda t, x, p: {"v": 2.0 * x.v}))
        with pytest.raises(ArgumentError, match="allowed in more than one mode: left, right"):
            simulate(system, (0.0, 0.0), (0.0, 1.0))
