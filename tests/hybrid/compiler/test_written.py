"""Fields with fractional powers of a guard, at and beyond the guard."""

import numpy as np
import pytest

from hybrid import DOP853, Guard, HybridSystem, Mode, RadauIIA, Taylor, Transition, Tsit5, simulate
from hybrid.status import StatusCode
from lyapunov import lyapunov_spectrum

HIT = Transition("free", "contact", Guard(lambda t, x, p: x.q + 0.5, direction=-1), name="hit")
RELEASE = Transition("contact", "free", Guard(lambda t, x, p: x.q + 0.5, direction=1), name="release")


def oscillator(force):
    """An oscillator that meets a contact with this force at ``q = -1/2``."""
    return HybridSystem(
        state=("q", "v"),
        modes=[
            Mode("free", lambda t, x, p: (x.v, np.cos(p.w * t) - x.q)),
            Mode("contact", lambda t, x, p: (x.v, np.cos(p.w * t) - x.q + force(x, p))),
        ],
        transitions=[HIT, RELEASE],
        parameters={"w": 0.7, "R": 2.0, "K": 10.0, "n": 1.5},
        period=lambda p: 2 * np.pi / p.w,
    )


def clamped(x, p):
    return p.K * np.maximum(-0.5 - x.q, 0.0) ** 1.5


# All are the same force, and have no value beyond the guard.
SAME = {
    "power": lambda x, p: p.K * (-0.5 - x.q) ** 1.5,
    "root": lambda x, p: p.K * np.sqrt(-0.5 - x.q) * (-0.5 - x.q),
    "multiple": lambda x, p: p.K * p.R**1.5 * ((-0.5 - x.q) / p.R) ** 1.5,
    "number": lambda x, p: p.K * 8.0 * (-0.125 - x.q / 4) ** 1.5,
    "exponent": lambda x, p: p.K * (-0.5 - x.q) ** p.n,
}


@pytest.fixture(scope="module")
def expected():
    return simulate(oscillator(clamped), (1.0, 0.0), (0.0, 30.0), mode="free", tangent=True)


@pytest.fixture(scope="module", params=SAME)
def same(request):
    return oscillator(SAME[request.param])


@pytest.mark.parametrize("method", [Taylor(), DOP853(), Tsit5(), RadauIIA()], ids=repr)
def test_contact_laws_need_no_maximum(same, method, expected):
    arc = simulate(same, (1.0, 0.0), (0.0, 30.0), mode="free", solver=method, tangent=True)
    assert arc.status.code in (StatusCode.SUCCESS, expected.status.code)
    assert arc.jumps.transition.tolist() == expected.jumps.transition.tolist()
    assert len(arc.jumps) > 5
    assert np.allclose(arc.x[-1], expected.x[-1], atol=1e-5)
    assert np.allclose(arc.fundamental, expected.fundamental, rtol=1e-4, atol=1e-4)


def test_a_spectrum_of_a_contact_as_it_is_written_in_textbooks():
    spectrum, expected = (
        lyapunov_spectrum(oscillator(force), (1.0, 0.0), intervals=200, mode="free")
        for force in (SAME["power"], clamped)
    )
    assert spectrum.status.ok
    assert spectrum.exponents == pytest.approx(expected.exponents, abs=1e-9)
    assert sum(spectrum.exponents) == pytest.approx(0.0, abs=1e-9)


def test_a_root_that_has_no_value_inside_the_mode_has_none_afterwards():
    wrong = oscillator(lambda x, p: p.K * (x.q + 0.5) ** 1.5)
    arc = simulate(wrong, (1.0, 0.0), (0.0, 30.0), mode="free")
    # It comes back to the guard again and again, which is no progress.
    assert not arc.status.ok
    assert arc.steps < 100_000
    negative = oscillator(SAME["multiple"])
    arc = simulate(negative, (1.0, 0.0), (0.0, 30.0), mode="free", parameters={"R": -2.0})
    assert not arc.status.ok


def test_a_root_beside_a_guard_that_does_not_end_the_mode_is_left_alone():
    # The state goes through the guard, and the field is to be a number on both sides.
    system = HybridSystem(
        state=("q",),
        modes=[Mode("only", lambda t, x, p: (-1.0 + 0.1 * np.sqrt(x.q),))],
        transitions=[Transition("only", "only", Guard(lambda t, x, p: x.q, direction=-1), name="mark")],
    )
    arc = simulate(system, (1.0,), (0.0, 2.0), solver=DOP853())
    assert arc.status.code is StatusCode.NON_FINITE
