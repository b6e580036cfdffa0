"""Which mode a run starts in, from the verdicts of the guards on the start."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid import ArgumentError, Guard, HybridSystem, Mode, Reset, Transition, from_equations, simulate
from hybrid.kernels.types.codes import BEYOND, LEAVES, NO_TRANSITION
from hybrid.simulation import initial_mode
from hybrid.simulation.initial_mode import choose_mode
from hybrid.system.growth import Unexplored

# Transitions by name, with the mode that each leaves, and the transition of the user's that it is a part of.
OUT = {"ab": ("a", "ab"), "ac": ("a", "ac"), "bc": ("b", "bc"), "ca": ("c", "ca")}
SPLIT = {"up": ("m, q<0", None), "down": ("m, q>0", None), "hit": ("m, q>0", "hit"), "ca": ("c", "ca")}


@pytest.fixture
def choose(monkeypatch):
    """`choose_mode` with given verdicts, by name of a transition; nan for a guard without a value."""

    def chosen(verdicts, mode=None, out=OUT, modes=("a", "b", "c"), growth=None):
        def try_modes(parts, model, run, work, first, stop, found):
            for index, (name, (source, _)) in enumerate(out.items()):
                if modes.index(source) in range(first, stop) and name in verdicts:
                    if math.isnan(verdicts[name]):
                        work.scalar[0] = math.nan
                        return index
                    found[index] = verdicts[name]
            return NO_TRANSITION

        monkeypatch.setattr(initial_mode, "move_alike", lambda *_: False)
        monkeypatch.setattr(initial_mode, "load_kernels", lambda name: SimpleNamespace(try_modes=try_modes))
        system = SimpleNamespace(
            mode_names=modes,
            modes=[SimpleNamespace(name=m, part_of=m.split(",")[0] if "," in m else None) for m in modes],
            dimension=2,
            transition_names=tuple(out),
            transitions=[SimpleNamespace(name=n, source=s, part_of=part) for n, (s, part) in out.items()],
            parts_of=lambda name: [i for i, each in enumerate(modes) if each.split(",")[0] == name],
            growth=growth,
        )
        run = SimpleNamespace(phase=0.5, y=np.array([1.0, 2.0, 0.0]))
        work = SimpleNamespace(scalar=np.zeros(1))
        return choose_mode(system, None, None, run, work, mode)

    return chosen


@pytest.mark.parametrize(
    ("verdicts", "mode", "expected"),
    [
        # A named mode is entered wherever its guards are; those of other modes do not count.
        ({"ab": BEYOND, "ac": LEAVES, "bc": BEYOND}, "a", (0, ("ab",))),
        ({"ab": BEYOND, "ac": BEYOND}, "b", (1, ())),
        ({"ab": LEAVES, "bc": BEYOND}, "b", (1, ("bc",))),
        ({"ab": BEYOND, "bc": math.nan}, "a", (0, ("ab",))),
        ({"ca": BEYOND, "ab": math.nan}, "c", (2, ("ca",))),
        # Without a name, the only mode that no guard objects to.
        ({"ab": BEYOND, "bc": LEAVES}, None, (2, ())),
        ({"ac": LEAVES, "ca": BEYOND}, None, (1, ())),
        # A guard without a value objects to its mode alone.
        ({"ab": math.nan, "ca": BEYOND}, None, (1, ())),
    ],
)
def test_the_mode_that_allows_the_start(choose, verdicts, mode, expected):
    assert choose(verdicts, mode) == expected


def test_the_only_mode_of_a_system_needs_no_name(choose):
    own = {"hit": ("m", "hit")}
    assert choose({"hit": LEAVES}, out=own, modes=("m",)) == (0, ())
    assert choose({"hit": BEYOND}, out=own, modes=("m",)) == (0, ("hit",))
    with pytest.raises(ArgumentError, match=r"'hit': the guard is nan at t = 0.5, x0 = \(1.0, 2.0\)"):
        choose({"hit": math.nan}, out=own, modes=("m",))


@pytest.mark.parametrize(
    ("verdicts", "mode", "text"),
    [
        ({"ab": BEYOND}, None, r"x0 = \(1.0, 2.0\) is allowed in more than one mode: b, c. Choose"),
        ({}, None, "in more than one mode: a, b, c"),
        (
            {"ab": BEYOND, "ac": LEAVES, "bc": BEYOND, "ca": LEAVES},
            None,
            "no mode: mode 'a' is left through 'ab', 'ac'; mode 'b' is left through 'bc'; mode 'c' is left",
        ),
        # The first of the guards without a value, where no mode is left.
        ({"ab": BEYOND, "ca": math.nan, "bc": math.nan}, None, "'bc': the guard is nan"),
        ({"ac": math.nan}, "a", "'ac': the guard is nan"),
    ],
)
def test_a_start_that_no_mode_or_several_allow_is_refused(choose, verdicts, mode, text):
    with pytest.raises(ArgumentError, match=text):
        choose(verdicts, mode)


@pytest.mark.parametrize(
    ("verdicts", "expected"),
    [
        # Sides must be right; guards of the user's may be crossed in a mode that is named.
        ({"up": BEYOND}, (1, ())),
        ({"down": BEYOND}, (0, ())),
        ({"up": LEAVES, "hit": BEYOND}, (1, ("hit",))),
    ],
)
def test_of_the_parts_of_a_named_mode_the_one_on_the_side_of_the_state(choose, verdicts, expected):
    assert choose(verdicts, "m", SPLIT, ("m, q<0", "m, q>0", "c")) == expected


@pytest.mark.parametrize(("verdicts", "names"), [({}, "m, q<0, m, q>0"), ({"hit": BEYOND}, "m, q<0, m, q>0")])
def test_parts_that_both_allow_the_state_are_told(choose, verdicts, names):
    with pytest.raises(ArgumentError, match=f"more than one mode: {names}. Choose"):
        choose(verdicts, "m", SPLIT, ("m, q<0", "m, q>0", "c"))


@pytest.mark.parametrize(("onward", "made"), [({"up", "down"}, ["down"]), ({"up"}, ["up"])])
def test_where_no_part_allows_the_state_a_mode_along_the_last_surface_is_made(choose, onward, made):
    found = []
    growth = SimpleNamespace(leads_on=onward.__contains__, extend=found.append)
    with pytest.raises(Unexplored, match=made[0]):
        choose({"up": BEYOND, "down": BEYOND}, "m", SPLIT, ("m, q<0", "m, q>0", "c"), growth)
    assert found == made


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
