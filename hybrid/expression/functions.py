"""What a function of real numbers is: the columns of the table of functions in ``operations``."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np

from hybrid.expression.nodes import Expression, Function, Number, number
from hybrid.expression.ranges import ANYTHING


class RealFunction(Function):
    """A function of real numbers; numbers are put in, a sign comes out where it may."""

    __slots__ = ()
    numpy: ClassVar[Any]
    code: ClassVar[Any] = ""
    bounds: ClassVar[Any] = 0
    parity: ClassVar[int] = 0
    range: ClassVar[Any] = staticmethod(lambda *parts: ANYTHING)
    slopes: ClassVar[tuple[Callable[..., Expression], ...]] = ()
    in_other_terms: ClassVar[Any] = None
    by_derivative: ClassVar[bool] = False

    @classmethod
    def simplified(cls, *args: Expression) -> Expression | None:
        """The number that it is of numbers; the value at the opposite if it is even or odd."""
        if all(each.is_number for each in args):
            return cls.of_numbers(*map(float, args))
        if cls.parity and args[0].leads_with_minus:
            value = cls(-args[0])
            return value if cls.parity > 0 else -value
        return None

    @classmethod
    def of_numbers(cls, *values: float) -> Number:
        """The value at numbers; nan where there is none."""
        with np.errstate(all="ignore"):
            return number(float(cls.numpy(*values)))

    def slope(self, place: int = 0) -> Expression:
        """The derivative in one of the arguments."""
        found: Expression = self.slopes[place](*self.args)
        return found
