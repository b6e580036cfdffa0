"""Hybrid systems from plain equations: kinks and jumps in model functions become modes and guards."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, Unpack

from hybrid.shared import shares
from hybrid.system.elements import Function, Mode
from hybrid.system.graph import HybridSystem, as_system
from hybrid.system.repeat import Repeat
from hybrid.transform.asked import DescribedWithShifts, passed_on


@shares(DescribedWithShifts)
def from_equations(
    field: Function,
    *,
    state: tuple[str, ...] | int,
    parameters: Mapping[str, float] | None = None,
    modes: Mapping[str, Any] | None = None,
    repeats: Iterable[Repeat] = (),
    **asked: Unpack[DescribedWithShifts],
) -> HybridSystem:
    """The hybrid system of one right-hand side with ``np.sign``, ``np.abs``, ``np.where`` and the like.

    It is `split` of the system whose only mode, named ``smooth`` before it is split, has this field.

    Parameters
    ----------
    field
        ``f(t, x, p)``, which returns the ``n`` derivatives. It must be traceable.
    state, parameters
        As for `HybridSystem`.
    modes
        Names for the modes, as for `split`.
    repeats
        Many of a kind, from `repeat`, whose equations may have kinks and jumps too.

    Raises
    ------
    ModelError
        As `HybridSystem` and `split`.

    Examples
    --------
    A mass on a spring with dry friction: it slides, or it sticks.

    >>> import numpy as np
    >>> from hybrid import from_equations, simulate
    >>> block = from_equations(
    ...     lambda t, x, p: (x.v, -x.q - p.mu * np.sign(x.v)), state=("q", "v"), parameters={"mu": 0.3}
    ... )
    >>> block.mode_names
    ('v<0', 'v>0', 'v=0')
    >>> arc = simulate(block, x0=(1.0, 0.0), t_span=(0.0, 10.0))
    >>> [str(mode) for mode in arc.jumps.transition], round(float(arc["q"][-1]), 12)
    (['v<0->v>0', 'v>0->v=0'], -0.2)
    """
    return split(
        HybridSystem(
            state=state,
            parameters={} if parameters is None else parameters,
            modes=[Mode("smooth", field)],
            **passed_on(asked),
            repeats=repeats,
        ),
        modes=modes,
    )


def split(system: HybridSystem, *, modes: Mapping[str, Any] | None = None) -> HybridSystem:
    """The system in which every kink and every jump inside a model function has become modes and guards.

    Switching functions are found in fields, guards and resets: ``sign``, ``abs``, ``maximum``, ``minimum``,
    ``clip``, ``heaviside``, ``where``, ``select``, ``piecewise``, comparisons joined by ``&``, ``|``, ``~``,
    ``floor``, ``ceil``, ``trunc``, ``round``, ``mod`` and ``fmod``, nested in any way. Each has a surface
    ``h = 0``; one that is written twice counts once. Each mode becomes the modes between these surfaces,
    named by their sides, such as ``v<0, q>1``. A long height is named ``h1`` or the like, which ``repr``
    shows in full. With several modes of the user's, theirs comes first: ``flight: v<0``.

    Where the field is continuous across a surface, or has the same speed through it on either side, the
    transition is a plain crossing. Where the speed through the surface jumps, there is also a mode ``v=0``
    that slides along it, as in `filippov`. A run ends (status TERMINAL, transition ``two-fold``) where an
    orbit slides to a place from which the surface repels: there its future is not unique.

    Parameters
    ----------
    system
        Its functions must be traceable where they have kinks or jumps.
    modes
        Names for the modes: ``{"in the gap": lambda t, x, p: (x.q > -1) & (x.q < 1)}``. Where the condition
        holds the name takes the place of the sides that the condition compares. It is a comparison of what
        the equations switch on, or several; or sides as they stand in the names of modes, ``"q>-1, q<1"``.

    Returns
    -------
    HybridSystem
        Each `Mode` and each `Transition` keeps the user's name as ``part_of``; ``arc.part_of`` and
        ``arc.jumps["impact"]`` group by it, and ``mode=`` of a run may name the user's mode. A system of more
        than twelve modes is made in stages: it shows a few modes, and a run makes those that it needs.
        The system of its result, ``arc.system``, has every mode that the run has visited.

    Raises
    ------
    ModelError
        If a field cannot be traced, or a reset into a mode that is split cannot. If a branch is written with
        Python's ``if``, the message shows the ``np.where`` to write. If a `Table` jumps in the state; other
        tables are left as they are. If a name in ``modes`` is that of no mode.

    Notes
    -----
    *On the intersection of two surfaces* with the four fields ``f_ij`` of its corners, the orbit follows

        ``f = sum of (1 + i a) (1 + j b) / 4 f_ij``,  ``-1 <= a, b <= 1``,

    with ``a`` and ``b`` such that both heights are constant: the bilinear combination of Alexander and
    Seidman, which Dieci and Lopez study. It is one choice of many: Filippov's convex combinations of four
    fields leave one of them free. If the jumps add up, as for two dry contacts, the combination is
    unique and equals Utkin's equivalent control. Of two solutions ``(a, b)`` the one is taken for which the
    determinant of the derivatives of the rates of the heights in ``a`` and ``b`` is positive. The run ends
    (``two-fold``) where the two solutions meet.

    *An orbit that slides and reaches another surface* goes on in the cell around the intersection that is
    consistent: the orbit slides along the surfaces on which the cell slides, and moves to the side of the
    cell from the others. So does an orbit whose ``a`` or ``b`` reaches 1 or -1. If several cells are
    consistent, the future is not unique and the status is AMBIGUOUS_ORDER; if none is, the run ends with the
    transition ``no way on``.

    *On three or more* surfaces whose jumps do not add up, the sliding field on the last surface combines the
    sliding fields on the others, in the order in which the surfaces were found; another order may give
    another field.

    *A floor* has two modes for each of its steps' halves, with the surfaces ``sin(2 pi u) = 0``. A choice
    by floors alone, as by ``floor(t) % 2 == 0``, changes where these floors do, and makes no other modes.

    *A sawtooth of time* crosses its surfaces at the ticks of an `Every`: ``mod(t, p.T) < p.d * p.T`` has two
    modes, and so has ``mod(t, p.T)`` itself. The period must be positive.

    *A fractional power* of a height, as in Hertz' ``np.maximum(z, 0)**1.5``, is zero beyond its surface.

    References
    ----------
    A. F. Filippov, Differential Equations with Discontinuous Righthand Sides, Kluwer, 1988, section 4.
    L. Dieci, L. Lopez, Sliding motion on discontinuity surfaces of high co-dimension, Numerische Mathematik
    117, 2011, doi:10.1007/s00211-011-0365-4.
    V. I. Utkin, Sliding Modes in Control and Optimization, Springer, 1992, doi:10.1007/978-3-642-84379-2.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid import HybridSystem, Mode, split
    >>> block = Mode("block", lambda t, x, p: (x.v, -x.q - 0.3 * np.sign(x.v)))
    >>> split(HybridSystem(state=("q", "v"), modes=[block])).mode_names
    ('v<0', 'v>0', 'v=0')
    """
    as_system("split: system", system)
    # SymPy is slow to import, so it is not imported with the library.
    from hybrid.transform.splitter import Splitter

    return Splitter(system, modes).begin()
