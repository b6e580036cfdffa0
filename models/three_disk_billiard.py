"""A particle among three disks: a scatterer with a chaotic repeller, or a closed dispersing billiard."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid import Guard, HybridSystem, Laws, Mode, Reset, Transition


def three_disk_billiard() -> HybridSystem:
    r"""Point particle among three hard disks at the corners of an equilateral triangle.

    .. math::

        \ddot q = 0, \quad |q - c_k| \ge a, \qquad
        \dot q \mapsto \dot q - 2 (\dot q \cdot n)\, n, \; n = (q - c_k) / a \text{ at } |q - c_k| = a

    Returns
    -------
    HybridSystem
        State ``x``, ``y``, ``vx``, ``vy``; mode ``flight``; transitions ``disk1`` (above), ``disk2`` (left),
        ``disk3`` (right). Parameters: radius ``a = 1`` and distance between centres ``R = 6``, both lengths.
        Output: ``speed``.

    Notes
    -----
    With ``sigma = R / a``:

    - On the orbit between two disks a reflection stretches by ``sigma - 1 + sqrt(sigma (sigma - 2))``.
    - On the triangular orbit a reflection stretches by ``s - 1 + s sqrt(1 - sqrt(3) / sigma)``,
      ``s = 2 sigma / sqrt(3)``. The orbit's multiplier is minus the cube of this, since three reflections
      reverse the orientation.
    - Nearly all particles escape. Those that stay in forward and backward time form a chaotic repeller.
    - For ``sqrt(3) < sigma < 2`` the disks overlap, and a particle between them is trapped: a closed
      dispersing billiard with the exponents ``lambda, 0, 0, -lambda``. If the enclosed region has the area
      ``A`` and the perimeter ``P``, the mean free path is ``pi A / P``.

    References
    ----------
    P. Gaspard, S. A. Rice, "Scattering from a classically chaotic repellor", Journal of Chemical Physics 90,
    2225-2241, 1989. doi:10.1063/1.456017

    Examples
    --------
    >>> import numpy as np
    >>> import models
    >>> from hybrid import simulate
    >>> closed = {"R": 1.9}
    >>> arc = simulate(models.three_disk_billiard(), (0.0, 0.0, 1.0, 0.3), (0.0, 10.0), parameters=closed)
    >>> bool(np.allclose(np.hypot(arc["vx"], arc["vy"]), np.hypot(1.0, 0.3)))
    True
    """
    return HybridSystem(
        name="three-disk billiard",
        state=("x", "y", "vx", "vy"),
        parameters={"a": 1.0, "R": 6.0},
        modes=[Mode("flight", _flight)],
        transitions=[
            Transition(
                "flight",
                "flight",
                Guard(partial(_gap, k), direction=-1),
                Reset(partial(_reflected, k)),
                name=f"disk{k + 1}",
            )
            for k in range(3)
        ],
        outputs={"speed": _speed},
        laws=Laws(
            invariant={f"gap to disk{k + 1}": partial(_gap, k) for k in range(3)},
            conserved=["speed"],
            across={
                f"disk{k + 1}": {"angular momentum about its centre": partial(_turn, k)} for k in range(3)
            },
            elastic=("vx", "vy"),
        ),
    )


def _flight(t, x, p):
    return x.vx, x.vy, 0.0, 0.0


def _from_centre(k, x, p):
    angle = np.pi / 2 + 2 * np.pi * k / 3
    return x.x - p.R / np.sqrt(3) * np.cos(angle), x.y - p.R / np.sqrt(3) * np.sin(angle)


def _gap(k, t, x, p):
    dx, dy = _from_centre(k, x, p)
    return dx**2 + dy**2 - p.a**2


def _reflected(k, t, x, p):
    dx, dy = _from_centre(k, x, p)
    twice = 2 * (x.vx * dx + x.vy * dy) / (dx**2 + dy**2)
    return x.x, x.y, x.vx - twice * dx, x.vy - twice * dy


def _speed(t, x, p):
    return np.hypot(x.vx, x.vy)


def _turn(k, t, minus, plus, p):
    dx, dy = _from_centre(k, minus, p)
    return dx * (plus.vy - minus.vy) - dy * (plus.vx - minus.vx)
