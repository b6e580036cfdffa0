"""Names of sides are short, in the words of the model, and true."""

import numpy as np
import pytest

from hybrid import HybridSystem, Mode
from hybrid.expression.evaluation import Program
from hybrid.expression.graph import nodes_of
from hybrid.expression.operations import Level
from hybrid.transform.naming import LONGEST
from hybrid.transform.splitter import Splitter

PARAMETERS = {"gap": 0.5, "mu": 1.0, "w": 2.0}
WORDS = {
    **{name: getattr(np, name) for name in ("sin", "cos", "exp", "floor")},
    "pi": np.pi,
    "mod": lambda a, b: a - b * np.floor(a / b),
}


def step(height):
    return lambda t, x, p: (np.where(height(t, x, p) > 0, 1.0, 2.0), 0.0 * x.v)


def named(field, parameters=PARAMETERS):
    """The names, with all surfaces found."""
    system = HybridSystem(state=("q", "v"), parameters=parameters, modes=[Mode("m", field)])
    splitter = Splitter(system)
    [pieces] = splitter.pieces
    assert list(pieces.cells({}))
    return splitter.names, pieces.surfaces


HEIGHTS = {
    "a state": (lambda t, x, p: x.q, "q?0"),
    "downwards": (lambda t, x, p: -x.q, "q?0"),
    "a parameter": (lambda t, x, p: x.q - p.gap, "q?gap"),
    "a parameter first": (lambda t, x, p: p.gap - x.q, "q?gap"),
    "a number": (lambda t, x, p: x.v - 0.3, "v?0.3"),
    "two states": (lambda t, x, p: 2 * x.q - 3 * x.v, "q?1.5*v"),
    "a factor": (lambda t, x, p: 4 * x.q + 1, "q?-0.25"),
    "a circle": (lambda t, x, p: x.q**2 + x.v**2 - 1, "q^2+v^2?1"),
    "a wave": (lambda t, x, p: x.q - np.cos(p.w * t), "q?cos(t*w)"),
    "time": (lambda t, x, p: t - 3, "t?3"),
    "time and parameters": (lambda t, x, p: p.mu - p.gap * t, "gap*t?mu"),
    "a sum": (lambda t, x, p: x.q + x.v + p.gap, "q+v?-gap"),
    "a negative sum": (lambda t, x, p: -x.q - x.v - p.gap, "q+v?-gap"),
    "products": (lambda t, x, p: 0.1 * x.q * x.v - p.mu * x.v**3, "mu*v^3?0.1*q*v"),
    "long": (lambda t, x, p: np.sin(x.q) * np.cos(x.v) - x.q * x.v + p.gap * t, "h1?0"),
    "factors": (lambda t, x, p: (x.q + x.v) * (x.q - x.v) * (x.q + 1) - p.mu, "h1?0"),
}


@pytest.mark.parametrize("case", HEIGHTS)
def test_sides_of_one_surface(case):
    height, text = HEIGHTS[case]
    names, surfaces = named(step(height))
    found = [names.side(surfaces.known, 0, side) for side in (-1, 0, 1)]
    assert found == [text.replace("?", sign) for sign in "<=>"]


FIELDS = {
    **{name: step(height) for name, (height, _) in HEIGHTS.items()},
    "whole": lambda t, x, p: (np.floor(t), np.mod(t, p.w)),
    "stairs": lambda t, x, p: (np.where(x.q > np.floor(x.v), 1.0, 2.0), 0.0 * x.v),
    "square wave": lambda t, x, p: (np.sign(np.mod(t, 2.0) - 1), 0.0 * x.v),
    "square wave in space": lambda t, x, p: (np.sign(np.mod(x.q, 2.0) - 1), 0.0 * x.v),
    "shifted": lambda t, x, p: (np.sign(x.q - 3 * np.floor(x.q / 3 + 0.25)), 0.0 * x.v),
    "ceiling": lambda t, x, p: (np.sign(x.q - np.ceil(p.w * x.v)), 0.0 * x.v),
}


@pytest.mark.parametrize("case", FIELDS)
def test_a_name_holds_where_its_side_is(case):
    """Read as Python, names and the notes on short names have the sign of the height at random points."""
    names, surfaces = named(FIELDS[case])
    symbols, rng = names.symbols, np.random.default_rng(3)
    levels = [*nodes_of(Level, *(each.height for each in surfaces.known))]
    compared = 0
    for _ in range(60):
        t, q, v = rng.uniform(-4.0, 4.0, 3)
        words = {"t": t, "q": q, "v": v, **PARAMETERS}
        values = dict(zip((symbols.t, *symbols.x, *symbols.p), (t, q, v, *PARAMETERS.values()), strict=True))
        # A level has its value on its half of a step only.
        fractions = [value % 1.0 for value in Program([level.args[0] for level in levels]).run(values)]
        for number, surface in enumerate(surfaces.known):
            own = [
                f
                for level, f in zip(levels, fractions, strict=True)
                if level in set(nodes_of(Level, surface.height))
            ]
            if not all(0.25 < f < 0.75 for f in own):
                continue
            [height] = Program([surface.height]).run(values)
            side = 1 if height > 0 else -1
            for each in (1, -1):
                name = names.side(surfaces.known, number, each)
                assert len(name) <= LONGEST
                notes = dict(note.split(" = ") for note in names.notes)
                for short, text in notes.items():
                    words[short] = eval(text.replace("^", "**"), {**WORDS, **words})
                assert eval(name.replace("^", "**"), {**WORDS, **words}) == (each == side), name
                compared += 1
    assert compared > 30


def test_short_names_are_new_words_and_the_same_each_time():
    parameters = {"h1": 1.0, "gap": 0.5, "mu": 1.0}
    long = HEIGHTS["long"][0]
    names, surfaces = named(step(lambda t, x, p: long(t, x, p) + p.h1 * x.q**3), parameters)
    assert [names.side(surfaces.known, 0, side) for side in (1, -1, 0)] == ["h2>0", "h2<0", "h2=0"]
    assert len(names.notes) == 1
    assert names.cell(surfaces.known, [(0, 1), (0, -1)]) == "h2>0, h2<0"
    assert names.cell(surfaces.known, []) == ""
