"""What the error for a branch in Python's own words tells its reader to write."""

import numpy as np
import pytest

from hybrid.expression.branches import OTHERWISE
from hybrid.expression.tracing import trace
from hybrid.expression.values import TraceError

STATE, PARAMETERS = ("q", "v"), ("mu",)


def advice(function):
    with pytest.raises(TraceError) as caught:
        trace(function, STATE, PARAMETERS)
    return str(caught.value)


def test_choice_in_an_expression():
    told = advice(lambda t, x, p: p.mu if x.v > 0 else -p.mu)
    assert "in place of ``p.mu if x.v > 0 else -p.mu``" in told
    assert "write ``np.where(x.v > 0, p.mu, -p.mu)``" in told


def test_assignments_on_both_sides():
    def force(t, x, p):
        if x.v > 0 and x.q < 1:
            f = p.mu
        else:
            f = -p.mu * x.v
        return f

    assert "``f = np.where((x.v > 0) & (x.q < 1), p.mu, -p.mu * x.v)``" in advice(force)


def test_a_chain_of_choices():
    def sign(t, x, p):
        if x.v > 0:
            d = 1.0
        elif x.v < 0:
            d = -1.0
        else:
            d = 0.0
        return d

    assert "``d = np.where(x.v > 0, 1.0, np.where(x.v < 0, -1.0, 0.0))``" in advice(sign)


def test_returns_differ_in_one_entry_only():
    def field(t, x, p):
        if x.v > 0:
            return x.v, -x.q - p.mu
        return x.v, -x.q + p.mu

    assert "``return (x.v, np.where(x.v > 0, -x.q - p.mu, -x.q + p.mu))``" in advice(field)


@pytest.mark.parametrize("sign", ["+=", "-="])
def test_a_change_on_one_side(sign, tmp_path):
    source = f"def f(t, x, p):\n    a = -x.q\n    if not 0 < x.q < 1:\n        a {sign} p.mu\n    return a\n"
    file = tmp_path / "model.py"
    file.write_text(source)
    space = {}
    exec(compile(source, str(file), "exec"), space)
    assert f"``a {sign} np.where(~((0 < x.q) & (x.q < 1)), p.mu, 0.0)``" in advice(space["f"])


def test_a_new_value_on_one_side():
    def force(t, x, p):
        f = p.mu
        if x.v < 0 or x.q < 0:
            f = 0.0
        return f

    assert "``f = np.where((x.v < 0) | (x.q < 0), 0.0, f)``" in advice(force)


@pytest.mark.parametrize("name", ["max", "min"])
def test_extremes(name):
    functions = {"max": lambda t, x, p: max(x.q, 0.0), "min": lambda t, x, p: min(x.q, 0.0)}
    assert f"``{name}(x.q, 0.0)``" in advice(functions[name])
    assert f"``np.{name}imum(x.q, 0.0)``" in advice(functions[name])


def test_the_advice_can_be_followed():
    """The code in the message has the values of the branch that it replaces."""

    def force(t, x, p):
        return (x.q if x.q > 0 else x.v) if x.v > 0 else -p.mu

    told = advice(force)
    new = told.split("write ``")[1].split("``")[0]

    class At:
        mu = 0.3

        def __init__(self, q, v):
            self.q, self.v = q, v

    for q, v in [(1.0, 2.0), (-1.0, 2.0), (1.0, -2.0), (-1.0, -2.0)]:
        # The inner choice stays; at numbers it may be one.
        assert eval(new, {"np": np, "x": At(q, v), "p": At}) == force(0.0, At(q, v), At)


def test_without_source_the_ways_are_listed():
    space = {}
    exec("def f(t, x, p):\n    return x.q if x.v > 0 else 0.0", space)
    assert OTHERWISE in advice(space["f"])


def test_a_loop_has_no_replacement():
    def count(t, x, p):
        q = x.q
        while q > 0:
            q = q - 1
        return q

    assert OTHERWISE in advice(count)


def test_a_branch_inside_numpy():
    assert "traced" in advice(lambda t, x, p: np.sort([x.q, x.v])[0])


def written(lines, tmp_path):
    """A function of these lines, with its source in a file."""
    file = tmp_path / "model.py"
    body = "".join(f"    {line}\n" for line in lines)
    source = f"def f(t, x, p):\n    a, b = -x.q, [x.q, x.v]\n{body}    return a\n"
    file.write_text(source)
    space = {"np": np}
    exec(compile(source, str(file), "exec"), space)
    return space["f"]


@pytest.mark.parametrize(
    "lines",
    [
        ("if x.v > 0:", "    a = 1.0", "else:", "    b = 2.0"),
        ("if x.v > 0:", "    a = 1.0", "    b = 2.0", "else:", "    a = 2.0"),
        ("if x.v > 0:", "    a = 1.0", "    b = 2.0"),
        ("if x.v > 0:", "    b[0] = 1.0"),
        ("if x.v > 0:", "    a += 1.0", "else:", "    a -= 2.0"),
        ("if x.v > 0:", "    a *= 2.0"),
        ("if x.v > 0:", "    return", "return a"),
        ("if x.v > 0:", "    return a", "return"),
        ("if x.v > 0:", "    a = 1.0", "elif x.q > 0:", "    b = 2.0", "else:", "    a = 3.0"),
    ],
)
def test_statements_that_are_no_single_choice_have_no_replacement(lines, tmp_path):
    assert OTHERWISE in advice(written(lines, tmp_path))


@pytest.mark.parametrize(
    ("lines", "told"),
    [
        (("if x.v > 0:", "    a = 1.0", "a = a + 2.0"), "a = np.where(x.v > 0, 1.0, a)"),
        (("if x.v > 0:", "    b[0] = 1.0", "else:", "    b[0] = a"), "b[0] = np.where(x.v > 0, 1.0, a)"),
        (("if x.v > 0:", "    return a", "return 2 * a"), "return np.where(x.v > 0, a, 2 * a)"),
        (("if x.v > 0:", "    return a, x.q", "return a"), "return np.where(x.v > 0, (a, x.q), a)"),
        (("a = max(x.q, x.v, 0.0)",), "np.maximum(np.maximum(x.q, x.v), 0.0)"),
        (("a = min([x.q, x.v])",), "np.minimum(x.q, x.v)"),
        (("a = max((x.q, x.v))",), "np.maximum(x.q, x.v)"),
    ],
)
def test_replacements(lines, told, tmp_path):
    assert f"write ``{told}``" in advice(written(lines, tmp_path))


def test_a_search_in_a_tuple_has_no_replacement():
    def force(t, x, p):
        return 1.0 if x.q in (1.0, 2.0) else 0.0

    assert OTHERWISE in advice(force)
