"""Which propagator fits a mode: exact series, series on a clock of its own, Taylor series, or Runge-Kutta.

Tracing decides. What a guard says of the states inside its mode is used: where ``x1 - x2 >= 0`` in the whole
mode, ``max(x1 - x2, 0)`` is ``x1 - x2`` there.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import attrs
import numpy as np
import sympy
from sympy.core.parameters import distribute

from hybrid.compiler.emitted import Propagator, Series
from hybrid.compiler.taylor.linear import LinearForm, linear_form, table_statements
from hybrid.compiler.taylor.loops import StateLoop, TangentLoop, indented, padded
from hybrid.compiler.taylor.roots import (
    ROOT,
    Root,
    in_roots,
    is_multiple,
    on_clock,
    regular_root,
    singular_bases,
    slope_along,
)
from hybrid.compiler.taylor.series import ONE_THEN_ZERO, PAIRS, NoSeries, Recurrences
from hybrid.kernels.types.codes import (
    DESINGULARISED,
    EXACT,
    HIGHEST_ORDER,
    NARROW,
    ROOTED,
    RUNGE_KUTTA,
    TAYLOR,
    WIDE,
)
from hybrid.symbolic.constants import Constants
from hybrid.symbolic.derivatives import directional, divergence, partial_derivatives
from hybrid.symbolic.expressions import (
    ZERO,
)
from hybrid.symbolic.nodes import (
    contains,
    degree_of,
    mentions,
    nodes,
    nodes_of,
    replaced,
    symbols_of,
)
from hybrid.symbolic.printer import assignments
from hybrid.symbolic.signs import sign_of, simplified
from hybrid.symbolic.tracing import Symbols

ELEMENTARY = (sympy.sin, sympy.cos, sympy.exp, sympy.sinh, sympy.cosh)
# Columns behind those of the guards: the time since the step's start, the integral of div f. All these are
# written and evaluated as whole vectors; the others follow, the root of a desingularised mode first.
CLOCK, DIVERGENCE, OTHERS = range(3)
# The square root of a guard is started from no less than this share of the sizes it is a difference of.
FLOOR = 1e-17
# No matrix is scaled up by more than its inverse.
SMALLEST = 1e-300
# Share of those sizes below which the guard and the square of a root differ by rounding.
SAME = 1e-13


@attrs.frozen
class Boundary:
    """A guard of a mode: its expression, and its sign inside the mode if the mode ends there, else 0."""

    guard: sympy.Expr | None
    inside: int
    is_affine: bool = False


def propagator(
    field: Sequence[sympy.Expr] | None, boundaries: Sequence[Boundary], symbols: Symbols
) -> Propagator:
    """The propagator of a mode from its traced field (None if it could not be traced) and its guards."""
    if field is None:
        return Propagator(RUNGE_KUTTA, 0, "its field is not traced")
    known = known_positive(boundaries)
    try:
        with distribute(False):
            return _series(field, boundaries, known, symbols)
    except NoSeries as reason:
        return Propagator(RUNGE_KUTTA, 0, str(reason))
    except RecursionError:
        return Propagator(RUNGE_KUTTA, 0, "its functions are nested too deeply for a series")


def known_positive(boundaries: Iterable[Boundary]) -> list[sympy.Expr]:
    """What is positive or zero in the whole mode, since it ends where its guards say."""
    return [b.guard if b.inside > 0 else -b.guard for b in boundaries if b.inside and b.guard is not None]


def _series(
    field: Sequence[sympy.Expr], boundaries: Sequence[Boundary], known: list[sympy.Expr], symbols: Symbols
) -> Propagator:
    field = [simplified(entry, known) for entry in field]
    bases = singular_bases(field, known, symbols)
    held = [_is_held(boundary, bases, symbols) for boundary in boundaries]
    guards = _columns(boundaries, held)
    roots = [
        root for place, z in enumerate(bases) if (root := regular_root(field, z, place, symbols)) is not None
    ]
    if roots:
        written = _write_rooted(field, boundaries, guards, roots, symbols)
        reason = "half-integer powers of a guard, whose root is smooth"
        return Propagator(ROOTED, 0, reason, written, tuple(held))
    if len(bases) > 1:
        raise NoSeries("it has fractional powers of more than one guard")
    if bases:
        [z] = bases
        written = _write_desingularised(field, boundaries, guards, z, symbols)
        reason = "half-integer powers of a guard, on the clock dt = w ds"
        return Propagator(DESINGULARISED, 0, reason, written, tuple(held))
    jacobian = partial_derivatives(field, symbols.x)
    if any(mentions(entry, symbols.variables) for row in jacobian for entry in row):
        written = _write(field, guards, symbols)
        return Propagator(TAYLOR, 0, "smooth, nonlinear in the state", written, tuple(held))
    if not all(_elementary(entry, symbols) for entry in field):
        written = _write(field, guards, symbols)
        reason = "affine, its forcing has no short series"
        return Propagator(TAYLOR, 0, reason, written, tuple(held))
    of_state = _degree(field, jacobian, symbols)
    if 0 < of_state <= HIGHEST_ORDER:
        # A quadratic guard is a polynomial in time here; of higher ones flat roots drown in rounding.
        powers = [0 if b.guard is None else _polynomial(b.guard, symbols) for b in boundaries]
        held = [0 < power <= 2 and of_state * power <= HIGHEST_ORDER for power in powers]
        degree = of_state * max([1, *(power for power, is_held in zip(powers, held, strict=True) if is_held)])
        written = _write(field, _columns(boundaries, held), symbols)
        return Propagator(EXACT, degree, f"polynomials of degree {degree}", written, tuple(held))
    harmonics = _harmonics(field, symbols)
    form = linear_form(field, guards, harmonics, symbols)
    if form is None:
        written = _write(field, guards, symbols)
    else:
        written = _write_linear(form, harmonics, len(guards), symbols)
    return Propagator(EXACT, 0, "affine in the state", written, tuple(held))


def _is_held(boundary: Boundary, bases: Sequence[sympy.Expr], symbols: Symbols) -> bool:
    """Whether the series of a mode hold the guard: an affine one, and one whose root they may hold."""
    guard = boundary.guard
    if guard is None:
        return False
    return boundary.is_affine or any(is_multiple(guard, z, symbols) for z in bases)


def _columns(boundaries: Sequence[Boundary], held: Sequence[bool]) -> list[sympy.Expr]:
    """What the columns of the guards hold; zero for a guard that is bounded by its program instead."""
    pairs = zip(boundaries, held, strict=True)
    return [b.guard if is_held and b.guard is not None else ZERO for b, is_held in pairs]


def _in_terms_of_root(
    boundaries: Sequence[Boundary], z: sympy.Expr, root: sympy.Symbol, symbols: Symbols
) -> dict[int, sympy.Expr]:
    """By place, the guards that are multiples of ``z``: the root with the sign of the guard in the mode."""
    return {
        place: (boundary.inside or sign_of(boundary.guard, [z]) or 1) * root
        for place, boundary in enumerate(boundaries)
        if boundary.guard is not None and is_multiple(boundary.guard, z, symbols)
    }


def _elementary(entry: sympy.Expr, symbols: Symbols) -> bool:
    """Whether it depends on time by polynomials and by harmonics and exponentials of linear functions."""
    for node in nodes(entry):
        if not mentions(node, (symbols.t,)) or node.is_Symbol or node.is_Add or node.is_Mul:
            continue
        if node.is_Pow and node.exp.is_Integer and node.exp.is_positive:
            continue
        if isinstance(node, ELEMENTARY) and not mentions(node.args[0].diff(symbols.t), (symbols.t,)):
            continue
        return False
    return True


def _polynomial(guard: sympy.Expr, symbols: Symbols) -> int:
    """Degree of a guard that is a polynomial in state and time, at least 1; zero for any other."""
    degree = degree_of(guard, frozenset(symbols.variables))
    return 0 if degree is None else max(1, degree)


def _degree(field: Sequence[sympy.Expr], jacobian: Sequence[Sequence[sympy.Expr]], symbols: Symbols) -> int:
    """Degree of the solutions in time if they are polynomials, else 0."""
    if any(contains(entry, ELEMENTARY) and mentions(entry, (symbols.t,)) for entry in field):
        return 0
    if not _may_be_nilpotent(jacobian):
        return 0
    # x^(k + 1) = J x^(k) + d^k f/dt^k
    rate, forcing = list(field), list(field)
    for degree in range(1, 2 * len(field) + 4):
        forcing = [entry.diff(symbols.t) for entry in forcing]
        rate = [
            (push + sympy.Add(*(a * r for a, r in zip(row, rate, strict=True)))).expand()
            for row, push in zip(jacobian, forcing, strict=True)
        ]
        if all(entry == 0 for entry in rate):
            return degree
    return 0


def _may_be_nilpotent(matrix: Sequence[Sequence[sympy.Expr]]) -> bool:
    """Whether a matrix in the parameters vanishes in its own powers, as far as one set of values can tell."""
    names = sorted({name for row in matrix for entry in row for name in symbols_of(entry)}, key=str)
    drawn = np.random.default_rng(1).uniform(1.0, 2.0, len(names))
    values = dict(zip(names, map(sympy.Float, drawn), strict=True))
    try:
        numbers = np.array([[float(replaced(entry, values)) for entry in row] for row in matrix])
    except (TypeError, ValueError):
        return True
    scaled = numbers / max(np.abs(numbers).max(), SMALLEST)
    power = np.linalg.matrix_power(scaled, len(matrix))
    return not np.abs(power).max() > SAME


def _write(field: Sequence[sympy.Expr], guards: Sequence[sympy.Expr], symbols: Symbols) -> Series:
    body = _Body(symbols, guards, (), ONE_THEN_ZERO)
    seeds = _seeds(symbols)
    tangents = directional(field, seeds)
    trace = divergence(field, symbols.x)
    return body.assemble(symbols.x, *_state(symbols), field, guards, trace, tangents, seeds)


def _write_linear(
    form: LinearForm, harmonics: dict[sympy.Expr, sympy.Symbol], guards: int, symbols: Symbols
) -> Series:
    n, constants = len(symbols.x), Constants()
    begun = [f"start{i}" for i in range(len(harmonics))]
    starts = [*_state(symbols)[1], *begun, "1.0"]
    lines, vectors, table, tangents = table_statements(form, n, constants, starts)
    shared = [*constants.statements(), *assignments(begun, list(harmonics)), *lines]
    front = padded(n + guards + OTHERS, WIDE)
    return Series(tuple(shared), (_groups(n), *shared, *vectors), front, table, tangents)


def _write_desingularised(
    field: Sequence[sympy.Expr],
    boundaries: Sequence[Boundary],
    guards: Sequence[sympy.Expr],
    z: sympy.Expr,
    symbols: Symbols,
) -> Series:
    """Series on the clock ``dt = w ds``, ``w = sqrt(z)``, where half-integer powers of ``z`` are smooth.

    All fields are multiplied by ``w``, and ``dw/ds = (dz/dt)/2``. The root is never started at zero exactly:
    with a speed of zero too it would stay there. What it is started at is below the rounding of ``z``.

    A guard is a small difference of states, and its rounding is felt: by the energy, and a thousandfold by
    the tangent vectors. The root has none of that. So a step goes on with the root that the last one ended
    with, ``z`` is its square, and only a root that has drifted from the states is taken from them again.
    """
    harmonics = _harmonics(field, symbols)
    field = [replaced(rate, harmonics) for rate in field]
    # The time since the start comes behind the states among what is advanced.
    body = _Body(symbols, guards, [ROOT, *harmonics.values()], f"{{}}y{len(symbols.x)}")
    clock, (root, *driven) = body.column(CLOCK), body.rows.values()
    seeds = _seeds(symbols)
    slope = slope_along(field, z, symbols)
    rates = [on_clock(rate, z) for rate in field]
    tangents = [on_clock(along, z) for along in directional(field, seeds)]
    trace = on_clock(divergence(field, symbols.x), z)
    # Where z is zero its root crosses zero, with a slope.
    roots = _in_terms_of_root(boundaries, z, ROOT, symbols)
    crossing = [roots.get(place, in_roots(guard, z)) for place, guard in enumerate(guards)]
    columns, starts = _state(symbols)
    body.start_root("root", z, min(roots))
    turning = [ROOT * replaced(function.diff(symbols.t), harmonics) for function in harmonics]
    begun = [f"start{i}" for i in range(len(harmonics))]
    body.preamble += assignments(begun, list(harmonics))
    return body.assemble(
        [*symbols.x, None, ROOT, *harmonics.values()],
        [*columns, clock, root, *driven],
        [*starts, "0.0", "root", *begun],
        [*rates, ROOT, in_roots(slope / 2, z), *turning],
        crossing,
        trace,
        tangents,
        seeds,
    )


def _write_rooted(
    field: Sequence[sympy.Expr],
    boundaries: Sequence[Boundary],
    guards: Sequence[sympy.Expr],
    roots: Sequence[Root],
    symbols: Symbols,
) -> Series:
    """Series in time of the states and of the roots of guards, whose half-integer powers are theirs."""
    body = _Body(symbols, guards, [root.symbol for root in roots], ONE_THEN_ZERO)
    seeds = _seeds(symbols)

    def in_all_roots(expression: sympy.Expr) -> sympy.Expr:
        for root in roots:
            expression = in_roots(expression, root.base, root.symbol)
        return expression

    signed: dict[int, sympy.Expr] = {}
    names = [f"root_{root.symbol}" for root in roots]
    for name, root in zip(names, roots, strict=True):
        places = _in_terms_of_root(boundaries, root.base, root.symbol, symbols)
        body.start_root(name, root.base, min(places))
        signed |= places
    crossing = [signed.get(place, in_all_roots(guard)) for place, guard in enumerate(guards)]
    columns, starts = _state(symbols)
    trace = divergence(field, symbols.x)
    return body.assemble(
        [*symbols.x, *(root.symbol for root in roots)],
        [*columns, *body.rows.values()],
        [*starts, *names],
        [*(in_all_roots(rate) for rate in field), *(in_all_roots(root.rate) for root in roots)],
        crossing,
        in_all_roots(trace),
        [in_all_roots(along) for along in directional(field, seeds)],
        seeds,
    )


def _harmonics(field: Sequence[sympy.Expr], symbols: Symbols) -> dict[sympy.Expr, sympy.Symbol]:
    """Symbols for the sines, cosines and exponentials of linear functions of time, closed under ``d/dt``.

    On a clock of their own they are states like others: their rates share the factor of all rates.
    """
    found: dict[sympy.Expr, sympy.Symbol] = {}
    for node in sorted(nodes_of(ELEMENTARY, *field), key=sympy.default_sort_key):
        slope = node.args[0].diff(symbols.t)
        if slope == 0 or mentions(slope, (symbols.t,)) or mentions(node, symbols.x):
            continue
        for function in PAIRS.get(node.func, (node.func,))[:2]:
            found.setdefault(function(node.args[0]), sympy.Symbol(f"h{len(found)}", real=True))
    return found


def _seeds(symbols: Symbols) -> dict[sympy.Symbol, sympy.Symbol]:
    return {x: sympy.Symbol(f"v{i}", real=True) for i, x in enumerate(symbols.x)}


def _state(symbols: Symbols) -> tuple[list[str], list[str]]:
    n = len(symbols.x)
    return [str(i) for i in range(n)], [f"x[{i}]" for i in range(n)]


class _Body:
    """The body of one mode: allots columns, and puts the loops one into the other.

    Parameters
    ----------
    others
        Symbols besides the states, each of which has a column.
    time
        Text of the coefficients of time from the first on; the prefix of the local variables goes into it.
    """

    def __init__(
        self, symbols: Symbols, guards: Sequence[sympy.Expr], others: Iterable[sympy.Symbol], time: str
    ) -> None:
        self.symbols, self.time = symbols, time
        self.n = len(symbols.x)
        self.behind_guards = self.n + len(guards)
        self.columns = padded(self.behind_guards + OTHERS, WIDE)
        self.rows = {symbol: self.allot() for symbol in others}
        self.constants = Constants()
        self.preamble: list[str] = []
        self.at_start: dict[sympy.Expr, str] = {}

    def column(self, place: int) -> str:
        """A column behind those of the guards."""
        return str(self.behind_guards + place)

    def start_root(self, name: str, z: sympy.Expr, place: int) -> None:
        """Statements for the value ``name`` that the root of ``z``, the guard in a place, starts from."""
        size = sympy.Add(*(sympy.Abs(z.diff(x)) * sympy.Abs(x) for x in self.symbols.x))
        self.at_start[z] = f"{name}*{name}"
        self.preamble += [
            *assignments(["z", "size"], [z, size]),
            f"last = abs(out[order + 1, {self.n + place}])",
            # Anything as close to the root as this is one, whoever left it there.
            f"same = abs(last*last - z) <= {SAME}*size < z",
            f"{name} = last if same else sqrt(max(z, {FLOOR}*size, 1e-300))",
        ]

    def allot(self) -> str:
        """A new column."""
        self.columns += 1
        return str(self.columns - 1)

    def assemble(
        self,
        names: Sequence[sympy.Symbol | None],
        columns: list[str],
        starts: list[str],
        rates: Sequence[sympy.Expr],
        guards: Sequence[sympy.Expr],
        trace: sympy.Expr,
        tangents: Sequence[sympy.Expr],
        seeds: dict[sympy.Symbol, sympy.Symbol],
    ) -> Series:
        """The series without and with tangent vectors.

        Those without know nothing of what only tangent vectors need: the products in their rates, and the
        divergence.
        """
        free = self.columns
        alone = self._state("s", names, columns, starts, rates, guards)
        self._place_pairs(alone.block)
        width, self.columns = self.columns, free
        names, rates = [*names, None], [*rates, trace]
        columns, starts = [*columns, self.column(DIVERGENCE)], [*starts, "0.0"]
        moved = self._state("a", names, columns, starts, rates, guards)
        vectors = Recurrences(
            dict.fromkeys(seeds.values(), ""), None, self.allot, "b", self.constants, moved.block, lanes=True
        )
        vectors.expect(seeds.values(), tangents)
        carried = TangentLoop(list(seeds.values()), vectors)
        carried.compute(tangents)
        self._place_pairs(moved.block)
        together = [*moved.higher(), *carried.higher()]
        shared = [*self.preamble, *self.constants.statements(), "o = 0"]
        return Series(
            (*shared, *alone.first(), *_each_order(alone.higher())),
            (_groups(self.n), *shared, *moved.first(), *carried.first(), *_each_order(together)),
            padded(max(width, self.columns), WIDE),
            0,
            carried.columns,
        )

    def _state(
        self,
        prefix: str,
        names: Sequence[sympy.Symbol | None],
        columns: list[str],
        starts: list[str],
        rates: Sequence[sympy.Expr],
        guards: Sequence[sympy.Expr],
    ) -> StateLoop:
        """The loop of the state, and of what else there are ``rates`` for; local names have a prefix."""
        state = {x: str(i) for i, x in enumerate(self.symbols.x)}
        time = self.symbols.t, self.time.format(prefix)
        block = Recurrences(
            {**state, **self.rows}, time, self.allot, prefix, self.constants, at_start=self.at_start
        )
        block.expect(names, rates)
        moved = StateLoop(names, columns, rates, starts, block)
        crossing = {str(self.n + place): block.coefficient(guard) for place, guard in enumerate(guards)}
        moved.write_front(self.behind_guards + OTHERS, crossing)
        return moved

    def _place_pairs(self, block: Recurrences) -> None:
        for factors in "ab" if block.common_left is None else "b":
            self.columns = padded(self.columns, WIDE)
            self.preamble.append(f"{block.prefix}{factors} = {self.columns}")
            self.columns += padded(len(block.pairs))


def _groups(n: int) -> str:
    return f"groups = (len(x)//{n} + {NARROW - 2})//{NARROW}"


def _each_order(statements: Iterable[str]) -> list[str]:
    return ["for o in range(1, order + 1):", *indented(["shrink = 1.0/o", *statements])]
