"""Names that a person can read for surfaces and for the cells between them, such as ``v<belt, q>1``."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

import sympy
from sympy.printing.str import StrPrinter

from hybrid.symbolic.expressions import Level
from hybrid.symbolic.nodes import is_larger_than, mentions, nodes_of, symbols_of
from hybrid.symbolic.switches import QUARTER, Surface
from hybrid.symbolic.tracing import Symbols, model_symbols
from hybrid.system.variables import Variables

# A name of more characters than this is replaced by a letter and a number.
LONGEST = 20
# A height written with more operations than this is not taken apart.
LARGEST = 40
# One written with more than this is not shown.
MOST_SHOWN = 200
SIGNS = {-1: "<", 0: "=", 1: ">"}


class Names:
    """Names of sides in the words of a model."""

    def __init__(self, variables: Variables) -> None:
        names = variables.parameter_names
        self.symbols: Symbols = model_symbols(variables.dimension, len(names))
        pairs = [*zip(self.symbols.x, variables.state_names, strict=True)]
        pairs += zip(self.symbols.p, names, strict=True)
        self.words = {symbol: sympy.Symbol(name) for symbol, name in pairs}
        self.taken = {name for _, name in pairs}
        self.short: dict[int, str] = {}
        self.notes: list[str] = []

    def side(self, surfaces: Sequence[Surface], number: int, side: int) -> str:
        """Name of a side of a surface; 0 is the surface."""
        surface = surfaces[number]
        if number in self.short:
            return f"{self.short[number]}{SIGNS[side]}0"
        if surface.argument is not None:
            words = self._text(surface.argument)
            name = f"mod({words},1){'>1/2' if side < 0 else '<1/2'}" if side else f"2*({words}) whole"
        elif surface.pulse is not None:
            u, level, above = surface.pulse
            name = f"mod({self._text(u)},1){SIGNS[side * above]}{self._text(level)}"
        else:
            left, right = self._equation(self._without_levels(surface.height))
            name = f"{left}{SIGNS[side]}{right}"
        if len(name) <= LONGEST:
            return name
        self._shorten(surface.height, number)
        return self.side(surfaces, number, side)

    def _shorten(self, height: sympy.Expr, number: int) -> None:
        """Give a surface a short name, with a note that says what it is."""
        name = next(name for k in count(1) if (name := f"h{k}") not in self.taken)
        self.taken.add(name)
        self.short[number] = name
        text = (
            self._text(self._without_levels(height))
            if not is_larger_than(MOST_SHOWN, height)
            else "a long expression"
        )
        self.notes.append(f"{name} = {text}")

    def cell(self, surfaces: Sequence[Surface], sides: Sequence[tuple[int, int]]) -> str:
        """Name of a cell by its sides; empty if there are none."""
        return ", ".join(self.side(surfaces, number, side) for number, side in sides)

    def _without_levels(self, height: sympy.Expr) -> sympy.Expr:
        """The height with each floor written as a remainder if that is shorter, else as ``floor``."""
        for level in nodes_of(Level, height):
            # On its half of a step, the level is the floor of its argument less the quarter.
            u = level.args[0] + min((-QUARTER, QUARTER), key=lambda q: (level.args[0] + q).count_ops())
            text = self._text(u)
            fraction = sympy.Symbol(f"mod({text},1)", real=True)
            shorter = height.xreplace({level: u - fraction}).expand()
            whole = height.xreplace({level: sympy.Symbol(f"floor({text})", real=True)})
            height = min(shorter, whole, key=lambda each: each.count_ops())
        return height

    def _equation(self, height: sympy.Expr) -> tuple[str, str]:
        """Both sides of ``height = 0``: what depends on the state on the left, if that makes sense."""
        if is_larger_than(LARGEST, height):
            return self._text(height), "0"
        terms = sympy.Add.make_args(height.expand())
        if len(terms) > len(sympy.Add.make_args(height)) + 1:
            terms = sympy.Add.make_args(height)
        left = [term for term in terms if self._moves(term)]
        if not left:
            left = [*terms]
        elif all(term.could_extract_minus_sign() for term in left):
            return self._text(height), "0"
        moved = [term for term in left if term.could_extract_minus_sign()]
        right = [-term for term in terms if term not in left or term in moved]
        left = [term for term in left if term not in moved]
        factor = left[0].as_coeff_Mul()[0]
        if len(left) == 1 and factor != 1:
            # A multiple of one term: the name is shorter without the factor.
            left, right = [left[0] / factor], [sympy.Float(1 / factor) * term for term in right]
        return self._text(sympy.Add(*left)), self._text(sympy.Add(*right))

    def _moves(self, term: sympy.Expr) -> bool:
        return mentions(term, self.symbols.x) or any("(" in symbol.name for symbol in symbols_of(term))

    def _text(self, expression: sympy.Expr) -> str:
        return (
            _Printer({"full_prec": False})
            .doprint(expression.xreplace(self.words))
            .replace(" ", "")
            .replace("**", "^")
        )


def copy_name(transition: str, own: str, to: str = "") -> str:
    """Name of the copy of a user's transition that leaves some sides, and leads to others if they matter."""
    sides = f"{own}->{to}" if own and to else own or (to and f"->{to}")
    return f"{transition} ({sides})" if sides else transition


class _Printer(StrPrinter):
    """Sums start with a positive term if they have one."""

    def _as_ordered_terms(self, expr: sympy.Expr, order: str | None = None) -> list[sympy.Expr]:
        return sorted(
            super()._as_ordered_terms(expr, order), key=lambda term: term.could_extract_minus_sign()
        )
