"""Systems written differently have the values of the original, and the changes that are asked for."""

import attrs
import numpy as np
import pytest

from hybrid import Guard, HybridSystem, Mode, Reset, Transition
from hybrid.system.derivatives import evaluate
from hybrid.testing import variants
from hybrid.testing.variants import AGAIN, altered, new_name, renamed, reordered

X, T = np.array([0.3, -0.7]), 0.9


def made(**options):
    return HybridSystem(
        state=("q", "v"),
        parameters={"g": 2.0, "cut_offset": 5.0},
        modes=[
            Mode(
                "b",
                lambda t, x, p: (x.v, -p.g * x.q + p.cut_offset),
                jacobian=lambda t, x, p: ((0, 1), (-p.g, 0)),
            ),
            Mode("a", lambda t, x, p: (x.v, 0.0 * t)),
        ],
        transitions=[
            Transition("b", "a", Guard(lambda t, x, p: x.q - p.g, +1), accumulates_to="b", name="z"),
            Transition(
                "a",
                "a",
                Guard(lambda t, x, p: x.v * x.q, -1, gradient=lambda t, x, p: (x.v, x.q, 0.0)),
                Reset(lambda t, x, p: (x.q, -p.g * x.v)),
                name="y",
            ),
            Transition(
                "a", None, Guard(lambda t, x, p: x.v - 9.0, 0, when=lambda t, x, p: p.g - x.q), name="w"
            ),
        ],
        **options,
    )


SYSTEM = made()


def value(system, function, **parameters):
    return evaluate(system.variables, function, T, X, system.parameter_values(parameters))


def by_name(items):
    return {each.name: each for each in items}


@pytest.mark.as_given
class TestAltered:
    VARIANT = altered(SYSTEM)

    def test_names(self):
        variant = self.VARIANT
        assert variant is altered(SYSTEM)
        assert not variant.resets_stay
        # A parameter of the model had one of the names.
        assert variant.offset == "cut_offset_"
        names = set(variant.system.mode_names) | set(variant.system.transition_names) - variant.cuts
        assert names == set(variant.original)
        assert {variant.original[name] for name in names} == {"a", "b", "z", "y", "w"}
        assert len(variant.cuts) == 4

    def test_as_declared_it_is_the_original_twice(self):
        modes, transitions = by_name(self.VARIANT.system.modes), by_name(self.VARIANT.system.transitions)
        for mode in SYSTEM.modes:
            for name in (mode.name, mode.name + AGAIN):
                np.testing.assert_array_equal(
                    value(self.VARIANT.system, modes[name].field), value(SYSTEM, mode.field)
                )
        np.testing.assert_array_equal(value(self.VARIANT.system, modes["b"].jacobian), [0.0, 1.0, -2.0, 0.0])
        for transition in SYSTEM.transitions:
            for name in (transition.name, transition.name + AGAIN):
                other = transitions[name]
                assert other.guard.direction == transition.guard.direction
                assert value(self.VARIANT.system, other.guard.function) == value(
                    SYSTEM, transition.guard.function
                )
                assert (other.guard.when is None) == (transition.guard.when is None)
                if transition.target is None:
                    assert other.reset is None
                    continue
                reset = X if transition.reset is None else value(SYSTEM, transition.reset.function)
                np.testing.assert_array_equal(value(self.VARIANT.system, other.reset.function), reset)
        ends = {name: (each.source, each.target) for name, each in transitions.items()}
        assert {name: end for name, end in ends.items() if name not in self.VARIANT.cuts} == {
            "z": ("b", "a"),
            "y": ("a", "a"),
            "w": ("a", None),
            "z" + AGAIN: ("b" + AGAIN, "a"),
            "y" + AGAIN: ("a" + AGAIN, "a" + AGAIN),
            "w" + AGAIN: ("a" + AGAIN, None),
        }

    def test_guards_are_scaled_with_their_gradients(self):
        transitions = by_name(self.VARIANT.system.transitions)
        factor = self.VARIANT.scaled(7.0)
        for transition in SYSTEM.transitions:
            scaled = value(self.VARIANT.system, transitions[transition.name].guard.function, **factor)
            np.testing.assert_allclose(scaled, 7.0 * value(SYSTEM, transition.guard.function))
        gradient = value(self.VARIANT.system, transitions["y"].guard.gradient, **factor)
        np.testing.assert_allclose(gradient, [7.0 * X[1], 7.0 * X[0], 0.0])

    def test_multiples_of_the_guard_are_added_to_resets(self):
        transitions = by_name(self.VARIANT.system.transitions)
        multiples = self.VARIANT.extension(np.array([3.0, -5.0]))
        for transition in SYSTEM.transitions[:2]:
            reset = X if transition.reset is None else value(SYSTEM, transition.reset.function)
            guard = value(SYSTEM, transition.guard.function)
            found = value(self.VARIANT.system, transitions[transition.name].reset.function, **multiples)
            np.testing.assert_allclose(found, reset + np.array([3.0, -5.0]) * guard)

    def test_planes_lead_to_the_copies_and_back(self):
        cuts = [each for each in self.VARIANT.system.transitions if each.name in self.VARIANT.cuts]
        assert {(each.source, each.target, each.guard.direction) for each in cuts} == {
            *((name, name + AGAIN, 1) for name in "ab"),
            *((name + AGAIN, name, -1) for name in "ab"),
        }
        plane = self.VARIANT.cut(np.array([2.0, 4.0]), 0.5)
        for cut in cuts:
            np.testing.assert_allclose(
                value(self.VARIANT.system, cut.guard.function, **plane), 2 * 0.3 - 4 * 0.7 - 0.5
            )
            # As declared the plane is never crossed.
            assert value(self.VARIANT.system, cut.guard.function) == -1.0
            assert cut.reset is None


def test_functions_that_cannot_be_traced_stay():
    def opaque(t, x, p):
        return float(x.q) - p.g

    guard = Guard(opaque, +1, gradient=lambda t, x, p: (1.0, 0.0))
    system = HybridSystem(
        state=("q",),
        parameters={"g": 2.0},
        modes=[Mode("a", lambda t, x, p: (1.0,))],
        transitions=[Transition("a", "a", guard, Reset(lambda t, x, p: (0.0,)))],
    )
    variant = altered(system)
    assert variant.resets_stay
    [kept] = [each for each in variant.system.transitions if each.name == system.transitions[0].name]
    assert kept.guard.function is opaque


def test_names_in_the_reverse_order():
    system = renamed(SYSTEM)
    assert system is renamed(SYSTEM)
    assert system.mode_names == ("001 b", "002 a")
    assert system.transition_names == ("001 z", "002 y", "003 w")
    assert [(each.source, each.target, each.accumulates_to) for each in system.transitions] == [
        ("001 b", "002 a", "001 b"),
        ("002 a", "002 a", None),
        ("002 a", None, None),
    ]
    assert [new_name(("q", "p", "r"), name) for name in "pqr"] == ["003 p", "002 q", "001 r"]


def test_transitions_in_the_reverse_order():
    assert reordered(SYSTEM) is reordered(SYSTEM)
    assert reordered(SYSTEM).transition_names == ("w", "y", "z")
    assert reordered(SYSTEM).modes == SYSTEM.modes


@pytest.mark.parametrize("change", [altered, renamed, reordered])
def test_the_period_stays(change):
    system = made(period=3.0)
    changed = change(system)
    assert getattr(changed, "system", changed).period == 3.0


def test_a_name_that_no_parameter_has():
    modes = [Mode("only", lambda t, x, p: (x.q,))]
    system = HybridSystem(state=("q",), parameters={"unit": 1.0, "unit_": 2.0, "unit___": 3.0}, modes=modes)
    assert variants.free_name(system, "unit") == "unit__"
    assert variants.free_name(system, "other") == "other"
    assert variants.free_name(attrs.evolve(system, parameters={}), "unit") == "unit"
