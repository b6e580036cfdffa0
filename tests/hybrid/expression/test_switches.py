"""Surfaces of switching functions, what their sides imply, and the smooth branches between them."""

import numpy as np
import pytest

from hybrid.expression.graph import symbols_of
from hybrid.expression.implications import MOST_TERMS
from hybrid.expression.nodes import Number, add
from hybrid.expression.operations import Absolute, Less, Level, Select, Sign, Sin
from hybrid.expression.surfaces import Surfaces
from hybrid.expression.switches import (
    Switches,
    _first_atom,
    _without_truths,
)
from hybrid.expression.text import text
from hybrid.expression.tracing import model_symbols, trace
from tests.hybrid.code import values_of

SYMBOLS = model_symbols(2, 1)
(Q, V), (K,), T = SYMBOLS.x, SYMBOLS.p, SYMBOLS.t


def traced(function):
    return trace(lambda t, x, p: (function(t, x.q, x.v),), ("q", "v"), ("k",))


def value(expression, t, q, v):
    """Value of an expression, from the code that would be compiled; nan if it has none."""
    return values_of([expression], (q, v), (1.0,), t)[0]


class TestFirst:
    """The innermost switching function is the first that is replaced by its branches."""

    def first(self, *functions):
        return _first_atom([each for function in functions for each in traced(function)], SYMBOLS)

    def test_none(self):
        assert self.first(lambda t, q, v: q * v - t, lambda t, q, v: np.sin(q)) is None
        assert _first_atom([Sign(K) * Q, Q], SYMBOLS) is None
        assert _first_atom([Level(Q), V], SYMBOLS) is None

    def test_the_only_one(self):
        assert self.first(lambda t, q, v: q * v, lambda t, q, v: 2 * np.sign(q - v)) == Sign(Q - V)
        assert self.first(lambda t, q, v: np.sign(t)) == Sign(T)

    def test_the_innermost(self):
        assert self.first(lambda t, q, v: np.sign(q - np.abs(v))) == Absolute(V)

    def test_conditions_come_before_what_they_choose(self):
        found = self.first(lambda t, q, v: np.where(q > 1, np.abs(v), 0.0))
        assert found == self.first(lambda t, q, v: np.where(q > 1, v, 0.0))
        assert symbols_of(found) == {Q}


class TestSurfaces:
    def test_a_surface_written_in_other_ways_is_one(self):
        surfaces = Surfaces(SYMBOLS)
        assert surfaces.find(2 * Q - 4 * V - 6) == (0, 1)
        assert surfaces.known[0].height == 2 * Q - 4 * V - 6
        assert surfaces.find(Q - 2 * V - 3) == (0, 1)
        assert surfaces.find(0.3 * Q - 0.6 * V - 0.9) == (0, 1)
        assert surfaces.find(4 * V - 2 * Q + 6) == (0, -1)
        assert surfaces.match(-Q + 2 * V + 3) == (0, -1)
        assert surfaces.match(Q - 2 * V + 3) is None
        assert len(surfaces.known) == 1

    def test_heights_grow_with_the_first_state(self):
        surfaces = Surfaces(SYMBOLS)
        assert surfaces.find(3 - V - Q) == (0, -1)
        assert surfaces.known[0].height == Q + V - 3
        assert surfaces.known[0].level == 3.0
        assert surfaces.find(-V + K) == (1, -1)
        assert surfaces.known[1].height == V - K

    def test_parallel_surfaces_have_one_core_and_their_levels(self):
        surfaces = Surfaces(SYMBOLS)
        numbers = [surfaces.find(Q + V - level)[0] for level in (0.0, 1e-9, 1.0, 1.0 + 1e-9, -1.0)]
        assert numbers == [0, 1, 2, 3, 4]
        assert len({each.core for each in surfaces.known}) == 1
        assert [each.level for each in surfaces.known] == [0.0, 1e-9, 1.0, 1.0 + 1e-9, -1.0]

    @pytest.mark.parametrize(
        ("height", "given", "side"),
        [
            (Q, {Q - 1: 1}, 1),
            (Q - 1, {Q: -1}, -1),
            (Q, {Q + 1: 1}, None),
            (Q, {Q - 1: -1}, None),
            (Q + V, {Q: 1, V: 1}, 1),
            (Q + V, {Q: -1, V: -1}, -1),
            (Q + V, {Q: 1, V: -1}, None),
            (Q - V, {Q: 1, V: -1}, 1),
            (2 * Q + 3 * V - 4, {Q - 1: 1, V - 1: 1}, 1),
            (2 * Q + 3 * V - 5, {Q - 1: 1, V - 1: 1}, 1),
            (2 * Q + 3 * V - 6, {Q - 1: 1, V - 1: 1}, None),
            (Q - V, {Q: 0, V: -1}, 1),
            (Q - V, {Q: 0, V: 1}, -1),
            (Q - V, {Q: -2, V: -1}, 1),
            (Q - V, {Q: 2, V: 1}, -1),
            (Q - V, {Q: 0, V: 0}, None),
            (Q - V + 1, {Q: 0, V: 0}, 1),
            (Q - V - 1, {Q: 0, V: 0}, -1),
            (Q * V + Q, {Q * V: 1, Q: 1}, 1),
            (K * Q + 1, {K * Q - 2: 1}, 1),
            (Q - V, {Q - T: 1, T - V: 1}, 1),
            (1e-9 * Q + 1e-9 * V, {Q: 1, V: 1}, 1),
            (Q, {}, None),
        ],
    )
    def test_sides_that_follow_from_others(self, height, given, side):
        surfaces = Surfaces(SYMBOLS)
        sides = {}
        for each, on in given.items():
            number, orientation = surfaces.find(each)
            sides[number] = on * orientation
        number, orientation = surfaces.find(height)
        implied = surfaces.implied(number, sides)
        assert (implied if implied is None else implied * orientation) == side
        # Its own side is not asked for.
        assert surfaces.implied(number, {**sides, number: -1}) == implied


def test_surfaces_that_are_too_long_to_be_expanded():
    """Two of them are one if they are written alike. Sides imply nothing between them and others."""
    surfaces = Surfaces(SYMBOLS)
    long = Q * add(*(Sin(k * V) for k in range(1, MOST_TERMS)))
    first, orientation = surfaces.find(long)
    assert (orientation, surfaces.known[first].level, surfaces.known[first].core) == (1, 0.0, text(long))
    assert surfaces.find(long) == (first, 1)
    assert surfaces.find(-long)[0] != first
    other, _ = surfaces.find(Q + 1)
    assert surfaces.implied(first, {other: -1}) is None
    assert surfaces.implied(other, {first: 1}) is None


FIELDS = {
    "sign": lambda t, q, v: np.sign(q - 0.3 * v) * v,
    "absolute": lambda t, q, v: np.abs(q * v - 1.0),
    "extrema": lambda t, q, v: np.maximum(q, 2.0 * v) - np.minimum(q + v, 0.5),
    "nested extrema": lambda t, q, v: np.maximum(np.minimum(q, v), np.abs(q - v)),
    "heaviside": lambda t, q, v: np.heaviside(q, 0.5) * v + np.heaviside(-v, 0.5),
    "choice": lambda t, q, v: np.where(q < v, np.where(v < 1.0, q, 2.0), np.abs(v)),
    "choices of both kinds": lambda t, q, v: np.where((q <= 0.5) & ~(v > 1.0), q * v, q - v),
    "either": lambda t, q, v: np.where((q > 0.5) | (v > 1.0), q * v, q - v),
    "an equality": lambda t, q, v: np.where(q == v, 7.0, q - v),
    "a number as a condition": lambda t, q, v: np.where(q, v, 3.0),
    "floor": lambda t, q, v: np.floor(2.0 * q) + v,
    "ceiling": lambda t, q, v: np.ceil(q - v),
    "truncated": lambda t, q, v: np.trunc(1.5 * q) * v,
    "remainder": lambda t, q, v: np.mod(q, 0.7) + np.mod(v, -0.4),
    "truncated remainder": lambda t, q, v: np.fmod(q, 0.7) - v,
    "in time": lambda t, q, v: np.sign(np.sin(7.0 * t)) * q,
    "factors of known sign": lambda t, q, v: np.sign(q**2 * v) + np.sign(np.exp(q) * (v - 1.0)),
    "factors of sides": lambda t, q, v: np.where(q > 0.0, np.sign(q * v), np.sign(-(q**3) * v)),
    "a power": lambda t, q, v: np.where(q > 0.0, q**1.5, 0.0),
}


@pytest.mark.parametrize("name", FIELDS)
def test_branches_have_the_values_of_the_field(name):
    """Each surface that is asked for lies where its height changes sign; then no switch is left."""
    function = FIELDS[name]
    surfaces = Surfaces(SYMBOLS)
    entries = traced(function)
    switches = Switches(entries, surfaces)
    rng = np.random.default_rng(20261124)
    seen = set()
    for t, q, v in rng.uniform(-2.5, 2.5, (40, 3)):
        sides = {}
        while isinstance(found := switches.resolved(sides), int):
            assert found not in sides
            sides[found] = int(np.sign(value(surfaces.known[found].height, t, q, v)))
        for number, side in found.used.items():
            assert side == np.sign(value(surfaces.known[number].height, t, q, v))
        with np.errstate(invalid="ignore"):
            expected = float(function(np.float64(t), np.float64(q), np.float64(v)))
        assert value(found.entries[0], t, q, v) == pytest.approx(expected, rel=1e-12, abs=1e-12)
        assert value(found.bare[0], t, q, v) == pytest.approx(expected, rel=1e-12, abs=1e-12)
        seen.add(tuple(sorted(found.used.items())))
    # What holds on a surface only has no side.
    assert (len(seen) > 1) == (name not in ("an equality", "a number as a condition"))


def test_only_the_branch_taken_is_looked_at():
    surfaces = Surfaces(SYMBOLS)
    switches = Switches(traced(lambda t, q, v: np.where(q < 0.0, np.abs(v), np.sign(v - 1.0))), surfaces)
    assert switches.resolved({}) == 0
    assert surfaces.known[0].height == Q
    below = switches.resolved({0: -1})
    assert surfaces.known[below].height == V
    above = switches.resolved({0: 1})
    assert surfaces.known[above].height == V - 1
    assert switches.resolved({0: -1, below: -1}).entries == (-V,)
    assert switches.resolved({0: -2, below: 2}).entries == (V,)
    assert switches.resolved({0: 1, above: -1}).used == {0: 1, above: -1}


def test_implied_sides_are_not_asked_for():
    surfaces = Surfaces(SYMBOLS)
    switches = Switches(traced(lambda t, q, v: np.sign(q) + np.sign(q - 1.0)), surfaces)
    first = switches.resolved({})
    [other] = {0, 1} - {first} if len(surfaces.known) > 1 else {1}
    assert surfaces.known[first].level == 0.0
    assert switches.resolved({first: -1}).entries == (Number(-2),)
    assert switches.resolved({first: 1}) == other
    assert switches.resolved({first: 1, other: -1}).entries == (Number(0),)


def test_fractional_powers_of_heights_are_zero_beyond_their_surface():
    """A step may look slightly beyond its mode, where the power itself has no value."""
    surfaces = Surfaces(SYMBOLS)
    switches = Switches(traced(lambda t, q, v: np.where(q > 0.5, (q - 0.5) ** 1.5, v**1.5)), surfaces)
    found = switches.resolved({switches.resolved({}): 1})
    assert value(found.entries[0], 0.0, 0.4, 0.0) == 0.0
    assert np.isnan(value(found.bare[0], 0.0, 0.4, 0.0))
    other = switches.resolved({0: -1})
    assert np.isnan(value(other.entries[0], 0.0, 0.0, -0.1))


def test_numbers_that_serve_as_conditions_count_as_true():
    condition = Less(Q, V)
    number, switching, known = Select(Q - V, T, V), Select(condition, T, V), Select(K, Q, V)
    assert _without_truths(2 * number + switching) == 2 * T + switching
    assert _without_truths(known) == Q
    assert _without_truths(switching + Q) == switching + Q
    assert _without_truths(Select(Sign(Q), T, V)) == Select(Sign(Q), T, V)
