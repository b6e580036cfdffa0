"""Small random systems: piecewise affine, forced or autonomous, with transverse crossings only."""

from __future__ import annotations

from functools import cache
from typing import Any

import attrs
import numpy as np
from hypothesis import strategies as st
from hypothesis.strategies import SearchStrategy

from hybrid.system.elements import Guard, Mode, Reset, Transition
from hybrid.system.graph import HybridSystem

# Coefficients are hundredths, so that a failing system can be written down.
HUNDREDTHS = 100


def small_systems() -> SearchStrategy[HybridSystem]:
    r"""Piecewise-affine systems with two or three states, one or two modes and transverse crossings.

    .. math::

        \dot s = v_k + c_k \cdot y, \qquad \dot y = A_k y + b_k + F_k \cos(w t)

    A transition fires where :math:`s` rises through a level, :math:`1 + m \cos(w t)` or 2, and its reset is
    affine in :math:`y`. The speed :math:`v_k` is at least 1/2; the other term of :math:`\dot s` is small
    while :math:`|y|` is small. The diagonal of :math:`A_k` is not positive. Systems without forcing have no
    :math:`F_k` and no :math:`m`.

    All coefficients are parameters of the system, and systems of one shape share their compiled code.

    Examples
    --------
    >>> from hybrid.testing import cases, check_jumps, small_systems
    >>> from hypothesis import given, strategies as st
    >>> @given(st.data())
    ... def test_jumps_of_many_systems(data):
    ...     check_jumps(data.draw(cases(data.draw(small_systems()))))
    """

    @st.composite
    def system(draw: Any) -> HybridSystem:
        shape = draw(st.integers(1, 2)), draw(st.integers(1, 2)), draw(st.booleans())
        template = _template(*shape)
        drawn = {name: draw(_coefficients(name)) for name in template.parameters}
        return attrs.evolve(template, parameters=drawn)

    return system()


# First letter of a coefficient's name to its range.
_RANGES = {
    "v": (0.5, 2.0),
    "w": (1.0, 2.0),
    "c": (-0.05, 0.05),
    "m": (-0.1, 0.1),
    "d": (-1.0, 0.0),
    "a": (-0.5, 0.5),
    "b": (-1.0, 1.0),
    "F": (-1.0, 1.0),
    "B": (-1.0, 1.0),
    "r": (-1.0, 1.0),
}


def _coefficients(name: str) -> SearchStrategy[float]:
    low, high = (round(HUNDREDTHS * end) for end in _RANGES[name[0]])
    return st.integers(low, high).map(lambda i: i / HUNDREDTHS)


@cache
def _template(others: int, modes: int, forced: bool) -> HybridSystem:
    """A system of one shape, with ``others`` components besides ``s`` and placeholder coefficients."""
    rows = range(others)
    names: list[str] = ["w"] if forced else []

    def field(k: int) -> Any:
        names.extend(
            [f"v{k}", *(f"c{k}{i}" for i in rows), *(f"b{k}{i}" for i in rows)]
            + [f"{'d' if i == j else 'a'}{k}{i}{j}" for i in rows for j in rows]
            + [f"F{k}{i}" for i in rows if forced]
        )

        def affine(t: Any, x: Any, p: Any) -> list[Any]:
            s_rate = getattr(p, f"v{k}") + sum(getattr(p, f"c{k}{i}") * x[i + 1] for i in rows)
            rates = [s_rate]
            for i in rows:
                linear = sum(getattr(p, f"{'d' if i == j else 'a'}{k}{i}{j}") * x[j + 1] for j in rows)
                rate = getattr(p, f"b{k}{i}") + linear
                rates.append(rate + getattr(p, f"F{k}{i}") * np.cos(p.w * t) if forced else rate)
            return rates

        return affine

    def reset(k: int, fall: float) -> Any:
        names.extend([f"r{k}{i}" for i in rows] + [f"B{k}{i}{j}" for i in rows for j in rows])

        def affine(t: Any, x: Any, p: Any) -> list[Any]:
            rest = [
                getattr(p, f"r{k}{i}") + sum(getattr(p, f"B{k}{i}{j}") * x[j + 1] for j in rows) for i in rows
            ]
            return [x[0] - fall, *rest]

        return affine

    def level(t: Any, x: Any, p: Any) -> Any:
        return x[0] - 1.0 - p.m * np.cos(p.w * t) if forced else x[0] - 1.0

    if forced:
        names.append("m")
    if modes == 1:
        transitions = [Transition("one", "one", Guard(level, +1), Reset(reset(1, 1.0)))]
    else:
        transitions = [
            Transition("one", "two", Guard(level, +1), Reset(reset(1, 0.0))),
            Transition("two", "one", Guard(lambda t, x, p: x[0] - 2.0, +1), Reset(reset(2, 2.0))),
        ]
    fields = [Mode(name, field(k)) for k, name in ((1, "one"), (2, "two"))[:modes]]
    return HybridSystem(
        name="a small system",
        state=("s", *(f"y{i + 1}" for i in rows)),
        parameters={name: max(_RANGES[name[0]]) for name in names},
        modes=fields,
        transitions=transitions,
        period=(lambda p: 2.0 * np.pi / p.w) if forced else None,
    )
