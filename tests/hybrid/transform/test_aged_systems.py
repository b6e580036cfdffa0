"""Derivatives where a clock counts from the entry of its mode: systems that change, or grow, in use."""

import attrs
import numpy as np

from hybrid import After, Guard, HybridSystem, Mode, Reset, Transition, periodic_orbit, simulate, split
from lyapunov import lyapunov_spectrum
from tests.hybrid.transform.test_aged import DRIVE, REST, charger, difference, run

FLOOR = 0.0


def test_a_global_that_has_changed_is_read_anew(monkeypatch):
    system = attrs.evolve(
        charger(),
        modes=[Mode("charge", lambda t, x, p: (p.I - x.q - FLOOR,)), Mode("empty", lambda t, x, p: (-x.q,))],
    )
    for floor in (0.0, 0.3):
        monkeypatch.setattr(f"{__name__}.FLOOR", floor)
        arc = simulate(system, (0.2,), (0.0, 2.0), tangent=True)
        np.testing.assert_allclose(arc.x[-1], simulate(system, (0.2,), (0.0, 2.0)).x[-1], rtol=1e-12)
        moved = difference(lambda q: simulate(system, (q,), (0.0, 2.0)).x[-1, 0], 0.2)
        np.testing.assert_allclose(arc.fundamental, [[moved]], atol=1e-7)


def test_a_system_that_is_made_in_stages():
    """It has the modes that a run needs, with tangent vectors and without."""

    def made():
        kinks = 0.15 * np.arange(1, 6)
        return split(
            HybridSystem(
                state=("v", "w"),
                parameters={"I": DRIVE, "r": REST},
                modes=[
                    Mode(
                        "rise",
                        lambda t, x, p: (
                            p.I - x.v + sum(0.1 * np.maximum(x.v - k, 0.0) for k in kinks),
                            0.3 * np.sign(x.w - 0.2) * np.abs(x.v - x.w) - x.w,
                        ),
                    ),
                    Mode("rest", lambda t, x, p: (-np.abs(x.v - 0.1), 0.1 - np.abs(x.w))),
                ],
                transitions=[
                    Transition(
                        "rise",
                        "rest",
                        Guard(lambda t, x, p: x.v - 1.0, +1),
                        Reset(lambda t, x, p: {"v": 0.15}),
                    ),
                    Transition("rest", "rise", After("r")),
                ],
                start="rise",
            )
        )

    system = made()
    arc = simulate(system, (0.2, 0.1), (0.0, 3.0), tangent=True)
    assert len(arc.system.modes) > len(system.modes)
    for i in range(2):
        moved = difference(lambda h, i=i: run(system, (0.2, 0.1) + h * np.eye(2)[i], 3.0, None), 0.0)
        np.testing.assert_allclose(arc.fundamental[:, i], moved, atol=1e-7)
    spectrum = lyapunov_spectrum(made(), (0.2, 0.1), intervals=30, transient=10)
    assert spectrum.status.ok
    assert len(spectrum.exponents) == 2
    # The modes that the search for an orbit comes through are made on the way.
    assert periodic_orbit(made(), (0.2, 0.1), period=1.0).x0.shape[0] >= 2
