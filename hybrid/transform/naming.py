"""Names that a person can read for surfaces and for the cells between them, such as ``v<belt, q>1``."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

from hybrid.expression.graph import is_larger_than, mentions, nodes_of, replaced, symbols_of, terms_of
from hybrid.expression.nodes import Expression, Symbol, add, number, split
from hybrid.expression.operations import Level
from hybrid.expression.polynomials import expanded
from hybrid.expression.surfaces import QUARTER, Surface
from hybrid.expression.text import text
from hybrid.expression.tracing import Symbols, model_symbols
from hybrid.system.variables import Variables
from hybrid.transform.titles import Titles

# A name of more characters than this is replaced by a letter and a number.
LONGEST = 20
# A height written with more operations than this is not taken apart.
LARGEST = 40
# One written with more than this is not shown.
MOST_SHOWN = 200
SIGNS = {-1: "<", 0: "=", 1: ">"}


class Names:
    """Names of sides in the words of a model, and those that its author gives."""

    def __init__(self, variables: Variables, titles: Titles) -> None:
        self.titles = titles
        names = variables.parameter_names
        self.symbols: Symbols = model_symbols(variables.dimension, len(names))
        pairs = [*zip(self.symbols.x, variables.state_names, strict=True)]
        pairs += zip(self.symbols.p, names, strict=True)
        self.words = dict(pairs)
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
            pulse = surface.pulse
            name = f"mod({self._text(pulse.argument)},1){SIGNS[side * pulse.above]}{self._text(pulse.level)}"
        else:
            left, right = self._equation(self._without_levels(surface.height))
            name = f"{left}{SIGNS[side]}{right}"
        if len(name) <= LONGEST:
            return name
        self._shorten(surface.height, number)
        return self.side(surfaces, number, side)

    def _shorten(self, height: Expression, number: int) -> None:
        """Give a surface a short name, with a note that says what it is."""
        name = next(name for k in count(1) if (name := f"h{k}") not in self.taken)
        self.taken.add(name)
        self.short[number] = name
        long = is_larger_than(MOST_SHOWN, height)
        self.notes.append(
            f"{name} = {'a long expression' if long else self._text(self._without_levels(height))}"
        )

    def cell(self, surfaces: Sequence[Surface], sides: Sequence[tuple[int, int]]) -> str:
        """Name of a cell by what its author calls it, and its other sides; empty if there are none."""
        given, told = self.titles.of(sides, lambda number, side: self.side(surfaces, number, side))
        left = [self.side(surfaces, number, side) for number, side in sides if number not in told]
        return ", ".join([*given, *left])

    def _without_levels(self, height: Expression) -> Expression:
        """The height with each floor written as a remainder if that is shorter, else as ``floor``."""
        for level in nodes_of(Level, height):
            # On its half of a step, the level is the floor of its argument less the quarter.
            u = level.args[0] + min((-QUARTER, QUARTER), key=lambda q: (level.args[0] + q).size)
            words = self._text(u)
            shorter = expanded(replaced(height, {level: u - Symbol(f"mod({words},1)")}))
            whole = replaced(height, {level: Symbol(f"floor({words})")})
            height = min(shorter, whole, key=lambda each: each.size)
        return height

    def _equation(self, height: Expression) -> tuple[str, str]:
        """Both sides of ``height = 0``: what depends on the state on the left, if that makes sense."""
        if is_larger_than(LARGEST, height):
            return self._text(height), "0"
        terms = terms_of(expanded(height))
        if len(terms) > len(terms_of(height)) + 1:
            terms = terms_of(height)
        left = [term for term in terms if self._moves(term)]
        if not left:
            left = [*terms]
        elif all(term.leads_with_minus for term in left):
            return self._text(height), "0"
        moved = [term for term in left if term.leads_with_minus]
        right = [-term for term in terms if term not in left or term in moved]
        left = [term for term in left if term not in moved]
        factor, alone = split(left[0])
        if len(left) == 1 and factor != 1:
            # A multiple of one term: the name is shorter without the factor.
            left, right = [alone], [number(1.0 / float(factor)) * term for term in right]
        return self._text(add(*left)), self._text(add(*right))

    def _moves(self, term: Expression) -> bool:
        return mentions(term, self.symbols.x) or any("(" in symbol.label for symbol in symbols_of(term))

    def _text(self, expression: Expression) -> str:
        return text(expression, self.words).replace(" ", "").replace("**", "^")


def copy_name(transition: str, own: str, to: str = "") -> str:
    """Name of the copy of a user's transition that leaves some sides, and leads to others if they matter."""
    sides = f"{own}->{to}" if own and to else own or (to and f"->{to}")
    return f"{transition} ({sides})" if sides else transition
