"""Random formulas: functions of three values, which may be expressions or floats."""

from fractions import Fraction

import numpy as np
from hypothesis import strategies as st

from hybrid.expression import operations as ops
from hybrid.expression.evaluation import Program
from hybrid.expression.nodes import Expression, Symbol, number

X, Y, Z = LEAVES = tuple(map(Symbol, ("x[0]", "x[1]", "p[0]")))
EXACT = (2, -3, Fraction(2, 3), Fraction(-1, 4))
places = st.tuples(*[st.floats(-1.5, 1.5).map(lambda value: round(value, 6) + 2.0**-30)] * 3)


def of(kind):
    """A function of expressions or of floats."""

    def called(*values):
        return kind(*values) if any(isinstance(each, Expression) for each in values) else kind.numpy(*values)

    return called


def leaf(i):
    return lambda *leaves: leaves[i]


def constant(value):
    return lambda *leaves: number(value) if isinstance(leaves[0], Expression) else np.float64(value)


def joined(operation, *parts):
    return lambda *leaves: operation(*(part(*leaves) for part in parts))


POLYNOMIAL = {
    1: (lambda a: -a, lambda a: a**2, lambda a: a**3, lambda a: 3 * a, lambda a: a / 3),
    2: (lambda a, b: a + b, lambda a, b: a - b, lambda a, b: a * b, lambda a, b: a - 2 * b),
}
SMOOTH = {
    1: (
        *(of(kind) for kind in (ops.Sin, ops.Cos, ops.Tanh, ops.Arctan)),
        lambda a: (1 + a**2) ** Fraction(1, 2),
        lambda a: (2 + a**2) ** -1,
        lambda a: of(ops.Exp)(-(a**2)),
    ),
    2: (
        lambda a, b: a / (2 + b**2),
        lambda a, b: (1 + a**2) ** b,
        lambda a, b: ((1 + a**2) ** 2 * (2 + b**2) ** 4 / 3) ** Fraction(3, 4),
        lambda a, b: (a**2 + b**2 + 1) ** -0.3,
    ),
}
KINKED = {
    1: (of(ops.Absolute), of(ops.Step), lambda a: (a**2) ** Fraction(1, 2)),
    2: (of(ops.Maximum), of(ops.Minimum), lambda a, b: of(ops.Select)(of(ops.Less)(a, b), b, a)),
}


def formulas(*families, numbers=(*EXACT, 0.3, 0.37), most=8):
    """Formulas of some families of operations."""
    parts = {count: [each for family in families for each in family[count]] for count in (1, 2)}
    return st.recursive(
        st.one_of(st.sampled_from(range(3)).map(leaf), st.sampled_from(numbers).map(constant)),
        lambda inner: st.one_of(
            st.builds(joined, st.sampled_from(parts[1]), inner),
            st.builds(joined, st.sampled_from(parts[2]), inner, inner),
        ),
        max_leaves=most,
    )


polynomials = formulas(POLYNOMIAL, numbers=EXACT)
smooth = formulas(POLYNOMIAL, SMOOTH)
anything = formulas(POLYNOMIAL, SMOOTH, KINKED)


def expression_of(formula):
    """A formula of symbols."""
    return formula(*LEAVES)


def at(expressions, place):
    """Values of expressions at a place."""
    with np.errstate(all="ignore"):
        found = Program(expressions).run(dict(zip(LEAVES, map(np.float64, place), strict=True)))
    return [float(each) for each in found]


def plainly(formula, place):
    """The value of a formula by plain arithmetic."""
    with np.errstate(all="ignore"):
        return float(formula(*map(np.float64, place)))
