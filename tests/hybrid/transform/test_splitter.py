"""Systems with many modes are made in stages: which modes there are, and what a run needs of them."""

import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, ModelError, Reset, Transition, from_equations, simulate, split
from hybrid.system.derivatives import evaluate
from hybrid.transform import splitter


def kinks(most, monkeypatch):
    """Four modes, between which nothing jumps."""
    monkeypatch.setattr(splitter, "MOST_WHOLE", most)
    return from_equations(
        lambda t, x, p: (x.v, -2.0 * x.q - np.abs(x.q) - 0.5 * np.abs(x.v)), state=("q", "v")
    )


ALL = {"q<0, v<0", "q<0, v>0", "q>0, v<0", "q>0, v>0"}


@pytest.mark.parametrize(("most", "count"), [(12, 4), (4, 4), (3, 1), (1, 1)])
def test_a_small_system_is_made_as_a_whole(most, count, monkeypatch):
    system = kinks(most, monkeypatch)
    assert len(system.modes) == count
    assert (system.growth is None) == (count == 4)
    if count == 4:
        assert set(system.mode_names) == ALL
        assert all(each.target is not None for each in system.transitions)


def test_modes_are_made_where_a_run_needs_them(monkeypatch):
    whole, staged = kinks(4, monkeypatch), kinks(3, monkeypatch)
    growth = staged.growth
    [first] = staged.mode_names
    onward = [each.name for each in staged.transitions]
    assert [each.target for each in staged.transitions] == [None, None]
    assert [growth.leads_on(name) for name in onward] == [True, True]
    assert not growth.leads_on("no such")
    assert set(growth.frontier) == set(onward)
    # A mode and its neighbours, not the one across.
    growth.extend(onward[0])
    assert len(growth.current.modes) == 2
    arc = simulate(staged, (1.0, 0.0), (0.0, 6.0))
    expected = simulate(whole, (1.0, 0.0), (0.0, 6.0))
    assert arc.status.ok
    np.testing.assert_array_equal(arc.jumps.t, expected.jumps.t)
    np.testing.assert_array_equal(arc.x[-1], expected.x[-1])
    assert set(growth.current.mode_names) == ALL
    assert growth.current.mode_names[0] == first
    assert growth.current is growth.current


def test_a_start_makes_its_own_mode(monkeypatch):
    staged = kinks(1, monkeypatch)
    growth = staged.growth
    signs = {name: np.array([0.5 if part == ">" else -0.5 for part in (name[1], name[6])]) for name in ALL}
    # Points on a surface count as above it.
    signs["q>0, v>0"][:] = 0.0
    made = set(staged.mode_names)
    for name, x in signs.items():
        assert growth.place(0.0, x, np.zeros(0), None) == (name not in made)
        made.add(name)
        assert set(growth.current.mode_names) == made
        assert not growth.place(0.0, x, np.zeros(0), None)


HERE, THERE = (0.5, 2.0), (-0.25, 1.0)


def edges(system, source):
    """What leaves a mode: target, direction, whether it counts at the start, guard, condition and reset.

    Functions have their values here and there.
    """

    def values(function):
        found = (evaluate(system.variables, function, 0.25, np.array(x), p) for x in (HERE, THERE))
        return None if function is None else tuple(tuple(each.tolist()) for each in found)

    def scalars(function):
        return None if function is None else tuple(each for (each,) in values(function))

    p = system.parameter_values()
    return {
        each.name: (
            each.target,
            each.guard.direction,
            each.guard.at_start,
            scalars(each.guard.function),
            scalars(each.guard.when),
            None if each.reset is None else values(each.reset.function),
        )
        for each in system.transitions
        if each.source == source
    }


class TestOneSurface:
    """``q' = 1/4 - sign(q)``, so 5/4 below and -3/4 above: there is sliding, with the sign 1/4."""

    system = from_equations(
        lambda t, x, p: (p.a - p.b * np.sign(x.q), 1.0 + x.r - 0.5 * np.sign(x.q)),
        state=("q", "r"),
        parameters={"a": 0.25, "b": 1.0},
    )

    def test_fields(self):
        system = self.system
        rates = {
            mode.name: evaluate(system.variables, mode.field, 0.25, np.array(HERE), system.parameter_values())
            for mode in system.modes
        }
        assert {name: each.tolist() for name, each in rates.items()} == {
            "q<0": [1.25, 3.5],
            "q>0": [-0.75, 2.5],
            "q=0": [0.0, 2.875],
        }
        assert [mode.part_of for mode in system.modes] == ["smooth"] * 3

    def test_arrivals(self):
        """From both sides the state arrives to slide; at the start it may lie beyond by rounding."""
        height, yes, no = (0.5, -0.25), (1.0, 1.0), (0.0, 0.0)
        assert edges(self.system, "q<0") == {
            "q<0->q>0 at the start": ("q>0", 1, True, height, None, None),
            "q<0->q=0": ("q=0", 1, False, height, yes, None),
            "q<0->q>0": ("q>0", 1, False, height, no, None),
        }
        assert edges(self.system, "q>0") == {
            "q>0->q<0 at the start": ("q<0", -1, True, height, None, None),
            "q>0->q=0": ("q=0", -1, False, height, yes, None),
            "q>0->q<0": ("q<0", -1, False, height, no, None),
        }

    def test_departures(self):
        """Where a speed passes zero; the state is put onto the surface. Two-folds end the run."""
        height, yes, onto = (0.5, -0.25), (1.0, 1.0), ((0.0, 2.0), (0.0, 1.0))
        assert edges(self.system, "q=0") == {
            "q=0->q>0 at the start": ("q>0", 1, True, height, yes, None),
            "q=0->q<0 at the start": ("q<0", -1, True, height, yes, None),
            "q=0: two-fold at start": (None, -1, True, (2.0, 2.0), None, None),
            "q=0: two-fold": (None, -1, False, (2.0, 2.0), None, None),
            "q=0->q>0": ("q>0", 1, False, (-0.75, -0.75), None, onto),
            "q=0->q<0": ("q<0", -1, False, (1.25, 1.25), None, onto),
        }


class TestTwoSurfaces:
    """``q' = sign(r)/4 - sign(q)`` and ``r' = 1/2 + q - sign(r)``."""

    system = from_equations(
        lambda t, x, p: (0.25 * np.sign(x.r) - np.sign(x.q), 0.5 + x.q - np.sign(x.r)), state=("q", "r")
    )

    def test_modes(self):
        sides = [f"q{a}0, r{b}0" for a in "<>=" for b in "<>="]
        assert set(self.system.mode_names) == set(sides)

    def test_arrivals_from_a_corner(self):
        """At ``q = 1/2`` the rate above ``r = 0`` is zero, which is not yet beyond."""
        q, r, yes, no = (0.5, -0.25), (2.0, 1.0), (1.0, 1.0), (0.0, 0.0)
        assert edges(self.system, "q<0, r>0") == {
            "q<0, r>0->q>0, r>0 at the start": ("q>0, r>0", 1, True, q, None, None),
            "q<0, r>0->q=0, r>0": ("q=0, r>0", 1, False, q, yes, None),
            "q<0, r>0->q>0, r>0": ("q>0, r>0", 1, False, q, no, None),
            "q<0, r>0->q<0, r<0 at the start": ("q<0, r<0", -1, True, r, None, None),
            "q<0, r>0->q<0, r=0": ("q<0, r=0", -1, False, r, (0.0, 1.0), None),
            "q<0, r>0->q<0, r<0": ("q<0, r<0", -1, False, r, no, None),
        }

    def test_a_slide_into_the_corner(self):
        """The way on is the one that is consistent there, and the run ends if none is."""
        q, r, yes, no = (0.5, -0.25), (2.0, 1.0), (1.0, 1.0), (0.0, 0.0)
        onto = ((0.0, 2.0), (0.0, 1.0))
        assert edges(self.system, "q=0, r<0") == {
            "q=0, r<0->q>0, r<0 at the start": ("q>0, r<0", 1, True, q, yes, None),
            "q=0, r<0->q<0, r<0 at the start": ("q<0, r<0", -1, True, q, yes, None),
            "q=0, r<0: two-fold at start": (None, -1, True, (2.0, 2.0), None, None),
            "q=0, r<0: two-fold": (None, -1, False, (2.0, 2.0), None, None),
            "q=0, r<0->q>0, r<0": ("q>0, r<0", 1, False, (-1.25, -1.25), None, onto),
            "q=0, r<0->q<0, r<0": ("q<0, r<0", -1, False, (0.75, 0.75), None, onto),
            "q=0, r<0->q=0, r>0 at the start": ("q=0, r>0", 1, True, r, None, None),
            "q=0, r<0->q=0, r=0": ("q=0, r=0", 1, False, r, (0.0, 1.0), None),
            "q=0, r<0->q=0, r>0": ("q=0, r>0", 1, False, r, no, None),
            "q=0, r<0->q>0, r=0": ("q>0, r=0", 1, False, r, no, onto),
            "q=0, r<0->q>0, r>0": ("q>0, r>0", 1, False, r, no, onto),
            "q=0, r<0->q<0, r=0": ("q<0, r=0", 1, False, r, no, onto),
            "q=0, r<0->q<0, r>0": ("q<0, r>0", 1, False, r, no, onto),
            "q=0, r<0: no way on at q=0, r=0": (None, 1, False, r, (1.0, 0.0), None),
        }

    def test_exits_from_the_corner(self):
        """Each surface is left in both directions of each speed, along the other one if that holds the state.

        The speeds are those of the sliding along the other surface.
        """
        found = edges(self.system, "q=0, r=0")
        ways = [
            each for name, each in found.items() if "at" not in name.replace("at q", "").replace("at r", "")
        ]
        assert len(found) == 4 + 2 + 4 * 9
        starts = {name: each for name, each in found.items() if each[2]}
        q, r, yes = (0.5, -0.25), (2.0, 1.0), (1.0, 1.0)
        corner = "q=0, r=0"
        assert starts == {
            f"{corner}->q>0, r=0 at the start": ("q>0, r=0", 1, True, q, yes, None),
            f"{corner}->q<0, r=0 at the start": ("q<0, r=0", -1, True, q, yes, None),
            f"{corner}: two-fold at start": (None, -1, True, (4.0, 4.0), None, None),
            f"{corner}->q=0, r>0 at the start": ("q=0, r>0", 1, True, r, yes, None),
            f"{corner}->q=0, r<0 at the start": ("q=0, r<0", -1, True, r, yes, None),
        }
        assert found[f"{corner}: two-fold"] == (None, -1, False, (4.0, 4.0), None, None)
        assert all(each[1] == 0 for each in ways if each[0] is not None and not each[2])
        speeds = {each[3] for each in found.values() if each[1] == 0}
        assert speeds == {(-0.75, -0.9375), (1.25, 1.0625), (0.0, -0.75), (2.0, 1.25)}
        first = {name: each[4:] for name, each in found.items() if each[3] == (-0.75, -0.9375)}
        onto_q, onto_r, onto_both = (((0.0, 2.0), (0.0, 1.0)), ((0.5, 0.0), (-0.25, 0.0)), ((0.0, 0.0),) * 2)
        no = (0.0, 0.0)
        assert first == {
            f"{corner}->q>0, r=0": ((0.0, 1.0), onto_q),
            f"{corner}->q=0, r>0": (no, onto_r),
            f"{corner}->q=0, r<0": (no, onto_r),
            f"{corner}->q>0, r>0": (no, onto_both),
            f"{corner}->q>0, r<0": (no, onto_both),
            f"{corner}->q<0, r=0": (no, onto_q),
            f"{corner}->q<0, r>0": (no, onto_both),
            f"{corner}->q<0, r<0": (no, onto_both),
            f"{corner}: no way on at r=0, q=0": ((1.0, 0.0), None),
        }


def test_kinks_are_crossed(monkeypatch):
    system = kinks(12, monkeypatch)
    assert edges(system, "q<0, v>0") == {
        "q<0, v>0->q>0, v>0": ("q>0, v>0", 1, False, (0.5, -0.25), None, None),
        "q<0, v>0->q<0, v<0": ("q<0, v<0", -1, False, (2.0, 1.0), None, None),
    }


def machine(reset, *, target="m", limit=None, when=None):
    """A mode with friction and one without; a user's transition leaves the first one."""
    return split(
        HybridSystem(
            state=("q", "u"),
            modes=[
                Mode("m", lambda t, x, p: (-1.0, -0.1 * np.sign(x.u))),
                Mode("free", lambda t, x, p: (-1.0, 0.0)),
            ],
            transitions=[
                Transition(
                    "m",
                    target,
                    Guard(lambda t, x, p: x.q - np.abs(x.u), -1, when=when),
                    reset and Reset(reset),
                    name="tick",
                    accumulates_to=limit,
                ),
                Transition("m", "free", Guard(lambda t, x, p: x.q - 100.0, +1), name="off"),
            ],
        )
    )


class TestCopies:
    """Of a user's transition, with the guard, the landing and the name for each piece."""

    def ticks(self, system, source):
        return {name: each for name, each in edges(system, source).items() if name.startswith("tick")}

    def test_one_for_each_landing(self):
        """The guard has the branch of the piece that is left: ``q - u`` or ``q + u``."""
        system = machine(lambda t, x, p: (x.q + 1.0, x.u - 1.5))
        landing = ((1.5, 0.5), (0.75, -0.5))
        assert self.ticks(system, "m: u>0") == {
            "tick (u>0->u>0)": ("m: u>0", -1, False, (-1.5, -1.25), (1.0, 0.0), landing),
            "tick (u>0->u<0)": ("m: u<0", -1, False, (-1.5, -1.25), (0.0, 1.0), landing),
        }
        assert self.ticks(system, "m: u<0") == {
            "tick (u<0->u>0)": ("m: u>0", -1, False, (2.5, 0.75), (1.0, 0.0), landing),
            "tick (u<0->u<0)": ("m: u<0", -1, False, (2.5, 0.75), (0.0, 1.0), landing),
        }
        assert {each.part_of for each in system.transitions} == {"tick", "off", None}

    def test_one_where_the_landing_is_known(self):
        stays = machine(lambda t, x, p: (x.q + 1.0, 0.5 * x.u))
        turns = machine(lambda t, x, p: (x.q + 1.0, -0.5 * x.u))
        kept = machine(None)
        for system, target, sign in ((stays, "m: u>0", 0.5), (turns, "m: u<0", -0.5)):
            landing = ((1.5, 2.0 * sign), (0.75, sign))
            assert self.ticks(system, "m: u>0") == {
                "tick (u>0)": (target, -1, False, (-1.5, -1.25), None, landing)
            }
        assert self.ticks(kept, "m: u>0") == {"tick (u>0)": ("m: u>0", -1, False, (-1.5, -1.25), None, None)}

    def test_a_reset_has_the_branch_of_the_piece(self):
        system = machine(lambda t, x, p: (x.q + np.abs(x.u), x.u))
        [above], [below] = (self.ticks(system, f"m: u{side}0").values() for side in "><")
        assert above[-1] == ((2.5, 2.0), (0.75, 1.0))
        assert below[-1] == ((-1.5, 2.0), (-1.25, 1.0))

    def test_a_switch_of_the_reset_alone_is_asked(self):
        """The switch ``q > 0`` is none of the field."""
        system = machine(lambda t, x, p: (x.q + 1.0, np.where(x.q > 0, 2.0, -2.0) + 0.0 * x.u))
        assert self.ticks(system, "m: u>0") == {
            "tick (u>0->u>0)": ("m: u>0", -1, False, (-1.5, -1.25), (1.0, 0.0), ((1.5, 2.0), (0.75, 2.0))),
            "tick (u>0->u<0)": ("m: u<0", -1, False, (-1.5, -1.25), (0.0, 1.0), ((1.5, -2.0), (0.75, -2.0))),
        }

    def test_a_condition_is_asked_too(self):
        asked = machine(lambda t, x, p: (x.q + 1.0, x.u - 1.5), when=lambda t, x, p: x.q)
        assert [each[4] for each in self.ticks(asked, "m: u>0").values()] == [(0.0, 0.0), (1.0, 0.0)]
        asked = machine(None, when=lambda t, x, p: x.q)
        # A condition alone stays the user's own function.
        assert [each[4] for each in self.ticks(asked, "m: u>0").values()] == [(0.5, -0.25)]

    def test_ends_and_other_modes(self):
        ends = machine(None, target=None)
        assert self.ticks(ends, "m: u>0") == {"tick (u>0)": (None, -1, False, (-1.5, -1.25), None, None)}
        onward = machine(None, target="free")
        assert self.ticks(onward, "m: u<0") == {"tick (u<0)": ("free", -1, False, (2.5, 0.75), None, None)}

    def test_the_limit_of_chatter_is_on_the_same_side(self):
        system = machine(lambda t, x, p: (x.q, x.u), target="free", limit="m")
        limits = {each.source: each.accumulates_to for each in system.transitions if each.part_of == "tick"}
        assert limits == {"m: u<0": "m: u<0", "m: u>0": "m: u>0", "m: u=0": "m: u=0"}
        assert {each.accumulates_to for each in machine(None).transitions} == {None}
        free = machine(None, limit="free")
        assert {each.accumulates_to for each in free.transitions if each.part_of == "tick"} == {"free"}


def test_a_landing_on_the_surface_itself_counts_as_above():
    system = machine(lambda t, x, p: (1.0, 0.0))
    targets = {each.source: each.target for each in system.transitions if each.part_of == "tick"}
    assert targets == {"m: u<0": "m: u>0", "m: u>0": "m: u>0", "m: u=0": "m: u>0"}


def test_a_part_with_other_values_than_the_field_is_refused(monkeypatch):
    true = splitter.evaluate

    def off(variables, function, t, x, parameters):
        values = true(variables, function, t, x, parameters)
        return values * (1.0 + share) if not hasattr(function, "__name__") else values

    def system():
        return split(HybridSystem(state=("q",), modes=[Mode("m", lambda t, x, p: (1.0 - np.sign(x.q),))]))

    monkeypatch.setattr(splitter, "evaluate", off)
    share = 5e-10
    system()
    share = 2e-9
    with pytest.raises(ModelError, match="of mode 'm' has other values than its field"):
        system()
