"""Messages say what to write instead."""

import numpy as np
import pytest
from scipy.special import j0

import hybrid
import lyapunov
import models
from hybrid import HybridSystem, Mode, ModelError

BALL = models.bouncing_ball()


@pytest.mark.parametrize(
    "call",
    [
        lambda **options: hybrid.simulate(BALL, (1.0, 0.0), (0.0, 1.0), **options),
        lambda **options: hybrid.simulate_many(BALL, [(1.0, 0.0)], (0.0, 1.0), **options),
        lambda **options: hybrid.global_error(BALL, (1.0, 0.0), (0.0, 1.0), **options),
        lambda **options: hybrid.periodic_orbit(BALL, (1.0, 0.0), **options),
        lambda **options: hybrid.stroboscopic_section(BALL, (1.0, 0.0), periods=1, **options),
        lambda **options: lyapunov.lyapunov_spectrum(BALL, (1.0, 0.0), **options),
        lambda **options: hybrid.attractors(BALL, {"q": 1.0, "v": 0.0}, **options),
        lambda **options: hybrid.basins(BALL, {"q": 1.0, "v": 0.0}, **options),
        lambda **options: hybrid.basin_fractions(BALL, {"q": 1.0, "v": 0.0}, **options),
        lambda **options: hybrid.edge_state(BALL, (1.0, 0.0), (2.0, 0.0), **options),
        lambda **options: lyapunov.covariant_vectors(BALL, (1.0, 0.0), **options),
        lambda **options: lyapunov.finite_time_exponents(BALL, (1.0, 0.0), **options),
        lambda **options: lyapunov.two_orbit_exponents(BALL, (1.0, 0.0), **options),
        lambda **options: lyapunov.chart(BALL, {"e": [0.8]}, (1.0, 0.0), **options),
    ],
)
@pytest.mark.parametrize("option", ["rtol", "atol"])
def test_tolerances_belong_to_the_solver(call, option):
    with pytest.raises(
        ModelError, match=rf"{option}= is an option of the solver. Write solver=Taylor\({option}=1e-08\)"
    ):
        call(**{option: 1e-8})


def fields_refused():
    def solves(t, x, p):
        return tuple(np.linalg.solve(np.array([[1 + x.q**2, 0.1], [0.1, 1.0]]), np.array([x.v, -x.q])))

    return {
        "j0 is not a function of NumPy: only NumPy's functions can be traced": lambda t, x, p: (
            x.v,
            j0(x.q),
        ),
        "np.linalg.solve of numbers that depend on the state cannot be traced: write": solves,
    }


@pytest.mark.parametrize("text", fields_refused())
def test_a_field_that_cannot_be_compiled_is_told_what_to_write(text):
    system = HybridSystem(state=("q", "v"), modes=[Mode("m", fields_refused()[text])])
    with pytest.raises(ModelError, match=text) as raised:
        hybrid.simulate(system, (1.0, 0.0), (0.0, 1.0))
    assert "it gives no reason" not in str(raised.value)


def test_a_division_of_plain_numbers_by_zero_is_refused_at_once():
    with pytest.raises(ModelError, match="Mode 'm': field divides by zero at every point that was tried"):
        HybridSystem(state=("q",), modes=[Mode("m", lambda t, x, p: (1 / (2 - 2),))])


def test_a_run_without_proof_names_the_guard():
    flat = HybridSystem(
        state=("q",),
        modes=[Mode("m", lambda t, x, p: (-x.q,))],
        transitions=[
            hybrid.Transition("m", "m", hybrid.Guard(lambda t, x, p: x.q**3, direction=-1), name="flat")
        ],
    )
    message = hybrid.simulate(flat, (1.0,), (0.0, 40.0)).status.message
    assert "not proved" not in message or "the guard of 'flat'" in message
