"""Small random systems are what their docstring says."""

from itertools import product

import attrs
import numpy as np
import pytest
from hypothesis import Phase, find, given, settings
from hypothesis.errors import NoSuchExample

from hybrid.testing.small import _coefficients, _template, small_systems

RANGES = {
    **{"v1": (0.5, 2.0), "w": (1.0, 2.0), "c10": (-0.05, 0.05), "m": (-0.1, 0.1), "d100": (-1.0, 0.0)},
    **{"a101": (-0.5, 0.5), "b10": (-1.0, 1.0), "F10": (-1.0, 1.0), "B100": (-1.0, 1.0), "r10": (-1.0, 1.0)},
}
SHAPES = [*product((1, 2), (1, 2), (False, True))]


@pytest.mark.parametrize(("others", "modes", "forced"), SHAPES)
def test_fields_guards_and_resets_are_those_of_the_formulas(others, modes, forced):
    rng = np.random.default_rng(7)
    template = _template(others, modes, forced)
    p = {name: float(rng.uniform(0.1, 0.9)) for name in template.parameters}
    assert template.dimension == 1 + others
    assert len(template.modes) == len(template.transitions) == modes
    view = attrs.evolve(template, parameters=p).variables
    values = view.parameter_view(np.array([*p.values()]))
    t, x = 0.7, rng.uniform(-1.0, 1.0, 1 + others)
    s, y = x[0], x[1:]
    w, m = p.get("w", 0.0), p.get("m", 0.0)
    rows = range(others)
    for k, mode in enumerate(template.modes, 1):
        A = [[p[f"{'d' if i == j else 'a'}{k}{i}{j}"] for j in rows] for i in rows]
        c, b = ([p[f"{letter}{k}{i}"] for i in rows] for letter in "cb")
        F = [p.get(f"F{k}{i}", 0.0) for i in rows]
        rates = np.array(mode.field(t, x, values))
        np.testing.assert_allclose(rates[0], p[f"v{k}"] + np.dot(c, y), rtol=1e-14)
        np.testing.assert_allclose(rates[1:], A @ y + b + np.array(F) * np.cos(w * t), rtol=1e-13)
    for k, transition in enumerate(template.transitions, 1):
        level = 1.0 + m * np.cos(w * t) if k == 1 else 2.0
        assert transition.guard.function(t, x, values) == pytest.approx(s - level, rel=1e-14)
        assert transition.guard.direction == 1
        after = np.array(transition.reset.function(t, x, values))
        B = [[p[f"B{k}{i}{j}"] for j in rows] for i in rows]
        fall = {(1, 1): 1.0, (2, 1): 0.0, (2, 2): 2.0}[modes, k]
        assert after[0] == pytest.approx(s - fall, rel=1e-14)
        np.testing.assert_allclose(after[1:], [p[f"r{k}{i}"] for i in rows] + B @ y, rtol=1e-13)
    ways = [(each.source, each.target) for each in template.transitions]
    assert ways == ([("one", "one")] if modes == 1 else [("one", "two"), ("two", "one")])
    if forced:
        assert template.period(values) == pytest.approx(2 * np.pi / w, rel=1e-15)
    else:
        assert template.period is None


@pytest.mark.parametrize("name", RANGES)
def test_coefficients_are_hundredths_of_their_whole_range(name):
    low, high = RANGES[name]
    strategy = _coefficients(name)
    assert find(strategy, lambda value: value <= low) == low
    assert find(strategy, lambda value: value >= high) == high
    with pytest.raises(NoSuchExample):
        find(strategy, lambda value: not low <= value <= high or abs(round(100 * value) - 100 * value) > 1e-9)


@pytest.mark.parametrize(("others", "modes", "forced"), SHAPES)
def test_every_shape_is_drawn(others, modes, forced):
    def fits(system):
        return (
            system.dimension == 1 + others
            and len(system.modes) == modes
            and (system.period is not None) == forced
        )

    # Without shrinking.
    assert fits(find(small_systems(), fits, settings=settings(phases=(Phase.generate,), max_examples=200)))


@given(small_systems())
def test_parameters_lie_in_their_ranges(system):
    ranges = {name[0]: ends for name, ends in RANGES.items()}
    for name, value in system.parameters.items():
        low, high = ranges[name[0]]
        assert low <= value <= high
