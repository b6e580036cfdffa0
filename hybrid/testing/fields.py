"""Random right-hand sides with kinks and jumps, as a person would write them, and their smooth pieces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import attrs
import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from hybrid import arguments

# Coefficients are tenths, so that a failing field can be written down.
TENTHS = 10
MOST_SWITCHES = 4
FORMS = ("sign", "abs", "maximum", "where")


@attrs.frozen(eq=False)
class PiecewiseAffineField:
    r"""The right-hand side ``A x + b`` plus, for each switch, ``c s(h)`` with ``h = a \cdot x - level``.

    Call it as a model function of ``(t, x, p)``; the parameters are not used.

    Attributes
    ----------
    matrix, constant
        ``A (n, n)`` and ``b (n,)``.
    forms
        For each switch ``s``: ``"sign"``, which is ``np.sign(h)``; ``"abs"``, which is ``np.abs(h)``;
        ``"maximum"``, which is ``np.maximum(h, 0)``; or ``"where"``, which is ``np.where(h > 0, h - 1, 1)``.
    normals, levels
        The vectors ``a (m, n)`` and the levels ``(m,)``.
    jumps
        The vectors ``c (m, n)``.

    Examples
    --------
    >>> import numpy as np
    >>> import hybrid
    >>> from hybrid.testing import PiecewiseAffineField
    >>> friction = PiecewiseAffineField(
    ...     matrix=np.array([[0.0, 1.0], [-1.0, 0.0]]),
    ...     constant=np.zeros(2),
    ...     forms=("sign",),
    ...     normals=np.array([[0.0, 1.0]]),
    ...     levels=np.zeros(1),
    ...     jumps=np.array([[0.0, -0.5]]),
    ... )
    >>> [float(rate) for rate in friction(0.0, (0.0, 2.0), None)]
    [2.0, -0.5]
    >>> len(hybrid.from_equations(friction, state=("x", "v")).modes)
    3
    """

    matrix: np.ndarray
    constant: np.ndarray
    forms: tuple[str, ...]
    normals: np.ndarray
    levels: np.ndarray
    jumps: np.ndarray

    def __call__(self, t: Any, x: Any, p: Any) -> list[Any]:
        """The ``n`` derivatives."""
        rates = [_sum(row, x) + float(b) for row, b in zip(self.matrix, self.constant, strict=True)]
        rows = zip(self.forms, self.normals, self.levels, self.jumps, strict=True)
        for form, normal, level, jump in rows:
            value = _SWITCHES[form](_sum(normal, x) - float(level))
            rates = [rate + float(c) * value if c else rate for rate, c in zip(rates, jump, strict=True)]
        return rates

    def heights(self, x: np.ndarray) -> np.ndarray:
        """The heights ``h`` of the switches ``(m,)`` at a state."""
        return self.normals @ x - self.levels

    def piece(self, sides: tuple[int, ...]) -> tuple[np.ndarray, np.ndarray]:
        """The affine field ``(A, b)`` where each height has the sign of its side, -1 or 1."""
        matrix, constant = self.matrix.copy(), self.constant.copy()
        for form, side, normal, level, jump in zip(
            self.forms, sides, self.normals, self.levels, self.jumps, strict=True
        ):
            slope, value = _PIECES[form][int(side > 0)]
            matrix += slope * np.outer(jump, normal)
            constant += jump * (value - slope * level)
        return matrix, constant


_SWITCHES: dict[str, Callable[[Any], Any]] = {
    "sign": np.sign,
    "abs": np.abs,
    "maximum": lambda h: np.maximum(h, 0.0),
    "where": lambda h: np.where(h > 0.0, h - 1.0, 1.0),
}
# Slope and value at zero, below and above.
_PIECES = {
    "sign": ((0.0, -1.0), (0.0, 1.0)),
    "abs": ((-1.0, 0.0), (1.0, 0.0)),
    "maximum": ((0.0, 0.0), (1.0, 0.0)),
    "where": ((0.0, 1.0), (1.0, -1.0)),
}


def piecewise_affine_fields(
    dimensions: tuple[int, int] = (2, 3), switches: tuple[int, int] = (1, MOST_SWITCHES)
) -> SearchStrategy[PiecewiseAffineField]:
    """Right-hand sides with ``np.sign``, ``np.abs``, ``np.maximum`` and ``np.where``, for ``from_equations``.

    Parameters
    ----------
    dimensions, switches
        The least and the largest number of states and of switches.

    Raises
    ------
    ArgumentError
        If one of them is not a pair of whole numbers ``(least, most)`` with ``1 <= least <= most``.

    Examples
    --------
    >>> from hypothesis import given
    >>> from hybrid import from_equations
    >>> from hybrid.testing import piecewise_affine_fields
    >>> @given(piecewise_affine_fields(switches=(1, 2)))
    ... def test_my_integrator(field):
    ...     system = from_equations(field, state=len(field.constant))
    """
    dimensions, switches = _range("dimensions", dimensions), _range("switches", switches)

    @st.composite
    def field(draw: Any) -> PiecewiseAffineField:
        n, m = draw(st.integers(*dimensions)), draw(st.integers(*switches))

        def numbers(*shape: int, most: float = 1.0) -> np.ndarray:
            whole = st.integers(-round(TENTHS * most), round(TENTHS * most))
            size = int(np.prod(shape))
            drawn = draw(st.lists(whole, min_size=size, max_size=size))
            return np.array(drawn, dtype=float).reshape(shape) / TENTHS

        normals = numbers(m, n)
        for k, normal in enumerate(normals):
            if not normal.any():
                normal[k % n] = 1.0
        return PiecewiseAffineField(
            matrix=numbers(n, n) - np.eye(n),
            constant=numbers(n),
            forms=tuple(draw(st.sampled_from(FORMS)) for _ in range(m)),
            normals=normals,
            levels=numbers(m, most=0.5),
            jumps=numbers(m, n),
        )

    return field()


def _range(name: str, given: Any) -> tuple[int, int]:
    wanted = "be (least, most), two whole numbers with 1 <= least <= most"
    if not isinstance(given, tuple | list) or len(given) != 2:
        raise arguments.refusal(name, wanted, given)
    least, most = (arguments.count(name, each, 1) for each in given)
    if least > most:
        raise arguments.refusal(name, wanted, given)
    return least, most


def _sum(row: np.ndarray, x: Any) -> Any:
    """The dot product; terms whose factor is zero are left out."""
    terms = [float(factor) * x[j] for j, factor in enumerate(row) if factor]
    return sum(terms[1:], terms[0]) if terms else 0.0
