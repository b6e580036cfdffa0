"""Models of ``models`` as a paper would write them: one right-hand side with kinks and jumps."""

from __future__ import annotations

import attrs
import numpy as np

import models
from hybrid import Every, HybridSystem, Mode, Reset, Transition, split
from hybrid.system.elements import Function
from models.vibroimpact import _field as vibroimpact_field


@attrs.frozen
class Plain:
    """The right-hand side of a model, and a run of it.

    Attributes
    ----------
    interval
        Time between two orthonormalisations; None for a period of the model.
    transitions
        Jumps of the state that no right-hand side can hold.
    """

    field: Function
    x0: tuple[float, ...]
    end: float
    interval: float | None
    transitions: tuple[Transition, ...] = ()


def pair(name: str) -> tuple[HybridSystem, HybridSystem]:
    """The model written by hand, and the split of its plain equations."""
    model, plain = getattr(models, name)(), PLAIN[name]
    system = HybridSystem(
        state=model.state,
        parameters=model.parameters,
        modes=[Mode("plain", plain.field)],
        transitions=plain.transitions,
        period=model.period,
    )
    return model, split(system)


PLAIN = {
    "bilinear_oscillator": Plain(
        lambda t, x, p: (x.v, p.A * np.cos(p.w * t) - p.c * x.v - np.where(x.x < 0, p.k1, p.k2) * x.x),
        (0.3, 0.2),
        200.0,
        None,
    ),
    "stop_oscillator": Plain(
        lambda t, x, p: (
            x.v,
            p.A * np.cos(p.w * t)
            - p.c * x.v
            - p.k * x.x
            - np.where(np.abs(x.x) > p.d, p.F0 * np.sign(x.x) + p.ks * (x.x - p.d * np.sign(x.x)), 0.0),
        ),
        (0.3, 0.2),
        200.0,
        None,
    ),
    "chua_circuit": Plain(
        lambda t, x, p: (
            p.alpha * (x.y - x.x - (p.m1 * x.x + 0.5 * (p.m0 - p.m1) * (np.abs(x.x + 1) - np.abs(x.x - 1)))),
            x.x - x.y + x.z,
            -p.beta * x.y,
        ),
        (0.3, 0.2, 0.1),
        30.0,
        1.0,
    ),
    "stick_slip": Plain(
        lambda t, x, p: (
            x.v,
            -p.Fs * np.sign(x.v - p.belt) / (1 + p.delta * np.abs(x.v - p.belt)) - x.x,
        ),
        (0.3, 0.1),
        100.0,
        1.0,
    ),
    "dry_friction_oscillator": Plain(
        lambda t, x, p: (x.v, p.A * np.cos(p.w * t) - p.c * x.v - x.x - p.f * np.sign(x.v)),
        (0.3, 0.1),
        100.0,
        None,
    ),
    "vibroimpact": Plain(
        lambda t, x, p: vibroimpact_field(t, x, p, p.K * np.maximum(x.x1 - x.x2, 0.0) ** 1.5),
        (0.0, 0.001, 0.1, 0.0),
        50.0,
        None,
    ),
    "buck_converter": Plain(
        lambda t, x, p: (
            (x.i - x.v / p.R) / p.C,
            (np.where(p.a * (x.v - p.V_ref) - p.V_L - (p.V_U - p.V_L) * x.tau < 0, p.E, 0.0) - x.v) / p.L,
            1 / p.T,
        ),
        (11.0, 0.5, 0.0),
        0.04,
        4e-4,
        (Transition("plain", "plain", Every("T"), Reset(lambda t, x, p: (x.v, x.i, 0.0)), name="ramp"),),
    ),
}
