"""Draining buffers, and one server that fills the one just emptied: chaos with constant fields."""

from __future__ import annotations

from functools import partial

from hybrid import Guard, HybridSystem, Laws, Mode, Transition

BUFFERS = (1, 2, 3)


def switched_arrival() -> HybridSystem:
    r"""Switched arrival system of three buffers.

    .. math::

        \dot x_i = -\rho_i + \delta_{ij} \, (\rho_1 + \rho_2 + \rho_3)
            \text{ while buffer } j \text{ is filled}, \qquad j \mapsto i \text{ at } x_i = 0

    Returns
    -------
    HybridSystem
        State ``x1``, ``x2``, ``x3``, the work in the buffers; modes ``fill1``, ``fill2``, ``fill3``, one per
        buffer. Parameters: ``rho1 = rho2 = rho3 = 1/3``, the rates at which the buffers drain (work per unit
        of time). The server's rate is their sum, so the total work is constant.
        Output: ``work`` in all buffers.

    Notes
    -----
    Exact results for a total of 1 and rates that sum to 1:

    - Equal rates: at a switch one buffer is empty, one holds ``a <= 1/2`` and one ``1 - a``. At the next
      switch, after the time ``3 a``, they hold ``2 a``, 0 and ``1 - 2 a``: a doubling map of the sides of
      the triangle of states. Its exponent is ln 2 per switch; the mean time between switches is 3/4.
    - Any rates: the fields are constant, so a density that is uniform on the triangle in each mode, with the
      fraction ``rho_j`` of the time in mode ``j``, is invariant. It gives
      ``2 rho_j (1 - rho_j)`` switches to ``j`` per unit of time.
    - The saltation matrix of a switch to ``j`` has the determinant ``1 - 1 / rho_j``. The other two exponents
      are zero, for the flow direction and for the conserved total, so the largest is
      ``sum_j 2 rho_j (1 - rho_j) ln((1 - rho_j) / rho_j)``; for equal rates ``(4/3) ln 2 = 0.924196``.
    - If two buffers run empty together, no time passes between switches: the run ends as ``STUCK``.

    References
    ----------
    C. Chase, J. Serrano, P. J. Ramadge, "Periodicity and chaos from switched flow systems: contrasting
    examples of discretely controlled continuous systems", IEEE Transactions on Automatic Control 38(1),
    70-83, 1993. doi:10.1109/9.186313

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import simulate
    >>> arc = simulate(models.switched_arrival(), (0.0, 0.314, 0.686), (0.0, 40.0), mode="fill1")
    >>> bool(np.allclose(arc.x.sum(axis=1), 1.0))
    True
    """
    return HybridSystem(
        name="switched arrival system",
        state=("x1", "x2", "x3"),
        parameters={"rho1": 1 / 3, "rho2": 1 / 3, "rho3": 1 / 3},
        modes=[Mode(f"fill{j}", partial(_filling, j)) for j in BUFFERS],
        transitions=[
            Transition(f"fill{j}", f"fill{i}", _empties(i)) for j in BUFFERS for i in BUFFERS if i != j
        ],
        outputs={"work": _total},
        laws=Laws(
            invariant={f"work in buffer {i}": partial(_content, i) for i in BUFFERS},
            conserved={"total work": "work"},
        ),
    )


def _filling(j, t, x, p):
    inflow = p.rho1 + p.rho2 + p.rho3
    return tuple(inflow * (i == j) - rho for i, rho in zip(BUFFERS, p, strict=True))


def _empties(i):
    return Guard(partial(_content, i), direction=-1)


def _content(i, t, x, p):
    return x[i - 1]


def _total(t, x, p):
    return x.x1 + x.x2 + x.x3
